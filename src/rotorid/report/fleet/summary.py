"""Tables of a fleet: which sets show which effect, each parameter over time, which verdicts need a person."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from rotorid.effects.catalogue import catalogue
from rotorid.errors import InputError
from rotorid.io.text.files import read_yaml
from rotorid.report.fleet.judge import FAILED

_SHOWN = ("established", "ambiguous", "suggested")
"""Words of effects that a summary counts; what is absorbed or not established shows nothing."""
_DATE = re.compile(r"(?<!\d)(20\d\d)[-_]?(0[1-9]|1[0-2])[-_]?(0[1-9]|[12]\d|3[01])(?!\d)")
"""A day in the name of a set: 2026-11-22, 2026_11_22 or 20261122."""


def collect(folders: Sequence[Path], recordings: Path) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """Tables of sets, of effects in sets and of parameters in sets.

    Parameters
    ----------
    folders
        One folder a set, with its verdict or `failed.json`.
    recordings
        Folder of the sets themselves, for the names of their vehicles.

    Returns
    -------
    sets
        One row a set: `set`, `vehicle`, `day` (of the set's name, empty where it has none), `verdict`,
        `unexplained` (share), `effects`, `person` (why a person should look, empty where nobody need), `sentence`.
    effects
        One row a set and effect that shows: `set`, `vehicle`, `day`, `effect`, `status`, `share`.
    parameters
        One row a set and number: `set`, `vehicle`, `day`, `parameter`, `unit`, `value`, `low_95`, `high_95`, `status`.
    """
    rows, effects, parameters = [], [], []
    for folder in sorted(folders, key=lambda path: path.name):
        own = {"set": folder.name, "vehicle": _vehicle(recordings / folder.name), "day": day_of(folder.name)}
        if (folder / FAILED).is_file():
            reason = json.loads((folder / FAILED).read_text(encoding="utf-8"))
            what = "a fault of rotorid" if reason["fault"] else "the set cannot be judged"
            rows.append(own | {"verdict": "failed", "effects": "", "person": what, "sentence": reason["reason"]})
            continue
        verdict = json.loads((folder / "verdict.json").read_text(encoding="utf-8"))
        found = [e for e in verdict["effects"] if e["status"] in _SHOWN]
        rows.append(
            own
            | {
                "verdict": verdict["verdict"],
                "unexplained": verdict["unexplained"]["share"],
                "effects": " ".join(e["id"] for e in found if e["status"] != "suggested"),
                "person": "; ".join(reasons(verdict)),
                "sentence": verdict["sentence"],
            }
        )
        effects += [own | {"effect": e["id"], "status": e["status"], "share": e["share"]} for e in found]
        parameters += [own | row for row in _numbers(verdict, found)]
    return (
        pd.DataFrame(rows, columns=[*_OWN, "verdict", "unexplained", "effects", "person", "sentence"]),
        pd.DataFrame(effects, columns=[*_OWN, "effect", "status", "share"]),
        pd.DataFrame(parameters, columns=[*_OWN, "parameter", "unit", "value", "low_95", "high_95", "status"]),
    )


_OWN = ("set", "vehicle", "day")


def reasons(verdict: dict[str, Any]) -> list[str]:
    """Why a person should look at a verdict; nothing where it stands by itself."""
    out = []
    if verdict["verdict"] == "not_judged":
        out.append("not judged: " + "; ".join(d["sentence"].rstrip(".") for d in verdict["doubts"] if d["stops"]))
    elif verdict["verdict"] == "unexplained":
        out.append("a mismatch that nothing of the catalogue explains")
    elif verdict["verdict"] == "partly_explained":
        out.append(f"{verdict['unexplained']['share']:.0%} of the mismatch unexplained")
    for status, words in (("ambiguous", "cannot be distinguished from another cause"), ("suggested", "only suggested")):
        named = [e["id"] for e in verdict["effects"] if e["status"] == status]
        if named:
            out.append(f"{words}: {', '.join(named)}")
    kinds = {name: effect.kind for name, effect in catalogue().items()}
    wrong = [e["id"] for e in verdict["effects"] if e["status"] == "established" and kinds.get(e["id"]) == "mistake"]
    if wrong:
        out.append(f"a mistake in the set: {', '.join(wrong)}")
    return out


def by_effect(effects: pd.DataFrame, sets: pd.DataFrame) -> pd.DataFrame:
    """One row an effect: in how many sets and vehicles it is `established`, `ambiguous`, `suggested`, and its median
    `share` of the error that goes; the most frequent first."""
    rows = []
    for name, own in effects.groupby("effect"):
        counts = {status: int((own["status"] == status).sum()) for status in _SHOWN}
        surely = own[own["status"] == "established"]
        rows.append(
            {"effect": name, **counts, "vehicles": surely["vehicle"].nunique(), "share": surely["share"].median()}
        )
    table = pd.DataFrame(rows, columns=["effect", *_SHOWN, "vehicles", "share"])
    judged = int((sets["verdict"] != "failed").sum())
    table.insert(1, "of_sets", judged)
    return table.sort_values([*_SHOWN, "effect"], ascending=[False] * 3 + [True], ignore_index=True)


def by_vehicle(effects: pd.DataFrame, sets: pd.DataFrame) -> pd.DataFrame:
    """One row a vehicle: `vehicle`, `sets`, `failed`, `person` (how many need one), `effects` (established, and in how
    many sets, the most frequent first), `last` (verdict of its last set by day and name)."""
    sure = effects[effects["status"] == "established"]
    rows = []
    for name, own in sets.sort_values(["day", "set"]).groupby("vehicle"):
        counts = sure.loc[sure["vehicle"] == name, "effect"].value_counts()
        ordered = sorted(counts.items(), key=lambda pair: (-pair[1], pair[0]))
        rows.append(
            {
                "vehicle": name,
                "sets": len(own),
                "failed": int((own["verdict"] == "failed").sum()),
                "person": int((own["person"] != "").sum()),
                "effects": ", ".join(f"{effect} {count}" for effect, count in ordered),
                "last": own["verdict"].iloc[-1],
            }
        )
    return pd.DataFrame(rows, columns=["vehicle", "sets", "failed", "person", "effects", "last"])


def day_of(name: str) -> str:
    """Day in the name of a set as YYYY-MM-DD, else empty."""
    found = _DATE.search(name)
    return "-".join(found.groups()) if found else ""


def _numbers(verdict: dict[str, Any], found: Sequence[dict[str, Any]]):
    """Every number that a verdict states with an interval."""
    for effect in found:
        for p in effect["parameters"]:
            low, high = p["interval_95"]
            yield {
                "parameter": f"{effect['id']}.{p['symbol']}",
                "unit": p["unit"],
                "value": p["value"],
                "low_95": low,
                "high_95": high,
                "status": effect["status"],
            }
    for name, value in verdict["parameters"].items():
        low, high = value["interval_95"]
        yield {
            "parameter": name,
            "unit": "",
            "value": value["refitted"],
            "low_95": low,
            "high_95": high,
            "status": "wrong value",
        }


def _vehicle(folder: Path) -> str:
    """Name of a set's vehicle, else the set's own."""
    try:
        return str(read_yaml(folder / "vehicle.yaml")["name"])
    except (InputError, KeyError):
        return folder.name
