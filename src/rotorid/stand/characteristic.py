"""Thrust and torque characteristics of a rotor (thesis fig. 3.22): by throttle and by speed, with the voltage.

The steady points come from `rotorid.rotor.campaign`, one a test. A rotor's speed for a throttle follows a power of it
and of the battery's voltage; C_F and C_Q are the slopes over ω² (`rotorid.rotor.coefficients`).
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy.stats import t as student_t

from rotorid.errors import InputError

LEAST_SPEED_RAD_S = 100.0


def speed_law(points: pd.DataFrame) -> dict:
    """ω = ω_half (2 u)^n (V / V̄)^m from steady points: exponents with 95 % intervals, by logarithms.

    `points` has the columns `throttle speed_rad_s voltage_v`. Points slower than `LEAST_SPEED_RAD_S` are left out:
    near the smallest throttles the motor's dead zone rules, and the power does not hold.
    """
    kept = points[(points["speed_rad_s"] > LEAST_SPEED_RAD_S) & (points["throttle"] > 0)]
    if len(kept) < 5:
        raise InputError("a law of throttle and voltage needs at least five points at which the motor turns")
    voltage = kept["voltage_v"].to_numpy()
    columns = np.column_stack(
        [np.ones(len(kept)), np.log(2 * kept["throttle"].to_numpy()), np.log(voltage / voltage.mean())]
    )
    target = np.log(kept["speed_rad_s"].to_numpy())
    solution, *_ = np.linalg.lstsq(columns, target, rcond=None)
    left = target - columns @ solution
    freedom = len(kept) - 3
    covariance = np.linalg.inv(columns.T @ columns) * (left @ left) / freedom
    half = student_t.ppf(0.975, freedom) * np.sqrt(np.diag(covariance))
    return {
        "speed_at_half_rad_s": float(np.exp(solution[0])),
        "throttle_exponent": float(solution[1]),
        "throttle_exponent_interval_95": [float(solution[1] - half[1]), float(solution[1] + half[1])],
        "voltage_exponent": float(solution[2]),
        "voltage_exponent_interval_95": [float(solution[2] - half[2]), float(solution[2] + half[2])],
        "mean_voltage_v": float(voltage.mean()),
        "residual_rms_relative": float(np.sqrt(np.mean(left**2))),
        "points": len(kept),
    }
