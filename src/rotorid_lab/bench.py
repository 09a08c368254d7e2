"""The load-cell bench from raw logs to force: readings made ready, calibration, reconstruction, recording sets.

The bench is a cantilever (thesis 2.4, tables 2.2 and 2.3, eqs 2.3 to 2.9): a force along one axis at a time follows
from a sum of moments (x, y) or of the cells' forces (z). With loads along several axes at once the six readings do not
determine six unknowns, and the equations are then no more than an attempt. Axes are the vehicle's, z down; newtons.

Of the calibration:

- A reading is the mean of the tared voltage from where it stays steady under the weight to the end (fig. 2.34).
- Linearity: largest distance of a weight's mean reading from the line. Repeatability: standard deviation of
  readings of the same weight. Both in gf and as a share of the largest weight.
- Drift: slope in time of cells that carry nothing. Creep: slope under load, beyond the drift, per gf.
- Hysteresis needs loads taken off again. The thesis's calibration only puts weights on, so it is not to be
  had from it; the return to zero after a flight (dynamic tests) bounds hysteresis, creep and drift together.

Static tests that are ready make sets of kind `bench`, the reconstructed force next to the load. A run holds the loads
of one axis and repeat in their order. Its time counts from the set's first recording, so that runs lie where they were
in the day; each load has its own recording, tared at its start, with a gap in time before the next.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.special import stdtrit as student_quantile

from rotorid.errors import InputError
from rotorid.recordings import columns as c
from rotorid.recordings.run import RecordingSet, Run
from rotorid.recordings.signal import first_order, spikes, steady, tare, without_spikes, zero_phase
from rotorid.recordings.vehicle import Vehicle
from rotorid_acquire.io.logs import by_recording
from rotorid_lab.loadcell import LineFit, fit_line, mean_interval

GF_N = 9.80665e-3
"""Newtons in a gram-force."""
_C30, _C45, _C60 = np.cos(np.radians([30.0, 45.0, 60.0]))

_DISTANCES = ("D_1x D_2x D_4x D_5x D_6x D_1y D_2y D_3y D_4y D_5y D_6y D_135z D_246z L").split()
PULLED = (0, 2, 4)
"""Cells 1, 3, 5: their absolute value enters eq. 2.8."""
CELLS = tuple(f"cell_{i}_v" for i in range(1, 7))
FORCES = ("force_x_n", "force_y_n", "force_z_n")
DIRECTION = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, -1.0)}
"""Unit vector of a load, body axes: along z it pulls upwards, as thrust does."""
_FEWEST_STEADY = 50
SPIKE = 16
_SETTLING_SAMPLES = 10
"""Fig. 2.35: so many samples let the spikes of switching on dissipate."""


Geometry = Mapping[str, float]
"""Table 2.3: distances from {T} to where each cell takes its force, m, by their names there."""


def force_matrix(d: Geometry) -> np.ndarray:
    """M of eq. 2.9, shape (3, 6): cells' forces to the force on the vehicle, but for the |F| of cells 1, 3, 5."""
    length = d["L"]
    return np.array(
        [
            [
                -d["D_135z"] / (_C60 * length),
                (d["D_246z"] / _C30 - d["D_2x"]) / (_C45 * length),
                d["D_135z"] / length,
                d["D_4x"] / (_C45 * length),
                -d["D_135z"] / (_C60 * length),
                -(d["D_246z"] / _C30 - d["D_6x"]) / (_C45 * length),
            ],
            [
                d["D_135z"] / (_C30 * length),
                (d["D_246z"] / _C60 + d["D_2y"]) / (_C45 * length),
                0.0,
                (d["D_4y"] - d["D_246z"]) / (_C45 * length),
                -d["D_135z"] / (_C30 * length),
                (d["D_246z"] / _C60 - d["D_6y"]) / (_C45 * length),
            ],
            [0.0, -1 / _C45, 0.0, -1 / _C45, 0.0, -1 / _C45],
        ]
    )


