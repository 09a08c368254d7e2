"""Thrust coefficient of a propeller from stand runs: through the origin, with an offset, per motor, pooled.

- Through the origin, F = C_F ω² (thesis eq. 4.25), and with an offset of each run, F = C_F ω² + F_0.
- Speeds are noisy too: points are weighted by their effective variance σ_F² + (2 C_F ω σ_ω)², with σ_F found
  so that the weighted residuals have unit variance, and the mean of ω² is freed of the noise's own σ_ω².
- One motor's interval says how well that motor's points fit a curve, not how well the propeller is known: the
  same propeller differs from motor to motor. The pooled value is therefore a random-effects mean
  (Paule and Mandel 1982) with Hartung's and Knapp's interval (2001), which holds for few motors.
- A motor is called outlying where its modified z-score, 0.6745 |C - median| / MAD, exceeds a threshold of 3.5
  (Iglewicz and Hoaglin 1993): neither centre nor scale is moved by the outlier itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.stats import t as student_t

from rotorid.errors import InputError


@dataclass(frozen=True)
class Points:
    """Steady points of one run: rotor speed (rad/s) and thrust (N), shape (n,) each."""

    run: str
    speed_rad_s: np.ndarray
    thrust_n: np.ndarray


@dataclass(frozen=True)
class CoefficientFit:
    """A thrust coefficient with its interval; offsets are empty for a fit through the origin."""

    value: float
    """C_F, N s²."""
    standard_error: float
    interval_95: tuple[float, float]
    offsets_n: tuple[float, ...]
    offset_intervals_n: tuple[tuple[float, float], ...]
    residual_rms_n: float
    points: int


@dataclass(frozen=True)
class Pooled:
    """Random-effects mean over motors."""

    value: float
    interval_95: tuple[float, float]
    between_sd: float
    """Standard deviation of the true values between motors, the unit of the values."""
    prediction_95: tuple[float, float]
    """Where the value of one further motor is expected."""


TOO_SLOW = 1.35
"""A point whose F/ω² exceeds the run's median by this factor has lost part of its speed pulses.

An offset of the balance or a curve that bends makes the low points' F/ω² smaller, not larger, in these data,
so the rule is one-sided: it must not remove what the offset explains.
"""


def lost_speed(speed_rad_s: np.ndarray, thrust_n: np.ndarray) -> np.ndarray:
    """Points that turn but whose speed is too low for their thrust, shape (n,), bool."""
    turning = speed_rad_s > 0
    if not turning.any():
        return turning
    ratio = np.where(turning, thrust_n, 0.0) / np.where(turning, speed_rad_s, 1.0) ** 2
    return turning & (ratio > TOO_SLOW * np.median(ratio[turning]))


def usable(speed_rad_s: np.ndarray, thrust_n: np.ndarray) -> np.ndarray:
    """Points with a speed: a reading of 0 while there is thrust is a missing speed, not a rotor at rest."""
    known = np.isfinite(speed_rad_s) & np.isfinite(thrust_n) & (speed_rad_s > 0)
    return known & ~lost_speed(speed_rad_s, thrust_n)


def _solve(columns: np.ndarray, y: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Weighted least squares: estimate and (XᵀWX)⁻¹."""
    information = columns.T @ (weight[:, None] * columns)
    inverse = np.linalg.inv(information)
    return inverse @ (columns.T @ (weight * y)), inverse


def fit_coefficient(
    runs: Sequence[Points], offset: bool, speed_noise_relative: float = 0.0
) -> CoefficientFit:
    """C_F of one motor and propeller from its runs, with one offset a run where `offset`.

    Parameters
    ----------
    runs
        Steady points of each run.
    offset
        Whether each run has a force offset of its own.
    speed_noise_relative
        One-sigma noise of the speed reading, as a share of the speed.

    Raises
    ------
    InputError
        Not more points than unknowns.
    """
    kept = [(p, usable(p.speed_rad_s, p.thrust_n)) for p in runs]
    speed = np.concatenate([p.speed_rad_s[k] for p, k in kept])
    thrust = np.concatenate([p.thrust_n[k] for p, k in kept])
    unknowns = 1 + (len(runs) if offset else 0)
    if len(speed) <= unknowns:
        raise InputError(
            f"runs {', '.join(p.run for p in runs)}: {len(speed)} points for {unknowns} unknowns"
        )
    # E[(ω + ε)²] = ω² + σ_ω²: what the noise adds to the mean of the square is taken off.
    columns = [speed**2 / (1 + speed_noise_relative**2)]
    if offset:
        for number in range(len(runs)):
            columns.append(
                np.concatenate([np.full(k.sum(), float(i == number)) for i, (_, k) in enumerate(kept)])
            )
    columns = np.column_stack(columns)
    scale = np.array([np.mean(columns[:, 0])] + [1.0] * (unknowns - 1))
    columns = columns / scale
    freedom = len(speed) - unknowns
    estimate, inverse = _solve(columns, thrust, np.ones(len(speed)))
    variance = np.sum((thrust - columns @ estimate) ** 2) / freedom
    if speed_noise_relative > 0:
        for _ in range(20):
            from_speed = (2 * estimate[0] / scale[0] * speed**2 * speed_noise_relative) ** 2

            def excess(force_variance, spread=from_speed):
                trial, _ = _solve(columns, thrust, 1 / (force_variance + spread))
                return np.sum((thrust - columns @ trial) ** 2 / (force_variance + spread)) - freedom

            ceiling = variance + 1e-12
            own = brentq(excess, 1e-12, 100 * ceiling) if excess(1e-12) > 0 > excess(100 * ceiling) else 1e-12
            new, inverse = _solve(columns, thrust, 1 / (own + from_speed))
            moved = abs(new[0] - estimate[0])
            estimate = new
            if moved < 1e-12 * abs(estimate[0]):
                break
        covariance = inverse
    else:
        covariance = variance * inverse
    errors = np.sqrt(np.diag(covariance)) / scale
    values = estimate / scale
    half = student_t.ppf(0.975, freedom) * errors
    intervals = tuple((float(v - h), float(v + h)) for v, h in zip(values, half, strict=True))
    residuals = thrust - columns @ estimate
    return CoefficientFit(
        value=float(values[0]),
        standard_error=float(errors[0]),
        interval_95=intervals[0],
        offsets_n=tuple(float(v) for v in values[1:]),
        offset_intervals_n=intervals[1:],
        residual_rms_n=float(np.sqrt(np.mean(residuals**2))),
        points=len(speed),
    )


