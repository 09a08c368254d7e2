"""Intervals of the scores over cases."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

Z95 = 1.959963984540054


def wilson(hits: int, trials: int) -> tuple[float, float]:
    """95 % interval of a rate, Wilson 1927: (p + z²/2n ± z √(p(1−p)/n + z²/4n²)) / (1 + z²/n); (0, 1) of nothing."""
    if trials == 0:
        return 0.0, 1.0
    p, z2 = hits / trials, Z95**2
    centre = (p + z2 / (2 * trials)) / (1 + z2 / trials)
    half = Z95 / (1 + z2 / trials) * math.sqrt(p * (1 - p) / trials + z2 / (4 * trials**2))
    low = 0.0 if hits == 0 else centre - half
    high = 1.0 if hits == trials else centre + half
    return low, high


def bootstrap_mean(values: Sequence[float], draws: int = 2000, seed: int = 1) -> tuple[float, float]:
    """95 % percentile interval of the mean, whole cases drawn with replacement; (nan, nan) of nothing."""
    values = np.asarray(values, float)
    if len(values) == 0:
        return math.nan, math.nan
    picks = np.random.default_rng(seed).integers(len(values), size=(draws, len(values)))
    low, high = np.percentile(values[picks].mean(axis=1), [2.5, 97.5])
    return float(low), float(high)


def bootstrap_ratio(
    numerators: Sequence[float], denominators: Sequence[float], draws: int = 2000, seed: int = 1
) -> tuple[float, float]:
    """95 % percentile interval of Σ numerators / Σ denominators, whole cases drawn with replacement."""
    top, bottom = np.asarray(numerators, float), np.asarray(denominators, float)
    if len(top) == 0 or bottom.sum() == 0:
        return math.nan, math.nan
    picks = np.random.default_rng(seed).integers(len(top), size=(draws, len(top)))
    below = bottom[picks].sum(axis=1)
    ratios = top[picks].sum(axis=1)[below > 0] / below[below > 0]
    low, high = np.percentile(ratios, [2.5, 97.5])
    return float(low), float(high)
