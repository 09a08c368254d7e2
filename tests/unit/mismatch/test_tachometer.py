"""Measured rotor speeds without their noise: plateaus are averaged, steps stay steps."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from rotorid.mismatch.instrument.tachometer import WIDTHS, without_noise

RATE_HZ = 200.0
TIME_S = np.arange(6000) / RATE_HZ
LAG_S = 0.05


def stepping() -> np.ndarray:
    """A rotor that steps between 600 and 900 rad/s every two seconds, with a lag of 50 ms."""
    command = np.where((TIME_S // 2) % 2 == 0, 600.0, 900.0)
    share = 1 - np.exp(-1 / RATE_HZ / LAG_S)
    return lfilter([share], [1, share - 1], command, zi=[(1 - share) * 600.0])[0]


def read(noise: np.ndarray) -> np.ndarray:
    return without_noise((stepping() + noise)[:, None], RATE_HZ)[:, 0]


def test_noise_of_a_half_percent_is_taken_out_and_steps_stay():
    """On a plateau the longest windows leave a tenth to a third of the noise; at a step the readings stay."""
    true = stepping()
    noise = 0.005 * true * np.random.default_rng(0).standard_normal(TIME_S.size)
    left = read(noise) - true
    settled, stepped = TIME_S % 2 > 1, TIME_S % 2 < 0.05
    assert np.std(left[settled]) < 0.4 * np.std(noise[settled])
    assert np.abs(left[stepped]).max() < 4 * np.std(noise)
    assert np.mean(left) == pytest.approx(0.0, abs=0.1)


def test_speeds_without_noise_stay_as_they_are():
    np.testing.assert_allclose(read(np.zeros(TIME_S.size)), stepping(), atol=1e-6)


def test_a_speed_that_moves_quickly_is_no_noise():
    """A vibration at 60 Hz of a smooth speed: the upper end of the spectrum is not white."""
    vibration = 20.0 * np.sin(2 * np.pi * 60.0 * TIME_S)
    np.testing.assert_array_equal(read(vibration), stepping() + vibration)


def test_a_short_stretch_stays_as_it_is():
    short = np.random.default_rng(1).standard_normal((2 * WIDTHS[-1] - 1, 2))
    assert without_noise(short, RATE_HZ) is short
