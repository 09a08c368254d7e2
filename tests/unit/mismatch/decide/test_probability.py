"""The probability of each effect of a model that was chosen otherwise, and the status that it leaves it. Every form
of the catalogue that the search may choose can be reported: parameters, gain and channels.
"""

import numpy as np
import pytest

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.decide.findings import Finding, with_probabilities
from rotorid.mismatch.decide.posterior import Found, Posterior
from rotorid.mismatch.decide.select import Questions, Search, Selection
from rotorid.mismatch.decide.selected import wrench_findings
from rotorid.mismatch.evidence.regression import build
from rotorid.mismatch.evidence.rows import Contributions, Rows, Term
from rotorid.mismatch.evidence.unknowns import UNKNOWNS
from tests.unit.mismatch.decide.test_posterior import Flight, effect, flight, problem
from tests.unit.mismatch.evidence.test_regression import RATE_HZ
from tests.unit.mismatch.flights import quad

TERMS = (effect("rotor_drag/a"), effect("ground_effect/a"), effect("frame_drag/a"))


def shaped(x):
    """Columns of torques, of thrusts and torques, and of an offset that pushes as the thrusts do."""
    own = x.copy()
    own[..., 1] = x[..., 0] + x[..., 2]
    return own


def found(beta, active, alike=0.0) -> Found:
    """The posterior at the effects `active` of a flight with coefficients `beta` of drag, ground and frame."""
    posterior = Posterior(problem(flight(beta, TERMS, alike=alike)))
    model = tuple(sorted(f"{one}/a" for one in active))
    return Found(posterior, model, posterior(model))


def claims(*ids: str) -> list[Finding]:
    return [Finding(i, "established") for i in ids]


def test_an_effect_at_work_stays_established_and_one_that_is_not_there_does_not():
    drag, ground = with_probabilities(
        claims("rotor_drag", "ground_effect"), found([0.5, 0.0, 0.0], ["rotor_drag", "ground_effect"])
    )
    assert drag.status == "established" and drag.probability > 0.99
    assert ground.status == "not_established" and ground.probability < 0.1
    assert ground.rule == "probability" and "its probability is" in ground.sentence


def test_a_claim_with_collinear_rivals_becomes_a_class_with_them():
    same = found([0.05, 0.0, 0.0], ["rotor_drag"], alike=10.0)
    members = ("frame_drag", "ground_effect", "rotor_drag")
    (alone,) = with_probabilities(claims("rotor_drag"), same)
    (as_class,) = with_probabilities([Finding("rotor_drag", "ambiguous", alternatives=members)], same)
    for one in (alone, as_class):
        assert one.status == "ambiguous" and one.probability > 0.99
        assert "rotor_drag" in one.alternatives and set(one.alternatives) <= set(members)


@pytest.mark.parametrize("active", [("com_offset/a", "unequal_rotors/torque"), ("unequal_rotors/both",)])
def test_an_id_next_to_a_plain_form_of_another_is_a_class_with_its_richer_form(active):
    terms = (effect("unequal_rotors/torque"), effect("unequal_rotors/both"), effect("com_offset/a"))
    made = flight([0.0, 0.0, 0.0], terms)
    x = shaped(made.x)
    same = Posterior(problem(Flight(x, made.y + 0.5 * x[..., 1], terms)))
    stated = {f.id: f for f in with_probabilities(
        claims(*(key.split("/")[0] for key in active)), Found(same, active, same(active))
    )}  # fmt: skip
    assert stated["unequal_rotors"].status == "established"
    if "com_offset" in stated:
        assert stated["com_offset"].status == "ambiguous"
        assert stated["com_offset"].alternatives == ("com_offset", "unequal_rotors")


def test_what_a_better_model_nearby_makes_likely_counts_though_it_was_not_chosen():
    chosen = found([0.05, 0.0, 0.0], ["rotor_drag", "frame_drag"], alike=10.0)
    (drag,) = [f for f in with_probabilities(claims("rotor_drag"), chosen) if f.id == "rotor_drag"]
    assert drag.status == "ambiguous" and "ground_effect" in drag.alternatives


@pytest.mark.parametrize(("size", "status"), [(0.15, "not_established"), (0.235, "suggested"), (0.4, "established")])
def test_the_status_follows_from_the_probability(size, status):
    (drag,) = with_probabilities(claims("rotor_drag"), found([size, 0.0, 0.0], ["rotor_drag"]))
    assert drag.status == status
    low, high = {"not_established": (0.0, 0.5), "suggested": (0.5, 0.99), "established": (0.99, 1.0)}[status]
    assert low <= drag.probability <= high


def test_what_the_regression_does_not_decide_stays_as_it_is():
    lag, dropped = Finding("motor_lag", "established"), Finding("ground_effect", "not_established")
    assert with_probabilities([lag, dropped], found([0.5, 0.0, 0.0], ["rotor_drag"])) == [lag, dropped]


FORMS = {
    f"{effect.id}/{form.name}": (effect.id, form)
    for effect in catalogue().values()
    if effect.id not in UNKNOWNS
    for form in effect.forms(quad())
    if not form.on_loading
}


def told(key: str):
    """The finding on one form that explains most of two runs, the second held out."""
    effect_id, form = FORMS[key]
    rng = np.random.default_rng(4)
    size, columns = 1200, max(1, len(form.linear))
    rows = []
    for run in "ab":
        x, y = np.zeros((size, 12, columns)), np.full((size, 12), np.nan)
        x[:, 0] = rng.standard_normal((size, columns))
        y[:, 0] = x[:, 0].sum(axis=1) + 0.5 * rng.standard_normal(size)
        rows.append(Rows(run, np.arange(size) / RATE_HZ, y, x))
    values = tuple(1.0 if p.nonlinear else 0.0 for p in form.parameters)
    terms = [Term(key, "effect", effect_id, form, values, columns)]
    regression = build(rows, terms, {0: np.array([1.0])}, lambda run, t: run == "a", 1.0, RATE_HZ)
    search = Search(regression, Questions(lambda *_: np.ones(12), lambda *_: np.ones(12)))
    selection = Selection([key], regression.fit([key], jackknife=True), {key: 1e-9})
    noise = np.array([0.5, *[np.nan] * 11])
    return wrench_findings(Contributions(rows), regression, search, selection, noise, {}, selection.fit)


@pytest.mark.parametrize("key", FORMS)
def test_a_form_is_told_with_its_linear_parameters(key):
    """Coefficients are 1 by construction."""
    effect_id, form = FORMS[key]
    (finding,) = [f for f in told(key) if f.id == effect_id]
    assert [p.symbol for p in finding.parameters] == [form.parameters[i].symbol for i in form.linear]
