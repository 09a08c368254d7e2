"""Inertias from real flights: the moment of the rotors against the angular acceleration, within a frequency band.

In flight the controller answers every disturbance with a moment of its own, so at low frequency moment and motion are
tied by the controller as much as by the inertia; at high frequency both readings are noise. Between them lies a band
where the moment drives the motion. There both sides are still noisy, and no regression knows by how much: taking the
acceleration as given bounds the inertia from below, <M a> / <a a>, taking the moment as given bounds it from above,
<M M> / <M a> (Frisch). The truth lies between if the noises are independent; the geometric mean is the estimate, and
the ratio of the bounds is one over the squared correlation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, sosfiltfilt

from rotorid.recordings import Run, Vehicle
from rotorid.recordings import columns as c
from rotorid.vehicle.mixer import wrench_matrix


@dataclass(frozen=True)
class _BandSignals:
    """Band-passed moment and angular acceleration of one stretch, (n, 3), N m and rad/s2, with the sample rate."""

    run: str
    moment: np.ndarray
    acceleration: np.ndarray
    rate_hz: float


@dataclass(frozen=True)
class _FlightInertia:
    """Of one axis: bounds, estimate and its 95 % interval over blocks (kg m2), squared correlation."""

    lower: float
    upper: float
    estimate: float
    interval_95: tuple[float, float]
    r2: float


def band_signals(
    run: Run, vehicle: Vehicle, band_hz: tuple[float, float], delay_s: float, rate_hz: float
) -> _BandSignals | None:
    """Signals of a run on an even grid, rotor speeds taken `delay_s` earlier; None where columns are missing.

    The gyroscopic term Ω × JΩ, small here, is added to the moment's side with the believed inertia.
    """
    speeds = c.rotor_columns("rotor_speed", vehicle.rotor_count)
    if not run.has(*speeds, *c.ANGULAR_VELOCITY):
        return None
    grid = np.arange(run.time_s[0], run.time_s[-1], 1 / rate_hz)
    square = _on_grid(grid - delay_s, run.time_s, run.array(speeds)) ** 2
    rates = _on_grid(grid, run.time_s, run.array(c.ANGULAR_VELOCITY))
    if len(grid) < 4 * rate_hz / band_hz[0]:
        return None
    inertia = vehicle.inertia_kg_m2.matrix()
    moment = square @ wrench_matrix(vehicle)[1:].T - np.cross(rates, rates @ inertia)
    filtered = butter(3, band_hz, "bandpass", fs=rate_hz, output="sos")
    acceleration = np.gradient(rates, 1 / rate_hz, axis=0)
    # The central difference passes a share sin(x)/x of a frequency, about 1 - x²/6; the moment gets the same.
    moment = (np.roll(moment, 1, 0) + 4 * moment + np.roll(moment, -1, 0)) / 6
    edge = int(rate_hz / band_hz[0])
    keep = slice(edge, -edge)
    return _BandSignals(
        run.name,
        sosfiltfilt(filtered, moment, axis=0)[keep],
        sosfiltfilt(filtered, acceleration, axis=0)[keep],
        rate_hz,
    )


def _on_grid(grid: np.ndarray, time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    good = np.isfinite(values).all(axis=1)
    return np.column_stack([np.interp(grid, time_s[good], column[good]) for column in values.T])


def fit_flights(
    parts: Sequence[_BandSignals], block_s: float, rng: np.random.Generator, draws: int = 500
) -> list[_FlightInertia]:
    """Inertia about x, y, z from several flights; intervals by drawing blocks of `block_s`."""
    sums = []
    for part in parts:
        size = int(block_s * part.rate_hz)
        for start in range(0, len(part.moment) - size + 1, size):
            m, a = part.moment[start : start + size], part.acceleration[start : start + size]
            sums.append([(m * a).sum(0), (a * a).sum(0), (m * m).sum(0)])
    sums = np.array(sums)
    drawn = sums[rng.integers(0, len(sums), (draws, len(sums)))].sum(axis=1)
    ma, aa, mm = sums.sum(axis=0)
    found = []
    for k in range(3):
        positive = ma[k] > 0
        spread = np.sqrt(drawn[:, 2, k] / drawn[:, 1, k])
        found.append(
            _FlightInertia(
                float(ma[k] / aa[k]) if positive else float("nan"),
                float(mm[k] / ma[k]) if positive else float("nan"),
                float(np.sqrt(mm[k] / aa[k])),
                tuple(float(v) for v in np.quantile(spread, [0.025, 0.975])),
                float(ma[k] * abs(ma[k]) / (aa[k] * mm[k])),
            )
        )
    return found
