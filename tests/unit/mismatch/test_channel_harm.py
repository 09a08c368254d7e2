"""What is delivered may leave no channel worse on the held-out part than the believed vehicle does."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rotorid.mismatch import channel_harm, fitted
from rotorid.mismatch.channel_errors import about_means, excited, growth, harmed, helps, smaller
from rotorid.mismatch.channel_harm import HELP_Z, costs_more, fitted_anew, within_bounds, without_useless
from rotorid.mismatch.fitted import refined_model, turning
from rotorid.mismatch.prepare import prepare

from .flights import recorded

PER = 10


def parts(scale: float, blocks: int = 20, seed: int = 0) -> np.ndarray:
    """Residual (n, 12) of which the second channel is `scale` times noise of one sigma."""
    left = np.random.default_rng(seed).standard_normal((blocks * PER, 12))
    left[:, 1] *= scale
    return left


def test_a_channel_twice_as_large_is_harmed_and_no_other():
    before = parts(1.0)
    after = before * np.array([1.0, 2.0, *[0.5] * 10])
    ratio, z = growth([before], [after], [np.ones(len(before), bool)], PER)
    assert np.allclose(ratio, [1.0, 2.0, 0.5, 0.5, 0.5, 0.5])
    assert harmed(ratio, z).tolist() == [False, True, False, False, False, False]


def test_only_held_out_rows_count():
    before = parts(1.0)
    after = before.copy()
    after[: 10 * PER, 1] *= 5.0
    held = np.arange(len(before)) >= 10 * PER
    ratio, z = growth([before], [after], [held], PER)
    assert np.allclose(ratio, 1.0) and not harmed(ratio, z).any()
    assert harmed(*growth([before], [after], [~held], PER))[1]


def test_one_bad_second_of_twenty_is_no_proof_of_harm():
    before = parts(1.0)
    after = before.copy()
    after[:PER, 1] *= 8.0
    ratio, z = growth([before], [after], [np.ones(len(before), bool)], PER)
    assert ratio[1] > 1.1 and not harmed(ratio, z).any()


def test_too_short_a_held_out_part_says_nothing():
    before = parts(1.0, blocks=5)
    ratio, z = growth([before], [3 * before], [np.ones(len(before), bool)], PER)
    assert np.all(ratio == 1.0) and not harmed(ratio, z).any()


def test_of_two_residuals_each_channel_has_the_one_that_is_smaller_where_it_is_held_out():
    one, other = parts(2.0), parts(1.0, seed=1)
    other[:, 2] *= 3.0
    held = np.arange(len(one)) >= 10 * PER
    other[~held, 1] *= 9.0  # large where it was fitted, which must not count
    least = smaller([one], [other], [held])[0]
    assert np.array_equal(least[:, 1], other[:, 1]) and np.array_equal(least[:, 2], one[:, 2])


def surely(effect: float, fitted: float, channels: list[int]) -> float:
    """How surely the second channel grows where an effect of `effect` is in it and `fitted` of it is modelled."""
    rng = np.random.default_rng(3)
    shape = rng.standard_normal((30 * PER, 1)) * np.eye(12)[1]
    noise = rng.standard_normal((30 * PER, 12))
    held = [np.ones(30 * PER, bool)]
    return helps(*growth([noise + (effect - fitted) * shape], [noise + effect * shape], held, PER), channels)


def test_an_effect_that_is_there_helps_in_its_channel():
    assert surely(0.5, 0.5, [1]) > 2.0
    assert surely(0.5, 0.45, [1, 4]) > 2.0


def test_an_effect_that_is_not_there_helps_in_no_channel():
    """Modelled at 0.3 it adds 0.09 to a variance of 1; in channels that it does not act in nothing changes."""
    assert surely(0.0, 0.3, [1]) == 0.0 < HELP_Z
    assert surely(0.5, 0.5, [0, 2]) == 0.0


def test_what_acts_in_no_force_or_moment_is_not_judged_by_them():
    assert surely(0.5, 0.5, []) == np.inf


def test_means_are_those_of_the_held_out_rows_of_each_run():
    parts = [np.full((4, 12), 1.0), np.full((4, 12), 3.0), np.full((2, 12), 7.0)]
    held = [np.array([True] * 4), np.array([True] * 4), np.array([False] * 2)]
    left = about_means(["a", "a", "b"], parts, held)
    assert [x[0, 0] for x in left] == [-1.0, 1.0, 7.0]


def test_what_hardly_acts_on_the_held_out_part_cannot_be_judged_there():
    """A tenth of the mean square: 0.32 of the amplitude."""
    held = [np.array([False] * 10 + [True] * 10)]
    for amplitude, judged in ((1.0, True), (0.35, True), (0.3, False), (0.0, False)):
        assert excited([np.repeat([1.0, amplitude], 10)], held) is judged


@pytest.mark.parametrize(
    "own, other, costs",
    [(1.5, 1.0, False), (1.3, 0.25, True), (1.3, 0.85, False), (0.8, 1.0, True), (6.0, 0.25, False)],
)
def test_an_effect_that_costs_another_channel_more_than_it_brings_its_own_is_of_no_use(own, other, costs):
    """Errors of its own channel (5) and another (0) where it is left out, beside those with it."""
    with_it = parts(1.0)
    left = with_it * np.array([other, 1.0, 1.0, 1.0, 1.0, own, *[1.0] * 6])
    held = [np.ones(len(left), bool)]
    assert costs_more(growth([with_it], [left], held, PER), growth([left], [with_it], held, PER), [5]) is costs


def test_an_effect_is_of_use_where_another_is_beyond_its_bounds_without_it(monkeypatch):
    """Rotors that are alike: their difference is useless, unless drag would be beyond what is possible without it."""
    prepared = prepare(recorded(1, 2, flight={"drag": 0.5, "duration_s": 15.0}))
    drag, spare = "rotor_drag/at the centre of mass", "unequal_rotors/thrust"
    model = fitted_anew(refined_model(prepared, *turning(prepared)), [drag, spare])
    assert within_bounds(model)
    kept, _ = without_useless(prepared, model, {}, lambda *_: {})
    assert kept.selection.active == [drag]

    def only_with_the_spare(model):
        column = model.regression.columns([drag])[0]
        beta = model.selection.fit.beta.copy()
        if spare not in model.selection.active:
            beta[model.selection.fit.columns == column] = -1.0  # a drag that pushes
        fit = replace(model.selection.fit, beta=beta)
        return within_bounds(replace(model, selection=replace(model.selection, fit=fit)))

    monkeypatch.setattr(channel_harm, "within_bounds", only_with_the_spare)
    kept, _ = without_useless(prepared, model, {}, lambda *_: {})
    assert kept.selection.active == [drag, spare]


def test_what_was_right_only_beside_a_useless_effect_is_looked_at_again(monkeypatch):
    """A spare effect bears a leaning one: harm is asked for once more without the spare, use without the leaning."""

    def model_with(active):
        return SimpleNamespace(selection=SimpleNamespace(active=active))

    def useless(prepared, model, values, values_of):
        active = [k for k in model.selection.active if k != "spare"]
        return model_with(active if "leaning" in active else [k for k in active if k != "with it"]), values

    def harm(prepared, model, values_of, commanded):
        active = model.selection.active
        kept = active if "spare" in active else [k for k in active if k != "leaning"]
        return model_with(kept), {}, values_of, False

    monkeypatch.setattr(fitted, "without_useless", useless)
    monkeypatch.setattr(fitted, "without_harm", harm)
    monkeypatch.setattr(fitted, "without_unsure", lambda model, values, values_of: (model, values))
    model, _ = fitted.borne_out(None, model_with(["drag", "spare", "leaning", "with it"]), {}, None, True)
    assert model.selection.active == ["drag"]
