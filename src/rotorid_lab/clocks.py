"""The clocks of two instruments, and their samples on one clock.

A sample is read by the host some time after the device took it, never before. So in a plane of device time
against host time all samples lie on or above the true line, and those that were read at once lie on it: the
line is the lower edge of the cloud (`lower_edge`). Its slope is the device clock's rate, its intercept the offset. Two
devices that one host listens to are thereby on one clock, without a look at what they measured, to within the interval
at which the host looked, which for a radio link in bursts is several samples. The measurements show more:

- the lift on the wrench's clock follows the throttle on the quadrotor's by the motors' lag plus the offset of the
  two clocks;
- the battery's voltage, which the quadrotor sends, sags with the motors' current: it follows the throttle by the
  motors' lag alone, on the same clock.

The difference is the offset. One record's sag is too small for that, but the motors are the same in all of them:
their delay is pooled. It is best had from the sines, which separate it from the idle current that a trapezoid switches
on and off. The clocks' skew is read off the sines too, whose delay must not change over the record; a trapezoid's
rising and falling ramp lag differently by themselves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.recordings.signal import zero_phase

_STEP_S = 0.01
_SMOOTH_HZ = 5.0
LARGEST_S = 0.5
"""Largest offset that the arrival times may leave."""
_FASTER_THAN_LIFE = 1.2
"""Device seconds a host second that no clock's error explains."""
_LEAST_THRUST_N = 1e-3
"""A motor that is asked for more than this turns."""
_CURRENT_POWER = 1.5
"""A propeller's current grows with ω³, its thrust with ω²."""
THROTTLES = tuple(f"throttle_{i}" for i in (1, 2, 3, 4))


def lower_edge(device_s: np.ndarray, host_s: np.ndarray, largest_error: float) -> tuple[float, float]:
    """Offset, s, and rate of the line host = offset + rate · device below all samples that lies closest to them.

    Of all lines that no sample lies below, and whose rate is within 1 ± `largest_error`, the one with the
    smallest mean distance; it touches the lower convex hull where the samples' mean time lies.

    Raises InputError for fewer than two samples or times that do not increase.
    """
    x, y = np.asarray(device_s, float), np.asarray(host_s, float)
    if len(x) < 2 or (np.diff(x) <= 0).any():
        raise InputError("a clock needs at least two samples in increasing device time")
    # With y − x instead of y the numbers are small and the hull is well conditioned.
    hull = _lower_hull(x, y - x)
    middle = x.mean()
    place = int(np.clip(np.searchsorted(x[hull], middle), 1, len(hull) - 1))
    left, right = hull[place - 1], hull[place]
    slope = ((y - x)[right] - (y - x)[left]) / (x[right] - x[left])
    slope = float(np.clip(slope, -largest_error, largest_error))
    offset = float(np.min(y - x - slope * x))
    return offset, 1 + slope


def device_time(time_s: np.ndarray, seen_s: np.ndarray, host_s: np.ndarray) -> np.ndarray:
    """Times of a device's clock at times of the host, s, interpolated between the device's samples.

    Of a batch that the host sees at once, the last sample counts.

    `time_s`, `seen_s`: shape (n,): the device's time of each sample, and the host's time when it was read. `host_s`:
    times of the host, any shape; beyond the samples the first or last device time is given.
    """
    latest = pd.Series(np.asarray(time_s, float)).groupby(np.asarray(seen_s, float)).max()
    return np.interp(host_s, latest.index, latest)


