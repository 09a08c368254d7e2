"""Inertias: from an excitation under which all of them show, from real flights, and from a table of components.

The excitation is multisines within what motors can do. Each axis gets its own harmonics of one period (so the axes are
orthogonal). Amplitudes, phases and the axes' shares are searched from a seed; each candidate is scaled to the largest
that keeps every rotor within its limits and roll and pitch within a tilt, and judged by the standard errors it promises
(worst of inertias and gyroscopic weights, each against what is wanted). The search uses the motion without controller:
rates are integrals of moment over inertia.

In real flight the controller answers every disturbance with a moment of its own, so at low frequency moment and motion
are tied by the controller as much as by the inertia; at high frequency both readings are noise. Between them lies a
band where the moment drives the motion. There both sides are still noisy, and no regression knows by how much: taking
the acceleration as given bounds the inertia from below, <M a> / <a a>, taking the moment as given bounds it from above,
<M M> / <M a> (Frisch). The truth lies between if the noises are independent; the geometric mean is the estimate, and
the ratio of the bounds is one over the squared correlation.

A component of the table (in place of CAD, thesis eq. 4.27) is a point, a box or a cylinder (axis along z) of even
density; its inertia is moved to the centre of mass by the theorem of parallel axes. One with count 4 stands at the four
corners (±x, ±y).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.signal import butter, sosfiltfilt

from rotorid.errors import InputError
from rotorid.recordings import Run, Vehicle
from rotorid.recordings import columns as c
from rotorid.vehicle.control import AttitudePid, AttitudeReference
from rotorid.vehicle.fast import AttitudeLoop
from rotorid.vehicle.mixer import allocation_matrix, wrench_matrix
from rotorid_lab.fem.placement import turn
from rotorid_lab.grey_box import regressors, weights_of_inertias

COLUMNS = ("component count mass_kg shape size_x_m size_y_m size_z_m x_m y_m z_m").split()
_SHAPES = ("point", "box", "cylinder")
_INERTIA_ERROR, _GYROSCOPIC_ERROR = 0.001, 0.04
"""Standard errors that are wanted of a period: of inertias (relative), of gyroscopic weights (absolute)."""
_HOLD_GAINS = ((0.04, 0.04, 0.04), (0.02, 0.02, 0.01), (0.015, 0.015, 0.02))
"""A soft attitude hold, slower than the excitation: it keeps the attitude but does not undo the motion."""
_FIRST_SHARES_N_M = np.array([0.1, 0.1, 0.03])
"""Where the search for the axes' shares begins: roll and pitch can be pushed far harder than yaw."""
WINDOW_S = 0.25
"""Length of the windows that the estimate is expected to use."""


@dataclass(frozen=True)
class Multisine:
    """Moment about each axis: Σ_h amplitude cos(2π h t / period + phase); arrays (harmonics, 3)."""

    period_s: float
    harmonics: np.ndarray
    amplitude_n_m: np.ndarray
    phase_rad: np.ndarray

    def moment(self, time_s: np.ndarray) -> np.ndarray:
        """(n, 3), N m, at times (n,), s."""
        return self.integral(time_s, 0)

    def integral(self, time_s: np.ndarray, order: int) -> np.ndarray:
        """The `order`-th integral over time without its constants, (n, 3)."""
        rate = 2 * np.pi * self.harmonics[:, None] / self.period_s
        angle = rate * np.asarray(time_s, float) - order * np.pi / 2
        waves = np.cos(angle[:, :, None] + self.phase_rad[:, None, :]) / rate[:, :, None] ** order
        return np.einsum("ha,hta->ta", self.amplitude_n_m, waves)

    def scaled(self, factor) -> Multisine:
        return Multisine(self.period_s, self.harmonics, self.amplitude_n_m * factor, self.phase_rad)


Readings = tuple[float, np.ndarray, float]
"""Noise of the readings of the rates, rad/s, and, through the rotor speeds, of the moments (3,), N m: one sigma,
and samples a second."""


