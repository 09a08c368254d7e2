"""The proof's tables as files, from folders of verdicts and of answers."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rotorid_proof import table
from rotorid_proof.score import score_case

OURS = "rotorid"
COLUMNS = {
    "confusion": ["kind", "truth", "claimed", "share", "cases"],
    "power": ["effect", "size_over_noise", "detected", "low_95", "high_95", "cases"],
    "parameters": ["case", "effect", "symbol", "true", "estimate", "relative_error", "covered"],
    "families": ["simulator", "family", "released", "cases", "right", "false_alarms", "wrong_names", "missed"],
    "effects": ["kind", "effect", "strong", "moderate", "weak", "instead"],
}
"""Headings of tables that may have no row."""
SIGNIFICANT = "%.6g"


def read_json(path: Path) -> Any:
    """A JSON file."""
    return json.loads(path.read_text(encoding="utf-8"))


def write_tables(
    verdicts: Sequence[Path], answers: Sequence[Path], peers: Sequence[Path], out: Path, present: str = ""
) -> list[dict[str, Any]]:
    """Score everything and write summary, cases, families, effects, confusion, power, parameters, peers (CSV) and state
    (JSON). `present` is the hash of the code that judges now: rows that other code judged are marked as older.

    Returns the scores of our verdicts, one a case.
    """
    truth = {path.stem: read_json(path) for folder in answers for path in sorted(folder.glob("set-*.json"))}
    said = {path.stem: read_json(path) for folder in verdicts for path in sorted(folder.glob("set-*.json"))}
    seconds: dict[str, Any] = {}
    for folder in verdicts:
        seconds |= read_json(folder / "seconds.json")
    scores = [score_case(said[name], answer, seconds[name]["samples_per_row"]) for name, answer in truth.items()]
    for s in scores:
        s["seconds"], s["flown_s"] = seconds[s["set"]]["seconds"], seconds[s["set"]]["flown_s"]
        s["judged_by"] = seconds[s["set"]].get("code", "")
    by_method = {OURS: [s for s in scores if s["kind"] == "flight"], **peer_scores(peers, truth)}
    rows = table.peer_rows(by_method)
    summary = table.summary(scores)
    summary.append(better_row(rows) | table.provenance(scores))
    for row in summary:
        row["older"] = row["judged_by"] not in ("", present)
    tables = {
        "summary": summary,
        "cases": table.case_rows(scores),
        "families": table.drawn_families(scores),
        "effects": table.by_effect(scores),
        "confusion": table.confusion(scores),
        "power": table.power(scores),
        "parameters": table.parameter_rows(scores),
        "peers": rows,
    }
    out.mkdir(parents=True, exist_ok=True)
    for name, found in tables.items():
        frame = pd.DataFrame(found) if found else pd.DataFrame(columns=COLUMNS[name])
        frame.to_csv(out / f"{name}.csv", index=False, float_format=SIGNIFICANT)
    (out / "state.json").write_text(json.dumps(state(scores, summary), indent=1) + "\n", encoding="utf-8")
    return scores


def peer_scores(folders: Sequence[Path], truth: Mapping[str, Any]) -> dict[str, list[dict[str, Any]]]:
    """Scores of each peer on the sets that it saw."""
    out: dict[str, list[dict[str, Any]]] = {}
    for folder in folders:
        for path in sorted(folder.glob("set-*.json")):
            if path.stem in truth:
                for method, verdict in read_json(path).items():
                    out.setdefault(method, []).append(score_case(verdict, truth[path.stem]))
    return out


def better_row(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The table's last line: whether we beat every peer."""
    better = table.better_than_all(rows, OURS)
    return {
        "id": "better",
        "what": "Better than every peer in the same table (1 = yes)",
        "at_least": 1.0,
        "at_most": None,
        "value": None if better is None else float(better),
        "cases": rows[0]["cases"],
        "holds": None if better is None else (table.HOLDS if better else table.FAILS),
    }


def state(scores: Sequence[Mapping[str, Any]], summary: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Numbers that the chapter's prose needs."""
    asked = [row for row in summary if row["holds"] is not None]
    own = [table.family(s) for s in scores]
    timed = [s for s in scores if s["flown_s"] and s["kind"] == "flight"]
    per_minute = [60 * s["seconds"] / s["flown_s"] for s in timed]
    return {
        "cases": len(scores),
        "kinds": {kind: sum(s["kind"] == kind for s in scores) for kind in table.KINDS},
        "families": {f: own.count(f) for f in sorted(set(own))},
        "targets": len(asked),
        "met": sum(row["holds"] == table.HOLDS for row in asked),
        "open": sum(row["holds"] == table.OPEN for row in asked),
        "missed": [row["what"] for row in asked if row["holds"] == table.FAILS],
        "released": sorted({s["released"] for s in scores if s["released"]}),
        "stopped": [s["case"] for s in scores if s["failed"]],
        "seconds_median": float(np.median([s["seconds"] for s in timed])) if timed else None,
        "seconds_slowest": float(max(s["seconds"] for s in timed)) if timed else None,
        "seconds_per_minute_flown": float(np.median(per_minute)) if timed else None,
    }
