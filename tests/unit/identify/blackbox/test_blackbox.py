import numpy as np
import pandas as pd
import pytest

from rotorid_lab.black_box import (
    INPUTS,
    OUTPUTS,
    conformal_coverage,
    conformal_half_width,
    effects_wrench,
    fit_linear,
    fit_ridge_physics,
    fit_thesis_network,
    fit_white_box_effects,
    folds,
    read_experiments,
    samples_of,
    scores,
    stand_wrench,
    thrust_of_throttle,
    white_box,
    within_training,
)
from tests.unit.identify.blackbox.samples import generated_experiments
from tests.unit.vehicle.thesis import D, thesis_vehicle

NEUTRAL = np.concatenate([np.ones(8), np.zeros(4)])


def stand():
    return thesis_vehicle(kind="stand", sensor_position_m=(0, 0, 0.045))


def curve(throttle):
    return 4.7 * np.asarray(throttle) / 0.5


def samples():
    return generated_experiments(stand(), curve, 0.0, 0.0, np.random.default_rng(0))


def test_stand_wrench_by_hand():
    """Two rotors on the left at 2 N, two on the right at 1 N, level: F_z = -6 N, M_x = 2 · 0.0884 · (2 - 1)."""
    found = stand_wrench(stand(), np.array([[1.0, 2, 2, 1]]), np.zeros(1), np.zeros(1))
    np.testing.assert_allclose(found[0, :5], [0, 0, -6, 2 * D, 0], atol=1e-12)
    tilted = stand_wrench(stand(), np.full((1, 4), 1.0), np.array([np.pi / 6]), np.zeros(1))
    # Rolled right by 30 degrees the thrust of 4 N points right (east, +y): 4 sin 30 = 2 N.
    np.testing.assert_allclose(tilted[0, :3], [0, 2, -4 * np.cos(np.pi / 6)], atol=1e-12)


def test_neutral_effects_are_the_white_box():
    table = samples()
    np.testing.assert_allclose(effects_wrench(stand(), table, NEUTRAL), white_box(stand())(table), atol=1e-12)


def test_effects_are_recovered():
    table = samples()
    truth = NEUTRAL + [-0.02, 0.03, 0.01, 0, 0.1, -0.05, 0, 0.02, 0.002, -0.001, 0.01, -0.02]
    table[list(OUTPUTS)] = effects_wrench(stand(), table, truth)
    predict, found, errors = fit_white_box_effects(stand(), table)
    np.testing.assert_allclose(found, truth, atol=1e-6)
    assert errors.max() < 1e-6
    np.testing.assert_allclose(predict(table), table[list(OUTPUTS)], atol=1e-8)


def test_ridge_on_physics_predicts_whole_experiments():
    table = samples()
    masks = folds(table["experiment"].to_numpy(), 6, np.random.default_rng(0))
    held = masks[0]
    predict = fit_ridge_physics(table[~held], table["experiment"].to_numpy()[~held])
    error = predict(table[held]) - table.loc[held, list(OUTPUTS)].to_numpy()
    assert np.abs(error[:, :3]).max() < 0.03


def test_folds_keep_experiments_whole():
    numbers = np.repeat(np.arange(10), 3)
    masks = folds(numbers, 4, np.random.default_rng(0))
    assert np.sum(masks, axis=0).tolist() == [1] * 30
    for mask in masks:
        assert not set(numbers[mask]) & set(numbers[~mask])


def test_scores_by_hand():
    measured, predicted = np.array([[0.0], [2.0], [4.0], [2.5]]), np.array([[0.0], [2.0], [1.0], [2.5]])
    found = scores(measured, predicted, np.array([0, 0, 1, 1]), np.random.default_rng(0))
    # Errors 0, 0, 3, 0; mean 2.125, squares about it 4.515625 + 0.015625 + 3.515625 + 0.140625 = 8.1875.
    assert found["rmse"][0] == pytest.approx(1.5) and found["r2"][0] == pytest.approx(1 - 9 / 8.1875)