def read_geometry(path: str | Path) -> dict[str, float]:
    """Table 2.3 from a CSV with the columns `distance` and `value_mm`. Raises InputError where one is missing."""
    table = pd.read_csv(path)
    if not {"distance", "value_mm"} <= set(table.columns):
        raise InputError(f"{path}: expected the columns distance and value_mm")
    values = dict(zip(table["distance"], table["value_mm"] / 1000, strict=True))
    missing = [name for name in _DISTANCES if name not in values]
    if missing:
        raise InputError(f"{path}: the distance {missing[0]} is missing")
    return {name: float(values[name]) for name in _DISTANCES}


def input_components(cells_n: np.ndarray) -> dict[str, np.ndarray]:
    """Table 2.2: input forces f_nx, f_ny, f_nz of the cells' perpendicular forces, shape (n,) each, N.

    What the table gives as "N/A" is left out: that cell does not feel that axis.
    """
    f = {i + 1: np.asarray(cells_n, float)[..., i] for i in range(6)}
    return {
        "f_1x": f[1] / _C60,
        "f_2x": f[2] / (_C30 * _C45),
        "f_3x": f[3],
        "f_5x": f[5] / _C60,
        "f_6x": f[6] / (_C30 * _C45),
        "f_1y": f[1] / _C30,
        "f_2y": f[2] / (_C60 * _C45),
        "f_4y": f[4] / _C45,
        "f_5y": f[5] / _C30,
        "f_6y": f[6] / (_C60 * _C45),
        "f_2z": f[2] / _C45,
        "f_4z": f[4] / _C45,
        "f_6z": f[6] / _C45,
    }


def moments(cells_n: np.ndarray, d: Geometry) -> np.ndarray:
    """Eqs 2.3 to 2.5: sums of moments about the axes of {T}, N m, shape (n, 3), of cells' forces (n, 6), N."""
    f = input_components(cells_n)
    about_x = (
        (f["f_1y"] - f["f_5y"]) * d["D_135z"]
        + (f["f_2y"] - f["f_4y"] + f["f_6y"]) * d["D_246z"]
        + f["f_2z"] * d["D_2y"]
        + f["f_4z"] * d["D_4y"]
        - f["f_6z"] * d["D_6y"]
    )
    about_y = (
        (f["f_1x"] - f["f_3x"] + f["f_5x"]) * d["D_135z"]
        + (f["f_6x"] - f["f_2x"]) * d["D_246z"]
        + f["f_2z"] * d["D_2x"]
        - f["f_4z"] * d["D_4x"]
        - f["f_6z"] * d["D_6x"]
    )
    about_z = (
        f["f_1x"] * d["D_1y"]
        - f["f_2x"] * d["D_2y"]
        + f["f_3x"] * d["D_3y"]
        - f["f_5x"] * d["D_5y"]
        - f["f_6x"] * d["D_6y"]
        - f["f_1y"] * d["D_1x"]
        - f["f_2y"] * d["D_2x"]
        - f["f_4y"] * d["D_4x"]
        + f["f_5y"] * d["D_5x"]
        + f["f_6y"] * d["D_6x"]
    )
    return np.stack([about_x, about_y, about_z], axis=-1)


def forces(cells_n: np.ndarray, geometry: Geometry) -> np.ndarray:
    """Eqs 2.6 to 2.8: force on the vehicle, N, shape (n, 3), of cells' forces (n, 6), N."""
    cells_n = np.asarray(cells_n, float)
    sums, f = moments(cells_n, geometry), input_components(cells_n)
    pulled = np.abs(cells_n[..., PULLED]).sum(axis=-1)
    along_z = -(pulled + f["f_2z"] + f["f_4z"] + f["f_6z"])
    return np.stack([-sums[..., 1] / geometry["L"], sums[..., 0] / geometry["L"], along_z], axis=-1)


