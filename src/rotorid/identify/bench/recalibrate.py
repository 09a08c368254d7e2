"""Calibration of the cells from raw logs: readings of known weights, lines, and what a metrologist asks for.

- A reading is the mean of the tared voltage from where it stays steady under the weight to the end (fig. 2.34).
- Linearity: largest distance of a weight's mean reading from the line. Repeatability: standard deviation of
  readings of the same weight. Both in gf and as a share of the largest weight.
- Drift: slope in time of cells that carry nothing. Creep: slope under load, beyond the drift, per gf.
- Hysteresis needs loads taken off again. The thesis's calibration only puts weights on, so it is not to be
  had from it; the return to zero after a flight (dynamic tests) bounds hysteresis, creep and drift together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.special import stdtrit as student_quantile

from rotorid.errors import InputError
from rotorid.identify.bench.loadcell import LineFit, fit_line
from rotorid.identify.bench.reconstruct import CELLS
from rotorid.io.tables import by_recording

_FEWEST_STEADY = 50


def readings(prepared: pd.DataFrame, sessions: pd.DataFrame) -> pd.DataFrame:
    """One row per calibration recording: cell, weight, repeat, mean reading and how it was had.

    Columns `id cell weight_gf repeat reading_10uv mean_from_s noise_10uv samples slope_v_s`; the reading is in
    1e-5 V, as in the thesis's table 2.7. Raises InputError where a recording never became steady under its weight.
    """
    parts = by_recording(prepared)
    rows = []
    for session in sessions.itertuples():
        table = parts[session.id]
        loaded = table[table["index"] > session.mark_load]
        # Steady until the end: before the weight is really on, the reading at rest is steady too.
        unsteady = np.flatnonzero(~loaded["steady"].to_numpy())
        first = int(unsteady[-1]) + 1 if len(unsteady) else 0
        if len(loaded) - first < _FEWEST_STEADY:
            raise InputError(f"{session.id}: the reading was not steady for the last {_FEWEST_STEADY} samples")
        kept = loaded.iloc[first:]
        kept = kept[kept["quality"] == 0]
        volts, time_s = kept["cell_v"].to_numpy(), kept["time_s"].to_numpy()
        rows.append(
            {
                "id": session.id,
                "cell": int(session.cell),
                "weight_gf": session.load_gf,
                "repeat": session.repeat,
                "reading_10uv": volts.mean() * 1e5,
                "mean_from_s": time_s[0],
                "noise_10uv": volts.std(ddof=1) * 1e5,
                "samples": len(kept),
                "slope_v_s": _slope(time_s, volts),
            }
        )
    return pd.DataFrame(rows)


def _slope(time_s: np.ndarray, values: np.ndarray) -> float:
    """Least-squares slope of values in time."""
    centred = time_s - time_s.mean()
    return float(centred @ values / (centred @ centred))


@dataclass(frozen=True)
class _Metrology:
    """Figures of one cell; gf unless the name says otherwise."""

    line: LineFit
    linearity_gf: float
    repeatability_gf: float
    full_scale_gf: float
    noise_gf: float
    """Standard deviation of one sample."""
    drift_gf_min: float
    drift_interval_95: tuple[float, float]
    creep_share_min: float
    """Growth of the reading under load as a share of the load, per minute, over the seconds of a recording."""
    creep_interval_95: tuple[float, float]


def calibrate_cell(table: pd.DataFrame, idle_slopes_v_s: np.ndarray) -> _Metrology:
    """Line and figures of one cell from its rows of `readings` and its slopes where it was not loaded (V/s)."""
    weight, reading = table["weight_gf"].to_numpy(float), table["reading_10uv"].to_numpy(float)
    line = fit_line(reading, weight)
    force = line.a0 + line.a1 * reading
    by_weight = pd.DataFrame({"weight": weight, "force": force}).groupby("weight")["force"]
    off = by_weight.mean() - by_weight.mean().index
    repeats = by_weight.count() - 1
    spread = float(np.sqrt((by_weight.var(ddof=1).fillna(0) * repeats).sum() / max(repeats.sum(), 1)))
    gf_per_volt = line.a1 * 1e5
    drift, drift_interval = _mean_interval(idle_slopes_v_s)
    growth = table["slope_v_s"].to_numpy() - drift
    volts = reading * 1e-5
    share = float(growth @ volts / (volts @ volts))
    left = growth - share * volts
    half = student_quantile(len(volts) - 1, 0.975) * np.sqrt(left @ left / (len(volts) - 1) / (volts @ volts))
    return _Metrology(
        line=line,
        linearity_gf=float(np.abs(off).max()),
        repeatability_gf=spread,
        full_scale_gf=float(weight.max()),
        noise_gf=float(np.sqrt((table["noise_10uv"] ** 2).mean()) * line.a1),
        drift_gf_min=drift * 60 * gf_per_volt,
        drift_interval_95=tuple(60 * gf_per_volt * v for v in drift_interval),
        creep_share_min=60 * share,
        creep_interval_95=(60 * (share - half), 60 * (share + half)),
    )


def _mean_interval(values: np.ndarray) -> tuple[float, tuple[float, float]]:
    """Mean and its 95 % interval by Student's t."""
    values = np.asarray(values, float)
    if len(values) < 2:
        return float("nan"), (float("nan"), float("nan"))
    half = student_quantile(len(values) - 1, 0.975) * values.std(ddof=1) / np.sqrt(len(values))
    return float(values.mean()), (float(values.mean() - half), float(values.mean() + half))


