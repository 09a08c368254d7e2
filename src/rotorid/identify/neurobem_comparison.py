"""Rigid-body residuals of the NeuroBEM flights, next to what NeuroBEM itself leaves over.

Three differences are taken, each side filtered alike: measured minus the believed rotors (`rigid_body`),
measured minus NeuroBEM's prediction (`neurobem`), and the latter with the mass that its paper prints
(`neurobem_paper_mass`), since the two published masses differ.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from rotorid.identify.rigid_body_residuals import (
    CHANNELS,
    TOTALS,
    Binned,
    airspeed,
    by_airspeed,
    low_pass,
    measured_wrench,
    rmse,
    rotor_wrench,
)
from rotorid.recordings import RecordingSet, Run, Vehicle
from rotorid.recordings import columns as c
from rotorid.recordings.importers.neurobem import ANGULAR_ACCELERATION, PREDICTED_FORCE, PREDICTED_MOMENT

_PAPER_MASS_KG = 0.752
_POINT_STEP = 40
"""Every so many samples become a point of the figure."""
_MODELS = ("rigid_body", "neurobem")
_FLIGHT_COLUMNS = ["flight", "model", "airspeed_mean_m_s", "airspeed_max_m_s", *CHANNELS, *TOTALS]
_BIN_COLUMNS = ["model", "channel", "airspeed_low_m_s", "airspeed_high_m_s", "samples"]
_BIN_COLUMNS += ["rms", "low_95", "high_95"]
_POINT_COLUMNS = ["flight", "airspeed_m_s", *CHANNELS]


@dataclass(frozen=True)
class _NeurobemTables:
    """Summary and tables; forces in N, moments in N m."""

    summary: dict
    flights: pd.DataFrame
    bins: pd.DataFrame
    points: pd.DataFrame


def nothing() -> _NeurobemTables:
    """Tables without a row, for recordings that are not there."""
    tables = (pd.DataFrame(columns=names) for names in (_FLIGHT_COLUMNS, _BIN_COLUMNS, _POINT_COLUMNS))
    return _NeurobemTables({}, *tables)


def residuals_of(run: Run, vehicle: Vehicle, cutoff_hz: float) -> dict[str, np.ndarray]:
    """What each model leaves over in one flight, shape (n, 6) each."""
    rate = 1 / float(np.median(np.diff(run.time_s)))
    acceleration = run.array(ANGULAR_ACCELERATION)
    lighter = vehicle.model_copy(update={"mass_kg": _PAPER_MASS_KG})

    def filtered(wrench: np.ndarray) -> np.ndarray:
        return low_pass(wrench, rate, cutoff_hz)

    measured = filtered(measured_wrench(run, vehicle, acceleration))
    rotor_speeds = run.array(c.rotor_columns("rotor_speed", vehicle.rotor_count))
    predicted = filtered(run.array(PREDICTED_FORCE + PREDICTED_MOMENT))
    return {
        "rigid_body": measured - filtered(rotor_wrench(rotor_speeds, vehicle)),
        "neurobem": measured - predicted,
        "neurobem_paper_mass": filtered(measured_wrench(run, lighter, acceleration)) - predicted,
    }


def _growth(found: Binned) -> dict[str, dict]:
    """RMS in the slowest and the fastest bin, and their ratio, of each channel and total."""
    return {
        channel: {
            "slowest_m_s": [float(found.low_m_s[0]), float(found.high_m_s[0])],
            "fastest_m_s": [float(found.low_m_s[-1]), float(found.high_m_s[-1])],
            "rms_slowest": float(found.rms[0, place]),
            "rms_fastest": float(found.rms[-1, place]),
            "growth": float(found.growth[place]),
            "growth_95": [float(v) for v in found.growth_95[place]],
        }
        for place, channel in enumerate(CHANNELS + TOTALS)
    }


def _bin_rows(model: str, found: Binned) -> list[tuple]:
    rows = []
    for place, channel in enumerate(CHANNELS + TOTALS):
        for b in range(len(found.low_m_s)):
            where = (model, channel, found.low_m_s[b], found.high_m_s[b], found.samples[b])
            rows.append((*where, found.rms[b, place], found.rms_low[b, place], found.rms_high[b, place]))
    return rows


def compare(
    recordings: RecordingSet, cutoff_hz: float, airspeed_bin_m_s: float, block_s: float, seed: int
) -> _NeurobemTables:
    """RMS of every flight and model, and against airspeed with block-bootstrap intervals."""
    vehicle = recordings.vehicle
    left = {run.name: residuals_of(run, vehicle, cutoff_hz) for run in recordings.runs}
    speeds = {run.name: airspeed(run) for run in recordings.runs}
    times = {run.name: run.time_s for run in recordings.runs}
    rows, summary = [], {"mass_kg": vehicle.mass_kg, "paper_mass_kg": _PAPER_MASS_KG, "flights": {}}
    for flight, models in left.items():
        pace = {
            "airspeed_mean_m_s": float(speeds[flight].mean()),
            "airspeed_max_m_s": float(speeds[flight].max()),
        }
        summary["flights"][flight] = {**pace, **{model: rmse(r) for model, r in models.items()}}
        rows += [{"flight": flight, "model": model, **pace, **rmse(r)} for model, r in models.items()]
    tops = sorted(float(speed.max()) for speed in speeds.values())
    top = tops[-1]
    summary["one_flight_above_m_s"] = tops[-2] if len(tops) > 1 else 0.0
    edges = np.arange(0.0, top + airspeed_bin_m_s, airspeed_bin_m_s)
    bins = []
    for model in _MODELS:
        mine = {flight: models[model] for flight, models in left.items()}
        found = by_airspeed(mine, speeds, times, edges, block_s, np.random.default_rng(seed))
        summary[model] = _growth(found)
        bins += _bin_rows(model, found)
    cloud = [np.column_stack([speeds[flight], models["rigid_body"]])[::_POINT_STEP] for flight, models in left.items()]
    points = pd.DataFrame(np.concatenate(cloud), columns=_POINT_COLUMNS[1:])
    points.insert(0, "flight", np.repeat(list(left), [len(part) for part in cloud]))
    return _NeurobemTables(
        summary, pd.DataFrame(rows)[_FLIGHT_COLUMNS], pd.DataFrame(bins, columns=_BIN_COLUMNS), points
    )
