"""The posterior over changes on small made-up sets, and what the first set says of the second's columns. By how much
flights differ in which nothing changed.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.changes.joint import within_bounds
from rotorid.mismatch.changes.problem import (
    at_own_noise,
    decide_changes,
    feigned,
    form_spread,
    hidden_in,
    pair_of,
    share_of_form,
    usual_spread,
)
from rotorid.mismatch.decide.problem import Prior
from rotorid.mismatch.decide.statements import statements_of, visited_instead
from rotorid.mismatch.evidence.gram import EvidenceTerm, LinearParameter
from tests.unit.mismatch.decide.test_posterior import OFFSET, effect, flight

DRAG, LIFT = "drag/plain", "lift/plain"
TERMS = (OFFSET, effect(DRAG), effect(LIFT), effect("both/plain"))


def made(beta: list[float], seed: int, noise: float = 1.0):
    """A set whose residual is `beta` times its columns; the last column is the sum of the two before it."""
    own = flight([*beta, 0.0], TERMS, seed, noise=noise)
    x = own.x.copy()
    x[:, :, 3] = x[:, :, 1] + x[:, :, 2]
    return replace(own, x=x, y=own.y - own.x @ [*beta, 0.0] + x @ [*beta, 0.0]).evidence()


def decided(new, spread: float = 0.0):
    return decide_changes(made([0.0, 0.5, 0.0], 1), new, np.array([0.0, spread, spread, spread]))


def test_what_both_sets_have_is_no_change_and_what_one_has_more_is():
    assert decided(made([0.0, 0.5, 0.0], 2)).model == ()
    assert decided(made([0.0, 0.9, 0.0], 2)).model == (DRAG,)


@pytest.mark.parametrize("spread", [0.0, 0.2])
def test_noise_of_a_column_makes_no_change_smaller(spread):
    """A fifth of the column's squares is noise; without the correction the change of 2 reads 1.6."""
    share, (own, new) = 0.2, (flight([0.0, b, 0.0], TERMS[:3], seed, noise=0.3) for b, seed in ((0.5, 1), (2.5, 2)))

    def seen(of, seed: int, known: bool):
        noise = np.zeros(3)
        noise[1] = share / (1.0 - share) * np.mean(of.x[:, :, 1] ** 2)
        shaken = of.x + np.sqrt(noise) * np.random.default_rng(seed).normal(size=of.x.shape)
        bias = np.diag(noise) * of.y.size * known
        return replace(replace(of, x=shaken).evidence(), bias_gram=bias[None])

    def size(known: bool) -> float:
        found = decide_changes(seen(own, 3, known), seen(new, 4, known), np.array([0.0, spread, spread]))
        (said,) = statements_of(found, of_change=True)
        return said.parameters[0].value

    assert size(False) < 1.7
    assert size(True) == pytest.approx(2.0, abs=0.1)


def test_what_an_effect_brings_about_costs_nothing_next_to_it():
    new, brings = made([0.0, 0.9, 0.0], 2), {DRAG: ("lift",)}
    bringing = replace(new, terms=tuple(replace(t, brings=brings.get(t.key, ())) for t in new.terms))
    plain, free = decided(new).posterior, decided(bringing).posterior
    assert free((DRAG, LIFT)) - plain((DRAG, LIFT)) == pytest.approx(Prior().effect_nats)
    assert free((LIFT,)) == pytest.approx(plain((LIFT,)))


def scattered(sizes, seed: int):
    """A set whose drag is another in each environment: half of one and `sizes`, by turns."""
    own = flight([0.0, 0.0, 0.0, 0.0], TERMS, seed)
    x = own.x.copy()
    x[:, :, 3] = x[:, :, 1] + x[:, :, 2]
    block = np.arange(len(x)) // 10
    drag = 0.5 + np.asarray(sizes)[block % len(sizes)]
    return replace(own, x=x, y=own.y + drag[:, None] * x[:, :, 1]).evidence()


