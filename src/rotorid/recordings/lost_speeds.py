"""Points of a rotor test whose speed sensor lost pulses, found by their thrust."""

from __future__ import annotations

import numpy as np

_TOO_SLOW = 1.35
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
    return turning & (ratio > _TOO_SLOW * np.median(ratio[turning]))