def fit_exponent(runs: Sequence[Points]) -> tuple[float, tuple[float, float]]:
    """Exponent n of F = C ω^n with one C a run, and its 95 % interval: 2 where C_F is truly constant.

    Least squares of log F on log ω; points below 2 % of the largest thrust are left out, since there the
    balance's own offset rules the logarithm.
    """
    x, y, group = [], [], []
    for number, points in enumerate(runs):
        keep = usable(points.speed_rad_s, points.thrust_n)
        keep &= points.thrust_n > 0.02 * np.nanmax(points.thrust_n)
        log_speed, log_thrust = np.log(points.speed_rad_s[keep]), np.log(points.thrust_n[keep])
        x.append(log_speed - log_speed.mean())
        y.append(log_thrust - log_thrust.mean())
        group.append(number)
    x, y = np.concatenate(x), np.concatenate(y)
    freedom = len(x) - len(group) - 1
    exponent = np.sum(x * y) / np.sum(x**2)
    error = np.sqrt(np.sum((y - exponent * x) ** 2) / freedom / np.sum(x**2))
    half = student_t.ppf(0.975, freedom) * error
    return float(exponent), (float(exponent - half), float(exponent + half))


def pool(values: Sequence[float], standard_errors: Sequence[float]) -> Pooled:
    """Random-effects mean of the motors' values.

    τ² solves Σ (C_i - C̄)² / (s_i² + τ²) = k - 1 (Paule and Mandel); the interval is Hartung's and Knapp's,
    with Student's t for k - 1 degrees of freedom.
    """
    values, variances = np.asarray(values, float), np.asarray(standard_errors, float) ** 2
    k = len(values)
    if k < 2 or len(variances) != k:
        raise InputError(f"pooling needs the values of at least two motors, found {k}")

    def mean_of(tau2):
        weight = 1 / (variances + tau2)
        return np.sum(weight * values) / np.sum(weight), weight

    def excess(tau2):
        mean, weight = mean_of(tau2)
        return np.sum(weight * (values - mean) ** 2) - (k - 1)

    ceiling = 10 * np.var(values, ddof=1) + 1e-300
    tau2 = brentq(excess, 0.0, ceiling, xtol=1e-12 * ceiling) if excess(0.0) > 0 else 0.0
    mean, weight = mean_of(tau2)
    spread = np.sum(weight * (values - mean) ** 2) / ((k - 1) * np.sum(weight))
    half = student_t.ppf(0.975, k - 1) * np.sqrt(spread)
    ahead = student_t.ppf(0.975, k - 1) * np.sqrt(tau2 + spread)
    return Pooled(
        value=float(mean),
        interval_95=(float(mean - half), float(mean + half)),
        between_sd=float(np.sqrt(tau2)),
        prediction_95=(float(mean - ahead), float(mean + ahead)),
    )


def modified_z_scores(values: Sequence[float]) -> np.ndarray:
    """0.6745 (C - median) / MAD of each value, shape (n,); zeros where the median deviation is zero."""
    values = np.asarray(values, float)
    deviation = values - np.median(values)
    scale = np.median(np.abs(deviation))
    return np.zeros_like(values) if scale == 0 else 0.6745 * deviation / scale


def rest_reading(thrust_n: Sequence[float]) -> dict:
    """Mean thrust (N) of points with the rotor at rest, its 95 % interval and their number.

    A true zero error of the balance would show here too; an offset that does not is a bend of the curve.
    """
    thrust_n = np.asarray(thrust_n, float)
    if len(thrust_n) < 2:
        return {"mean_n": None, "interval_95_n": None, "points": len(thrust_n)}
    half = student_t.ppf(0.975, len(thrust_n) - 1) * thrust_n.std(ddof=1) / np.sqrt(len(thrust_n))
    mean = float(thrust_n.mean())
    return {
        "mean_n": mean,
        "interval_95_n": [float(mean - half), float(mean + half)],
        "points": len(thrust_n),
    }