def cell_forces(volts: np.ndarray, coefficients_gf: np.ndarray) -> np.ndarray:
    """Cells' forces, N, shape (n, 6), of tared voltages (n, 6), V, by eq. 2.10.

    `coefficients_gf` has shape (6, 2): a0 in gf and a1 in gf per 1e-5 V.
    """
    coefficients = np.asarray(coefficients_gf, float)
    return (coefficients[:, 0] + coefficients[:, 1] * np.asarray(volts, float) * 1e5) * GF_N


def cell_variance(volts: np.ndarray, lines: list[LineFit], reading_variance_v2: np.ndarray) -> np.ndarray:
    """Variance of the cells' forces, N², shape (n, 6): the lines' covariances and the readings' noise.

    `volts`: tared voltages, V, shape (n, 6). `lines`: calibration of each cell, gf against 1e-5 V.
    `reading_variance_v2`: variance of each voltage, V², shape (n, 6) or (6,).
    """
    x = np.atleast_2d(np.asarray(volts, float)) * 1e5
    noise = np.broadcast_to(np.asarray(reading_variance_v2, float), x.shape) * 1e10
    out = np.empty_like(x)
    for i, line in enumerate(lines):
        (v00, v01), (_, v11) = line.covariance
        out[:, i] = v00 + 2 * x[:, i] * v01 + x[:, i] ** 2 * v11 + line.a1**2 * noise[:, i]
    return out * GF_N**2


def force_covariance(cells_n: np.ndarray, variance_n2: np.ndarray, geometry: Geometry) -> np.ndarray:
    """Covariance of the reconstructed force, N², shape (n, 3, 3), to first order (cells are independent)."""
    cells_n = np.atleast_2d(np.asarray(cells_n, float))
    slope = np.repeat(force_matrix(geometry)[None], len(cells_n), axis=0)
    slope[:, 2, PULLED] -= np.sign(cells_n[:, PULLED])
    return np.einsum("nij,nj,nkj->nik", slope, np.atleast_2d(variance_n2), slope)


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
                "slope_v_s": float(_slope(time_s, volts)),
            }
        )
    return pd.DataFrame(rows)