def readings_at_hover(vehicle: Vehicle, rates_rad_s: float, speed_relative: float, rate_hz: float) -> Readings:
    """Noise of the moments from relative noise of each rotor's speed, all rotors at hover."""
    matrix = wrench_matrix(vehicle)
    square = allocation_matrix(vehicle) @ [vehicle.mass_kg * vehicle.gravity_m_s2, 0.0, 0.0, 0.0]
    return rates_rad_s, np.sqrt(np.sum((2 * speed_relative * square * matrix[1:]) ** 2, 1)), rate_hz


def promised_errors(
    rates: np.ndarray, moments: np.ndarray, inertias: np.ndarray, noise: Readings, dt_s: float, window_s: float
) -> np.ndarray:
    """Standard errors (6,) of w11, w22, w33 (absolute) and of the torque weights (relative).

    Two parts, added as squares. Noise of the rates: output error in windows with free starts, where the
    sensitivity of a rate to a weight is the integral of its regressor within the window, less its mean. Noise
    of the moments: it acts as noise of the acceleration, w σ_τ, against the regressors themselves.
    """
    length = int(round(window_s / dt_s))
    count = len(rates) // length
    true = weights_of_inertias(inertias)
    inputs = regressors(rates, moments)[: count * length]
    within = np.cumsum(inputs.reshape(count, length, 6), axis=1) * dt_s
    within = (within - within.mean(axis=1, keepdims=True)).reshape(-1, 6)
    # The candidate is sampled more coarsely than the sensors: more readings for each of its samples.
    rates_rad_s, moments_n_m, rate_hz = noise
    more = rate_hz * dt_s
    out = np.empty(6)
    for axis in range(3):
        pick = [axis, 3 + axis]
        by_rates = rates_rad_s**2 * np.linalg.inv(within[:, pick].T @ within[:, pick])
        sigma = moments_n_m[axis] * true[3 + axis]
        by_moments = sigma**2 * np.linalg.inv(inputs[:, pick].T @ inputs[:, pick])
        out[pick] = np.sqrt(np.diag(by_rates + by_moments) / more)
    out[3:] /= np.abs(true[3:])
    return out


def _largest(multisine: Multisine, time_s, allocation, thrust_n, inertias, speeds_rad_s, tilt_rad) -> Multisine:
    """Scaled to the largest that keeps rotor speeds (together) and tilt (per axis) within their limits."""
    mean = allocation @ np.array([thrust_n, 0.0, 0.0, 0.0])
    low, high = speeds_rad_s[0] ** 2, speeds_rad_s[1] ** 2

    def room(candidate: Multisine) -> float:
        swing = candidate.moment(time_s) @ allocation[:, 1:].T
        return float(np.min(np.where(swing > 0, high - mean, mean - low) / np.maximum(np.abs(swing), 1e-9)))

    multisine = multisine.scaled(room(multisine))
    tilt = np.abs(multisine.integral(time_s, 2) / inertias)[:, :2].max(axis=0)
    multisine = multisine.scaled(np.append(np.minimum(1.0, tilt_rad / np.maximum(tilt, 1e-12)), 1.0))
    # Where two axes cancelled each other in a rotor, less of one may be more for the rotor.
    return multisine.scaled(min(1.0, room(multisine)))


