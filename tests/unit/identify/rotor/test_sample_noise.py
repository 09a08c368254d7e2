"""The noise of rotor tests by their samples: growth with speed, and the chi-square of the fit."""

import numpy as np
import pandas as pd
import pytest

from rotorid.identify.rotor.campaign import sample_noise

SPEED = 1600 * (np.arange(1, 21) / 20) ** 0.669


def rotor_tests(rng: np.random.Generator, growth: float, bend: float = 0.0) -> pd.DataFrame:
    """Twenty tests of 490 samples with a tare of 300; the noise grows linearly with the squared speed."""
    noise = 7e-4 * (1 + (growth - 1) * SPEED**2 / SPEED[-1] ** 2)
    value = 1.8558e-8 * SPEED**2 + bend * SPEED
    sd, means = np.empty(20), np.empty(20)
    for k in range(20):
        samples = rng.normal(value[k], noise[k], 490)
        sd[k], means[k] = samples.std(ddof=1), samples.mean() - rng.normal(0, 7e-4, 300).mean()
    return pd.DataFrame(
        {"speed_rad_s": SPEED, "value": means, "value_sd": sd, "samples": 490, "rest_samples": 300.0}
    ).sample(frac=1, random_state=1)


def test_constant_noise_does_not_grow_and_fits() -> None:
    rng = np.random.default_rng(4)
    found = [sample_noise(rotor_tests(rng, 1.0)) for _ in range(200)]
    assert np.mean([f.sd for f in found]) == pytest.approx(7e-4, rel=0.01)
    assert np.mean([f.growth_interval_95[0] <= 1 <= f.growth_interval_95[1] for f in found]) > 0.9
    assert np.mean([f.chi_square for f in found]) == pytest.approx(19, abs=1.5)
    assert {f.freedom for f in found} == {19}
    assert np.mean([f.p_value < 0.05 for f in found]) < 0.12


def test_noise_that_grows_is_seen() -> None:
    found = sample_noise(rotor_tests(np.random.default_rng(5), 2.0))
    # Mean square of the noise over the fastest five tests over that of the slowest five.
    level = (1 + SPEED**2 / SPEED[-1] ** 2) ** 2
    assert found.growth == pytest.approx(np.sqrt(level[-5:].mean() / level[:5].mean()), rel=0.03)
    assert found.growth_interval_95[0] < found.growth < found.growth_interval_95[1]


def test_points_that_are_no_parabola_have_a_small_p() -> None:
    assert sample_noise(rotor_tests(np.random.default_rng(6), 1.0, bend=1e-6)).p_value < 1e-3
