"""Height without its sensor's flutter."""

import numpy as np
import pytest

from rotorid.mismatch.plant.motion import quiet_height

DT_S = 0.004
TIME_S = DT_S * np.arange(2500)
TRUE_M = 0.5 - 0.4 * np.sin(0.6 * TIME_S) ** 2 + 0.005 * np.sin(20 * TIME_S)
CLIMB_M_S = np.gradient(TRUE_M, DT_S)


def noisy(size_m: float) -> np.ndarray:
    return TRUE_M + size_m * np.random.default_rng(0).standard_normal(len(TRUE_M))


def test_the_flutter_goes_and_what_moves_stays():
    """White noise of 8 mm at 250 Hz through 1 Hz: σ √(1 / (2 √π · 0.1325 s · 250 Hz)) = 0.74 mm."""
    left = quiet_height(noisy(0.008), CLIMB_M_S, DT_S) - TRUE_M
    assert left.std() == pytest.approx(0.00074, rel=0.35) and abs(left).max() < 0.004


def test_a_bias_of_the_climb_hardly_moves_it():
    """0.05 m/s too much of climb: the slow part takes it back, at the ends later by 0.11 s times the bias."""
    found = quiet_height(TRUE_M, CLIMB_M_S + 0.05, DT_S)
    np.testing.assert_allclose(found[250:-250], TRUE_M[250:-250], atol=2e-5)
    assert abs(found - TRUE_M).max() < 0.007


def test_without_a_climb_only_the_fast_goes():
    slow = 0.5 - 0.4 * np.sin(0.6 * TIME_S) ** 2
    np.testing.assert_allclose(quiet_height(slow, None, DT_S)[100:-100], slow[100:-100], atol=6e-4)


def test_holes_stay_holes():
    holed = noisy(0.0)
    holed[500:600] = np.nan
    found = quiet_height(holed, CLIMB_M_S, DT_S)
    assert np.isnan(found[500:600]).all()
    np.testing.assert_allclose(found[600:], TRUE_M[600:], atol=1e-4)
    assert np.isnan(quiet_height(np.full(9, np.nan), None, DT_S)).all()
