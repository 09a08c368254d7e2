"""Least squares on stretches of a flight (an even grid), with intervals that hold where residuals are correlated.

The residuals of a model of flight are coloured: turbulence, what the model leaves out. They are whitened by an
autoregressive model of their own (Cochrane and Orcutt's iteration), and the covariance is the larger of the two that
then stand: the classical one, and the sandwich with scores summed over blocks of time, which holds for what colour is
left. Source: Hamilton, Time Series Analysis, ch. 8 and 10; Newey and West (1987) for the sandwich.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.optimize import least_squares
from scipy.signal import lfilter
from scipy.stats import t as student

from rotorid.errors import InputError
from rotorid.recordings import RecordingSet, Run
from rotorid.recordings import columns as c
from rotorid.recordings.mended import on_own_rates
from rotorid.vehicle.attitude import normalised, rotation_from_quaternion

_LARGEST_ORDER = 20
_BLOCKS = 40
_LEVEL = 0.95
_ROUNDS = 2
"""Times that the residuals are whitened and the fit repeated."""

_Residuals = Callable[[np.ndarray], Sequence[np.ndarray]]
"""From values (p,) to the residuals of each stretch, (n_i,) each."""
_LEAST_STRETCH_S = 3.0
_GAP_PERIODS = 6.0
"""Where the accelerometer gives nothing for longer than so many of its periods, a stretch ends."""


@dataclass(frozen=True)
class EstimatedNumber:
    """A number with its 95 % interval."""

    value: float
    interval_95: tuple[float, float]

    @property
    def half_width(self) -> float:
        return (self.interval_95[1] - self.interval_95[0]) / 2


@dataclass(frozen=True)
class _CorrelatedFit:
    """Values with what their errors are known by."""

    values: np.ndarray
    classical: np.ndarray
    """Covariance (p, p) by whitened residuals taken as independent."""
    sandwich: np.ndarray
    """Covariance (p, p) by scores summed over blocks."""
    blocks: int

    def of(self, quantity: Callable[[np.ndarray], float]) -> EstimatedNumber:
        """A quantity of the values with its 95 % interval, by its derivative (numerical)."""
        value = float(quantity(self.values))
        steps = 1e-3 * np.sqrt(np.maximum(np.diag(self.classical), 1e-24))
        slope = np.array(
            [
                (quantity(self.values + step) - quantity(self.values - step)) / (2 * step.sum())
                for step in np.diag(steps)
            ]
        )
        free = max(self.blocks - len(self.values), 2)
        half = max(
            np.sqrt(slope @ self.classical @ slope) * student.ppf(0.5 + _LEVEL / 2, 1000),
            np.sqrt(slope @ self.sandwich @ slope) * student.ppf(0.5 + _LEVEL / 2, free),
        )
        return EstimatedNumber(value, (value - float(half), value + float(half)))


def fit(
    residuals: _Residuals,
    start: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    scale: np.ndarray,
    prior: np.ndarray,
) -> _CorrelatedFit:
    """Values (p,) that make the residuals small.

    `bounds`, `scale` and `prior` are by value: where it may lie, its usual size, and the standard deviation of what is
    believed of it about its start (infinite where nothing is).
    """
    start = np.asarray(start, float)
    believed = np.isfinite(prior)
    values, whiten = start, np.array([1.0])
    spread = max(float(np.std(np.concatenate([r - r.mean() for r in residuals(start)]))), 1e-12)

    def rows(v: np.ndarray) -> np.ndarray:
        white = [lfilter(whiten, [1.0], r)[len(whiten) - 1 :] for r in residuals(v)]
        return np.concatenate([*white, spread * (v - start)[believed] / prior[believed]])

    solved = None
    for turn in range(_ROUNDS + 1):
        if turn:
            own = residuals(values)
            whiten = autoregression(own)
            white = np.concatenate([lfilter(whiten, [1.0], r)[len(whiten) - 1 :] for r in own])
            spread = max(float(np.sqrt(np.mean(white**2))), 1e-12)
        solved = least_squares(rows, values, bounds=bounds, x_scale=scale, max_nfev=60)
        values = solved.x
    count = len(solved.fun) - int(believed.sum())
    white, jacobian = solved.fun[:count], solved.jac[:count]
    return _CorrelatedFit(values, *_covariances(jacobian, white, prior))


def _covariances(jacobian: np.ndarray, white: np.ndarray, prior: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """The two covariances (p, p) and the number of blocks, of whitened rows."""
    freedom = max(len(white) - jacobian.shape[1], 1)
    variance = float(white @ white) / freedom
    belief = np.diag(np.where(np.isfinite(prior), 1.0 / prior**2, 0.0))
    bread = np.linalg.pinv(jacobian.T @ jacobian / variance + belief, hermitian=True)
    edges = np.linspace(0, len(white), min(_BLOCKS, len(white)) + 1).astype(int)[:-1]
    scores = np.add.reduceat(jacobian * white[:, None], edges, axis=0) / variance
    blocks = len(edges)
    meat = blocks / max(blocks - jacobian.shape[1], 1) * scores.T @ scores + belief
    return bread, bread @ meat @ bread, blocks


def autoregression(stretches: Sequence[np.ndarray]) -> np.ndarray:
    """Coefficients (1, −φ_1, …) that whiten residuals; the order by Akaike's criterion (Yule and Walker)."""
    count = sum(len(r) for r in stretches)
    most = min(_LARGEST_ORDER, min(len(r) for r in stretches) // 10)
    lags = np.array([sum(float(r[: len(r) - k] @ r[k:]) for r in stretches) for k in range(most + 1)]) / count
    if lags[0] <= 0 or most < 1:
        return np.array([1.0])
    best, chosen = count * np.log(lags[0]), np.array([1.0])
    for order in range(1, most + 1):
        phi = solve_toeplitz(lags[:order], lags[1 : order + 1])
        left = lags[0] - phi @ lags[1 : order + 1]
        if left <= 0:
            break
        worth = count * np.log(left) + 2 * order
        if worth < best:
            best, chosen = worth, np.concatenate([[1.0], -phi])
    return chosen


@dataclass(frozen=True)
class Stretch:
    """One stretch without a hole; every series is on the grid of `dt_s`, body axes forward-right-down."""

    run: str
    dt_s: float
    time_s: np.ndarray
    specific_force: np.ndarray
    """(n, 3), m/s²."""
    throttle: np.ndarray | None
    """Signals of the motors, (n, k), 0 to 1."""
    voltage: np.ndarray | None
    """(n,), V."""
    attitude: np.ndarray | None
    """Rotation from body to world, (n, 3, 3)."""
    velocity: np.ndarray | None
    """World north-east-down, (n, 3), m/s."""


def stretches_of(recordings: RecordingSet) -> list[Stretch]:
    """The stretches of a set's runs that last at least `_LEAST_STRETCH_S`.

    InputError where the set is no flight, or none of its runs has an accelerometer.
    """
    if recordings.vehicle.kind != "flight":
        raise InputError(f"{recordings.name}: kind is {recordings.vehicle.kind}, expected flight")
    even = on_own_rates(recordings)
    if not any(run.has(*c.SPECIFIC_FORCE) for run in even.runs):
        raise InputError(
            f"{recordings.name}: parameters need an accelerometer, found no {c.SPECIFIC_FORCE[0]} … in any run"
        )
    found = [s for run in even.runs for s in _of_run(run, even.vehicle.rotor_count)]
    if not found:
        raise InputError(
            f"{recordings.name}: too little data: no stretch with accelerometer readings lasts {_LEAST_STRETCH_S:g} s"
        )
    return found


def _of_run(run: Run, rotors: int) -> list[Stretch]:
    if not run.has(*c.SPECIFIC_FORCE):
        return []
    force = run.array(c.SPECIFIC_FORCE)
    known = np.isfinite(force).all(axis=1)
    time_s, force = run.time_s[known], force[known]
    if len(time_s) < 2:
        return []
    dt = float(np.median(np.diff(time_s)))
    cuts = np.flatnonzero(np.diff(time_s) > _GAP_PERIODS * dt) + 1
    out = []
    for part in np.split(np.arange(len(time_s)), cuts):
        span = time_s[part[-1]] - time_s[part[0]]
        if span < _LEAST_STRETCH_S:
            continue
        grid = time_s[part[0]] + dt * np.arange(int(span / dt) + 1)
        quaternion = _on(grid, run, c.QUATERNION)
        out.append(
            Stretch(
                run.name,
                dt,
                grid,
                np.stack([np.interp(grid, time_s[part], force[part, j]) for j in range(3)], axis=1),
                _on(grid, run, c.rotor_columns("throttle", rotors)),
                None if (volts := _on(grid, run, (c.BATTERY_VOLTAGE,))) is None else volts[:, 0],
                None if quaternion is None else rotation_from_quaternion(normalised(quaternion)),
                _on(grid, run, c.VELOCITY),
            )
        )
    return out


def _on(grid: np.ndarray, run: Run, names: tuple[str, ...]) -> np.ndarray | None:
    """Columns of a run on a grid, (n, len(names)), by straight lines; None where one is not recorded."""
    if not names or not run.has(*names):
        return None
    out = np.empty((len(grid), len(names)))
    for j, name in enumerate(names):
        values = run.column(name)
        known = np.isfinite(values)
        if known.sum() < 4:
            return None
        out[:, j] = np.interp(grid, run.time_s[known], values[known])
    return out
