"""What was taken home, asked of every kind of set: how well it predicts, whether it hovers and flies everywhere."""

from __future__ import annotations

import importlib.util
import json
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.mismatch.decide.findings import Analysis
from rotorid.mismatch.decide.sizes import fitted_part
from rotorid.mismatch.deliver.files import delivered, improved_vehicle
from rotorid.mismatch.deliver.usable import question_of
from rotorid.mismatch.evidence.rows import CHANNELS
from rotorid.mismatch.tell.verdict import Verdict
from rotorid.recordings import RecordingSet, Vehicle, read_set
from rotorid.report.deliver import analysis_of, verdict_of
from rotorid.vehicle.exports import export_vehicle
from rotorid.vehicle.exports.flown import try_out
from rotorid.vehicle.exports.forms import FORMS
from rotorid_proof.peers import predicting

ENGINES = {"rotorpy": "rotorpy", "mjcf": "mujoco", "gym-pybullet-drones": "pybullet"}
"""Form of an export to the module that flies it."""
CANDIDATES = ("believed", "refitted", "named", "believed+d", "refitted+d", "named+d")
"""Vehicles that may be delivered; with `+d` with derivatives."""
STAGES = ("refitted", "named", "after", "noise")
"""Errors on runs held out, in the geometric mean over channels of force and moment over the believed vehicle's."""
HALF_S = 0.5
"""Over which errors are averaged: what half a second of simulation accumulates."""
WORSE = 1.05
"""Error over the better of the believed and the refitted vehicle's from which a channel is worse."""
COLUMNS = (
    "set",
    "kind",
    "verdict",
    "vehicle",
    "conditions",
    "instruments",
    "chosen",
    "not_delivered",
    *(f"score_{name}" for name in CANDIDATES),
    *(f"held_out_{stage}" for stage in STAGES),
    *(f"half_second_{stage}" for stage in STAGES[:3]),
    *(f"peer_{name}" for name in predicting.PEERS),
    "channels",
    "channels_worse",
    "unfit",
    "not_exported",
    "not_flown_by",
    "warnings",
    "doubts",
    "failed",
)


def rows_of(folders: Sequence[Path], progress: Callable[[str], None]) -> list[dict]:
    """A row for every set; one on which the stage stops has only its reason."""
    rows = []
    for folder in folders:
        try:
            recordings = read_set(folder)
            analysis = analysis_of(recordings)
            rows.append(row_of(recordings, analysis, verdict_of(analysis)))
        except InputError as error:
            rows.append({"set": folder.name, "failed": str(error)})
        except Exception as error:  # any fault of the stage is a result here
            traceback.print_exc()
            rows.append({"set": folder.name, "failed": f"{type(error).__name__}: {error}"})
        progress(f"{folder.name}: {rows[-1].get('verdict', rows[-1].get('failed'))}")
    return rows


def row_of(recordings: RecordingSet, analysis: Analysis, verdict: Verdict) -> dict:
    """What an analysis delivers, and what is asked of it."""
    vehicle, flies = improved_vehicle(analysis), verdict.kind == "flight"
    return {
        "set": recordings.name,
        "kind": verdict.kind,
        "verdict": verdict.verdict,
        **{
            place: " ".join(f.id for f in delivered(analysis, place))
            for place in ("vehicle", "conditions", "instruments")
        },
        "chosen": candidate_name(verdict.delivered.model, verdict.delivered.derivatives),
        "not_delivered": "; ".join(f"{f.id}: {f.withheld}" for f in analysis.findings if f.withheld),
        **{f"score_{candidate_name(s.model, s.derivatives)}": s.score for s in verdict.delivered.scores},
        **held_out_errors(verdict),
        **(half_second_errors(analysis) if flies else {}),
        **({f"peer_{n}": e for n, e in predicting.errors(analysis).items()} if flies else {}),
        "unfit": question_of(analysis.believed, analysis.recordings.runs)[0](vehicle) if flies else "",
        "not_exported": " ".join(refused_by(vehicle)) if flies else "",
        "not_flown_by": " ".join(not_flown_by(vehicle)) if flies else "",
        "warnings": len(verdict.warnings),
        "doubts": " ".join(d.what for d in verdict.doubts),
        "failed": "",
    }


def candidate_name(model: str, derivatives: bool) -> str:
    """Name of a candidate as in CANDIDATES."""
    return f"{model}+d" if derivatives else model


def held_out_errors(verdict: Verdict) -> dict[str, float | int]:
    """Errors of each stage in the geometric mean over channels, over the believed vehicle's; channels made worse."""
    rows = []
    for name, channel in verdict.channels.items():
        e = channel.rmse.held_out
        if name.split("_")[0] in ("force", "moment") and e.before and None not in (e.refitted, e.named, e.after):
            rows.append([x / e.before for x in (e.refitted, e.named, e.after, channel.noise_floor or np.nan)])
    if not rows:
        return {"channels": 0}
    table = np.array(rows)
    means = np.exp(np.nanmean(np.log(np.maximum(table, 1e-9)), axis=0))
    worse = table[:, 2] > WORSE * np.minimum(1.0, table[:, 0])
    stages = {f"held_out_{stage}": round(float(m), 4) for stage, m in zip(STAGES, means, strict=True)}
    return {**stages, "channels": len(rows), "channels_worse": int(worse.sum())}


def half_second_errors(analysis: Analysis) -> dict[str, float]:
    """Means over half a second of what each stage leaves of the runs held out, as `held_out_errors` states errors."""
    part = fitted_part(analysis)
    squares: dict[str, list[np.ndarray]] = {}
    for t in analysis.traces:
        held = part(t.run, t.time_s) < 0
        if t.channel not in CHANNELS[:6] or held.sum() < 2:
            continue
        rows = max(1, round(HALF_S / float(np.median(np.diff(t.time_s)))))
        left = np.array([t.before, t.refitted, t.named, t.after])[:, held]
        count = left.shape[1] // rows
        means = left[:, : count * rows].reshape(4, count, rows).mean(axis=2)
        squares.setdefault(t.channel, []).append(means**2)
    sizes = [np.sqrt(np.nanmean(np.concatenate(own, axis=1), axis=1)) for own in squares.values()]
    over = np.array([own[1:] / own[0] for own in sizes if np.all(own > 0)])
    if not len(over):
        return {}
    return {
        f"half_second_{stage}": round(float(m), 4)
        for stage, m in zip(STAGES[:3], np.exp(np.log(over).mean(axis=0)), strict=True)
    }


def not_flown_by(vehicle: Vehicle) -> list[str]:
    """Forms of export that are written and whose engine, installed here, does not fly the vehicle."""
    out = []
    for form in sorted(ENGINES.keys() - refused_by(vehicle).keys()):
        if importlib.util.find_spec(ENGINES[form]) is None:
            continue
        try:
            try_out(vehicle, form, export_vehicle(vehicle, form))
        except (InputError, RuntimeError, ValueError) as error:
            out.append(f"{form} ({error})")
    return out


def refused_by(vehicle: Vehicle) -> dict[str, str]:
    """Forms of export that are not written, because their tool does not take such a vehicle, to the reason."""
    out = {}
    for form in FORMS:
        try:
            export_vehicle(vehicle, form)
        except InputError as error:
            out[form] = str(error)
    return out


def table(files: Sequence[Path]) -> pd.DataFrame:
    """Rows of all sets in one table."""
    rows = [row for file in files for row in json.loads(file.read_text(encoding="utf-8"))]
    return pd.DataFrame([[row.get(name, "") for name in COLUMNS] for row in rows], columns=COLUMNS)
