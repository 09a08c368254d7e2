"""How noisy the steady points of rotor tests are, by the samples that each is the mean of.

A point is the mean of n samples under load less the mean of m samples at rest (the tare). If every sample has the same
noise s, the point has the variance s² (1/n + 1/m). Two checks of that, neither of which uses the scatter of the points:

- whether s grows with the rotor speed: RMS of s over the fastest quarter of the tests over that of the slowest;
- whether the points scatter about the fitted curve as s says: chi-square of the residuals.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.special import chdtrc, fdtri


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
