"""Zero-phase low-pass and derivative kernels: gains at hand-chosen frequencies, nothing delayed."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.signal import lfilter

from rotorid.recordings.signal import kernels

RATE_HZ, CUTOFF_HZ = 250.0, 20.0


def gain(kernel: np.ndarray, frequency_hz: float, rate_hz: float = RATE_HZ) -> complex:
    """Frequency response about the kernel's centre."""
    half = (len(kernel) - 1) // 2
    return np.sum(kernel * np.exp(-2j * np.pi * frequency_hz / rate_hz * np.arange(-half, half + 1)))


def test_the_length_is_2_4_periods_of_the_cutoff_to_each_side():
    # 2.4 · 250 / 20 = 30
    assert kernels.half_length(RATE_HZ, CUTOFF_HZ) == 30
    assert len(kernels.low_pass(RATE_HZ, CUTOFF_HZ)) == 61


def test_the_low_pass_passes_halves_and_stops():
    kernel = kernels.low_pass(RATE_HZ, CUTOFF_HZ)
    assert gain(kernel, 0.0) == pytest.approx(1.0, abs=1e-14)
    assert gain(kernel, 10.0) == pytest.approx(1.0, abs=0.005)
    assert abs(gain(kernel, CUTOFF_HZ)) == pytest.approx(0.5, abs=0.01)
    assert max(abs(gain(kernel, f)) for f in np.arange(27.0, 125.0, 0.5)) < 10 ** (-45 / 20)


def test_neither_kernel_shifts_anything_in_time():
    low_pass, derivative = kernels.low_pass(RATE_HZ, CUTOFF_HZ), kernels.derivative(RATE_HZ, CUTOFF_HZ)
    np.testing.assert_allclose(low_pass, low_pass[::-1], atol=1e-15)
    np.testing.assert_allclose(derivative, -derivative[::-1], atol=1e-12)


def test_the_derivative_of_a_ramp_is_its_slope_and_of_a_sine_its_cosine():
    t = np.arange(500) / RATE_HZ
    inner = slice(30, -30)
    kernel = kernels.derivative(RATE_HZ, CUTOFF_HZ)
    np.testing.assert_allclose(kernels.apply(kernel, 3.0 - 2.0 * t), -2.0, atol=1e-10)
    wave, slope = np.sin(2 * np.pi * 5.0 * t), 2 * np.pi * 5.0 * np.cos(2 * np.pi * 5.0 * t)
    np.testing.assert_allclose(kernels.apply(kernel, wave), slope[inner], atol=0.002 * 2 * np.pi * 5.0)
    # The same gain as the low-pass throughout the band, or else a derived moment would be off by as much.
    low_pass = kernels.low_pass(RATE_HZ, CUTOFF_HZ)
    for f in (1.0, 4.0, 8.0, 12.0, 16.0, 20.0):
        assert (gain(kernel, f) / (2j * np.pi * f)).real == pytest.approx(gain(low_pass, f).real, abs=0.001)
    # Beyond the cutoff it is a low-pass: 60 Hz does not come through.
    assert abs(gain(kernel, 60.0)) < 0.01 * 2 * np.pi * 60.0


def test_only_covered_samples_are_kept_and_further_axes_stay():
    signal = np.random.default_rng(0).standard_normal((200, 3, 2))
    kernel = kernels.low_pass(RATE_HZ, CUTOFF_HZ)
    out = kernels.apply(kernel, signal)
    assert out.shape == (140, 3, 2)
    np.testing.assert_allclose(out[7, 1, 0], kernel @ signal[7 : 7 + 61, 1, 0], atol=1e-12)


@pytest.mark.parametrize("shape", [(400,), (400, 3)])
def test_quick_filters_give_what_scipy_gives(shape):
    rng = np.random.default_rng(0)
    signal, taps = rng.standard_normal(shape).cumsum(axis=0), rng.standard_normal(9)
    np.testing.assert_allclose(kernels.causal(taps, signal), lfilter(taps, [1.0], signal, axis=0), rtol=1e-9, atol=1e-9)
    # Wider than the signal, so that it is mirrored more than once.
    for sigma in (3.0, 250.0):
        wanted = gaussian_filter1d(signal, sigma, axis=0)
        np.testing.assert_allclose(kernels.gaussian(signal, sigma), wanted, rtol=1e-9, atol=1e-9)
