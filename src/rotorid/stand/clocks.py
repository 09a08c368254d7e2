"""Two clocks: each device's own against the host's.

A sample is read by the host some time after the device took it, never before. So in a plane of device time
against host time all samples lie on or above the true line, and those that were read at once lie on it: the
line is the lower edge of the cloud. Its slope is the device clock's rate, its intercept the offset. Two devices
that one host listens to are thereby on one clock, without a look at what they measured.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rotorid.errors import InputError


@dataclass(frozen=True)
class ClockLine:
    """host = offset_s + rate * device."""

    offset_s: float
    rate: float
    """Host seconds per device second."""

    def host(self, device_s: np.ndarray) -> np.ndarray:
        """Host time, s, at which the device took its samples."""
        return self.offset_s + self.rate * np.asarray(device_s, float)


def lower_edge(device_s: np.ndarray, host_s: np.ndarray, largest_error: float) -> ClockLine:
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
    return ClockLine(offset, 1 + slope)


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
