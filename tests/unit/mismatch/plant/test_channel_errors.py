"""Errors of channels compared by blocks of time."""

import numpy as np

from rotorid.mismatch.plant.comparison import growth

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
