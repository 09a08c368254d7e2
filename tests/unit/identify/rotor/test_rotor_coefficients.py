"""Thrust coefficients: hand-computed fits, honest pooling, outliers, lost speeds."""

import numpy as np
import pytest

from rotorid.recordings.mended import lost_speed
from rotorid_lab.rotor import Points, fit_coefficient, fit_exponent, modified_z_scores, pool, rest_reading, usable
from tests.refusals import refused

SPEED = np.array([400.0, 800.0, 1200.0, 1600.0, 2000.0])


def points(thrust, speed=SPEED, run="a") -> Points:
    return (run, np.asarray(speed, float), np.asarray(thrust, float))


def test_through_the_origin_by_hand() -> None:
    # Sum F w² = 1·1 + 3·4 = 13, sum w⁴ = 17 (w in thousands): 13/17; residuals 4/17, -1/17, variance 17/289.
    fit = fit_coefficient([points([1.0, 3.0], [1000.0, 2000.0])], offset=False)
    assert fit.value == pytest.approx(13 / 17 * 1e-6)
    assert fit.standard_error == pytest.approx(np.sqrt(17 / 289 / 17) * 1e-6)
    assert fit.residual_rms_n == pytest.approx(np.sqrt(17 / 289 / 2))
    assert fit.interval_95[1] - fit.value == pytest.approx(12.7062 * fit.standard_error, rel=1e-5)
    assert fit.offsets_n == ()


def test_the_interval_holds_where_fast_points_are_noisier() -> None:
    """Twenty torque tests whose noise grows with the squared speed, as that of a shaken sensor does."""
    rng = np.random.default_rng(2)
    speed = 1575 * (np.arange(1, 21) / 20) ** 0.669
    noise = 0.0006 + 0.0008 * (speed / 1000) ** 2
    held = 0
    for _ in range(1500):
        low, high = fit_coefficient([points(1.8558e-8 * speed**2 + rng.normal(0, noise), speed)], False).interval_95
        held += low <= 1.8558e-8 <= high
    # Three standard errors of a share of 1500; intervals for points of equal noise hold 86 %.
    assert 0.933 < held / 1500 < 0.967


def test_equal_noise_gives_the_usual_formula_by_hand() -> None:
    # As above three points: sum F w² = 1·1 + 3·4 + 8·9 = 85, sum w⁴ = 98; residuals² over two degrees of freedom.
    thrust, square = np.array([1.0, 3.0, 8.0]), np.array([1.0, 4.0, 9.0])
    fit = fit_coefficient([points(thrust, [1000.0, 2000.0, 3000.0])], offset=False, equal_noise=True)
    variance = np.sum((thrust - 85 / 98 * square) ** 2) / 2
    assert fit.standard_error == pytest.approx(np.sqrt(variance / 98) * 1e-6) and fit.freedom == 2


def test_each_run_has_an_offset_of_its_own() -> None:
    runs = [points(1.2e-6 * SPEED**2 - 0.07, run="a"), points(1.2e-6 * SPEED**2 + 0.03, run="b")]
    fit = fit_coefficient(runs, offset=True)
    assert fit.value == pytest.approx(1.2e-6) and fit.offsets_n == pytest.approx((-0.07, 0.03))
    assert fit_coefficient(runs, offset=False).value != pytest.approx(1.2e-6, rel=1e-3)


@pytest.mark.slow
def test_noise_in_the_speed_does_not_bias_and_is_in_the_interval() -> None:
    rng = np.random.default_rng(5)
    speed = np.linspace(400, 2000, 11)
    with_noise, ignoring, hits = [], [], 0
    for _ in range(400):
        read = speed * (1 + rng.normal(0, 0.05, 11))
        run = [points(1.3e-6 * speed**2 + rng.normal(0, 0.02, 11), read)]
        fit = fit_coefficient(run, offset=False, speed_noise_relative=0.05)
        with_noise.append(fit.value)
        ignoring.append(fit_coefficient(run, offset=False).value)
        hits += fit.interval_95[0] < 1.3e-6 < fit.interval_95[1]
    assert np.mean(with_noise) == pytest.approx(1.3e-6, rel=0.004)
    assert abs(np.mean(ignoring) / 1.3e-6 - 1) > 0.005 and np.std(with_noise) < np.std(ignoring)
    assert 0.92 < hits / 400 < 0.98


