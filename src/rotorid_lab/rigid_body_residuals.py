"""Rigid-body residuals of a flight: measured wrench minus the believed rotors' wrench, channel by channel.

Measured (body axes, forward-right-down): force m f with the specific force f, moment J Ω̇ + Ω × J Ω (thesis
eqs 4.10 to 4.19). Believed: F = (0, 0, -Σ C_F ω²), M = Σ (r_i × F_i) + Σ s_i C_Q ω_i² along z.

Measured and modelled wrench pass the same zero-phase filter, so neither amplitude nor delay differs between
the two sides.

Of the NeuroBEM flights three differences are taken: measured minus the believed rotors (`rigid_body`), measured minus
NeuroBEM's prediction (`neurobem`), and the latter with the mass that its paper prints (`neurobem_paper_mass`), since
the two published masses differ.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from scipy.signal import butter, sosfiltfilt

from rotorid.errors import InputError
from rotorid.recordings import RecordingSet, Run, Vehicle
from rotorid.recordings import columns as c
from rotorid.recordings.importers.neurobem import ANGULAR_ACCELERATION, PREDICTED_FORCE, PREDICTED_MOMENT

_CHANNELS = ("force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z")
_TOTALS = ("force", "moment")
"""Over three axes: sqrt(mean of the three squares), the convention of the NeuroBEM paper's table."""
_ORDER = 2
_PAPER_MASS_KG = 0.752
_POINT_STEP = 40
"""Every so many samples become a point of the figure."""
_REPEATS = 400
"""Of the bootstrap."""
_FEWEST_BLOCKS = 5
_MODELS = ("rigid_body", "neurobem")
_FLIGHT_COLUMNS = ["flight", "model", "airspeed_mean_m_s", "airspeed_max_m_s", *_CHANNELS, *_TOTALS]
_BIN_COLUMNS = ["model", "channel", "airspeed_low_m_s", "airspeed_high_m_s", "samples"]
_BIN_COLUMNS += ["rms", "low_95", "high_95"]
_POINT_COLUMNS = ["flight", "airspeed_m_s", *_CHANNELS]


def low_pass(values: np.ndarray, rate_hz: float, cutoff_hz: float) -> np.ndarray:
    """Zero-phase Butterworth low-pass along the first axis, shape kept; -3 dB at `cutoff_hz`.

    Forward and backward passes each attenuate, so the one-way filter's corner is set higher by
    (√2 - 1)^(-1/4) for the second order used here.
    """
    corner = cutoff_hz * (np.sqrt(2) - 1) ** (-1 / (2 * _ORDER))
    if corner >= rate_hz / 2:
        raise InputError(f"cutoff {cutoff_hz:g} Hz is too high for samples at {rate_hz:g} Hz")
    return sosfiltfilt(butter(_ORDER, corner, fs=rate_hz, output="sos"), values, axis=0)


def measured_wrench(run: Run, vehicle: Vehicle, angular_acceleration: np.ndarray) -> np.ndarray:
    """Force (N) and moment (N m) that act on the vehicle except gravity, body axes, shape (n, 6).

    `run`: with `specific_force_*` and `angular_velocity_*`. `vehicle`: believed mass and inertia.
    `angular_acceleration`: Ω̇, rad/s², body axes, shape (n, 3).
    """
    rates = run.array(c.ANGULAR_VELOCITY)
    inertia = vehicle.inertia_kg_m2.matrix()
    moment = angular_acceleration @ inertia + np.cross(rates, rates @ inertia)
    return np.hstack([vehicle.mass_kg * run.array(c.SPECIFIC_FORCE), moment])


def rotor_wrench(rotor_speeds: np.ndarray, vehicle: Vehicle) -> np.ndarray:
    """Force (N) and moment (N m) of the believed rotors at speeds (n, rotors) in rad/s, shape (n, 6)."""
    squared = rotor_speeds**2
    thrust = squared * vehicle.thrust_coefficients_n_s2()
    torque = squared * vehicle.torque_coefficients_n_m_s2() * vehicle.yaw_signs()
    x, y, _ = vehicle.rotor_positions_m().T
    zero = np.zeros(len(thrust))
    return np.column_stack([zero, zero, -thrust.sum(axis=1), -thrust @ y, thrust @ x, torque.sum(axis=1)])


def rmse(residual: np.ndarray) -> dict[str, float]:
    """Root mean square of each channel and of the totals, residual of shape (n, 6)."""
    squares = np.mean(_squares(residual), axis=0)
    return {name: float(np.sqrt(v)) for name, v in zip(_CHANNELS + _TOTALS, squares, strict=True)}


def _squares(residual: np.ndarray) -> np.ndarray:
    """Squares of the channels and, as columns 7 and 8, of the totals; shape (n, 8)."""
    squares = residual**2
    return np.column_stack([squares, squares[:, :3].mean(axis=1), squares[:, 3:].mean(axis=1)])


