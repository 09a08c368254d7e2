"""The calibration matrix against a bench whose answer is known."""

import numpy as np
import pytest

from rotorid.errors import InputError
from rotorid_lab.bench_tests import calibrate

RESPONSE = np.array([[1.0, 0, 0], [0, 2.0, 0], [0, 0, -4.0], [1, 1, 0], [0, 1, 1], [1, 0, 1]]) * 1e-5


def loads() -> np.ndarray:
    sizes = np.array([0.5, 1, 2, 3, 4, 5])
    return np.concatenate([np.outer(sizes, direction) for direction in ([1, 0, 0], [0, 1, 0], [0, 0, -1])])


def test_combined_loads_come_back() -> None:
    rng = np.random.default_rng(0)
    found = calibrate(loads() @ RESPONSE.T + rng.normal(0, 1e-9, (18, 6)), loads())
    assert found.response_v_n == pytest.approx(RESPONSE, abs=5e-9)
    together = np.array([[1.0, -2.0, 3.0], [2, 2, -2]])
    assert found.force(together @ RESPONSE.T) == pytest.approx(together, abs=1e-3)


def test_the_stated_uncertainty_is_that_of_repeated_calibrations() -> None:
    rng = np.random.default_rng(1)
    noise, load = 3e-7, np.array([[2.0, 1.0, -3.0]])
    errors, stated, covered = [], [], 0
    for _ in range(600):
        found = calibrate(loads() @ RESPONSE.T + rng.normal(0, noise, (18, 6)), loads())
        reading = load @ RESPONSE.T + rng.normal(0, noise, (1, 6))
        errors.append((found.force(reading) - load)[0])
        stated.append(np.diagonal(found.force_covariance(load, np.full(6, noise))[0]))
        covered += np.mean(np.abs(found.response_v_n - RESPONSE) <= found.response_interval())
    assert np.sqrt(np.mean(stated, axis=0)) == pytest.approx(np.std(errors, axis=0), rel=0.1)
    assert covered / 600 == pytest.approx(0.95, abs=0.01)


def test_loads_along_two_axes_only_are_refused() -> None:
    with pytest.raises(InputError, match="cover all three directions"):
        calibrate(np.ones((6, 6)), np.array([[1.0, 0, 0], [2, 0, 0], [3, 0, 0], [0, 1, 0], [0, 2, 0], [0, 3, 0]]))
