"""What a study of real recordings found, next to what was published."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from rotorid.recordings import RecordingSet
from rotorid_proof.studies import Study

GROUPS, STAGES = ("force", "moment", "rotor_speed"), ("before", "refitted", "after")
ROW_COLUMNS = ["study", "about", "held_out", "found", "values", "expected", "expected_found", "word"]
ROW_COLUMNS += [f"{group}_{stage}" for group in GROUPS for stage in STAGES]
ROW_COLUMNS += ["unexplained_share", "unexplained_depends_on"]
COMPARED_COLUMNS = ["study", "effect", "symbol", "found", "low_95", "high_95", "published", "unit", "source"]
STATED = ("established", "ambiguous")


def with_split(recordings: RecordingSet, wanted: Study) -> RecordingSet:
    """The set with the runs held out that the study asks for."""
    return recordings if wanted.held_out is None else replace(recordings, held_out=wanted.held_out)


SHOWN_HZ = 50.0
"""Rate at which residuals are kept for figures."""


def left_of(residuals: pd.DataFrame, verdict: Mapping[str, Any]) -> pd.DataFrame:
    """Residuals of force and moment over time of the first run held out, thinned: a verdict's `residuals_of`."""
    own = residuals[residuals["run"].isin(verdict["runs"]["held_out"][:1])].reset_index(drop=True)
    if own.empty:
        return own
    step = max(round(1 / SHOWN_HZ / float(np.median(np.diff(own["time_s"])))), 1)
    return own[[c for c in own if c in ("run", "time_s") or c.split("_")[0] in ("force", "moment")]].iloc[::step]


def mean_total_speed(recordings: RecordingSet) -> float | None:
    """Mean over time of the sum of measured rotor speeds, rad/s; None where none is measured."""
    count = recordings.vehicle.rotor_count
    names = [f"rotor_speed_{i + 1}_rad_s" for i in range(count)]
    sums = [np.nanmean(np.sum([run.column(n) for n in names], axis=0)) for run in recordings.runs if run.has(*names)]
    return float(np.mean(sums)) if sums else None


def rms_over_axes(verdict: Mapping[str, Any], group: str, stage: str) -> float | None:
    """Held-out rms of force or moment, root of the summed squares over its axes, in the group's unit."""
    found = [
        channel["rmse"]["held_out"][stage]
        for name, channel in verdict["channels"].items()
        if name.rsplit("_", 1)[0] == group
    ]
    known = [v for v in found if v is not None]
    return math.sqrt(sum(v * v for v in known)) if known else None


def compared(verdict: Mapping[str, Any], wanted: Study, total_speed: float | None) -> list[dict[str, Any]]:
    """Published numbers next to ours, where the verdict states the same effect with the same parameter.

    A symbol with a suffix (`k_d_x`, `tau_up`) counts as the plain one, one row each.
    """
    rows = []
    stated = {e["id"]: e for e in verdict["effects"] if e["status"] in STATED}
    for number in wanted.published:
        effect = stated.get(number.effect)
        for p in effect["parameters"] if effect else ():
            if p["symbol"] != number.symbol and not p["symbol"].startswith(f"{number.symbol}_"):
                continue
            factor = 1.0
            if number.times_total_speed:
                if total_speed is None:
                    continue
                factor = total_speed
            if number.times_rotors:
                factor = 4.0
            low, high = (None if x is None else factor * x for x in p["interval_95"])
            rows.append(
                {
                    "study": wanted.name,
                    "effect": number.effect,
                    "symbol": p["symbol"],
                    "found": factor * p["value"],
                    "low_95": low,
                    "high_95": high,
                    "published": number.value,
                    "unit": number.unit,
                    "source": number.source,
                }
            )
    return rows


def row_of(verdict: Mapping[str, Any], wanted: Study) -> dict[str, Any]:
    """One line of the table: what was found, how much better on runs not used, what stays unexplained."""
    stated = [e for e in verdict["effects"] if e["status"] in STATED]
    names = [" or ".join(dict.fromkeys((e["id"], *e["alternatives"]))) for e in stated]
    inside = {i for e in stated for i in (e["id"], *e["alternatives"])}
    row: dict[str, Any] = {
        "study": wanted.name,
        "about": wanted.about,
        "held_out": "; ".join(verdict["runs"]["held_out"]),
        "found": "; ".join(dict.fromkeys(names)),
        "values": "; ".join(verdict["parameters"]),
        "expected": "; ".join(wanted.expected),
        "expected_found": "; ".join(e for e in wanted.expected if e in inside),
        "word": verdict["verdict"],
    }
    for group in GROUPS:
        for stage in STAGES:
            row[f"{group}_{stage}"] = rms_over_axes(verdict, group, stage)
    row["unexplained_share"] = verdict["unexplained"]["share"]
    row["unexplained_depends_on"] = "; ".join(verdict["unexplained"]["depends_on"])
    return row


def neurobem_errors(flights: Sequence[Mapping[str, Any]]) -> dict[tuple[str, str], float]:
    """NeuroBEM's own error by flight and group, as `rms_over_axes` states ours: the root of the summed squares.

    `flights` are the lines of `results/neurobem/flights.csv`, whose own totals are means over the axes instead.
    """
    return {
        (flight["flight"], group): math.sqrt(sum(float(flight[f"{group}_{axis}"]) ** 2 for axis in "xyz"))
        for flight in flights
        if flight["model"] == "neurobem"
        for group in ("force", "moment")
    }


STOPPED = "the stage stopped"
"""Beginning of the reason of a study on whose recordings the stage itself failed."""


def read_results(paths: Sequence[Path]) -> list[dict[str, Any]]:
    """Results of studies that could be made, and of those on which the stage stopped."""
    found = [json.loads(path.read_text(encoding="utf-8")) for path in paths]
    return [f for f in found if f["available"] or f["reason"].startswith(STOPPED)]


def stopped_row(wanted: Study) -> dict[str, Any]:
    """The line of a study on which the stage stopped: what was expected, and that nothing came of it."""
    row = {"study": wanted.name, "about": wanted.about, "expected": "; ".join(wanted.expected)}
    return row | {"held_out": "; ".join(wanted.held_out or ()), "word": "stopped"}
