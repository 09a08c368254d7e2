"""Power in the band of frequency in which noise is distinguished from motion."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.signal import welch

NOISE_BAND = (0.5, 0.85)
"""Band, as shares of the cutoff, in which noise is distinguished from motion."""
SHORTEST_ROWS = 32


def band_power(parts: Sequence[np.ndarray], rate_hz: float, band_hz: tuple[float, float]) -> float:
    """Mean power density of stretches (n,) in a band of frequency."""
    total, weight = 0.0, 0
    for part in parts:
        if len(part) >= SHORTEST_ROWS:
            frequency, density = welch(part, fs=rate_hz, nperseg=min(len(part), 256))
            inside = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
            total, weight = total + float(density[inside].mean()) * len(part), weight + len(part)
    return total / max(weight, 1)