def by_airspeed(
    residuals: Mapping[str, np.ndarray],
    airspeeds: Mapping[str, np.ndarray],
    times_s: Mapping[str, np.ndarray],
    edges_m_s: Sequence[float],
    block_s: float,
    rng: np.random.Generator,
) -> dict[str, np.ndarray]:
    """RMS residual against airspeed over all runs, intervals by resampling blocks of time.

    Residuals are correlated in time, so whole blocks of `block_s` are drawn, not samples. By name: of each bin `low`
    and `high` (m/s), `samples`, and of its eight channels and totals `rms` with `rms_95` (2, bins, 8); `growth`, RMS in
    the fastest bin over RMS in the slowest, with `growth_95` (2, 8).

    `residuals`: per run, shape (n, 6). `airspeeds`, `times_s`: per run, shape (n,). `edges_m_s`: edges of the bins.
    `block_s`: length of a block. A bin seen in fewer than five blocks is left out.
    """
    edges = np.asarray(edges_m_s, float)
    bins = len(edges) - 1
    squares, counts = [], []
    for name, residual in residuals.items():
        which = np.digitize(airspeeds[name], edges) - 1
        block = ((times_s[name] - times_s[name][0]) // block_s).astype(int)
        inside = (which >= 0) & (which < bins)
        total = np.zeros((block.max() + 1, bins, 8))
        number = np.zeros((block.max() + 1, bins))
        np.add.at(total, (block[inside], which[inside]), _squares(residual[inside]))
        np.add.at(number, (block[inside], which[inside]), 1.0)
        squares.append(total)
        counts.append(number)
    squares, counts = np.concatenate(squares), np.concatenate(counts)
    kept = (counts > 0).sum(axis=0) >= _FEWEST_BLOCKS
    squares, counts = squares[:, kept], counts[:, kept]
    blocks = len(counts)
    draws = rng.multinomial(blocks, np.full(blocks, 1 / blocks), size=_REPEATS).astype(float)
    number = draws @ counts
    total = np.einsum("rb,bkc->rkc", draws, squares)
    spread = np.sqrt(total / np.where(number > 0, number, np.nan)[:, :, None])
    centre = np.sqrt(squares.sum(axis=0) / counts.sum(axis=0)[:, None])
    with np.errstate(divide="ignore", invalid="ignore"):  # a channel may have nothing left over
        ratio, growth = spread[:, -1] / spread[:, 0], centre[-1] / centre[0]
    return {
        "low": edges[:-1][kept],
        "high": edges[1:][kept],
        "samples": counts.sum(axis=0).astype(int),
        "rms": centre,
        "rms_95": np.nanpercentile(spread, [2.5, 97.5], axis=0),
        "growth": growth,
        "growth_95": np.nanpercentile(ratio, [2.5, 97.5], axis=0),
    }


_Tables = tuple[dict, pd.DataFrame, pd.DataFrame, pd.DataFrame]
"""Summary, flights, bins and points; forces in N, moments in N m."""


def no_neurobem() -> _Tables:
    """Tables without a row, for recordings that are not there."""
    tables = (pd.DataFrame(columns=names) for names in (_FLIGHT_COLUMNS, _BIN_COLUMNS, _POINT_COLUMNS))
    return {}, *tables


def _residuals_of(run: Run, vehicle: Vehicle, cutoff_hz: float) -> dict[str, np.ndarray]:
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


def compare_with_neurobem(
    recordings: RecordingSet, cutoff_hz: float, airspeed_bin_m_s: float, block_s: float, seed: int
) -> _Tables:
    """RMS of every flight and model, and against airspeed with block-bootstrap intervals."""
    vehicle = recordings.vehicle
    left = {run.name: _residuals_of(run, vehicle, cutoff_hz) for run in recordings.runs}
    speeds = {run.name: np.linalg.norm(run.array(c.VELOCITY), axis=1) for run in recordings.runs}
    times = {run.name: run.time_s for run in recordings.runs}
    rows, summary = [], {"mass_kg": vehicle.mass_kg, "paper_mass_kg": _PAPER_MASS_KG, "flights": {}}
    for flight, models in left.items():
        pace = {f"airspeed_{name}_m_s": float(getattr(speeds[flight], name)()) for name in ("mean", "max")}
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
        low, high, rms = (found[name].tolist() for name in ("low", "high", "rms"))
        summary[model] = {
            channel: {
                "slowest_m_s": [low[0], high[0]],
                "fastest_m_s": [low[-1], high[-1]],
                "rms_slowest": rms[0][place],
                "rms_fastest": rms[-1][place],
                "growth": float(found["growth"][place]),
                "growth_95": found["growth_95"][:, place].tolist(),
            }
            for place, channel in enumerate(_CHANNELS + _TOTALS)
        }
        bins += [
            (model, channel, low[b], high[b], found["samples"][b], rms[b][place], *found["rms_95"][:, b, place])
            for place, channel in enumerate(_CHANNELS + _TOTALS)
            for b in range(len(low))
        ]
    cloud = [np.column_stack([speeds[flight], models["rigid_body"]])[::_POINT_STEP] for flight, models in left.items()]
    points = pd.DataFrame(np.concatenate(cloud), columns=_POINT_COLUMNS[1:])
    points.insert(0, "flight", np.repeat(list(left), [len(part) for part in cloud]))
    return summary, pd.DataFrame(rows)[_FLIGHT_COLUMNS], pd.DataFrame(bins, columns=_BIN_COLUMNS), points
