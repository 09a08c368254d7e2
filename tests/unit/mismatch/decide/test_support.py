"""What survives when the seconds of a recording are weighed anew: a steady name, a class, one that comes and goes."""

import numpy as np
import pytest

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.decide.enough import _at_the_end_of_a_cable, may_be_nothing
from rotorid.mismatch.decide.findings import Finding, with_probabilities
from rotorid.mismatch.decide.statements import posterior_at, statements_of
from rotorid.mismatch.decide.status import Estimate
from rotorid.mismatch.decide.support import DRAWS, Support, support_of
from rotorid.mismatch.evidence.gram import spectrum_of
from tests.unit.mismatch.decide.test_posterior import BLOCKS, ROWS, Flight, effect
from tests.unit.mismatch.flights import quad

TERMS = (effect("rotor_drag/a"), effect("ground_effect/a"), effect("frame_drag/a"))


def made(coefficients, alike=0.3, seed=0) -> Flight:
    """A flight whose residual is what `coefficients` (BLOCKS, 3) make of drag, ground and frame, and white noise."""
    rng = np.random.default_rng(seed)
    x = rng.normal(size=(BLOCKS, ROWS, 3)) + alike * rng.normal(size=(BLOCKS, ROWS, 1))
    beta = np.broadcast_to(np.asarray(coefficients, float), (BLOCKS, 3))
    return Flight(x, np.einsum("brk,bk->br", x, beta) + rng.normal(size=(BLOCKS, ROWS)), TERMS)


def judged(of: Flight, *ids: str) -> tuple[dict[str, Finding], Support]:
    """Claims of some ids as the posterior and its support leave them, and that support."""
    evidence = of.evidence()
    spectrum = spectrum_of(evidence)
    found = posterior_at(evidence, spectrum, [f"{i}/a" for i in ids])
    statements_of(found)
    support = support_of(evidence, spectrum, found)
    stated = with_probabilities([Finding(i, "established") for i in ids], found, lambda: support)
    return {f.id: f for f in stated}, support


def test_what_acts_all_the_time_is_in_every_draw_and_the_shares_are_probabilities():
    stated, support = judged(made([0.5, 0.0, 0.0]), "rotor_drag")
    assert stated["rotor_drag"].status == "established"
    assert support.of(["rotor_drag"]) > 0.99 and support.of(["ground_effect"]) < 0.2
    assert sum(support.shares.values()) == pytest.approx(1.0)


def test_what_half_of_the_seconds_alone_show_is_suggested_however_sure_the_posterior_of_all_is():
    beta = np.zeros((BLOCKS, 3))
    beta[: BLOCKS // 2, 0] = 0.5
    of = made(beta, seed=1)
    evidence = of.evidence()
    found = posterior_at(evidence, spectrum_of(evidence), ["rotor_drag/a"])
    (taken_as_they_are,) = with_probabilities([Finding("rotor_drag", "established")], found)
    stated, support = judged(of, "rotor_drag")
    assert taken_as_they_are.status == "established" and support.of(["rotor_drag"]) < 0.8
    assert stated["rotor_drag"].status == "suggested" and "weighed anew" in stated["rotor_drag"].objection


def test_names_that_replace_each_other_are_a_class_and_what_is_there_anyway_is_none_of_it():
    of = Support({frozenset({"a", "c"}): 0.6, frozenset({"b", "c"}): 0.35, frozenset({"c"}): 0.05})
    assert of.class_of(["c"]) == {"c"}
    assert of.class_of(["a"], excluded=["c"]) == {"a", "b"}
    assert of.class_of(["b"], excluded=["c"]) == {"a", "b"}
    assert Support({frozenset({"a"}): 0.5, frozenset(): 0.5}).class_of(["a"]) is None


def test_two_columns_that_are_nearly_one_are_named_together():
    rng = np.random.default_rng(3)
    x = rng.normal(size=(BLOCKS, ROWS, 3))
    x[..., 1] = x[..., 0] + 0.2 * rng.normal(size=(BLOCKS, ROWS))
    y = 0.25 * (x[..., 0] + x[..., 1]) + rng.normal(size=(BLOCKS, ROWS))
    stated, support = judged(Flight(x, y, TERMS), "rotor_drag")
    assert support.of(["rotor_drag"]) < 0.99 < support.of(["rotor_drag", "ground_effect"]) + 1e-9
    assert stated["rotor_drag"].alternatives == ("ground_effect", "rotor_drag")


def test_draws_are_the_same_at_every_call():
    of = made([0.15, 0.1, 0.0])
    assert judged(of, "rotor_drag")[1] == judged(of, "rotor_drag")[1] and DRAWS > 10


def test_sizes_that_may_all_be_nothing_are_nothing_however_well_a_cable_is_known():
    forms = {f.name: f for f in catalogue()["payload"].forms(quad())}
    form = next(f for f in forms.values() if f.swings)
    numbers = [
        Estimate(p.symbol, 0.0, p.unit, -1.0, 1.0) if i in form.linear else Estimate(p.symbol, 2.0, p.unit, 1.9, 2.1)
        for i, p in enumerate(form.parameters)
    ]
    payload = Finding("payload", "established", form=form, parameters=tuple(numbers))
    assert any(p.low > 0 for p in payload.parameters) and may_be_nothing(payload)
    heavy = [Estimate(p.symbol, 0.2, p.unit, 0.1, 0.3) if p.symbol == "m_p" else p for p in numbers]
    assert not may_be_nothing(Finding("payload", "established", form=form, parameters=tuple(heavy)))


@pytest.mark.parametrize(("damping", "held"), [(0.1, False), (0.2985, True), (0.0021, False)])
def test_a_cable_that_hardly_swings_is_none_and_one_that_nothing_damps_is_one(damping, held):
    form = next(f for f in catalogue()["payload"].forms(quad()) if f.swings)
    values = tuple({"L": 1.0, "ζ": damping}.get(p.symbol, 0.1) for p in form.parameters)
    assert _at_the_end_of_a_cable(Finding("payload", "established", form=form, values=values)) is held


def test_a_cable_is_no_longer_than_such_a_vehicle_carries():
    wide = [r.model_copy(update={"x_m": 2 * r.x_m, "y_m": 2 * r.y_m}) for r in quad().rotors]
    small, large = quad(), quad().model_copy(update={"rotors": tuple(wide)})
    longest = []
    for vehicle in (small, large):
        form = next(f for f in catalogue()["payload"].forms(vehicle) if f.swings)
        (cable,) = (p for p in form.parameters if p.symbol == "L")
        arm = np.linalg.norm(vehicle.rotor_positions_m(), axis=1).max()
        assert cable.high == pytest.approx(min(6.0, 30.0 * arm)) and all(s < cable.high for s in cable.starts)
        longest.append(cable.high)
    assert longest[0] <= longest[1]
