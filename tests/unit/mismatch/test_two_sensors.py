"""A lever arm that the force asks for and the comparison of accelerometer and velocity does not show is none."""

from __future__ import annotations

import numpy as np
import pytest

from rotorid.mismatch.regression import Fit
from rotorid.mismatch.rows import Rows
from rotorid.mismatch.two_sensors import COMPARISONS, refute, shown

from .synthetic import coloured

COLS = np.array([0])
NOISE = np.where(np.isin(np.arange(12), (0, 6)), 1.0, np.nan)


def seen(share: float, noise: float = 1.0, size: int = 4000) -> tuple[list[Rows], Fit]:
    """A term of one sigma in force and comparison, the latter holding `share` of it under slow noise."""
    rng = np.random.default_rng(2)
    y, x = np.full((size, 12), np.nan), np.zeros((size, 12, 1))
    x[:, 0, 0] = x[:, 6, 0] = coloured(size, 1.0, rng, pole=0.9)
    y[:, 0] = x[:, 0, 0] + coloured(size, 1.0, rng, pole=0.9)
    y[:, 6] = share * x[:, 6, 0] + noise * coloured(size, 1.0, rng, pole=0.9)
    fit = Fit(COLS, np.ones(1), np.ones((1, 1)), np.zeros(1), 0.0)
    return [Rows("a", np.arange(size) / 40.0, y, x)], fit


def test_the_share_that_the_comparison_shows():
    """Noise and term of one sigma and 0.9 a row: 4000 rows are worth 4000 · (1 − 0.81)/(1 + 0.81) = 420."""
    rows, fit = seen(0.3)
    share, error = shown(rows, fit, COLS, NOISE, COMPARISONS["accelerometer"])
    assert error == pytest.approx(1 / np.sqrt(420), rel=0.3)
    assert abs(share - 0.3) < 3 * error
    assert shown(rows, fit, COLS, NOISE, COMPARISONS["gyroscope"]) is None


@pytest.mark.parametrize(("share", "noise", "refuted"), [(0.0, 1.0, True), (1.0, 1.0, False), (0.0, 10.0, False)])
def test_only_a_comparison_that_could_have_shown_it_refutes(share, noise, refuted):
    rows, fit = seen(share, noise)
    assert refute(rows, fit, COLS, np.where(np.arange(12) == 6, noise, NOISE)) is refuted
