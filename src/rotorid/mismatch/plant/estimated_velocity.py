"""Whether a recorded velocity is an estimate made from the recorded accelerometer.

An autopilot's filter integrates its accelerometer between the fixes of a slower sensor: the accelerometer's errors,
its noise and the vibrations that it feels are then in the velocity, too, and comparing the two shows nothing of them.
It shows at frequencies above those at which a vehicle moves: the change of an independent velocity is that sensor's
own noise there and has nothing in common with the accelerometer.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from scipy.signal import csd, welch

from rotorid.mismatch.plant.motion import Segment

WINDOW = 128
"""Samples of a window of the spectra."""
HIGHEST = 0.48
"""Highest frequency compared, as a share of the rate."""
LEAST_COMMON = 0.15
"""Coherence from which the two have a source in common: simulated autopilots have 0.2 to 1, independent sensors up to
0.03, which is what chance alone makes of forty windows."""


def made_from_accelerometer(segments: Iterable[Segment], cutoff_hz: float) -> bool:
    """Whether velocity and accelerometer of these stretches share what is above `cutoff_hz`."""
    cross = np.zeros((3, WINDOW // 2 + 1), complex)
    read, moved = np.zeros(cross.shape), np.zeros(cross.shape)
    band = np.zeros(cross.shape[1], bool)
    for s in segments:
        motion = s.motion
        both = motion.accelerometer is not None and motion.velocity is not None and motion.rotation is not None
        if not both or motion.size <= WINDOW:
            continue
        velocity, force = (
            np.einsum("nij,nj->in", motion.rotation, own) for own in (motion.velocity, motion.accelerometer)
        )
        change, between = np.diff(velocity) * s.rate_hz, 0.5 * (force[:, 1:] + force[:, :-1])
        how = {"fs": s.rate_hz, "nperseg": WINDOW, "axis": 1}
        f_hz, own = csd(between, change, **how)
        band |= (f_hz > cutoff_hz) & (f_hz < HIGHEST * s.rate_hz)
        cross += motion.size * own
        read += motion.size * welch(between, **how)[1]
        moved += motion.size * welch(change, **how)[1]
    if not band.any():
        return False
    coherence = np.abs(cross) ** 2 / np.maximum(read * moved, 1e-300)
    return bool(coherence[:, band].mean() > LEAST_COMMON)