def idle_slopes(samples: pd.DataFrame, sessions: pd.DataFrame) -> dict[int, np.ndarray]:
    """Slopes in time (V/s) of each cell in the recordings in which another cell was under load."""
    out: dict[int, list[float]] = {i: [] for i in range(1, 7)}
    parts = by_recording(samples)
    for session in sessions.itertuples():
        table = parts[session.id]
        table = table[table["quality"] == 0]
        time_s, volts = table["time_s"].to_numpy(), table[list(CELLS)].to_numpy()
        centred = time_s - time_s.mean()
        slopes = centred @ volts / (centred @ centred)
        for i in out:
            if i != int(session.cell):
                out[i].append(float(slopes[i - 1]))
    return {i: np.array(v) for i, v in out.items()}


def as_dict(cell: int, metrology: _Metrology) -> dict:
    """One cell's figures for a JSON file, units in the names."""
    line = metrology.line
    return {
        "cell": cell,
        "a0_gf": line.a0,
        "a0_interval_95": line.interval(0),
        "a1_gf_per_10uv": line.a1,
        "a1_interval_95": line.interval(1),
        "covariance": line.covariance,
        "r": line.r,
        "residual_sd_gf": line.residual_sd,
        "degrees_of_freedom": line.degrees_of_freedom,
        "linearity_gf": metrology.linearity_gf,
        "linearity_share": metrology.linearity_gf / metrology.full_scale_gf,
        "repeatability_gf": metrology.repeatability_gf,
        "repeatability_share": metrology.repeatability_gf / metrology.full_scale_gf,
        "full_scale_gf": metrology.full_scale_gf,
        "noise_gf": metrology.noise_gf,
        "drift_gf_min": metrology.drift_gf_min,
        "drift_interval_95": metrology.drift_interval_95,
        "creep_share_min": metrology.creep_share_min,
        "creep_interval_95": metrology.creep_interval_95,
    }


def line_of(entry: dict) -> LineFit:
    """The line in an entry of `as_dict`, without its residuals."""
    return LineFit(
        a0=entry["a0_gf"],
        a1=entry["a1_gf_per_10uv"],
        r=entry["r"],
        residual_sd=entry["residual_sd_gf"],
        residual_rms=float("nan"),
        covariance=tuple(tuple(row) for row in entry["covariance"]),
        degrees_of_freedom=entry["degrees_of_freedom"],
        residuals=(),
    )
