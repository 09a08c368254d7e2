"""What was taken home, asked of every kind of set: nothing worse elsewhere, a body, hovers, flies everywhere."""

from __future__ import annotations

import importlib.util
import json
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path

import pandas as pd

from rotorid.errors import InputError
from rotorid.mismatch.decision.findings import Analysis
from rotorid.mismatch.delivery.parts import delivered, improved_vehicle
from rotorid.mismatch.delivery.usable import question_of
from rotorid.mismatch.tell.verdict import Verdict
from rotorid.recordings import RecordingSet, Vehicle, read_set
from rotorid.report.deliver import analysis_of, verdict_of
from rotorid.vehicle.exports import export_vehicle
from rotorid.vehicle.exports.flown import try_out
from rotorid.vehicle.exports.forms import FORMS

ENGINES = {"rotorpy": "rotorpy", "mjcf": "mujoco", "gym-pybullet-drones": "pybullet"}
"""Form of an export to the module that flies it."""
COLUMNS = (
    "set",
    "kind",
    "verdict",
    "vehicle",
    "conditions",
    "instruments",
    "withheld",
    "withheld_values",
    "worse_elsewhere",
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
        "withheld": "; ".join(f"{f.id}: {f.withheld}" for f in analysis.findings if f.withheld),
        "withheld_values": "; ".join(f"{name}: {why}" for name, why in analysis.withheld_values.items()),
        "worse_elsewhere": "; ".join(analysis.worse_elsewhere),
        "unfit": question_of(analysis.believed, analysis.recordings.runs)[0](vehicle) if flies else "",
        "not_exported": " ".join(refused_by(vehicle)) if flies else "",
        "not_flown_by": " ".join(not_flown_by(vehicle)) if flies else "",
        "warnings": len(verdict.warnings),
        "doubts": " ".join(d.what for d in verdict.doubts),
        "failed": "",
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
