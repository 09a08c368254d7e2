"""Points off a line: found however many hide each other, and none found in good data beyond the stated level."""

import numpy as np
import pytest

from rotorid.identify.bench.loadcell import FLAG_LEVEL, find_outliers

WEIGHTS = np.repeat([35.7, 72.3, 108.5, 255.1, 343.4, 500.5, 751.0, 957.5], 3)
SLOPE, SCATTER_GF = 40.0, 0.07


def readings(weights: np.ndarray, seed: int) -> np.ndarray:
    return (weights + np.random.default_rng(seed).normal(0, SCATTER_GF, len(weights))) / SLOPE


@pytest.mark.parametrize("unloaded", [[0], [23], [0, 1, 2], [21, 22, 23], [0, 12, 23], list(range(16, 24))])
def test_readings_without_their_load_are_found_and_no_others(unloaded) -> None:
    x = readings(WEIGHTS, 1)
    x[unloaded] = 1e-3
    found = find_outliers(x, WEIGHTS, len(x))
    assert list(np.flatnonzero(found.flagged)) == unloaded
    assert found.line.a1 == pytest.approx(SLOPE, rel=1e-3)
    assert (np.abs(found.studentised[unloaded]) > 100).all() and found.limit < 10


def test_two_of_eight_that_hide_each_other() -> None:
    weights = WEIGHTS[::3]
    x = readings(weights, 2)
    x[[6, 7]] = x[[7, 6]]
    assert list(np.flatnonzero(find_outliers(x, weights, len(x)).flagged)) == [6, 7]


def test_the_studentised_residual_is_that_of_the_line_of_the_others() -> None:
    # 0, 1, 2, 3, 4 → 0, 1, 2, 3.1, 9: without the last, slope 1.03, intercept −0.02, residual 9 − 4.1 = 4.9,
    # scatter √(0.0030/2), its place grows it by √(1 + 1/4 + 2.5²/5).
    found = find_outliers([0, 1, 2, 3, 4], [0, 1, 2, 3.1, 9], 5)
    assert found.studentised[4] == pytest.approx(4.9 / np.sqrt(0.0030 / 2 * (1 + 1 / 4 + 2.5**2 / 5)))
    assert found.flagged.tolist() == [False] * 4 + [True]


def test_good_calibrations_are_flagged_no_more_often_than_stated() -> None:
    flagged = 0
    for seed in range(400):
        weights = WEIGHTS[::3] if seed % 2 else WEIGHTS
        flagged += find_outliers(readings(weights, seed), weights, len(weights)).flagged.any()
    assert flagged <= 400 * FLAG_LEVEL + 3 * np.sqrt(400 * FLAG_LEVEL)


def test_what_is_too_little_to_test_says_so() -> None:
    assert not find_outliers([0, 1, 2], [0, 1, 9], 3).tested
    assert not find_outliers([1, 1, 1, 1, 1, 1, 1, 2], [0, 0, 0, 0, 0, 0, 0, 9], 8).tested


def test_exact_readings_are_no_outliers_for_their_last_digits() -> None:
    x = WEIGHTS / SLOPE
    assert not find_outliers(x, WEIGHTS, len(x)).flagged.any()
    x[5] += 0.1
    assert list(np.flatnonzero(find_outliers(x, WEIGHTS, len(x)).flagged)) == [5]
