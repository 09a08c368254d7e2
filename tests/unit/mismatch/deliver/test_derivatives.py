"""Derivatives of what a candidate leaves: found where they are, absent where they are not, never driving."""

import numpy as np
import pytest

from rotorid.mismatch.deliver.derivatives import learn
from rotorid.vehicle.derivatives import CHANNELS, QUANTITIES

N, FOLDS = 3000, 6
STATE = QUANTITIES[:7]
FOLD = np.repeat(np.arange(FOLDS), N // FOLDS)


def flown(seed: int) -> np.ndarray:
    """Quantities of six runs, (n, 12): slow velocities and rates, rotors unknown."""
    rng = np.random.default_rng(seed)
    x = np.full((N, len(QUANTITIES)), np.nan)
    x[:, 0] = 1.0
    x[:, 1:7] = rng.normal(size=(N, 6)) * [2.0, 2.0, 1.0, 0.5, 0.5, 0.3]
    return x


def left(seed: int, **slopes: float) -> np.ndarray:
    """What is left of the channels, (n, 6): noise of a tenth, and slopes such as force_x_by_u."""
    x, y = flown(seed), 0.1 * np.random.default_rng(1000 + seed).normal(size=(N, 6))
    for name, slope in slopes.items():
        channel, quantity = name.split("_by_")
        y[:, CHANNELS.index(channel)] += slope * x[:, QUANTITIES.index(quantity)]
    return y


def test_a_drag_is_found_with_its_interval_and_its_range():
    learnt = learn(flown(1), left(1, force_x_by_u=-0.2), FOLD)
    assert {d.channel for d in learnt.derivatives} == {"force_x"}
    drag = next(d for d in learnt.derivatives if d.quantity == "u")
    assert drag.unit == "N s/m" and drag.interval_95[0] < -0.2 < drag.interval_95[1] and abs(drag.value + 0.2) < 0.01
    low, high = np.quantile(flown(1)[:, 1], [0.002, 0.998])
    assert (drag.low, drag.high) == pytest.approx((low, high))


def test_what_is_predicted_was_learnt_without_the_fold():
    x, y = flown(2), left(2, moment_y_by_u=0.3)
    learnt = learn(x, y, FOLD)
    alone = y.copy()
    alone[FOLD == 3] += 0.3  # of this fold alone: what is predicted there must not hang on it
    again = learn(x, alone, FOLD)
    there = FOLD == 3
    assert again.left_out[there, 4] == pytest.approx(learnt.left_out[there, 4], abs=0.01)
    assert (again.of(x) - learnt.of(x))[there, 4].mean() == pytest.approx(0.3 / FOLDS, abs=0.01)


def test_noise_has_no_derivatives():
    found = sum(len({d.channel for d in learn(flown(seed), left(seed), FOLD).derivatives}) for seed in range(40))
    assert found <= 0.02 * 40 * len(CHANNELS)


def test_no_channel_is_driven_by_its_own_motion():
    learnt = learn(flown(3), left(3, force_y_by_v=0.2, force_y_by_p=-0.4), FOLD)
    own, other = (next(d.value for d in learnt.derivatives if d.quantity == q) for q in "vp")
    assert own == 0.0 and other == pytest.approx(-0.4, abs=0.02)


def test_beyond_what_was_flown_a_quantity_is_held():
    learnt = learn(flown(4), left(4, force_x_by_u=-0.2), FOLD)
    far, edge = np.zeros((2, 1, len(QUANTITIES)))
    far[0, :2], edge[0, :2] = (1.0, 50.0), (1.0, next(d.high for d in learnt.derivatives if d.quantity == "u"))
    assert learnt.of(far) == pytest.approx(learnt.of(edge))


def test_what_a_controller_commands_is_no_quantity():
    x = flown(5)
    x[:, 7:] = np.random.default_rng(5).normal(size=(N, 5))
    y = left(5)
    y[:, 2] += 0.5 * x[:, 7]
    assert learn(x, y, FOLD).derivatives == ()


CONTROL = {"moment_y": ("thrust_pitch", 2.0)}


def looped(seed: int, gain: float, disturbed: float, excited: float) -> tuple[np.ndarray, np.ndarray]:
    """Quantities and what is left of a vehicle whose pitch moment is `gain` times as large as believed: its controller
    answers a reference, and cancels a disturbance that nobody recorded."""
    rng, x, y = np.random.default_rng(50 + seed), flown(seed), left(seed)
    reference, wind = excited * rng.normal(size=N), disturbed * rng.normal(size=N)
    asked = (reference - wind) / (2.0 * gain)
    x[:, QUANTITIES.index("thrust_pitch")] = asked
    y[:, 4] += (gain - 1.0) * 2.0 * asked + wind
    return x, y


@pytest.mark.parametrize("gain", [0.6, 0.8, 1.3, 1.8])
def test_a_gain_is_learnt_where_references_move_the_controls(gain):
    found = learn(*looped(1, gain, 0.1, 1.0), FOLD, CONTROL).derivatives
    own = next(d for d in found if d.quantity == "thrust_pitch")
    assert own.unit == "N m" and own.value / 2.0 + 1.0 == pytest.approx(gain, abs=0.05)
    assert {d.channel for d in found} == {"moment_y"}


@pytest.mark.parametrize("gain", [0.8, 1.0, 1.2])
def test_what_a_controller_cancels_is_no_gain(gain):
    assert not [d for d in learn(*looped(2, gain, 1.0, 0.2), FOLD, CONTROL).derivatives if d.quantity not in STATE]


def test_two_folds_are_too_few_and_a_channel_that_was_not_recorded_has_none():
    assert learn(flown(6), left(6, force_x_by_u=-0.2), FOLD // 3).derivatives == ()
    y = left(6, force_x_by_u=-0.2, moment_x_by_p=-0.2)
    y[:, 3:] = np.nan
    assert {d.channel for d in learn(flown(6), y, FOLD).derivatives} == {"force_x"}


def test_a_side_force_of_the_day_is_left_out_and_what_goes_with_the_airspeed_stays():
    random = np.random.default_rng(3)
    fold = np.repeat(np.arange(6), 100)
    x = np.full((600, 12), np.nan)
    x[:, 0], x[:, 1:4] = 1.0, random.standard_normal((600, 3)) + [0.5, 0.0, 0.0]
    y = np.zeros((600, 6))
    y[:, 0] = 0.1 - 0.3 * x[:, 1] + 0.01 * random.standard_normal(600)
    y[:, 3] = 0.02 + 0.001 * random.standard_normal(600)
    made = {day: {(d.channel, d.quantity): d.value for d in learn(x, y, fold, {}, day).derivatives} for day in (0, 1)}
    assert made[0]["force_x", "constant"] == pytest.approx(0.1, abs=0.02)
    assert made[1]["force_x", "constant"] == pytest.approx(0.0, abs=1e-9)
    assert made[1]["force_x", "u"] == pytest.approx(-0.3, abs=0.02)
    assert made[1]["moment_x", "constant"] == pytest.approx(0.02, abs=0.001)
    left = learn(x, y, fold, {}, True).left_out
    assert np.quantile(np.abs(left[:, 0] + 0.3 * x[:, 1]), 0.99) < 0.02
