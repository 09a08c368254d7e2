"""Draws of coefficients that limits are read from."""

import numpy as np
import pytest

from rotorid.mismatch.posterior.limits import drawn

FREE = np.full(2, np.inf)


def test_draws_have_the_mean_and_the_covariance_asked_for():
    covariance = np.array([[4.0, -0.003], [-0.003, 1e-5]])
    found = drawn(np.array([1.0, 0.01]), covariance, -FREE, FREE)
    assert found.mean(axis=0) == pytest.approx([1.0, 0.01], abs=0.2)
    unit = np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(np.cov(found.T) / np.outer(unit, unit), covariance / np.outer(unit, unit), atol=0.1)


def test_rounding_does_not_move_a_draw():
    """Eigenvectors of nearly equal variances turn anyhow by rounding; the draws do not."""
    covariance = np.array([[1.0, 1e-13], [1e-13, 1.0]])
    away = drawn(np.zeros(2), covariance, -FREE, FREE) - drawn(
        np.zeros(2), covariance.T * [[1, -1], [-1, 1]], -FREE, FREE
    )
    assert np.abs(away).max() < 1e-10


def test_draws_beyond_the_bounds_are_moved_to_them():
    found = drawn(np.zeros(2), np.eye(2), np.array([-0.5, -np.inf]), np.array([np.inf, 0.25]))
    assert found[:, 0].min() == -0.5 and found[:, 1].max() == 0.25
