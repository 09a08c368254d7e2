"""How a rotor's speed follows throttle and voltage (next to thesis fig. 3.22), from steady points.

The points come from `rotorid.identify.rotor.campaign`, one a test. C_F and C_Q, the slopes of thrust and torque over
ω², are the business of `rotorid.identify.rotor.coefficients`.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.optimize import least_squares
from scipy.special import stdtrit as student_quantile

from rotorid.errors import InputError

PARAMETERS = ("speed_at_half_rad_s", "throttle_exponent", "dead_throttle", "voltage_exponent")


def law(values: np.ndarray, throttle: np.ndarray, voltage_share: np.ndarray) -> np.ndarray:
    """ω, rad/s, of throttle and voltage over its mean, for values in the order of `PARAMETERS`."""
    half, exponent, dead, sag = values
    return half * (np.clip(throttle - dead, 1e-9, None) / (0.5 - dead)) ** exponent * voltage_share**sag


def speed_law(points: pd.DataFrame) -> dict:
    """ω = ω_½ ((u − u₀)/(½ − u₀))ⁿ (V/V̄)ᵐ from steady points, with 95 % intervals.

    `points` has the columns `throttle speed_rad_s speed_sd_rad_s samples voltage_v`; each point counts by the standard
    error of its mean speed, and the intervals are as wide as the residuals in these units ask for. Raises InputError
    for fewer than six points at which the motor turns.
    """
    kept = points[(points["speed_rad_s"] > 0) & (points["throttle"] > 0)]
    if len(kept) < 6:
        raise InputError("a law of throttle and voltage needs at least six points at which the motor turns")
    throttle, speed = kept["throttle"].to_numpy(), kept["speed_rad_s"].to_numpy()
    voltage_v = float(kept["voltage_v"].mean())
    share = kept["voltage_v"].to_numpy() / voltage_v
    error = (kept["speed_sd_rad_s"] / np.sqrt(kept["samples"])).to_numpy()
    largest_dead = 0.9 * float(throttle.min())
    start = np.array([np.interp(0.5, throttle, speed), 0.7, 0.1 * largest_dead, 1.0])
    fit = least_squares(
        lambda values: (law(values, throttle, share) - speed) / error,
        start,
        bounds=([0.0, 0.1, 0.0, -5.0], [np.inf, 3.0, largest_dead, 5.0]),
        x_scale=np.array([1000.0, 1.0, 0.01, 1.0]),
    )
    freedom = len(kept) - len(PARAMETERS)
    covariance = np.linalg.inv(fit.jac.T @ fit.jac) * 2 * fit.cost / freedom
    half = student_quantile(freedom, 0.975) * np.sqrt(np.diag(covariance))
    relative = fit.fun * error / speed
    out = {"mean_voltage_v": voltage_v, "residual_rms_relative": float(np.sqrt(np.mean(relative**2)))}
    for name, value, width in zip(PARAMETERS, fit.x.tolist(), half.tolist(), strict=True):
        out |= {name: value, f"{name}_interval_95": [value - width, value + width]}
    return out | {"points": len(kept)}
