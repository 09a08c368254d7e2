"""Steady points of the rotor tests: 50 of thrust and 20 of torque (thesis 3.5.3), from tables of samples.

The reading at rest is taken off each test (the tare): before the motor starts, of a torque test also after.
Thrust comes from the tester alone. Torque comes from two instruments with their own clocks: the tester counts
revolutions, the wrench sensor feels the moment. The host's time shows which of its samples are of the motor's run; all
margins are in each device's own time, which also holds for an emulator that runs faster than life. Tables are those of
`rotorid.io.tables`: all samples of one instrument, and one row a recording.

Of the points two things are asked here, while C_F and C_Q, the slopes of thrust and torque over ω², are the business of
`rotorid.identify.rotor.coefficients`:

- how the speed follows throttle and voltage (next to thesis fig. 3.22);
- how noisy they are, by the samples that each is the mean of. A point is the mean of n samples under load less the mean
  of m samples at rest. If every sample has the same noise s, the point has the variance s² (1/n + 1/m). Two checks of
  that, neither of which uses the scatter of the points: whether s grows with the rotor speed (RMS of s over the fastest
  quarter of the tests over that of the slowest), and whether the points scatter about the fitted curve as s says
  (chi-square of the residuals).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.optimize import least_squares
from scipy.special import chdtrc, fdtri
from scipy.special import stdtrit as student_quantile

from rotorid.errors import InputError
from rotorid.identify.stand.clocks import device_time
from rotorid.io.tables import by_recording

_RPM = 2 * np.pi / 60
_MARGIN_S = 0.6
COLUMNS = (
    *("test", "throttle", "speed_rad_s", "speed_sd_rad_s"),
    *("value", "value_sd", "samples", "rest_samples", "voltage_v"),
)
"""`rest_samples`: of how many samples the mean would be as uncertain as the tare is."""
SPEED_LAW_PARAMETERS = ("speed_at_half_rad_s", "throttle_exponent", "dead_throttle", "voltage_exponent")


def _running(table: pd.DataFrame, name: str) -> pd.DataFrame:
    """First and last sample with the motor on."""
    on = table[table["throttle"] > 0]
    if len(on) == 0 or on["time_s"].iloc[-1] - on["time_s"].iloc[0] <= 2 * _MARGIN_S:
        raise InputError(f"{name}: the motor never ran for more than {2 * _MARGIN_S} s")
    return on.iloc[[0, -1]]


def thrust_points(samples: pd.DataFrame, recordings: pd.DataFrame) -> pd.DataFrame:
    """One row a thrust test, columns `COLUMNS` (`value` in N), by throttle.

    Raises InputError for a test whose motor never ran or that has no reading at rest.
    """
    tables = by_recording(samples[samples["quality"] == 0])
    rows = []
    for name in recordings["id"]:
        table = tables[name]
        start, stop = _running(table, name)["time_s"]
        steady = table[table["time_s"].between(start + _MARGIN_S, stop - _MARGIN_S / 3)]
        rest = table[table["time_s"] < start - 0.05]
        if len(rest) == 0:
            raise InputError(f"{name}: no sample before the motor started, so no tare")
        rows.append(_row(name, steady, steady["thrust_n"] - rest["thrust_n"].mean(), len(rest)))
    return _sorted(rows)


def torque_points(rotor: tuple[pd.DataFrame, pd.DataFrame], wrench: tuple[pd.DataFrame, pd.DataFrame]) -> pd.DataFrame:
    """One row a torque test, by throttle; `value` in N m, positive.

    `rotor` and `wrench` are (samples, recordings) of the tester and of the wrench sensor; recordings of one group are
    one test. Raises InputError for a tester's recording without the sensor's, and as `thrust_points`.
    """
    counted, felt = (by_recording(samples[samples["quality"] == 0]) for samples, _ in (rotor, wrench))
    sensors = {row.group: row for row in wrench[1].itertuples()}
    rows = []
    for drive in rotor[1].itertuples():
        if drive.group not in sensors:
            raise InputError(
                f"{drive.id}: a torque test without a recording of the wrench sensor (group {drive.group})"
            )
        read = sensors[drive.group]
        table, reading = counted[drive.id], felt[read.id]
        ends = _running(table, drive.id)
        start, stop = ends["time_s"]
        steady = table[table["time_s"].between(start + _MARGIN_S, stop - _MARGIN_S)]
        # Each recording's times count from its own beginning.
        seen = reading["host_time_s"] + (read.host_start_s - drive.host_start_s)
        start, stop = device_time(reading["time_s"], seen, ends["host_time_s"])
        when = reading["time_s"]
        loaded = reading.loc[when.between(start + _MARGIN_S, stop - _MARGIN_S), "moment_z_n_m"]
        before = reading.loc[when < start - 0.1, "moment_z_n_m"]
        after = reading.loc[when > stop + _MARGIN_S, "moment_z_n_m"]
        if len(loaded) == 0 or len(before) == 0 or len(after) == 0:
            raise InputError(f"{read.id}: no samples while the rotor ran, or none at rest before or after")
        # The run lies in the middle between both rests, so that a steady drift of the zero drops out.
        turned = loaded - (before.mean() + after.mean()) / 2
        # The sign of the mean, not of each sample: that would turn noise into torque.
        resting = 4 / (1 / len(before) + 1 / len(after))
        rows.append(_row(drive.group, steady, turned * np.sign(turned.mean()), resting))
    return _sorted(rows)


def _sorted(rows: list[dict]) -> pd.DataFrame:
    return pd.DataFrame(rows, columns=list(COLUMNS)).sort_values("throttle", ignore_index=True, kind="stable")


def _row(test: str, steady: pd.DataFrame, value: pd.Series, rest_samples: float) -> dict:
    speed = steady["speed_rpm"] * _RPM
    return {
        "test": test,
        "throttle": float(steady["throttle"].mean()),
        "speed_rad_s": float(speed.mean()),
        "speed_sd_rad_s": float(speed.std()),
        "value": float(value.mean()),
        "value_sd": float(value.std()),
        "samples": int(len(value)),
        "rest_samples": float(rest_samples),
        "voltage_v": float(steady["battery_voltage_v"].mean()),
    }


def speed_by_law(values: np.ndarray, throttle: np.ndarray, voltage_share: np.ndarray) -> np.ndarray:
    """ω, rad/s, of throttle and voltage over its mean, for values in the order of `SPEED_LAW_PARAMETERS`."""
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
        lambda values: (speed_by_law(values, throttle, share) - speed) / error,
        start,
        bounds=([0.0, 0.1, 0.0, -5.0], [np.inf, 3.0, largest_dead, 5.0]),
        x_scale=np.array([1000.0, 1.0, 0.01, 1.0]),
    )
    freedom = len(kept) - len(SPEED_LAW_PARAMETERS)
    covariance = np.linalg.inv(fit.jac.T @ fit.jac) * 2 * fit.cost / freedom
    half = student_quantile(freedom, 0.975) * np.sqrt(np.diag(covariance))
    relative = fit.fun * error / speed
    out = {"mean_voltage_v": voltage_v, "residual_rms_relative": float(np.sqrt(np.mean(relative**2)))}
    for name, value, width in zip(SPEED_LAW_PARAMETERS, fit.x.tolist(), half.tolist(), strict=True):
        out |= {name: value, f"{name}_interval_95": [value - width, value + width]}
    return out | {"points": len(kept)}


@dataclass(frozen=True)
class _SampleNoise:
    """Noise of the samples, and the chi-square of a parabola through the origin with it."""

    sd: float
    """Of one sample, all tests together, N or N m."""
    growth: float
    """Of the fastest quarter of the tests over the slowest (1)."""
    growth_interval_95: tuple[float, float]
    chi_square: float
    freedom: int
    p_value: float
    """Of a chi-square as large or larger, if the parabola holds and all samples are equally noisy."""


def sample_noise(points: pd.DataFrame) -> _SampleNoise:
    """Noise of tests with the columns of `rotorid.identify.rotor.campaign.COLUMNS`; at least four tests."""
    tests = points.sort_values("speed_rad_s")
    square, value = tests["speed_rad_s"].to_numpy() ** 2, tests["value"].to_numpy()
    counts = tests["samples"].to_numpy(float)
    squares, quarter = tests["value_sd"].to_numpy() ** 2 * (counts - 1), len(tests) // 4
    slow, fast = (float(np.sum(squares[part]) / np.sum(counts[part] - 1)) for part in _ends(quarter))
    freedoms = [float(np.sum(counts[part] - 1)) for part in _ends(quarter)]
    rest = tests["rest_samples"].to_numpy(float)
    variance = float(np.sum(squares) / np.sum(counts - 1))
    each = variance * (1 / counts + 1 / rest)
    left = value - square * np.sum(square * value / each) / np.sum(square**2 / each)
    total, freedom = float(np.sum(left**2 / each)), len(tests) - 1
    low, high = fdtri(freedoms[1], freedoms[0], [0.975, 0.025])
    return _SampleNoise(
        sd=variance**0.5,
        growth=(fast / slow) ** 0.5,
        growth_interval_95=(float((fast / slow / low) ** 0.5), float((fast / slow / high) ** 0.5)),
        chi_square=total,
        freedom=freedom,
        p_value=float(chdtrc(freedom, total)),
    )


def _ends(quarter: int) -> tuple[slice, slice]:
    return slice(0, quarter), slice(-quarter, None)
