"""Output error, excitation design and flights with a known answer."""

import numpy as np
import pandas as pd
import pytest

from rotorid.recordings import Run
from rotorid.vehicle.mixer import wrench_matrix
from rotorid_lab.grey_box import cut_windows, fit_output_error, simulate_rates, tied, untied
from rotorid_lab.inertias import band_signals, design, fit_flights, readings_at_hover
from tests.unit.vehicle.thesis import thesis_vehicle

TRUE = np.array([2.489e-3, 2.5743e-3, 4.6838e-3])
DT = 0.004


def flight(seconds=40.0, seed=0):
    """Rates of the plain model under smooth random moments on all axes, one long window."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, seconds, DT)
    moments = np.zeros((1, len(t), 3))
    for axis, size in enumerate((0.03, 0.03, 0.02)):
        for f in rng.uniform(1, 5, 8):
            moments[0, :, axis] += size * np.sin(2 * np.pi * f * t + rng.uniform(0, 6.28)) / 3
    return simulate_rates(tied(np.log(TRUE)), np.zeros((1, 3)), moments, DT)[0], moments[0]


def test_constant_moment_turns_at_a_constant_rate():
    """τ = 0.01 N m about z for 1 s: r = 0.01 / 4.6838e-3 = 2.13502 rad/s, by hand."""
    moments = np.zeros((1, 251, 3))
    moments[..., 2] = 0.01
    rates = simulate_rates(tied(np.log(TRUE)), np.zeros((1, 3)), moments, DT)
    np.testing.assert_allclose(rates[0, -1], [0, 0, 2.135019], atol=1e-6)


@pytest.mark.parametrize("window_moment", [False, True])
def test_noise_free_flight_gives_the_inertias_back(window_moment):
    rates, moments = flight()
    windows = cut_windows(rates, moments, DT, 0.5)
    fit = fit_output_error(*windows, DT, tied, np.log(TRUE * [1.3, 0.8, 1.2]), window_moment)
    # What is left is the interpolation of the moments at the windows' ends.
    np.testing.assert_allclose(fit.inertias, TRUE, rtol=2e-5)
    free = fit_output_error(*windows, DT, untied, np.concatenate([np.log(TRUE), np.zeros(3)]))
    np.testing.assert_allclose(free.parameters[3:], [-0.8475, 0.8526, -0.0182], atol=1e-3)


def test_intervals_cover_under_noise():
    rates, moments = flight(20.0)
    inside = []
    for seed in range(60):
        noisy = rates + 0.02 * np.random.default_rng(seed).normal(size=rates.shape)
        fit = fit_output_error(*cut_windows(noisy, moments, DT, 0.5), DT, tied, np.log(TRUE))
        low, high = fit.inertia_intervals_95.T
        inside.append((low < TRUE) & (high > TRUE))
    assert np.mean(inside) == pytest.approx(0.95, abs=0.05)


def test_noise_of_the_moments_is_taken_off():
    """White noise of 40 % in every moment sample makes the plain estimate too large; stated, it is taken off."""
    rates, moments = flight(200.0)
    sigma = 0.06
    noisy = moments + sigma * np.random.default_rng(1).normal(size=moments.shape)
    windows = cut_windows(rates, noisy, DT, 0.25)
    plain = fit_output_error(*windows, DT, tied, np.log(TRUE)).inertias / TRUE - 1
    mended = fit_output_error(*windows, DT, tied, np.log(TRUE), moment_noise_n_m=np.full(3, sigma)).inertias / TRUE - 1
    assert plain.min() > 0.03
    assert np.abs(mended).max() < 0.4 * plain.min()


def test_windows_with_gaps_are_left_out_and_too_few_are_said():
    rates, moments = flight(4.0)
    rates = rates.copy()
    rates[100] = np.nan
    windows = cut_windows(rates, moments, DT, 0.5)
    assert np.isfinite(windows[0]).all() and len(windows[0]) == 6
    few = tuple(part[:2] for part in windows)
    with pytest.raises(ValueError, match="2 windows cannot distinguish 3 parameters"):
        fit_output_error(*few, DT, tied, np.log(TRUE))


def test_designed_excitation_keeps_its_limits_and_beats_a_first_guess():
    vehicle = thesis_vehicle()
    wanted = (550.0, 1550.0), np.radians(12), (10, 40), 10.0
    readings = readings_at_hover(vehicle, 0.02, 0.005, 250.0)
    first, first_errors = design(vehicle, *wanted, readings, 4, np.random.default_rng(0))
    best, errors = design(vehicle, *wanted, readings, 80, np.random.default_rng(0))
    target = np.repeat([0.04, 0.001], 3)
    assert np.max(errors / target) < np.max(first_errors / target)
    t = np.arange(0, 10, 0.01)
    wrench = np.column_stack([np.full(len(t), 0.652 * 9.81), best.moment(t)])
    speed = np.sqrt(np.linalg.solve(wrench_matrix(vehicle), wrench.T))
    # The search looks at twelve instants of the fastest sine; between them a peak may stand out by a little.
    assert speed.min() > 0.98 * 550 and speed.max() < 1.02 * 1550
    assert np.degrees(np.abs(best.integral(t, 2) / TRUE)[:, :2].max()) < 12.1


def test_multisine_integrals_are_integrals():
    vehicle = thesis_vehicle()
    wanted = (550.0, 1550.0), np.radians(12), (10, 20), 10.0
    best, _ = design(vehicle, *wanted, readings_at_hover(vehicle, 0.02, 0.005, 250.0), 4, np.random.default_rng(0))
    t = np.array([0.5, 0.5 + 1e-5])
    slope = np.diff(best.integral(t, 1), axis=0)[0] / 1e-5
    np.testing.assert_allclose(slope, best.moment(t).mean(axis=0), rtol=1e-6, atol=1e-9)


def test_flight_bounds_hold_the_truth():
    """Rates and speeds with independent noise: bounds in order, the interval holds the truth."""
    vehicle = thesis_vehicle()
    rates, moments = flight(60.0, seed=3)
    wrench = np.column_stack([np.full(len(moments), 0.652 * 9.81), moments])
    speeds = np.sqrt(np.linalg.solve(wrench_matrix(vehicle), wrench.T).T)
    rng = np.random.default_rng(0)
    table = {"time_s": DT * np.arange(len(rates))}
    for i in range(4):
        table[f"rotor_speed_{i + 1}_rad_s"] = speeds[:, i] * (1 + 0.01 * rng.normal(size=len(rates)))
    for k, a in enumerate("xyz"):
        table[f"angular_velocity_{a}_rad_s"] = rates[:, k] + 0.05 * rng.normal(size=len(rates))
    part = band_signals(Run("flight", pd.DataFrame(table)), vehicle, (1.0, 6.0), 0.0, 250.0)
    fits = fit_flights([part], 250.0, 1.0, rng)
    for fit, true in zip(fits[:2], TRUE[:2], strict=True):
        assert fit["lower"] < fit["estimate"] < fit["upper"]
        assert fit["interval_95"][0] < true < fit["interval_95"][1] and fit["r2"] > 0.9
