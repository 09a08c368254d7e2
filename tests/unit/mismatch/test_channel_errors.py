"""Errors of channels compared by blocks of time."""

from __future__ import annotations

import numpy as np

from rotorid.mismatch.channel_errors import excited, growth, helps
from rotorid.mismatch.instrument.useful import HELP_Z

PER = 10


def parts(scale: float, blocks: int = 20, seed: int = 0) -> np.ndarray:
    """Residual (n, 12) of which the second channel is `scale` times noise of one sigma."""
    left = np.random.default_rng(seed).standard_normal((blocks * PER, 12))
    left[:, 1] *= scale
    return left


def test_a_channel_twice_as_large_has_grown_and_no_other():
    before = parts(1.0)
    after = before * np.array([1.0, 2.0, *[0.5] * 10])
    ratio, z = growth([before], [after], [np.ones(len(before), bool)], PER)
    assert np.allclose(ratio, [1.0, 2.0, 0.5, 0.5, 0.5, 0.5])
    assert (z > 2.0).tolist() == [False, True, False, False, False, False]


def test_only_masked_rows_count():
    before = parts(1.0)
    after = before.copy()
    after[: 10 * PER, 1] *= 5.0
    held = np.arange(len(before)) >= 10 * PER
    ratio, _ = growth([before], [after], [held], PER)
    assert np.allclose(ratio, 1.0)
    assert growth([before], [after], [~held], PER)[1][1] > 2.0


def test_one_bad_second_of_twenty_is_no_proof():
    before = parts(1.0)
    after = before.copy()
    after[:PER, 1] *= 8.0
    ratio, z = growth([before], [after], [np.ones(len(before), bool)], PER)
    assert ratio[1] > 1.1 and z[1] < 2.0


def test_too_short_a_part_says_nothing():
    before = parts(1.0, blocks=5)
    ratio, z = growth([before], [3 * before], [np.ones(len(before), bool)], PER)
    assert np.all(ratio == 1.0) and not z.any()


def surely(effect: float, fitted: float, channels: list[int]) -> float:
    """How surely the second channel grows where an effect of `effect` is in it and `fitted` of it is modelled."""
    rng = np.random.default_rng(3)
    shape = rng.standard_normal((30 * PER, 1)) * np.eye(12)[1]
    noise = rng.standard_normal((30 * PER, 12))
    held = [np.ones(30 * PER, bool)]
    return helps(*growth([noise + (effect - fitted) * shape], [noise + effect * shape], held, PER), channels)


def test_an_effect_that_is_there_helps_in_its_channel():
    assert surely(0.5, 0.5, [1]) > 2.0
    assert surely(0.5, 0.45, [1, 4]) > 2.0


def test_an_effect_that_is_not_there_helps_in_no_channel():
    """Modelled at 0.3 it adds 0.09 to a variance of 1; in channels that it does not act in nothing changes."""
    assert surely(0.0, 0.3, [1]) == 0.0 < HELP_Z
    assert surely(0.5, 0.5, [0, 2]) == 0.0


def test_what_acts_in_no_force_or_moment_is_not_judged_by_them():
    assert surely(0.5, 0.5, []) == np.inf


def test_what_hardly_acts_on_the_held_out_part_cannot_be_judged_there():
    """A tenth of the mean square: 0.32 of the amplitude."""
    held = [np.array([False] * 10 + [True] * 10)]
    for amplitude, judged in ((1.0, True), (0.35, True), (0.3, False), (0.0, False)):
        assert excited([np.repeat([1.0, amplitude], 10)], held) is judged
