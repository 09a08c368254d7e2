"""Measured rotor speeds without the noise of their measurement.

On a stand the speeds are the load: their noise is an error of the regressor, of which a play or a filter of the load
takes away what is small or quick, and so looks like one. A rotor's inertia keeps its speed smooth, the noise of a
counter is white: on a plateau every instant gets the longest window whose parabola agrees with those of all shorter
ones (intersection of confidence intervals; A. Goldenshluger and A. Nemirovski, 1997); at a step the reading stays.
What is quick may also be the rotors' own: the reading shows which, for it follows rotors but not their counters.
"""

from __future__ import annotations

import numpy as np
from scipy.ndimage import median_filter
from scipy.signal import savgol_coeffs, savgol_filter, welch

from rotorid.effects.loading import Loading

WIDTHS = (5, 9, 17, 33, 65, 129, 257)
"""Samples of the windows."""
_STEADY_WIDTH = 33
"""Samples that must agree for a reading to be replaced: near a step a window bends what it smooths."""
_GAMMA = 2.6
"""Half-width of the confidence intervals, in standard errors."""
_BAND = (0.5, 0.75, 1.0)
"""Shares of the highest frequency in which the noise must be white, in two halves."""
_LEVEL = 2.0
"""Ratio of the power in the two halves beyond which there is signal up there, and nothing is done."""
_SMALLER, _LARGER = 0.98, 1.01
"""Smoothed speeds are the better ones where they lower the quick errors of some load to this share, and raise none."""
_LOCAL_S = 1.0
"""Time over which the size of the noise is read off: it may grow with the speed."""


def without_noise(speed: np.ndarray, rate_hz: float) -> np.ndarray:
    """Rotor speeds (n, k), rad/s, at even instants, less their white noise; a short stretch as it is."""
    if len(speed) < 2 * WIDTHS[-1]:
        return speed
    return np.stack([_smoothed(x, rate_hz) if _noisy(x) else x for x in speed.T], axis=1)


def noise_of(speed: np.ndarray, rate_hz: float) -> np.ndarray:
    """One-sigma of the white noise of rotor speeds (n, k), rad/s, at every instant; 0 where it is no noise."""
    if len(speed) < 2 * WIDTHS[-1]:
        return np.zeros_like(speed)
    return np.stack([_spread(x, rate_hz) if _noisy(x) else np.zeros(len(x)) for x in speed.T], axis=1)


def quieter(as_read: list[Loading], smoothed: list[Loading]) -> list[Loading]:
    """Of stretches with loads from the speeds as read and from smoothed ones those whose loads the readings follow.

    Compared by the squares of the steps from sample to sample, in which effects of the instrument are small.
    """
    ratio = _steps(smoothed) / np.maximum(_steps(as_read), 1e-300)
    better = len(ratio) > 0 and np.nanmin(ratio) < _SMALLER and np.nanmax(ratio) < _LARGER
    return smoothed if better else as_read


def _steps(loadings: list[Loading]) -> np.ndarray:
    """Squares of the steps of reading less load, (6,), channels that are not read being NaN."""
    parts = [np.diff(x.reading - x.load, axis=0) ** 2 for x in loadings]
    return np.concatenate(parts).sum(axis=0) if parts else np.zeros(0)


def _noisy(speed: np.ndarray) -> bool:
    """Whether the upper end of the spectrum is white."""
    frequency, power = welch(speed, nperseg=WIDTHS[-1] - 1, detrend="linear")
    share = frequency / frequency[-1]
    lower, upper = (float(np.median(power[(share >= a) & (share < b)])) for a, b in zip(_BAND, _BAND[1:], strict=False))
    return upper > 0 and 1 / _LEVEL < lower / upper < _LEVEL


def _spread(speed: np.ndarray, rate_hz: float) -> np.ndarray:
    """Local one-sigma of white noise, (n,)."""
    quick = np.abs(speed - savgol_filter(speed, WIDTHS[0], 2))
    # Of white noise a parabola over five samples leaves 1 − 17/35 of the variance at its middle.
    spread = 1.4826 / np.sqrt(1.0 - savgol_coeffs(WIDTHS[0], 2)[WIDTHS[0] // 2])
    return spread * median_filter(quick, int(_LOCAL_S * rate_hz) | 1, mode="nearest")


def _smoothed(speed: np.ndarray, rate_hz: float) -> np.ndarray:
    weights = [savgol_coeffs(width, 2) for width in WIDTHS]
    sd = _spread(speed, rate_hz)
    best, low, high = speed.copy(), speed - _GAMMA * sd, speed + _GAMMA * sd
    agrees = np.ones(len(speed), bool)
    for width, weight in zip(WIDTHS, weights, strict=True):
        value, doubt = savgol_filter(speed, width, 2), _GAMMA * sd * np.sqrt(weight @ weight)
        low, high = np.maximum(low, value - doubt), np.minimum(high, value + doubt)
        agrees &= low <= high
        if width >= _STEADY_WIDTH:
            best = np.where(agrees, value, best)
    return best