def design(
    vehicle: Vehicle,
    speed_limits_rad_s: tuple[float, float],
    tilt_rad: float,
    harmonics: tuple[int, int],
    period_s: float,
    noise: Readings,
    candidates: int,
    rng: np.random.Generator,
) -> tuple[Multisine, np.ndarray]:
    """The best of `candidates` multisines and the standard errors (6,) that one period of it promises.

    It keeps rotor speeds and tilt within their limits, and has the `harmonics` from the first to the last.
    """
    allocation = allocation_matrix(vehicle)
    thrust = vehicle.mass_kg * vehicle.gravity_m_s2
    inertias = np.diag(vehicle.inertia_kg_m2.matrix())
    orders = np.arange(harmonics[0], harmonics[1] + 1)
    dt_s = period_s / (orders[-1] * 12)
    time_s = np.arange(0.0, period_s, dt_s)
    target = np.repeat([_GYROSCOPIC_ERROR, _INERTIA_ERROR], 3)
    mine = (np.arange(len(orders)) % 3)[:, None] == np.arange(3)

    def trial(levels, phases, share):
        amplitude = np.where(mine, np.exp(levels), 0.0) * np.exp(share) * _FIRST_SHARES_N_M
        made = Multisine(period_s, orders.astype(float), amplitude, phases)
        return _largest(made, time_s, allocation, thrust, inertias, speed_limits_rad_s, tilt_rad)

    best, best_cost, best_errors, best_point = None, np.inf, None, None
    for number in range(candidates):
        if number < candidates // 4:
            point = rng.normal(0, 1, mine.shape), rng.uniform(0, 2 * np.pi, mine.shape), rng.uniform(-2, 0, 3)
        else:
            # Smaller and smaller moves around the best so far.
            move = 1.0 - number / candidates
            point = tuple(
                part + move * size * rng.normal(0, 1, part.shape)
                for part, size in zip(best_point, (0.7, 0.7, 0.3), strict=True)
            )
        made = trial(*point)
        rates = made.integral(time_s, 1) / inertias
        errors = promised_errors(rates, made.moment(time_s), inertias, noise, dt_s, WINDOW_S)
        cost = float(np.max(errors / target))
        if cost < best_cost:
            best, best_cost, best_errors, best_point = made, cost, errors, point
    return best, best_errors


@dataclass(frozen=True)
class ExcitedHold:
    """A soft attitude hold with an excitation added to its moments (a `Controller`)."""

    vehicle: Vehicle
    multisine: Multisine
    limits_rad_s: tuple[float, float]

    def attitude_loop(self, time_s: np.ndarray) -> AttitudeLoop:
        """That of the hold at instants (m,), s, with the excitation's squared speeds added."""
        weight = self.vehicle.mass_kg * self.vehicle.gravity_m_s2
        level = AttitudeReference("level", weight, lambda t: np.zeros(3))
        hold = AttitudePid(self.vehicle, level, _HOLD_GAINS, derivative_time_s=0.02).attitude_loop(time_s)
        more = self.multisine.moment(time_s) @ hold.allocation[:, 1:].T
        return replace(hold, more=more, limits_rad_s=self.limits_rad_s)


