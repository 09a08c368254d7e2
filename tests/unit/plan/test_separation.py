"""The separation predicted from normal equations is the loss difference that the engine then finds."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from rotorid.mismatch.evidence.regression import bounded, build
from rotorid.mismatch.evidence.rows import Rows, Term
from rotorid.mismatch.evidence.speedpath import CommandChain
from rotorid.plan.questions import Hypothesis, Question
from rotorid.plan.separation import Information, drawn, log_odds, separations, squares_left, within, world_of
from rotorid.recordings import templates

RATE = 40.0
THETA = 0.3


def terms(trust: float = 0.05) -> list[Term]:
    return [
        Term("mass", "value", prior_sd=(trust,)),
        Term("a/form", "effect", "a"),
        Term("b/form", "effect", "b"),
        Term("b/other", "effect", "b"),
    ]


def regression(seed: int, noise: float, alike: float, trust: float = 0.05):
    """Rows of one channel in which b is `alike` to a, and a with THETA is true."""
    rng = np.random.default_rng(seed)
    x = np.zeros((2000, 12, 4))
    y = np.zeros((2000, 12))
    x[:, 0, 0] = rng.standard_normal(2000)
    x[:, 0, 1] = rng.standard_normal(2000) + 0.4 * x[:, 0, 0]
    x[:, 0, 2] = alike * x[:, 0, 1] + np.sqrt(1 - alike**2) * rng.standard_normal(2000)
    x[:, 0, 3] = rng.standard_normal(2000)
    y[:, 0] = THETA * x[:, 0, 1] + noise * rng.standard_normal(2000)
    rows = [Rows("run", np.arange(2000) / RATE, y, x)]
    return build(rows, terms(trust), {0: np.array([1.0])}, lambda run, t: True, 1.0, RATE)


QUESTION = Question(
    ("a", "b"),
    (Hypothesis("a", ("a/form",), np.array([THETA]), np.array([[1e-4]])),),
    ("mass",),
    {"a": (("a/form",),), "b": (("b/form",), ("b/other",))},
)


def known_of(reg):
    return SimpleNamespace(regression=reg)


def size_of(reg, theta: float = THETA) -> float:
    """λ of a with `theta` against the best form of b."""
    forms = (["mass", "b/form"], ["mass", "b/other"])
    gram, own = reg.gram.sum(axis=0), np.array([[theta]])
    return min(float(squares_left(reg, gram, ["a/form"], others, own)[0]) for others in forms)


def test_a_model_flies_by_the_chain_that_was_fitted() -> None:
    chain = CommandChain(SimpleNamespace(fit=SimpleNamespace(chain=())), 2000.0, 12.0, 0.8)
    known = SimpleNamespace(
        model=SimpleNamespace(selection=SimpleNamespace(active=()), wind=None),
        regression=SimpleNamespace(terms=()),
        prepared=SimpleNamespace(vehicle=templates.read("thesis"), segments=()),
        fitted=SimpleNamespace(chain=chain),
        derivatives=(),
    )
    world = world_of(known)
    assert (world.full_speed_rad_s, world.full_voltage_v, world.scale) == (2000.0, 12.0, 0.8)


@pytest.mark.parametrize("trust", [10.0, 0.05, 0.001])
def test_prediction_is_the_difference_that_a_fit_finds(trust: float) -> None:
    # Where the mass is trusted hardly at all, as usual, and so much that it hardly moves.
    reg = regression(1, 1e-9, 0.9, trust)
    found = reg.explained(["mass", "a/form"]) - reg.explained(["mass", "b/form"])
    assert size_of(reg) == pytest.approx(found, rel=1e-3)


def test_no_value_moves_beyond_the_limit_of_the_fit() -> None:
    # A contribution of which the mass would take over more than its limit.
    rng, theta = np.random.default_rng(0), 3.0
    x = np.zeros((2000, 12, 4))
    x[:, 0, 0] = rng.standard_normal(2000)
    x[:, 0, 1] = 0.5 * x[:, 0, 0] + 0.1 * rng.standard_normal(2000)
    x[:, 0, 2:] = rng.standard_normal((2000, 2))
    y = np.zeros((2000, 12))
    y[:, 0] = theta * x[:, 0, 1]
    rows = [Rows("run", np.arange(2000) / RATE, y, x)]
    reg = build(rows, terms(10.0), {0: np.array([1.0])}, lambda run, t: True, 1.0, RATE)
    found = reg.explained(["mass", "a/form"]) - max(reg.explained(["mass", k]) for k in ("b/form", "b/other"))
    assert size_of(reg, theta) == pytest.approx(found, rel=1e-3)
    free = reg.with_room(np.inf)
    assert size_of(free, theta) < 0.2 * size_of(reg, theta)


def test_many_right_sides_are_solved_within_limits_as_the_fit_solves_one() -> None:
    rng = np.random.default_rng(4)
    root = rng.standard_normal((5, 9))
    normal, right = root @ root.T, 10 * rng.standard_normal((50, 5))
    limit = np.array([np.inf, 0.5, 0.2, np.inf, 0.1])
    expected = [bounded(normal, r, limit)[0] for r in right]
    assert within(normal, right, limit) == pytest.approx(np.array(expected), rel=1e-4, abs=1e-4)
    assert (np.abs(expected) > 0.99 * limit).any(axis=0)[[1, 2, 4]].all()


def test_with_noise_the_difference_lies_within_its_own_standard_deviation() -> None:
    ratios = []
    for seed in range(20):
        reg = regression(seed, 1.0, 0.9)
        found = max(reg.explained(["mass", "a/form"]) - reg.explained(["mass", "b/form"]), 0.0)
        ratios.append(np.sqrt(found) - np.sqrt(size_of(reg)))
    assert abs(np.mean(ratios)) < 0.6
    assert 0.5 < np.std(ratios) < 1.6


def test_more_flight_separates_further_and_the_nearest_rival_counts() -> None:
    reg = regression(2, 1.0, 0.9)
    once = Information(reg.gram.sum(axis=0))
    (first,) = separations(known_of(reg), QUESTION, once, once)
    (second,) = separations(known_of(reg), QUESTION, once, once + once)
    assert second.sigma == pytest.approx(np.sqrt(2) * first.sigma, rel=1e-2)
    assert second.so_far == pytest.approx(first.sigma)
    assert (first.true, first.rival) == ("a", "b")
    assert second.interval_95[0] < second.sigma < second.interval_95[1]


def test_of_two_loops_the_worse_is_stated_and_the_interval_is_over_both() -> None:
    reg = regression(2, 1.0, 0.9)
    gram = reg.gram.sum(axis=0)
    set_alone = Information(gram)
    (fast,) = separations(known_of(reg), QUESTION, set_alone, set_alone + Information(3 * gram))
    (both,) = separations(known_of(reg), QUESTION, set_alone, set_alone + Information(np.stack([3 * gram, gram])))
    (slow,) = separations(known_of(reg), QUESTION, set_alone, set_alone + Information(gram))
    assert both.sigma == pytest.approx(slow.sigma)
    assert both.interval_95[0] < slow.sigma and both.interval_95[1] > fast.sigma


def test_copies_cannot_be_told_apart() -> None:
    reg = regression(3, 1.0, 1.0)
    left = squares_left(reg, reg.gram.sum(axis=0), ["a/form"], ["mass", "b/form"], np.array([[THETA]]))
    assert left[0] < 1e-3


def test_a_form_that_the_set_does_not_distinguish_has_draws_too() -> None:
    reg = regression(2, 1.0, 0.9)
    once = Information(reg.gram.sum(axis=0))
    (a,) = QUESTION.hypotheses
    # Another form of a, three times as probable, contributes a tenth.
    small = replace(a, beta=a.beta / 10, covariance=a.covariance / 100, weight=3.0)
    question = replace(QUESTION, hypotheses=(replace(a, others=(small,)),))
    (plain,) = separations(known_of(reg), QUESTION, once, once)
    (both,) = separations(known_of(reg), question, once, once)
    assert both.sigma < plain.sigma / 4
    assert both.interval_95[1] == pytest.approx(plain.interval_95[1], rel=0.2)


def test_draws_are_as_doubtful_as_the_set_and_no_larger_than_what_it_found() -> None:
    sure = drawn(Hypothesis("a", ("a/form",), np.array([0.3]), np.array([[1e-4]])), np.array([[400.0]]))
    assert sure.mean() == pytest.approx(0.3, abs=0.01) and sure.std() == pytest.approx(0.01, rel=0.15)
    # The second coefficient is unknown to the set: it is drawn as large as the first, not as large as its doubt.
    doubtful = Hypothesis("a", ("a/form",), np.array([0.3, 40.0]), np.diag([1e-4, 1e4]))
    first, second = drawn(doubtful, 400.0 * np.eye(2)).T
    assert first.mean() == pytest.approx(0.3, abs=0.02)
    assert 0.1 < np.abs(second).mean() < 1.0


def test_log_odds_are_half_the_squares_but_no_form_is_quite_right() -> None:
    assert log_odds(np.array([2.0]), 1e9) == pytest.approx(2.0, rel=1e-3)
    few, many = (log_odds(np.array([50.0]), seconds) for seconds in (10.0, 100.0))
    assert few < many < 1250.0
    # However large, what an environment can say is limited by the form: 1 / 2 f² of each.
    assert log_odds(np.array([1e6]), 10.0) == pytest.approx(2 / (2 * 0.15**2), rel=1e-3)
