"""Derivatives of what a candidate leaves: found where they are, absent where they are not, never driving."""

import numpy as np
import pytest

from rotorid.mismatch.delivery.derivatives import learn
from rotorid.vehicle.derivatives import CHANNELS, QUANTITIES

N, FOLDS = 3000, 6
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


def test_two_folds_are_too_few_and_a_channel_that_was_not_recorded_has_none():
    assert learn(flown(6), left(6, force_x_by_u=-0.2), FOLD // 3).derivatives == ()
    y = left(6, force_x_by_u=-0.2, moment_x_by_p=-0.2)
    y[:, 3:] = np.nan
    assert {d.channel for d in learn(flown(6), y, FOLD).derivatives} == {"force_x"}
