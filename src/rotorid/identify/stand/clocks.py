"""Two clocks: each device's own against the host's.

A sample is read by the host some time after the device took it, never before. So in a plane of device time
against host time all samples lie on or above the true line, and those that were read at once lie on it: the
line is the lower edge of the cloud. Its slope is the device clock's rate, its intercept the offset. Two devices
that one host listens to are thereby on one clock, without a look at what they measured.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from rotorid.errors import InputError


@dataclass(frozen=True)
class _ClockLine:
    """host = offset_s + rate * device."""

    offset_s: float
    rate: float
    """Host seconds per device second."""

    def host(self, device_s: np.ndarray) -> np.ndarray:
        """Host time, s, at which the device took its samples."""
        return self.offset_s + self.rate * np.asarray(device_s, float)


def lower_edge(device_s: np.ndarray, host_s: np.ndarray, largest_error: float) -> _ClockLine:
    """The line below all samples that lies closest to them.

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
    return _ClockLine(offset, 1 + slope)


def device_time(time_s: np.ndarray, seen_s: np.ndarray, host_s: np.ndarray) -> np.ndarray:
    """Times of a device's clock at times of the host, s, interpolated between the device's samples.

    Of a batch that the host sees at once, the last sample counts.

    Parameters
    ----------
    time_s, seen_s
        Shape (n,): the device's time of each sample, and the host's time when it was read.
    host_s
        Times of the host, any shape; beyond the samples the first or last device time is given.
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

    signal(t) = a + k cause(t − d − s (t − t̄)) + others(t) b, by Gauss and Newton from the best of a coarse search.

    Parameters
    ----------
    time_s
        Shape (n,), evenly spaced, s.
    signal, cause
        Shape (n,), smoothed alike if at all; any unit.
    largest_s
        Largest delay looked for, either way, s.
    others
        What else the signal depends on at once, shape (n, m).
    with_skew
        Whether the delay may grow over time.

    Raises
    ------
    InputError
        A constant cause.
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
