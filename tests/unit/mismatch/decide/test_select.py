"""The search over candidates, on rows made by hand: what enters, what must not, and what cannot be distinguished."""

from dataclasses import replace

import numpy as np

from rotorid.effects.contract import Form, Parameter
from rotorid.mismatch.decide.select import Questions, Search
from rotorid.mismatch.evidence.regression import autoregression, build
from rotorid.mismatch.evidence.rows import Term
from tests.unit.mismatch.evidence.test_regression import RATE_HZ, rows_of
from tests.unit.mismatch.synthetic import coloured


def form(name: str, low: float = -100.0, high: float = 100.0, size: int = 1) -> Form:
    """A form of `size` parameters; its contribution is never asked for, the rows hold it."""
    return Form(name, "y = k x", tuple(Parameter(f"k_{i}", "1", low, high) for i in range(size)), lambda *_: None)


def term(effect: str, name: str = "form", low: float = -100.0, high: float = 100.0, size: int = 1) -> Term:
    return Term(f"{effect}/{name}", "effect", effect, form(name, low, high, size), (0.0,) * size, size)


def search_of(terms: list[Term], y: list[np.ndarray], x: list[list[np.ndarray]], noise: float = 1.0) -> Search:
    """A search over runs `a`, `b`, … of which the last is held out; sizes are rms over the noise."""
    rows = [rows_of(target, *columns, run="abcdef"[k]) for k, (target, columns) in enumerate(zip(y, x, strict=True))]
    left = [r.y[:, 0] - r.x[:, 0] @ np.linalg.lstsq(r.x[:, 0], r.y[:, 0], rcond=None)[0] for r in rows]
    held = rows[-1].run
    regression = build(rows, terms, {0: autoregression(left)}, lambda run, t: run != held, 1.0, RATE_HZ)

    def joint(own, beta):
        strength = np.sqrt(np.mean(np.concatenate([r.x[:, 0][:, own] @ beta for r in rows]) ** 2))
        return np.array([strength / noise, *[0.0] * 11])

    sizes = lambda key, beta: joint(regression.columns([key]), beta)  # noqa: E731
    return Search(regression, Questions(sizes, joint))


def case(rng, columns: int, runs: int = 3, size: int = 1200):
    """Noise of one sigma with memory, and regressors with more memory, over some runs."""
    noise = [coloured(size, 1.0, rng, pole=0.8) for _ in range(runs)]
    return noise, [[coloured(size, 1.0, rng, pole=0.95) for _ in range(columns)] for _ in range(runs)]


def effects_of(search: Search) -> list[str]:
    return sorted(search.terms[k].effect for k in search.run().active)


def test_the_effects_that_are_there_enter_and_no_other():
    noise, x = case(np.random.default_rng(0), 6)
    y = [n + 0.8 * columns[1] - 0.6 * columns[4] for n, columns in zip(noise, x, strict=True)]
    selection = search_of([term(f"e{k}") for k in range(6)], y, x).run()
    assert sorted(selection.active) == ["e1/form", "e4/form"]
    assert all(p < 1e-4 for p in selection.p_values.values())
    values = dict(zip(selection.fit.columns, selection.fit.beta, strict=True))
    assert abs(values[1] - 0.8) < 0.25 and abs(values[4] + 0.6) < 0.25


def test_nothing_enters_where_nothing_is():
    """25 recordings of coloured noise, 12 candidates each: not one false alarm (1 in 100 recordings is promised)."""
    rng = np.random.default_rng(1)
    alarms = 0
    for _ in range(25):
        noise, x = case(rng, 12)
        alarms += bool(search_of([term(f"e{k}") for k in range(12)], noise, x).run().active)
    assert alarms == 0


def test_a_coefficient_of_the_wrong_sign_is_no_effect():
    noise, x = case(np.random.default_rng(2), 2)
    y = [n - 0.8 * columns[0] for n, columns in zip(noise, x, strict=True)]
    assert effects_of(search_of([term("drag", low=0.0), term("other")], y, x)) == []
    assert effects_of(search_of([term("drag"), term("other")], y, x)) == ["drag"]


def test_an_effect_that_does_not_matter_is_left_out():
    """Significant beyond doubt (a long recording), but 0.1 of the noise: too small to be worth a word."""
    noise, x = case(np.random.default_rng(3), 1, size=24000)
    y = [n + 0.1 * columns[0] for n, columns in zip(noise, x, strict=True)]
    selection = search_of([term("tiny")], y, x).run()
    assert selection.active == [] and "of the noise" in selection.not_established["tiny"]
    assert search_of([term("tiny")], y, x, noise=0.25).run().active == ["tiny/form"]


