"""Symmetric (zero-phase) low-pass and derivative kernels, so that both sides of an equation are filtered alike."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import scipy


def half_length(rate_hz: float, cutoff_hz: float) -> int:
    """Samples lost at each end by a kernel of this cutoff."""
    # Half the kernel's length in periods of the cutoff: the transition is 0.6 of the cutoff wide.
    half_length_cycles = 2.4
    return max(2, int(np.ceil(half_length_cycles * rate_hz / cutoff_hz)))


@lru_cache(maxsize=64)
def low_pass(rate_hz: float, cutoff_hz: float) -> np.ndarray:
    """Windowed-sinc low-pass of unit gain at zero frequency, shape (2 half_length + 1,); -6 dB at the cutoff."""
    attenuation_beta = 5.0  # Kaiser window for about 50 dB in the stop band.
    half = half_length(rate_hz, cutoff_hz)
    k = np.arange(-half, half + 1)
    kernel = np.sinc(2 * cutoff_hz * k / rate_hz) * scipy.signal.windows.kaiser(2 * half + 1, attenuation_beta)
    return kernel / kernel.sum()


@lru_cache(maxsize=64)
def derivative(rate_hz: float, cutoff_hz: float) -> np.ndarray:
    """Derivative of a signal low-passed at the cutoff, 1/s, shape (2 half_length + 1,).

    The antisymmetric kernel whose response, divided by 2πif, comes closest to the low-pass's own (least squares over
    all frequencies): windowing the slope of a sinc instead would read about 2 % too much in the whole band.
    """
    half = half_length(rate_hz, cutoff_hz)
    k = np.arange(1, half + 1)
    angle = np.linspace(0.0, np.pi, 3 * half + 1)[1:]
    flat = low_pass(rate_hz, cutoff_hz)
    wanted = flat[half] + 2 * np.cos(np.outer(angle, k)) @ flat[half + 1 :]
    per_slope = 2 * np.sin(np.outer(angle, k)) / angle[:, None]
    right = np.linalg.lstsq(per_slope, wanted, rcond=None)[0]
    # A ramp of slope one must give exactly one.
    right /= 2 * right @ k
    return rate_hz * np.concatenate([right[::-1], [0.0], -right])


def apply(kernel: np.ndarray, signal: np.ndarray) -> np.ndarray:
    """Convolve along axis 0 and keep only samples that the kernel fully covers."""
    shape = (len(kernel),) + (1,) * (signal.ndim - 1)
    return scipy.signal.fftconvolve(signal, kernel.reshape(shape), mode="valid", axes=0)


def causal(taps: np.ndarray, signal: np.ndarray) -> np.ndarray:
    """`scipy.signal.lfilter(taps, [1], signal, axis=0)`, without its loop in Python over the columns."""
    if signal.ndim == 1:
        return np.convolve(signal, taps)[: len(signal)]
    return scipy.signal.upfirdn(taps, signal, axis=0)[: len(signal)]


def gaussian(signal: np.ndarray, sigma_samples: float) -> np.ndarray:
    """`scipy.ndimage.gaussian_filter1d(signal, sigma_samples, axis=0)` at a cost that hardly grows with its width."""
    half = int(4.0 * sigma_samples + 0.5)
    kernel = np.exp(-0.5 * (np.arange(-half, half + 1) / sigma_samples) ** 2)
    padded = np.pad(signal, [(half, half)] + [(0, 0)] * (signal.ndim - 1), mode="symmetric")
    shape = (-1,) + (1,) * (signal.ndim - 1)
    return scipy.signal.oaconvolve(padded, (kernel / kernel.sum()).reshape(shape), mode="valid", axes=0)