def band_signals(
    run: Run, vehicle: Vehicle, band_hz: tuple[float, float], delay_s: float, rate_hz: float
) -> tuple[np.ndarray, np.ndarray] | None:
    """Band-passed moment and angular acceleration of a run on an even grid, (n, 3), N m and rad/s2.

    Rotor speeds are taken `delay_s` earlier; None where columns are missing.
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
    return sosfiltfilt(filtered, moment, axis=0)[keep], sosfiltfilt(filtered, acceleration, axis=0)[keep]


def _on_grid(grid: np.ndarray, time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    good = np.isfinite(values).all(axis=1)
    return np.column_stack([np.interp(grid, time_s[good], column[good]) for column in values.T])


def fit_flights(
    parts: Sequence[tuple[np.ndarray, np.ndarray]],
    rate_hz: float,
    block_s: float,
    rng: np.random.Generator,
    draws: int = 500,
) -> list[dict]:
    """Inertia about x, y, z from several flights: bounds `lower` and `upper`, `estimate`, `interval_95` (kg m2), `r2`.

    `parts` are of `band_signals` at `rate_hz`. Intervals by drawing blocks of `block_s`; `r2` is the squared
    correlation.
    """
    sums, size = [], int(block_s * rate_hz)
    for moment, acceleration in parts:
        for start in range(0, len(moment) - size + 1, size):
            m, a = moment[start : start + size], acceleration[start : start + size]
            sums.append([(m * a).sum(0), (a * a).sum(0), (m * m).sum(0)])
    sums = np.array(sums)
    drawn = sums[rng.integers(0, len(sums), (draws, len(sums)))].sum(axis=1)
    ma, aa, mm = sums.sum(axis=0)
    found = []
    for k in range(3):
        positive = ma[k] > 0
        spread = np.sqrt(drawn[:, 2, k] / drawn[:, 1, k])
        found.append(
            {
                "lower": float(ma[k] / aa[k]) if positive else float("nan"),
                "upper": float(mm[k] / ma[k]) if positive else float("nan"),
                "estimate": float(np.sqrt(mm[k] / aa[k])),
                "interval_95": tuple(float(v) for v in np.quantile(spread, [0.025, 0.975])),
                "r2": float(ma[k] * abs(ma[k]) / (aa[k] * mm[k])),
            }
        )
    return found


def read_components(path: str | Path) -> pd.DataFrame:
    """The component table; InputError names the line and what was expected."""
    table = pd.read_csv(path)
    missing = [c for c in COLUMNS if c not in table.columns]
    if missing:
        raise InputError(f"{path}: column {missing[0]} is missing, expected {', '.join(COLUMNS)}")
    for number, row in enumerate(table.itertuples(), 2):
        if row.shape not in _SHAPES:
            raise InputError(f"{path}, line {number}: shape {row.shape!r}, expected {', '.join(_SHAPES)}")
        if row.count not in (1, 4):
            raise InputError(f"{path}, line {number}: count {row.count}, expected 1 or 4 (the four corners)")
        sizes = (row.mass_kg, row.size_x_m, row.size_y_m, row.size_z_m)
        if not row.mass_kg > 0 or not min(sizes) >= 0:
            raise InputError(f"{path}, line {number}: mass must be positive and sizes 0 or more, got {sizes}")
    return table


def own_inertia(shape: str, mass_kg: float, size_m: np.ndarray) -> np.ndarray:
    """Inertia (3, 3), kg m2, of a component about its own centre; `size_m` (3,), a cylinder's x size its diameter."""
    x, y, z = size_m
    if shape == "point":
        return np.zeros((3, 3))
    if shape == "cylinder":
        across = mass_kg * (3 * (x / 2) ** 2 + z**2) / 12
        return np.diag([across, across, mass_kg * (x / 2) ** 2 / 2])
    return mass_kg / 12 * np.diag([y**2 + z**2, x**2 + z**2, x**2 + y**2])


def compose(table: pd.DataFrame) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, kg, of all components together, their centre of mass (3,), m, in the table's axes, and the inertia (3, 3),
    kg m2, about it."""
    masses, places, inertias = [], [], []
    for row in table.itertuples():
        size = np.array([row.size_x_m, row.size_y_m, row.size_z_m])
        # A box at a corner points along its diagonal; the four together are symmetric all the same.
        own = own_inertia(row.shape, row.mass_kg, size)
        corners = [(1, 1)] if row.count == 1 else [(1, 1), (1, -1), (-1, -1), (-1, 1)]
        for sx, sy in corners:
            masses.append(row.mass_kg)
            places.append([sx * row.x_m, sy * row.y_m, row.z_m])
            about_z = turn(np.arctan2(sy * row.y_m, sx * row.x_m)) if row.count == 4 else np.eye(3)
            inertias.append(about_z @ own @ about_z.T)
    masses, places = np.array(masses), np.array(places)
    centre = masses @ places / masses.sum()
    total = np.zeros((3, 3))
    for mass, arm, own in zip(masses, places - centre, inertias, strict=True):
        total += own + mass * ((arm @ arm) * np.eye(3) - np.outer(arm, arm))
    return float(masses.sum()), centre, total