def test_the_better_form_of_an_id_stands_for_it():
    rng = np.random.default_rng(4)
    noise, x = case(rng, 1)
    x = [[c[0], 0.8 * c[0] + 0.6 * coloured(1200, 1.0, rng, pole=0.95)] for c in x]
    y = [n + 1.0 * columns[1] for n, columns in zip(noise, x, strict=True)]
    assert search_of([term("drag", "plain"), term("drag", "true")], y, x).run().active == ["drag/true"]


def test_what_differs_from_run_to_run_is_no_constant_of_the_vehicle():
    noise, x = case(np.random.default_rng(5), 1, runs=5, size=2400)
    y = [n + slope * columns[0] for n, columns, slope in zip(noise, x, (2.0, 0.1, 2.0, 0.1, 1.0), strict=True)]
    selection = search_of([term("odd")], y, x).run()
    assert selection.active == [] and "odd" in selection.not_established


def test_copies_of_a_column_are_alternatives_and_others_are_not():
    rng = np.random.default_rng(6)
    noise, x = case(rng, 2)
    x = [[c[0], c[0] + 0.02 * coloured(1200, 1.0, rng, pole=0.95), c[1]] for c in x]
    y = [n + 1.0 * columns[0] for n, columns in zip(noise, x, strict=True)]
    search = search_of([term("com"), term("rotors"), term("other")], y, x)
    selection = search.run()
    (active,) = selection.active
    assert {search.terms[active].effect, *search.alternatives(active, selection.active)} == {"com", "rotors"}


def test_two_that_cancel_are_not_both_claimed_where_the_rest_is_what_their_forms_are_wrong_by():
    """y = x1 + 0.02 z, and x2 = x1 + 0.02 z': x1 − x2 is 2 % of either, less than any form is known by.

    Free, they would grow against each other to explain a bend of x1 that looks like z'.
    """
    rng = np.random.default_rng(7)
    noise, x = case(rng, 1, size=2400)
    bends = [coloured(2400, 1.0, rng, pole=0.95) for _ in x]
    x = [[100 * c[0], 100 * (c[0] + 0.02 * bend)] for c, bend in zip(x, bends, strict=True)]
    y = [n + columns[0] + 4 * bend for n, columns, bend in zip(noise, x, bends, strict=True)]
    search = search_of([term("one"), term("two")], y, x)
    beta = search.regression.fit(["one/form", "two/form"]).beta
    np.testing.assert_allclose(beta, [-1.0, 2.0], atol=0.2)
    assert len(search.run().active) == 1


def test_what_displaces_another_must_hold_by_itself():
    """A near copy that explains more but does not matter may not take the place of the effect that is there."""
    noise, x = case(np.random.default_rng(5), 2)
    for columns in x:
        columns[1] = columns[0] + 0.5 * columns[1]
    y = [n + 0.8 * columns[1] for n, columns in zip(noise, x, strict=True)]
    search = search_of([term("there"), term("copy")], y, x)
    assert search.swapped(["there/form"], {}) == ["copy/form"]
    search = search_of([term("there"), term("copy")], y, x)
    sizes = search.ask.sizes_of
    small = lambda key, beta: sizes(key, beta) * (0.01 if key == "copy/form" else 1.0)  # noqa: E731
    search.ask = replace(search.ask, sizes_of=small)
    assert search.swapped(["there/form"], {}) is None