@pytest.mark.parametrize("sizes, stays", [([0.8], True), ([0.0] * 8 + [3.0], False)])
def test_a_change_is_compared_with_the_leftover_that_would_explain_it(sizes, stays):
    """The same in every environment, or all of it in one of nine: the latter is more probably leftover."""
    pair = pair_of(made([0.0, 0.5, 0.0], 1), scattered(sizes, 2), np.zeros(4))
    found = pair.at((DRAG,), np.zeros(1))
    assert found.log_posterior - found.posterior(()) > 5.0
    compared, _ = pair.against_leftover(found)
    assert compared.model == ((DRAG,) if stays else ())
    assert bool(compared.problem.variance.any()) is not stays


def test_a_change_is_stated_no_more_surely_than_its_equation_holds():
    found = decided(made([0.0, 9.0, 0.0], 2))
    plain, with_form = (statements_of(found, form_sd=own)[0].parameters[0] for own in (0.0, 0.02))
    assert with_form.value == plain.value == pytest.approx(8.5, abs=0.3)
    of_form = 1.96 * 0.02 * plain.value
    assert with_form.high - with_form.value == pytest.approx(np.hypot(plain.high - plain.value, of_form), rel=0.01)


def test_a_change_far_beyond_what_flights_differ_by_is_not_drawn_to_nothing():
    """Ten times as large as flights differ by, and a hundred times as large as a row's noise."""
    (said,) = statements_of(decided(made([0.0, 100.5, 0.0], 2), spread=10.0))
    (size,) = said.parameters
    assert size.value == pytest.approx(100.0, rel=0.03) and size.low < 100.0 < size.high


def test_a_second_set_with_more_noise_has_its_own():
    """With four times the noise all products are a sixteenth; a change three times its error is found all the same."""
    base, noisy = made([0.0, 0.5, 0.0], 1), made([0.0, 0.9, 0.0], 2, noise=4.0)
    scaled, nats = at_own_noise(base, noisy)
    np.testing.assert_allclose(scaled.gram, noisy.gram / 16.0, rtol=0.15)
    assert nats == pytest.approx(noisy.blocks.sum() * base.square.sum() / base.blocks.sum() * np.log(4.0), rel=0.3)
    alike, none = at_own_noise(base, made([0.0, 0.9, 0.0], 2, noise=0.5))
    assert none == 0.0 and np.array_equal(alike.gram, made([0.0, 0.9, 0.0], 2, noise=0.5).gram)
    assert decided(made([0.0, 2.5, 0.0], 2, noise=4.0)).model == (DRAG,)
    assert decided(made([0.0, 0.5, 0.0], 2, noise=4.0)).model == ()


def test_an_effect_may_stand_for_several_but_what_is_stated_itself_is_no_rival():
    found = decided(made([0.0, 1.0, 0.85], 2))
    assert found.model == ("both/plain", LIFT)
    plain, classes = ({s.id: s for s in statements_of(found, several)} for several in (False, True))
    assert plain["both"].alternatives == classes["both"].alternatives == ("both", "drag")
    assert classes["lift"].status == plain["lift"].status == "suggested"
    assert visited_instead(found, {found.model: 0.9, (DRAG, LIFT): 0.05, ("both/plain",): 0.05}) == {"drag"}


def test_a_change_stays_within_what_is_physical_given_what_the_first_set_has():
    def term(low: float) -> EvidenceTerm:
        return EvidenceTerm(DRAG, "effect", "drag", 1, (np.inf,), linear=(LinearParameter("k", "1", low, 9.0, 0.0),))

    new = replace(made([0.0, 0.5, 0.0], 2), terms=(OFFSET, term(0.0), *TERMS[2:]))
    reference = SimpleNamespace(evidence=new, known=np.array([0.0, 0.5, 0.0, 0.0]))
    bounded = next(t for t in within_bounds(new, reference).terms if t.key == DRAG)
    assert bounded.of_change and -0.7 < bounded.linear[0].low < -0.5
    still = replace(new, gram=new.gram * (np.arange(4) != 1), cross=new.cross * (np.arange(4) != 1))
    unseen = SimpleNamespace(evidence=still, known=np.zeros(4))
    assert np.isinf(next(t for t in within_bounds(new, unseen).terms if t.key == DRAG).linear[0].low)


