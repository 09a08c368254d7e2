"""Dynamics of a reading between the samples of its load."""

import numpy as np
import pytest

from rotorid.effects.amplifier_filter import followed_now
from rotorid.effects.loading import between_samples, unsmoothed
from rotorid.effects.structural_resonance import resonance
from rotorid.mismatch.instrument.chain import between


def test_a_cubic_is_met_between_its_samples():
    values = np.array([[0.0], [1.0], [8.0], [27.0], [64.0]])
    found = between_samples(values, np.array([0.5, 1.5, 2.25, 4.0, 9.0]))[:, 0]
    assert found == pytest.approx([0.125, 3.375, 11.390625, 64.0, 64.0])


def test_three_samples_are_joined_by_lines():
    assert between_samples(np.array([[0.0], [2.0], [4.0]]), np.array([0.5]))[0, 0] == 1.0


def test_a_kink_loses_a_twelfth_of_its_second_difference():
    assert unsmoothed(np.array([[0.0], [0.0], [12.0], [0.0], [0.0]]))[:, 0] == pytest.approx([0, -1, 14, -1, 0])


@pytest.mark.parametrize("share", [0.02, 0.06, 0.1])
def test_gain_at_a_tenth_of_the_rate_is_that_of_the_equation(share):
    rate = 100.0
    f = share * rate
    t = np.arange(4000) / rate
    x = np.sin(2 * np.pi * f * t)[:, None]
    late = (t > 20) & (t < t[-1])  # settled, and with a neighbour on either side
    for f_n, zeta in ((9.0, 0.04), (6.0, np.sqrt(0.5))):
        gain = 1 / (1 - (f / f_n) ** 2 + 2j * zeta * f / f_n)
        y = resonance(x, f_n, zeta, 1 / rate)[late, 0]
        assert y == pytest.approx((gain * np.exp(2j * np.pi * f * t[late])).imag, abs=2e-3 * abs(gain))
    gain = 1 / (1 + 1j * f / 6.0)
    y = followed_now(x, 1 / (2 * np.pi * 6.0), 1 / rate)[late, 0]
    assert y == pytest.approx((gain * np.exp(2j * np.pi * f * t[late])).imag, abs=2e-3)


def test_a_command_is_refined_without_moving_its_samples():
    command = np.array([[0.0, 1.0], [1.0, 2.0], [4.0, 3.0], [9.0, 4.0]])
    fine = between(command, 4)
    assert fine.shape == (13, 2) and fine[::4] == pytest.approx(command)
    assert fine[2, 0] == pytest.approx(0.25)  # of t²
