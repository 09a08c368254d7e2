"""Tables of the public recordings for the report: sources, sets, faults."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from rotorid.recordings import read_set
from rotorid.recordings.check import check_set
from rotorid.recordings.importers.faults import read_report
from rotorid.recordings.importers.public_sets import PUBLIC_SETS

_FAULT_NAMES = {
    "byte_order_mark": "byte-order mark",
    "encoding": "encoding",
    "line_ends": "line ends",
    "cut_off": "last line or event cut off",
    "no_lock": "motion capture not locked",
    "no_telemetry": "no telemetry yet",
    "held": "last value repeated",
    "gap": "gaps in the clock",
    "repeated_time": "clock stands still",
    "speed_missing": "rotor speed 0 under thrust",
    "speed_lost": "rotor speed too low for its thrust",
    "speed_dropout": "rotor speed drops to 0",
    "tare": "thrust at rest",
    "flipped_sign": "sign of the thrust flipped",
    "stuck": "reading never moves",
    "unit": "unit",
    "superseded": "superseded columns",
    "derived": "derived, not measured",
    "no_pitch": "pitch not recorded",
    "on_ground": "rest, take-off and landing",
    "cut": "only the flight kept",
    "checksum": "checksum",
    "unknown_event": "unknown event",
    "dropout": "logger dropout",
    "no_command": "no command logged",
    "no_clock": "no clock",
    "second_sensor": "second sensor",
    "estimate": "estimate that did not fly the vehicle",
}
_HOW_TO_HAVE = {
    "folder": "ROTORID_PUBLIC_DATA names a folder and files are taken from there alone, so put the missing ones where "
    "the list says and run again, or unset it and run again where the network reaches their repositories",
    "network": "ROTORID_PUBLIC_DATA is not set and files are downloaded, so run again where the network reaches their "
    "repositories, after deleting results/public/<source>.json, or set it to a folder that holds the files",
}
"""What to do about files that are missing, by where they were looked for."""
_CHOICES = {"cut", "on_ground"}
"""Kinds that note what part of a log was kept, which is no fault of the log."""


def sources(status_files: Sequence[Path]) -> pd.DataFrame:
    """One row a source: repository, commit, licence, citation, contents, whether it was had, and from where."""
    rows = []
    for path in status_files:
        status = json.loads(Path(path).read_text(encoding="utf-8"))
        rows.append(
            {
                "source": status["source"],
                "repository": status["repository"],
                "place": f"{status['repository']} at {status['commit'][:10]}",
                "licence": status["licence"],
                "contents": status["contents"],
                "citation": status["citation"],
                "files": status["files"] - status["files_missing"],
                "obtained": "yes" if status["available"] else "no",
                "reason": status["reason"],
                "taken_from": status["taken_from"],
            }
        )
    return pd.DataFrame(rows)


def recordings(folders: Sequence[Path]) -> pd.DataFrame:
    """One row a set that is there: kind, runs, duration (s), rate (Hz), faults met."""
    rows = []
    for folder in folders:
        report = read_report(Path(folder))
        if not report["available"]:
            continue
        check = check_set(read_set(Path(folder)))
        rows.append(
            {
                "set": check.name,
                "kind": check.kind,
                "rotors": check.rotors,
                "runs": len(check.runs),
                "duration_s": sum(run.duration_s for run in check.runs),
                "rate_hz": sorted(run.rate_hz for run in check.runs)[len(check.runs) // 2],
                "faults": len(report["faults"]),
            }
        )
    columns = ["set", "kind", "rotors", "runs", "duration_s", "rate_hz", "faults"]
    return pd.DataFrame(rows, columns=columns)


def faults(folders: Sequence[Path]) -> pd.DataFrame:
    """One row a source and kind of fault: in how many runs, an example of what was seen and what was done."""
    rows: dict[tuple[str, str], dict] = {}
    for folder in folders:
        report = read_report(Path(folder))
        for fault in report["faults"]:
            if fault["kind"] in _CHOICES:
                continue
            recipe = PUBLIC_SETS[report["set"]]
            row = rows.setdefault(
                (recipe.source, fault["kind"]),
                {
                    "source": recipe.source,
                    "fault": _FAULT_NAMES.get(fault["kind"], fault["kind"]),
                    "runs": set(),
                    "found": fault["found"],
                    "action": fault["action"],
                },
            )
            row["runs"].add((report["set"], fault["run"]))
    table = [{**row, "runs": len(row["runs"])} for row in rows.values()]
    return pd.DataFrame(table, columns=["source", "fault", "runs", "found", "action"])


def state(table: pd.DataFrame) -> dict:
    """What the report's text needs to know of the table of sources."""
    missing = table[table["obtained"] == "no"]
    places = set(missing["taken_from"])
    return {
        "available": bool((table["obtained"] == "yes").all()),
        "sources": len(table),
        "obtained": int((table["obtained"] == "yes").sum()),
        "missing": missing[["source", "reason"]].to_dict("records"),
        "how": "; ".join(how for place, how in _HOW_TO_HAVE.items() if place in places),
    }
