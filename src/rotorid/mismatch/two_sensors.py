"""An error of a sensor is asked of the sensor it is compared with, too.

A lever arm of the accelerometer adds to the force and, equally, to what the accelerometer has over the change of
velocity. A cable that pulls at the tail turns the vehicle and pulls it sideways: it looks like a lever arm in the
force, and there is nothing of it between the two sensors.
"""

from __future__ import annotations

import numpy as np

from rotorid.mismatch.regression import Fit
from rotorid.mismatch.rows import Rows

COMPARISONS = {"accelerometer": slice(6, 9), "gyroscope": slice(9, 12)}
"""Channels in which two sensors are compared."""
LEAST_SHARE = 0.5
"""Share of an error that the comparison must show."""
REFUTED_Z = 3.5
"""Standard errors by which it must show less."""
BLOCK_ROWS = 80
"""Rows whose noise counts as of one piece (two seconds at 40 Hz)."""


def shown(rows: list[Rows], fit: Fit, cols: np.ndarray, noise: np.ndarray, where: slice) -> tuple[float, float] | None:
    """How much of a term, as fitted (1 is all), the channels `where` hold, and one sigma; None where it is not there.

    `noise` (12,) weighs the channels; the standard error is from blocks of rows, so that slow noise counts.
    """
    own = fit.beta[fit.places(cols)]
    seen, size = [], []
    for r in rows:
        channels = [c for c in range(*where.indices(12)) if np.isfinite(noise[c]) and r.x[:, c][:, cols].any()]
        for c in channels:
            part = r.x[:, c][:, cols] @ own / noise[c]
            left = (r.y[:, c] - r.x[:, c][:, fit.columns] @ fit.beta) / noise[c] + part
            count = max(1, len(part) // BLOCK_ROWS)
            seen += [float(s.sum()) for s in np.array_split(part * left, count)]
            size += [float(s.sum()) for s in np.array_split(part**2, count)]
    if not size or sum(size) <= 0:
        return None
    share = sum(seen) / sum(size)
    error = float(np.sqrt(sum((s - share * e) ** 2 for s, e in zip(seen, size, strict=True))) / sum(size))
    return share, max(error, 1.0 / np.sqrt(sum(size)))


def refute(rows: list[Rows], fit: Fit, cols: np.ndarray, noise: np.ndarray) -> bool:
    """Whether the comparison of two sensors shows that an error which they should both tell of is none."""
    for where in COMPARISONS.values():
        found = shown(rows, fit, cols, noise, where)
        if found is not None and found[0] < LEAST_SHARE and 1.0 - found[0] > REFUTED_Z * found[1]:
            return True
    return False