def test_of_a_derivative_of_speeds_noise_may_hide_as_much_as_there_is():
    little, more = (hidden_in(made([0.0, 0.5, 0.0], 1, noise), np.zeros(4))[1] for noise in (0.02, 0.04))
    assert more == pytest.approx(4.0 * little, rel=0.05)
    much = made([0.0, 0.5, 0.0], 1, noise=30.0)
    by_itself = np.abs(much.cross.sum(axis=(0, 1)) / np.einsum("cekk->k", much.gram))
    assert hidden_in(much, np.zeros(4)) == pytest.approx(by_itself)
    set_of = made([0.0, 0.5, 0.0], 1)
    spun = replace(set_of, terms=(OFFSET, replace(TERMS[1], effect="rotor_acceleration_torque"), *TERMS[2:]))
    usual = [usual_spread(own, own, np.zeros(4), np.ones(1)) for own in (set_of, spun)]
    assert usual[1][1] > usual[0][1]


def form(key: str, unit: str, symbol: str = "b") -> EvidenceTerm:
    """A form of one parameter."""
    parameter = LinearParameter(symbol, unit, -1, 1, 0)
    return EvidenceTerm(key, "effect", key.split("/")[0], 1, (np.inf,), linear=(parameter,))


ZEROS = (form("gyro_error/bias", "rad/s"), form("gyro_error/bias and scale", "rad/s"), form("rotor_drag/plain", "N"))
TURNED = form("gyro_error/misalignment", "rad", "theta")


def test_a_zero_that_two_forms_have_differs_no_more_than_one_that_one_form_has():
    """Their columns are the same: what they differ by together is the root of the sum of their squares."""
    made = flight([0.0, 0.0, 0.0, 0.0], (*ZEROS, TURNED)).evidence()
    spread = usual_spread(made, made, np.zeros(4), np.ones(1))
    usual = catalogue()["gyro_error"].between_flights
    assert np.hypot(spread[0], spread[1]) == pytest.approx(usual["rad/s"])
    assert spread[2] == 0.0 and spread[3] == pytest.approx(usual["rad"])


def test_the_error_of_a_form_is_shared_by_the_forms_that_it_may_look_like():
    made = flight([0.0, 0.0, 0.0], ZEROS).evidence()
    assert share_of_form(made) == pytest.approx([0.5**0.5, 0.5**0.5, 1.0])
    one = form_spread(flight([0.0, 0.0], ZEROS[1:], seed=3).evidence(), np.array([0.0, 1.0]), 0.02)
    three = flight([0.0, 0.0, 0.0], ZEROS, seed=3).evidence()
    shared = form_spread(three, np.array([0.0, 0.0, 1.0]), 0.02)
    assert np.hypot(shared[0], shared[1]) == pytest.approx(one[0], rel=0.1)


def test_a_closed_loop_feigns_a_delay_by_what_the_second_set_leaves_unexplained_more_than_the_first():
    calm, shaken = (flight([0.0, 0.0, 0.0], ZEROS, seed=3, noise=noise).evidence() for noise in (1.0, 3.0))
    assert feigned(calm, calm, np.ones(1)) == pytest.approx(np.zeros(3), abs=1e-9)
    # Columns of a variance of 1.09; what moves a heavier vehicle as much is three times as large a force.
    assert feigned(calm, shaken, np.ones(1)) == pytest.approx(np.full(3, 0.5 * (8 / 1.09) ** 0.5), rel=0.1)
    assert feigned(shaken, calm, np.ones(1)) == pytest.approx(np.zeros(3), abs=1e-9)
    assert (feigned(calm, shaken, np.full(1, 3.0)) < 0.2 * feigned(calm, shaken, np.ones(1))).all()