def tared(rng: np.random.Generator, copy: float) -> Search:
    """A tare, and a centre of mass whose column is `copy` of the tare's next to what differs from run to run."""
    noise, _ = case(rng, 0, runs=6)
    ones = [np.ones(len(n)) for n in noise]
    weight = [copy + (0.15, -0.1, 0.05, -0.15, 0.1, 0.0)[k] * one for k, one in enumerate(ones)]
    halves = [np.arange(len(one)) < len(one) / 2 for one in ones]
    own = [[(k == j // 2) * (half == j % 2) for j in range(10)] for k, half in enumerate(halves)]
    y = [2.0 * one + 20.0 * w + n for one, w, n in zip(ones, weight, noise, strict=True)]
    x = [[one, *each, w] for one, each, w in zip(ones, own, weight, strict=True)]
    terms = [term("tare_offset", "constant"), term("tare_offset", "own in each half", size=10), term("com_offset")]
    return search_of(terms, y, x)


def test_a_freer_form_does_not_stand_for_two_causes():
    """Ten tares explain as much as one and a weight that is off its place, by eight numbers more."""
    assert sorted(tared(np.random.default_rng(5), 0.0).run().active) == ["com_offset/form", "tare_offset/constant"]


def test_of_two_exact_ids_none_is_what_the_other_is_wrong_by():
    """Columns of which one is the other but for 2 % of its energy; inexact ids are told apart from 4 % on."""
    search = tared(np.random.default_rng(6), 4.0)
    keys = ["tare_offset/constant", "com_offset/form"]
    assert search.regression.own_part([*search.always, *keys], keys[1], np.ones(1))[0] < 0.04**2
    assert all(search.judge(key, keys).physical for key in keys)


def test_what_does_not_keep_its_promise_in_other_environments_is_refuted():
    """A coefficient that is 1.5 in one run and 0 in the two others promises there what it does not keep."""
    noise, x = case(np.random.default_rng(6), 1, runs=4)
    steady = [n + 0.8 * columns[0] for n, columns in zip(noise, x, strict=True)]
    assert search_of([term("e")], steady, x).refuted_elsewhere(["e/form"]) is None
    once = [n + (1.5 if k == 0 else 0.0) * columns[0] for k, (n, columns) in enumerate(zip(noise, x, strict=True))]
    assert search_of([term("e")], once, x).refuted_elsewhere(["e/form"]) == "e/form"


def test_of_two_effects_that_cancel_each_other_one_goes():
    """Columns alike but for a twentieth: y needs 20 of their difference, and no term is 20 times what it does."""
    noise, x = case(np.random.default_rng(11), 2)
    x = [[a, a + 0.05 * b] for a, b in x]
    y = [n + 20 * (columns[1] - columns[0]) for n, columns in zip(noise, x, strict=True)]
    search = search_of([term("e0"), term("e1")], y, x)
    assert search.cancelling(["e0/form", "e1/form"]) in ("e0/form", "e1/form")


def test_effects_that_add_up_are_left_alone():
    noise, x = case(np.random.default_rng(12), 2)
    y = [n + 2 * columns[0] - 1.5 * columns[1] for n, columns in zip(noise, x, strict=True)]
    assert search_of([term("e0"), term("e1")], y, x).cancelling(["e0/form", "e1/form"]) is None


def imitated_value(change: float, own: float, copied: float = 0.98) -> Search:
    """A value that is `change` off, trusted to a twentieth, and an effect that looks nearly like it, `own` at work."""
    noise, x = case(np.random.default_rng(4), 2)
    x = [[30 * a, 30 * (copied * a + np.sqrt(1 - copied**2) * b)] for a, b in x]
    y = [n + change * a + own * b for n, (a, b) in zip(noise, x, strict=True)]
    return search_of([Term("inertia_xx", "value", prior_sd=(0.05,)), term("unequal_rotors")], y, x)


def test_a_value_far_beyond_its_trust_is_not_taken_up_by_an_effect_that_looks_like_it():
    """Held to 0.15 in the search, 0.3 in truth: with a free value the effect that absorbed the rest is not
    identifiable."""
    found = imitated_value(0.3, 0.0).run()
    assert found.active == [] and found.not_established["unequal_rotors"].rule == "free_values"


def test_an_effect_that_is_there_stays_next_to_a_value_that_is_off():
    for change in (0.2, 0.02):  # held at its limit, and not
        assert imitated_value(change, 0.2).run().active == ["unequal_rotors/form"]


def test_a_term_that_turns_a_value_from_one_side_of_its_belief_to_the_other_strains_it():
    """Without the term the value is three deviations low, with it five high: as far off, and pushed all the same."""
    noise, x = case(np.random.default_rng(5), 2)
    x = [[30 * a, 30 * (a + 0.1 * b)] for a, b in x]
    y = [n - 0.15 * columns[0] for n, columns in zip(noise, x, strict=True)]
    search = search_of([Term("thrust", "value", prior_sd=(0.05,)), term("curve")], y, x)
    base, fit = search.regression.fit(["thrust"]), search.regression.fit(["thrust", "curve/form"])
    turned = replace(fit, beta=np.array([0.25, -0.4]))
    assert search.strains(turned, base) and not search.strains(replace(fit, beta=np.array([-0.1, 0.0])), base)


def test_of_two_that_explain_the_same_to_what_filters_are_known_the_first_stays():
    """A copy that is off by 0.2 % of a strong contribution is no better for it; one that is off by 2 % is."""
    noise, x = case(np.random.default_rng(6), 2)

    def search_beside(share: float) -> Search:
        columns = [[one, one + share * other] for one, other in x]
        y = [n + 80.0 * copy for n, (_, copy) in zip(noise, columns, strict=True)]
        return search_of([term("there"), term("copy")], y, columns)

    assert search_beside(0.002).swapped(["there/form"], {}) is None
    assert search_beside(0.02).swapped(["there/form"], {}) == ["copy/form"]