def _slope(time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Least-squares slope in time (n,) of values (n,) or of each column of values (n, m)."""
    centred = time_s - time_s.mean()
    return centred @ values / (centred @ centred)


def calibrate_cell(table: pd.DataFrame, idle_slopes_v_s: np.ndarray) -> dict:
    """Line and figures of one cell from its rows of `readings` and its slopes where it was not loaded (V/s).

    Creep is the growth of the reading under load as a share of the load, per minute, over the seconds of a recording;
    noise the standard deviation of one sample. Units stand in the names, for a JSON file.
    """
    weight, reading = table["weight_gf"].to_numpy(float), table["reading_10uv"].to_numpy(float)
    line = fit_line(reading, weight)
    force = line.a0 + line.a1 * reading
    by_weight = pd.DataFrame({"weight": weight, "force": force}).groupby("weight")["force"]
    off = by_weight.mean() - by_weight.mean().index
    repeats = by_weight.count() - 1
    spread = float(np.sqrt((by_weight.var(ddof=1).fillna(0) * repeats).sum() / max(repeats.sum(), 1)))
    gf_per_volt = line.a1 * 1e5
    drift, drift_interval = float("nan"), (float("nan"), float("nan"))
    if len(idle_slopes_v_s) > 1:
        drift, drift_interval = mean_interval(np.asarray(idle_slopes_v_s, float))
    growth = table["slope_v_s"].to_numpy() - drift
    volts = reading * 1e-5
    share = float(growth @ volts / (volts @ volts))
    left = growth - share * volts
    half = student_quantile(len(volts) - 1, 0.975) * np.sqrt(left @ left / (len(volts) - 1) / (volts @ volts))
    linearity, most = float(np.abs(off).max()), float(weight.max())
    return {
        "a0_gf": line.a0,
        "a0_interval_95": line.interval(0),
        "a1_gf_per_10uv": line.a1,
        "a1_interval_95": line.interval(1),
        "covariance": line.covariance,
        "r": line.r,
        "residual_sd_gf": line.residual_sd,
        "degrees_of_freedom": line.degrees_of_freedom,
        "linearity_gf": linearity,
        "linearity_share": linearity / most,
        "repeatability_gf": spread,
        "repeatability_share": spread / most,
        "full_scale_gf": most,
        "noise_gf": float(np.sqrt((table["noise_10uv"] ** 2).mean()) * line.a1),
        "drift_gf_min": drift * 60 * gf_per_volt,
        "drift_interval_95": tuple(60 * gf_per_volt * v for v in drift_interval),
        "creep_share_min": 60 * share,
        "creep_interval_95": (60 * (share - half), 60 * (share + half)),
    }


def idle_slopes(samples: pd.DataFrame, sessions: pd.DataFrame) -> dict[int, np.ndarray]:
    """Slopes in time (V/s) of each cell in the recordings in which another cell was under load."""
    out: dict[int, list[float]] = {i: [] for i in range(1, 7)}
    parts = by_recording(samples)
    for session in sessions.itertuples():
        table = parts[session.id]
        table = table[table["quality"] == 0]
        slopes = _slope(table["time_s"].to_numpy(), table[list(CELLS)].to_numpy())
        for i in out:
            if i != int(session.cell):
                out[i].append(float(slopes[i - 1]))
    return {i: np.array(v) for i, v in out.items()}


def line_of(entry: dict) -> LineFit:
    """The line in an entry of `calibrate_cell`, without its residuals."""
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


@dataclass(frozen=True)
class Filter:
    """Settings of the filters for one instrument."""

    low_pass_hz: float
    zero_phase_hz: float
    spike_window: int
    """Samples."""
    spike_threshold: float
    """Robust standard deviations."""
    steady_window: int
    """Samples."""
    steady_tolerance: float
    """Span of the low-passed signal, unit of the channel."""


def _rest_range(session: pd.Series, table: pd.DataFrame) -> tuple[int, int]:
    """First and last row of the rest reading: the recorder's tare, else what lies between settling and load.

    Marks are values of the table's column `index`.
    """
    index = table["index"].to_numpy()
    start, stop = session.get("mark_tare_start"), session.get("mark_tare_stop")
    if pd.notna(start) and pd.notna(stop):
        first, last = np.searchsorted(index, start), np.searchsorted(index, stop, side="right") - 1
    else:
        load = session.get("mark_load")
        if pd.isna(load):
            raise InputError(f"{session['id']}: has neither a tare nor a mark where the load was put on")
        first, last = _SETTLING_SAMPLES, np.searchsorted(index, load) - 2
    if last < first:
        raise InputError(f"{session['id']}: no samples at rest before the load")
    return int(first), int(last)


def _prepare_recording(session: pd.Series, table: pd.DataFrame, channels: Sequence[str], settings: Filter):
    """One recording made ready: columns `id time_s index quality steady`, and for each channel its tared values,
    `<channel>_low_pass` and `<channel>_zero_phase`."""
    rate_hz = float(session["rate_hz"])
    raw = table[list(channels)].to_numpy()
    jumped = spikes(raw, settings.spike_window, settings.spike_threshold)
    clean = without_spikes(raw, jumped)
    clean = clean - tare(clean, *_rest_range(session, table))
    low = first_order(clean, settings.low_pass_hz, rate_hz)
    out = table[["id", "time_s", "index"]].copy()
    out["quality"] = table["quality"].to_numpy() | np.where(jumped.any(axis=1), SPIKE, 0).astype(np.uint8)
    out["steady"] = steady(low, settings.steady_window, settings.steady_tolerance)
    smooth = zero_phase(clean, settings.zero_phase_hz, rate_hz)
    for kind, values in (("", clean), ("_low_pass", low), ("_zero_phase", smooth)):
        out[[name + kind for name in channels]] = values
    return out


def prepare(samples: pd.DataFrame, sessions: pd.DataFrame, settings: Filter) -> pd.DataFrame:
    """All recordings of one kind and instrument made ready; of a calibration only the cell under load, as `cell_v`."""
    parts = by_recording(samples)
    out = []
    for _, session in sessions.iterrows():
        table = parts[session["id"]]
        channels = [name for name in (*CELLS, *FORCES) if name in table]
        if session["kind"] == "calibration":
            table, channels = table.rename(columns={f"cell_{int(session['cell'])}_v": "cell_v"}), ["cell_v"]
        out.append(_prepare_recording(session, table, channels, settings))
    return pd.concat(out, ignore_index=True)


def bench_force(coefficients_gf: np.ndarray, geometry: Geometry) -> Callable[[pd.DataFrame], np.ndarray]:
    """Force, N, shape (n, 3), of a prepared table: of six cells by eqs 2.3 to 2.9, else as the sensor gives it."""

    def force(table: pd.DataFrame) -> np.ndarray:
        if CELLS[0] in table and table[CELLS[0]].notna().any():
            return forces(cell_forces(table[list(CELLS)].to_numpy(), coefficients_gf), geometry)
        return table[list(FORCES)].to_numpy()

    return force


def _reference(session, table: pd.DataFrame, force_n: np.ndarray) -> np.ndarray:
    """The known load at each sample, N, shape (n, 3).

    Nobody wrote down the very moment at which the weight came on: it is where the reading first exceeds half of
    its final value.
    """
    direction = np.array(DIRECTION[session.axis])
    along = force_n @ direction
    index = table["index"].to_numpy()
    final = along[(index >= session.mark_read_start) & (index <= session.mark_read_stop)].mean()
    after_tare = index > session.mark_tare_stop
    on = after_tare & (np.abs(along) > 0.5 * abs(final))
    loaded = np.arange(len(index)) >= (np.argmax(on) if on.any() else len(index))
    return np.outer(loaded * session.load_gf * GF_N, direction)


def bench_set(
    name: str,
    prepared: pd.DataFrame,
    sessions: pd.DataFrame,
    force_of: Callable[[pd.DataFrame], np.ndarray],
    noise_n: float,
) -> RecordingSet:
    """Static tests of one platform as a contract set.

    `prepared`, `sessions`: of that platform, from `rotorid_lab.bench` and `rotorid_acquire.io.logs`. `force_of`: force
    (n, 3), N, of a prepared recording, see `bench_force`. `noise_n`: one-sigma noise of a sample as it is believed, N.
    """
    parts = by_recording(prepared)
    started = pd.to_datetime(sessions["started"])
    day_s = (started - started.min()).dt.total_seconds()
    runs: dict[str, list[pd.DataFrame]] = {}
    for session, offset_s in zip(sessions.itertuples(), day_s, strict=True):
        whole = parts[session.id]
        force = force_of(whole)
        table = pd.DataFrame({c.TIME: whole["time_s"].to_numpy() + offset_s})
        table[list(c.FORCE)] = force
        table[list(c.REFERENCE_FORCE)] = _reference(session, whole, force)
        kept = whole["index"].between(session.mark_tare_start, session.mark_read_stop).to_numpy()
        runs.setdefault(f"{session.axis}-r{int(session.repeat):02d}", []).append(table[kept])
    vehicle = Vehicle.model_validate({"name": name, "kind": "bench", "tared": True, "noise": {"force_n": noise_n}})
    made = tuple(
        Run(run, pd.concat(tables, ignore_index=True).sort_values(c.TIME, ignore_index=True))
        for run, tables in sorted(runs.items())
    )
    return RecordingSet(name, vehicle, made)