def _lower_hull(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Indices of the lower convex hull of points in the order of x (Andrew's monotone chain)."""
    hull: list[int] = []
    for i in range(len(x)):
        while len(hull) >= 2:
            a, b = hull[-2], hull[-1]
            if (x[b] - x[a]) * (y[i] - y[a]) - (y[b] - y[a]) * (x[i] - x[a]) > 0:
                break
            hull.pop()
        hull.append(i)
    return np.array(hull)


@dataclass(frozen=True)
class Lag:
    """By how much one signal follows another: delay_s at the middle of the record, and its growth over time."""

    delay_s: float
    delay_error_s: float
    """Standard error."""
    skew: float
    """Seconds of further delay per second."""
    skew_error: float
    gain: float
    """Of the signal, per unit of the cause."""


_STEPS = 20
_BLOCKS = 24
"""Parts of a record whose residuals are taken as independent of each other."""


def follow(
    time_s: np.ndarray,
    signal: np.ndarray,
    cause: np.ndarray,
    largest_s: float,
    others: np.ndarray | None = None,
    with_skew: bool = False,
) -> Lag:
    """Delay with which a signal follows its cause, from their shapes alone.

    signal(t) = a + k cause(t − d − s (t − t̄)) + others(t) b, by Gauss and Newton from the best of a coarse search of
    delays up to `largest_s` either way. Signal and cause (n,), evenly spaced, are smoothed alike if at all; `others`
    (n, m) is what else the signal depends on at once. InputError: a constant cause.
    """
    time_s, signal, cause = (np.asarray(v, float) for v in (time_s, signal, cause))
    if np.ptp(cause) == 0:
        raise InputError("a constant cause shows no delay")
    at_once = np.column_stack([np.ones_like(time_s), *([] if others is None else np.asarray(others, float).T)])
    step = float(np.median(np.diff(time_s)))
    delay, skew = _coarse(time_s, signal, cause, at_once, np.arange(-largest_s, largest_s + step, 2 * step)), 0.0
    centred = time_s - time_s.mean()
    slope = np.gradient(cause, time_s)
    for _ in range(_STEPS):
        when = time_s - delay - skew * centred
        steep = np.interp(when, time_s, slope)
        base = np.column_stack([np.interp(when, time_s, cause), at_once])
        gain = np.linalg.lstsq(base, signal, rcond=None)[0][0]
        moves = [-gain * steep, *([-gain * steep * centred] if with_skew else [])]
        columns = np.column_stack([*moves, base])
        solution = np.linalg.lstsq(columns, signal, rcond=None)[0]
        delay += float(solution[0])
        skew += float(solution[1]) if with_skew else 0.0
        if abs(solution[0]) < 1e-7:
            break
    covariance = _robust_covariance(columns, signal - columns @ solution)
    return Lag(
        delay_s=delay,
        delay_error_s=float(np.sqrt(covariance[0, 0])),
        skew=skew,
        skew_error=float(np.sqrt(covariance[1, 1])) if with_skew else 0.0,
        gain=float(gain),
    )


def _coarse(time_s, signal, cause, at_once, delays) -> float:
    """Of some delays that which leaves least of the signal."""
    left = []
    for delay in delays:
        base = np.column_stack([np.interp(time_s - delay, time_s, cause), at_once])
        solution = np.linalg.lstsq(base, signal, rcond=None)[0]
        left.append(np.sum((signal - base @ solution) ** 2))
    return float(delays[int(np.argmin(left))])


def _robust_covariance(columns: np.ndarray, residual: np.ndarray) -> np.ndarray:
    """Covariance of least squares whose residuals are correlated within the parts of a record (sandwich)."""
    scale = np.linalg.norm(columns, axis=0)
    unit = columns / scale
    inverse = np.linalg.pinv(unit.T @ unit)
    parts = zip(np.array_split(unit, _BLOCKS), np.array_split(residual, _BLOCKS), strict=True)
    scores = np.array([part.T @ rest for part, rest in parts])
    middle = scores.T @ scores * _BLOCKS / (_BLOCKS - columns.shape[1])
    return inverse @ middle @ inverse / np.outer(scale, scale)


def pooled(lags: list[Lag]) -> tuple[float, float]:
    """Mean delay, weighted by its errors, and its standard error, s; widened where the delays disagree."""
    if not lags:
        raise InputError("no delays to pool")
    delays, errors = np.array([lag.delay_s for lag in lags]), np.array([lag.delay_error_s for lag in lags])
    weight = 1 / errors**2
    mean = float(weight @ delays / weight.sum())
    spread = float(weight @ (delays - mean) ** 2 / max(len(lags) - 1, 1))
    return mean, float(np.sqrt(max(spread, 1.0) / weight.sum()))


@dataclass(frozen=True)
class Pair:
    """Two recordings of one experiment on the host's clock, by arrival times alone."""

    name: str
    """The group of its recordings, as whoever recorded them called it."""
    experiment: int
    """Its number in the thesis's table A.1."""
    sine: bool
    quadrotor: pd.DataFrame
    """Samples with `host_s`, when they were taken."""
    wrench: pd.DataFrame
    rates: tuple[float, float]
    """Host seconds per device second, quadrotor and wrench."""


def _on_host(table: pd.DataFrame, largest_error: float) -> tuple[pd.DataFrame, float]:
    """The table with `host_s`, when its samples were taken by the host's clock, and the device clock's rate."""
    taken = table["time_s"].to_numpy(float)
    offset_s, rate = lower_edge(taken, table["host_time_s"].to_numpy(), largest_error)
    return table.assign(host_s=offset_s + rate * taken), rate


def both_on_host(
    first: pd.DataFrame, second: pd.DataFrame, largest_error: float
) -> tuple[tuple[pd.DataFrame, float], tuple[pd.DataFrame, float]]:
    """`_on_host` of two recordings that one host made at once.

    Where the devices' time passes faster than the host's, as an emulator's can, the clock of the first device
    takes the place of the host's.

    Raises InputError where such recordings have no time in common.
    """
    pace = np.ptp(second["time_s"]) / max(np.ptp(second["host_time_s"]), 1e-9)
    if pace < _FASTER_THAN_LIFE:
        return _on_host(first, largest_error), _on_host(second, largest_error)
    host = second["host_time_s"].to_numpy()
    both = (host >= first["host_time_s"].min()) & (host <= first["host_time_s"].max())
    if not both.any():
        raise InputError("two recordings of one test have no time in common")
    # Both arrive late, so that neither edge is the clocks'; what the median leaves, the measurements show.
    seen = device_time(first["time_s"], first["host_time_s"], host[both])
    offset = float(np.median(seen - second["time_s"].to_numpy()[both]))
    return (first.assign(host_s=first["time_s"]), 1.0), (second.assign(host_s=second["time_s"] + offset), 1.0)


def pair_of(
    name: str, experiment: int, sine: bool, quadrotor: pd.DataFrame, wrench: pd.DataFrame, largest_error: float
) -> Pair:
    """Both recordings by their arrival times."""
    (first, rate_1), (second, rate_2) = both_on_host(quadrotor, wrench, largest_error)
    return Pair(name, experiment, sine, first, second, (rate_1, rate_2))


def _lift_cause(quadrotor: pd.DataFrame, when_s: np.ndarray, thrust_of: Callable) -> np.ndarray:
    """Thrust that the throttles ask of each motor, N, shape (n, 4)."""
    sent = quadrotor["host_s"].to_numpy()
    throttle = np.column_stack([np.interp(when_s, sent, quadrotor[c], left=0.0, right=0.0) for c in THROTTLES])
    return np.clip(thrust_of(throttle), 0.0, None)


def _motor_delay(pair: Pair, thrust_of: Callable) -> Lag:
    """By how much the battery's sag follows the throttles, on the quadrotor's own clock.

    The charge that has been drawn lowers the voltage as well, and so does the idle current of motors that turn at
    all; both are fitted jointly with the sag.
    """
    sent = pair.quadrotor["host_s"].to_numpy()
    when = np.arange(sent[0], sent[-1], _STEP_S)
    voltage = np.interp(when, sent, pair.quadrotor["battery_voltage_v"])
    thrust = _lift_cause(pair.quadrotor, when, thrust_of)
    current = (thrust**_CURRENT_POWER).sum(axis=1)
    others = np.column_stack([np.cumsum(current) * _STEP_S, (thrust > _LEAST_THRUST_N).sum(axis=1)])
    return follow(when, voltage, current, LARGEST_S, others)


def _lift_delay(pair: Pair, thrust_of: Callable, with_skew: bool = False) -> Lag:
    """By how much the lift on the wrench's clock follows the throttles on the quadrotor's.

    The battery empties meanwhile, so that the same throttle gives less lift at the end: the thrust times the
    drop of the (smoothed) voltage is fitted jointly with the thrust.
    """
    felt, sent = pair.wrench["host_s"].to_numpy(), pair.quadrotor["host_s"].to_numpy()
    when = np.arange(felt[0], felt[-1], _STEP_S)
    lift = zero_phase(-np.interp(when, felt, pair.wrench["force_z_n"]), _SMOOTH_HZ, 1 / _STEP_S)
    cause = zero_phase(_lift_cause(pair.quadrotor, when, thrust_of).sum(axis=1), _SMOOTH_HZ, 1 / _STEP_S)
    voltage = np.interp(when, sent, zero_phase(pair.quadrotor["battery_voltage_v"].to_numpy(), 0.5, 50.0))
    weaker = cause * (voltage - voltage.mean())
    return follow(when, lift, cause, LARGEST_S, weaker[:, None], with_skew)


@dataclass(frozen=True)
class Aligned:
    """One pair of recordings and how its clocks lie to each other."""

    pair: Pair
    lift: Lag
    sag: Lag
    motor_delay_s: float
    motor_delay_error_s: float
    """Pooled over records."""

    @property
    def offset_s(self) -> float:
        """By how much the wrench's host times are late against the quadrotor's, beyond the motors' lag."""
        return self.lift.delay_s - self.motor_delay_s

    @property
    def offset_error_s(self) -> float:
        return float(np.hypot(self.lift.delay_error_s, self.motor_delay_error_s))


def align(pairs: list[Pair], thrust_of: Callable) -> list[Aligned]:
    """Offsets of all pairs; the motors' delay is pooled over the sines, or over all where there is no sine."""
    if not pairs:
        raise InputError("no experiment has both a quadrotor's and a wrench sensor's recording")
    sags = [_motor_delay(pair, thrust_of) for pair in pairs]
    of_sines = [sag for sag, pair in zip(sags, pairs, strict=True) if pair.sine]
    shared = pooled(of_sines or sags)
    return [Aligned(pair, _lift_delay(pair, thrust_of), sag, *shared) for pair, sag in zip(pairs, sags, strict=True)]


def skew(pairs: list[Pair], thrust_of: Callable) -> tuple[float, float]:
    """Relative skew of the two clocks and its standard error, from the sines' delays over time."""
    lags = [_lift_delay(pair, thrust_of, with_skew=True) for pair in pairs if pair.sine]
    if not lags:
        raise InputError("no experiment with a sine, so the clocks' skew cannot be distinguished from the motors' lag")
    weight = np.array([1 / lag.skew_error**2 for lag in lags])
    return float(weight @ [lag.skew for lag in lags] / weight.sum()), float(weight.sum() ** -0.5)


def torque_offset(rotor: pd.DataFrame, wrench: pd.DataFrame) -> Lag:
    """Offset of a torque test's clocks: the lift follows the measured speed squared at once.

    Both tables have `host_s`; the counter's speed is in `speed_rpm`.
    """
    felt, sent = wrench["host_s"].to_numpy(), rotor["host_s"].to_numpy()
    when = np.arange(max(felt[0], sent[0]), min(felt[-1], sent[-1]), _STEP_S)
    lift = zero_phase(-np.interp(when, felt, wrench["force_z_n"]), _SMOOTH_HZ, 1 / _STEP_S)
    square = zero_phase(np.interp(when, sent, rotor["speed_rpm"].to_numpy(float) ** 2), _SMOOTH_HZ, 1 / _STEP_S)
    return follow(when, lift, square, LARGEST_S)


def clock_table(aligned: list[Aligned]) -> pd.DataFrame:
    """One row an experiment, for people."""
    return pd.DataFrame(
        [
            {
                "experiment": entry.pair.experiment,
                "sine": entry.pair.sine,
                "quadrotor_rate_error": entry.pair.rates[0] - 1,
                "wrench_rate_error": entry.pair.rates[1] - 1,
                "lift_delay_s": entry.lift.delay_s,
                "lift_delay_error_s": entry.lift.delay_error_s,
                "sag_delay_s": entry.sag.delay_s,
                "sag_delay_error_s": entry.sag.delay_error_s,
                "offset_s": entry.offset_s,
                "offset_error_s": entry.offset_error_s,
            }
            for entry in aligned
        ]
    )


def clock_summary(aligned: list[Aligned], skewed: tuple[float, float]) -> dict:
    """The clocks in few numbers. `skewed` is the result of `skew`."""
    offsets = np.array([entry.offset_s for entry in aligned])
    rates = np.array([entry.pair.rates for entry in aligned]) - 1
    return {
        "experiments": len(aligned),
        "motor_delay_s": aligned[0].motor_delay_s,
        "motor_delay_interval_95": _interval(aligned[0].motor_delay_s, aligned[0].motor_delay_error_s),
        "offset_median_s": float(np.median(offsets)),
        "offset_smallest_s": float(offsets.min()),
        "offset_largest_s": float(offsets.max()),
        "offset_error_median_s": float(np.median([entry.offset_error_s for entry in aligned])),
        "arrival_rate_error_largest": float(np.abs(rates).max()),
        "skew": skewed[0],
        "skew_interval_95": _interval(*skewed),
        "skew_over_20_s_ms": float(20e3 * abs(skewed[0])),
    }


def _interval(value: float, error: float) -> tuple[float, float]:
    return value - 1.96 * error, value + 1.96 * error