def test_lost_speeds_are_not_used() -> None:
    speed = np.array([0.0, 3.0, 400.0, 800.0, 1200.0])
    thrust = np.array([0.1, 0.1, 0.16, 0.64, 1.44])
    assert lost_speed(speed, thrust).tolist() == [False, True, False, False, False]
    assert usable(speed, thrust).tolist() == [False, False, True, True, True]
    assert fit_coefficient([points(thrust, speed)], offset=False).value == pytest.approx(1e-6)
    assert not lost_speed(np.zeros(3), np.ones(3)).any()


def test_an_offset_that_lowers_the_small_thrusts_is_not_taken_for_a_lost_speed() -> None:
    assert usable(SPEED, 1.2e-6 * SPEED**2 - 0.15).all()


def test_too_few_points_are_told() -> None:
    refused("runs a: 1 points for 2 unknowns", fit_coefficient, [points([1.0], [1000.0])], offset=True)


def test_the_exponent_of_a_power_law() -> None:
    exponent, (low, high) = fit_exponent([points(1e-6 * SPEED**2.1), points(2e-6 * SPEED**2.1, run="b")])
    assert exponent == pytest.approx(2.1)
    assert low <= 2.1 <= high


def test_pooling_by_hand() -> None:
    # Equal errors s² = 1: Paule-Mandel gives s² + tau² = sample variance = 4, so tau² = 3; mean 0; the
    # Hartung-Knapp error is sqrt(4/3), Student's t for 2 degrees of freedom 4.30265.
    found = pool([-2.0, 0.0, 2.0], [1.0, 1.0, 1.0])
    assert found["value"] == pytest.approx(0, abs=1e-9)
    assert found["between_sd"] == pytest.approx(np.sqrt(3))
    assert found["interval_95"][1] == pytest.approx(4.30265 * np.sqrt(4 / 3), rel=1e-5)
    assert found["prediction_95"][1] == pytest.approx(4.30265 * np.sqrt(3 + 4 / 3), rel=1e-5)


def test_motors_that_agree_have_nothing_between_them() -> None:
    assert pool([1.0, 1.001, 0.999], [0.1, 0.1, 0.1])["between_sd"] == 0.0
    refused("at least two motors, found 1", pool, [1.0], [0.1])


def test_the_pooled_interval_covers_the_mean_of_all_motors() -> None:
    rng = np.random.default_rng(7)
    hits = 0
    for _ in range(1000):
        errors = rng.uniform(0.05, 0.3, 13)
        values = 10 + rng.normal(0, 0.5, 13) + rng.normal(0, errors)
        low, high = pool(values, errors)["interval_95"]
        hits += low < 10 < high
    assert 0.93 < hits / 1000 < 0.97


def test_modified_z_scores_by_hand() -> None:
    # Median 3, absolute deviations 2 1 0 1 97, their median 1.
    assert modified_z_scores([1, 2, 3, 4, 100]) == pytest.approx([-1.349, -0.6745, 0, 0.6745, 65.4265])
    assert (modified_z_scores([1, 1, 1, 5]) == 0).all()


def test_the_rest_reading_by_hand() -> None:
    found = rest_reading([0.0, 0.02])
    assert found["mean_n"] == pytest.approx(0.01)
    assert found["interval_95_n"][1] == pytest.approx(0.01 + 12.7062 * 0.01, rel=1e-5)
    assert rest_reading([0.1]) == {"mean_n": None, "interval_95_n": None, "points": 1}