def test_conformal_width_by_hand():
    """19 experiments with errors 1 to 19: for 95 % of 20 (one unseen) the largest, 19; for 50 % the tenth."""
    error, numbers = np.arange(1.0, 20)[:, None], np.arange(19)
    assert conformal_half_width(error, numbers, 0.95)[0] == 19
    assert conformal_half_width(error, numbers, 0.50)[0] == 10
    assert conformal_half_width(error, numbers, 0.99)[0] == np.inf


def test_conformal_intervals_cover_new_experiments():
    rng = np.random.default_rng(0)
    numbers = np.repeat(np.arange(60), 4)
    # Samples of an experiment share their error, so samples are not exchangeable but experiments are.
    error = np.repeat(rng.normal(size=(60, 1)), 4, axis=0) + 0.1 * rng.normal(size=(240, 1))
    masks = folds(numbers, 6, rng)
    _, coverage = conformal_coverage(error, np.zeros_like(error), numbers, masks, 0.9)
    assert coverage[0] == pytest.approx(0.9, abs=0.07)


def test_range_says_what_lies_outside():
    said_of = within_training(samples())
    assert said_of(np.array([1, 1, 1, 1, 0, 0.0])) == "inside the training range"
    assert "the force of motor 2 (N) is 9" in said_of(np.array([1, 9, 1, 1, 0, 0.0]))
    assert "no such combination" in said_of(np.array([0.5, 1.8, 0.5, 1.8, 0.5, 0.5]))


def test_network_learns_and_is_reproducible():
    table = samples()
    a, _, mse = fit_thesis_network(table, 3000, seed=1)
    b, *_ = fit_thesis_network(table, 3000, seed=1)
    np.testing.assert_array_equal(a(table), b(table))
    assert mse[-1].sum() < 0.05 * mse[1].sum()
    linear = fit_linear(table)
    assert linear(table).shape == (len(table), 6)


def test_samples_align_two_clocks():
    """A trapezoid whose wrench clock is 0.25 s ahead: plateau means are right all the same."""
    t = np.arange(0, 14, 0.02)
    throttle = 0.1 * np.clip(np.minimum((t - 1) / 2, (13 - t) / 2), 0, 1)
    quadrotor = pd.DataFrame({"host_time_s": t} | {f"throttle_{i}": throttle for i in (1, 2, 3, 4)})
    when = np.arange(0, 14, 0.01)
    thrust = 4 * curve(0.1 * np.clip(np.minimum((when - 1.25) / 2, (13.25 - when) / 2), 0, 1))
    wrench = pd.DataFrame({"host_time_s": when} | {name: 0.0 * when for name in OUTPUTS})
    wrench["force_z_n"] = 6.4 - thrust
    found = samples_of(1, quadrotor, wrench, curve)
    np.testing.assert_allclose(found["force_z_n"], -4 * curve(0.1), rtol=2e-3)
    np.testing.assert_allclose(found[list(INPUTS[:4])], curve(0.1), rtol=1e-3)
    check_repeats(quadrotor, wrench, found)


def check_repeats(quadrotor: pd.DataFrame, wrench: pd.DataFrame, once: pd.DataFrame) -> None:
    """An experiment recorded twice gives the samples of both, under names of any form."""
    tables = []
    for device, table in (("q", quadrotor), ("w", wrench)):
        samples = pd.concat([table.assign(id=f"{device}{n}", quality=0) for n in (1, 2)], ignore_index=True)
        recordings = pd.DataFrame(
            {"id": [f"{device}1", f"{device}2"], "group": ["mine", "yours"], "experiment": 1, "host_start_s": 5.0}
        )
        tables.append((samples, recordings))
    found = read_experiments(*tables, curve)
    assert len(found) == 2 * len(once) and found["sample"].tolist() == list(range(1, len(found) + 1))


def test_two_thrust_tests_at_one_throttle_count_as_one() -> None:
    points = pd.DataFrame({"throttle": [0.1, 0.2, 0.2], "value": [1.0, 2.0, 4.0]})
    assert thrust_of_throttle(points)(0.2) == pytest.approx(3.0)
