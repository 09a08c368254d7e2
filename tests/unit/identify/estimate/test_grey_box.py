"""Appendix A.1's identities, and the estimators on data with a known answer."""

import numpy as np
import pytest

from rotorid_lab.grey_box import (
    MASK,
    check_consistency,
    coefficient,
    fit_coefficient_network,
    fit_least_squares,
    fit_masked_network,
    implied_gyroscopic,
    inertias_of_weights,
    weights_of_inertias,
)
from rotorid_lab.networks import Network, Training

THESIS_INERTIAL = np.array([-1.7592, 0.0076, 4.0810, 401.5602, 388.2557, 218.0455])
TRUE = np.array([2.489e-3, 2.5743e-3, 4.6838e-3])


def linear(w1, w2):
    return Network((np.array(w1)[:, None], np.array(w2)[None]), (None, None), ("linear", "linear"), (None, None))


def test_appendix_a11_thrust():
    network = linear([-0.5311, 0.1014, -1.0462, -0.1708], [-0.4342, -0.6602, -0.7606, -0.1731])
    assert coefficient(network, 5.4669e-4, 0.2133) == pytest.approx(1.38571e-6, rel=1e-5)


def test_appendix_a12_torque():
    network = linear([-0.4279, 1.0063, -0.8083, -0.4139], [-0.3693, 0.5336, -0.0600, -0.5183])
    assert coefficient(network, 6.3486e-4, 20.8333) == pytest.approx(1.85339e-8, rel=1e-5)


def test_appendix_a13_inertias_and_the_contradiction():
    np.testing.assert_allclose(inertias_of_weights(THESIS_INERTIAL), [2.4903e-3, 2.5756e-3, 4.5862e-3], rtol=2e-5)
    np.testing.assert_allclose(implied_gyroscopic(THESIS_INERTIAL), [-0.8074, 0.8138, -0.0186], atol=6e-5)
    np.testing.assert_allclose(weights_of_inertias(TRUE)[:3], [-0.8475, 0.8526, -0.0182], atol=6e-5)


def test_weights_of_inertias_are_consistent_and_a_moved_one_is_not():
    weights = weights_of_inertias(TRUE)
    covariance = np.diag([0.02, 0.02, 0.02, 1.0, 1.0, 1.0]) ** 2
    assert check_consistency(weights, covariance)["p_value"] == pytest.approx(1.0)
    moved = weights + [0.2, 0, 0, 0, 0, 0]
    found = check_consistency(moved, covariance)
    assert found["p_value"] < 1e-10
    # By hand: dw11/dw14 = 1/w25 - 1/w36 = J_yy - J_zz, and so on; sigma = sqrt(0.02² + Σ slope²).
    slopes = [TRUE[1] - TRUE[2], -(TRUE[1] ** 2) / TRUE[0], TRUE[2] ** 2 / TRUE[0]]
    assert found["sigma"][0] == pytest.approx(np.sqrt(0.02**2 + np.sum(np.square(slopes))), rel=1e-9)


def test_p_values_of_the_consistency_test_are_uniform_under_the_null():
    rng = np.random.default_rng(0)
    weights = weights_of_inertias(TRUE)
    covariance = np.diag([0.02, 0.03, 0.01, 0.4, 0.3, 0.2]) ** 2
    draws = rng.multivariate_normal(weights, covariance, 2000)
    p = [check_consistency(w, covariance)["p_value"] for w in draws]
    assert np.mean(np.array(p) < 0.05) == pytest.approx(0.05, abs=0.015)


def test_network_without_noise_finds_the_coefficient():
    speed = np.linspace(200, 1829.2, 50)
    coefficient, *_ = fit_coefficient_network(speed, 1.3877e-6 * speed**2, 4, Training(0.01, 30000, seed=1))
    assert coefficient == pytest.approx(1.3877e-6, rel=1e-4)


def motion(n=4000, seed=0):
    rng = np.random.default_rng(seed)
    rates = rng.normal(0, 3.0, (n, 3))
    moments = rng.normal(0, 0.05, (n, 3))
    weights = weights_of_inertias(TRUE)
    matrix = MASK.copy()
    matrix[range(3), range(3)], matrix[range(3), range(3, 6)] = weights[:3], weights[3:]
    p, q, r = rates.T
    return rates, np.column_stack([q * r, p * r, p * q, moments]) @ matrix.T, moments


def test_least_squares_finds_the_inertias_and_covers():
    rates, accelerations, moments = motion()
    np.testing.assert_allclose(fit_least_squares(rates, accelerations, moments).inertias, TRUE, rtol=1e-9)
    rng = np.random.default_rng(1)
    inside = []
    for _ in range(200):
        noisy = accelerations + rng.normal(0, 1.0, accelerations.shape)
        fit = fit_least_squares(rates, noisy, moments)
        inside.append(np.abs(fit.inertias - TRUE) < 1.96 * fit.inertia_errors)
    assert np.mean(inside) == pytest.approx(0.95, abs=0.03)


@pytest.mark.parametrize("scaled", [False, True])
def test_masked_network_ends_where_least_squares_does(scaled):
    rates, accelerations, moments = motion(500)
    how = Training(0.8, 20000, every=1000)
    fit = fit_masked_network(rates / 10, accelerations / 10, moments, how, scaled)
    expected = fit_least_squares(rates / 10, accelerations / 10, moments).weights
    np.testing.assert_allclose(fit.weights, expected, rtol=1e-6)


def test_epochs_to_settle_are_the_time_constant_of_the_error():
    """One axis alone, constant input 0.1, rate 0.5: the error shrinks by 1 - 0.5 · 0.01 an epoch, 200 epochs to 1/e."""
    rates = np.zeros((10, 3))
    moments = np.full((10, 3), 0.1)
    fit = fit_masked_network(rates, moments * 400, moments, Training(0.5, 200, seed=1))
    np.testing.assert_allclose(fit.epochs_to_settle[3:], 200)
    mse = fit.mse[:, 0]
    assert mse[199] / mse[0] == pytest.approx(np.exp(-2 * 199 / 200), rel=0.01)
