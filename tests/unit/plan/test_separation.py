"""The separation predicted from normal equations is the loss difference that the engine then finds."""

from types import SimpleNamespace

import numpy as np
import pytest

from rotorid.mismatch.plant.regression import build
from rotorid.mismatch.plant.rows import Rows, Term
from rotorid.plan.questions import Hypothesis, Question
from rotorid.plan.separation import Information, drawn, left_over, log_odds, separations

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


def size_of(reg) -> float:
    """λ of a with THETA against the best form of b."""
    forms = (["mass", "b/form"], ["mass", "b/other"])
    return min(THETA**2 * left_over(reg, reg.gram.sum(axis=0), ["a/form"], others)[0, 0] for others in forms)


def test_prediction_is_the_difference_that_a_fit_finds() -> None:
    # Trust enters the prediction as what it costs to move a value; `explained` counts the rows alone.
    reg = regression(1, 1e-9, 0.9, trust=10.0)
    found = reg.explained(["mass", "a/form"]) - reg.explained(["mass", "b/form"])
    assert size_of(reg) == pytest.approx(found, rel=1e-3)


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
    left = left_over(reg, reg.gram.sum(axis=0), ["a/form"], ["mass", "b/form"])
    assert THETA**2 * left[0, 0] < 1e-3


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
