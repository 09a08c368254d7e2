"""Filters of sampled readings: the thesis's first-order low-pass, a zero-phase one, spikes, steadiness, tare, means.

Arrays have shape (n,) or (n, channels), samples along the first axis, evenly spaced. A steady stretch's mean is as well
known as its blocks say, since neighbouring samples are not independent.
"""

from __future__ import annotations

import numpy as np
import scipy

from rotorid.errors import InputError


def smoothing(cutoff_hz: float, rate_hz: float) -> float:
    """α of the first-order low-pass for a cutoff: 1 − exp(−2π f_c / f_s)."""
    return float(1 - np.exp(-2 * np.pi * cutoff_hz / rate_hz))


def first_order(values: np.ndarray, cutoff_hz: float, rate_hz: float) -> np.ndarray:
    """The thesis's low-pass (2.7.3), y_k = y_{k−1} + α (x_k − y_{k−1}); the first sample passes unchanged.

    It can run while recording, and lags behind by about 1 / (2π f_c).
    """
    values = np.asarray(values, float)
    if len(values) == 0:
        return values.copy()
    alpha = smoothing(cutoff_hz, rate_hz)
    start = (1 - alpha) * values[:1]
    return scipy.signal.lfilter([alpha], [1, alpha - 1], values, axis=0, zi=start)[0]


def zero_phase(values: np.ndarray, cutoff_hz: float, rate_hz: float) -> np.ndarray:
    """Butterworth low-pass run forward and backward: no lag, half the power at the cutoff's frequency.

    Raises InputError where the cutoff is not below half the rate.
    """
    zero_phase_order = 2  # Order of the Butterworth filter that runs forward and backward.
    values = np.asarray(values, float)
    if not 0 < cutoff_hz < rate_hz / 2:
        raise InputError(f"a cutoff of {cutoff_hz:g} Hz must lie below half the rate of {rate_hz:g} Hz")
    # Two runs halve the power twice; the single run's cutoff is raised so that both together halve it once.
    single = cutoff_hz / (np.sqrt(2) - 1) ** (1 / (2 * zero_phase_order))
    sections = scipy.signal.butter(zero_phase_order, min(single, 0.49 * rate_hz), fs=rate_hz, output="sos")
    pad = min(len(values) - 1, int(3 * rate_hz / cutoff_hz))
    return scipy.signal.sosfiltfilt(sections, values, axis=0, padlen=max(pad, 0)) if len(values) > 1 else values.copy()


def spikes(values: np.ndarray, window: int, threshold: float) -> np.ndarray:
    """Samples that leave their surroundings and come back (Hampel), bool, as the values.

    A sample is a spike where it differs from the median of `window` samples around it by more than `threshold`
    robust standard deviations of the whole record's such differences. A step is none: the median steps with it.
    """
    mad_to_sigma = 1.4826
    values = np.asarray(values, float)
    size = (window,) + (1,) * (values.ndim - 1)
    off = values - scipy.ndimage.median_filter(values, size=size, mode="nearest")
    scale = mad_to_sigma * np.median(np.abs(off), axis=0)
    return np.abs(off) > threshold * np.where(scale > 0, scale, np.inf)


def without_spikes(values: np.ndarray, found: np.ndarray) -> np.ndarray:
    """Spikes replaced by the straight line between their neighbours."""
    values = np.array(values, float)
    columns, flags = values.reshape(len(values), -1), found.reshape(len(values), -1)
    place = np.arange(len(values))
    for column, flag in zip(columns.T, flags.T, strict=True):
        if flag.any() and not flag.all():
            column[flag] = np.interp(place[flag], place[~flag], column[~flag])
    return columns.reshape(values.shape)


def steady(filtered: np.ndarray, window: int, tolerance: float) -> np.ndarray:
    """Samples that end a stretch of `window` in which no channel spans more than `tolerance`, bool, shape (n,).

    The recorder's rule (fig. 2.35), on the filtered signal.
    """
    filtered = np.asarray(filtered, float)
    columns = filtered.reshape(len(filtered), -1)
    origin = (window - 1) // 2  # shifts the centred window so that it ends at the sample
    high = scipy.ndimage.maximum_filter1d(columns, window, axis=0, origin=origin, mode="nearest")
    low = scipy.ndimage.minimum_filter1d(columns, window, axis=0, origin=origin, mode="nearest")
    flat = ((high - low) <= tolerance).all(axis=1)
    flat[: window - 1] = False
    return flat


def tare(values: np.ndarray, first: int, last: int) -> np.ndarray:
    """Mean of the samples `first` to `last` (both in it), shape (channels,). Raises InputError where none are."""
    part = np.asarray(values, float)[first : last + 1]
    if first < 0 or len(part) == 0:
        raise InputError(f"no samples between {first} and {last} to tare with")
    return part.mean(axis=0)


def mean_and_error(values: np.ndarray, blocks: int | None = None) -> tuple[float, float]:
    """Mean and its standard error, from the means of consecutive blocks, about √n of them by default.

    Means of blocks are nearly independent where single samples are not: noise that is slow, drift and ringing
    widen the error as they should. Of a periodic signal a block is one period. Fewer than 16 samples are taken
    one by one.
    """
    values = np.asarray(values, float)
    values = values[np.isfinite(values)]
    if len(values) < 2:
        return (float(values.mean()) if len(values) else float("nan")), float("nan")
    count = blocks or block_count(len(values))
    means = np.array([block.mean() for block in np.array_split(values, count)])
    return float(values.mean()), float(means.std(ddof=1) / np.sqrt(count)) if count > 1 else float("nan")


def block_count(samples: int) -> int:
    """Into how many blocks so many samples are divided."""
    return samples if samples < 16 else int(samples**0.5)
