"""The separation predicted from normal equations is the loss difference that the engine then finds."""

from types import SimpleNamespace

import numpy as np
import pytest

from rotorid.mismatch.regression import build
from rotorid.mismatch.rows import Rows, Term
from rotorid.plan.questions import Hypothesis, Question
from rotorid.plan.separation import Information, against, left_over, separations, spread

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


def test_prediction_is_the_difference_that_a_fit_finds() -> None:
    # Trust enters the prediction as what it costs to move a value; `explained` counts the rows alone.
    reg = regression(1, 1e-9, 0.9, trust=10.0)
    square, _, _ = against(known_of(reg), QUESTION, QUESTION.hypotheses[0], "b", Information(reg.gram.sum(axis=0)))
    found = reg.explained(["mass", "a/form"]) - reg.explained(["mass", "b/form"])
    assert square == pytest.approx(found, rel=1e-3)


def test_with_noise_the_difference_lies_within_its_own_standard_deviation() -> None:
    ratios = []
    for seed in range(20):
        reg = regression(seed, 1.0, 0.9)
        square, _, _ = against(known_of(reg), QUESTION, QUESTION.hypotheses[0], "b", Information(reg.gram.sum(axis=0)))
        found = max(reg.explained(["mass", "a/form"]) - reg.explained(["mass", "b/form"]), 0.0)
        ratios.append(np.sqrt(found) - np.sqrt(square))
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


def test_copies_cannot_be_told_apart() -> None:
    reg = regression(3, 1.0, 1.0)
    left = left_over(reg, Information(reg.gram.sum(axis=0)), ["a/form"], ["mass", "b/form"])
    assert THETA**2 * left[0, 0] < 1e-3


def test_a_doubt_about_the_size_widens_the_interval() -> None:
    forms = [(np.array([[400.0]]), np.array([0]))]
    _, sure = spread(Hypothesis("a", ("a/form",), np.array([0.3]), np.array([[1e-8]])), forms)
    _, unsure = spread(Hypothesis("a", ("a/form",), np.array([0.3]), np.array([[0.01]])), forms)
    assert sure[1] - sure[0] == pytest.approx(2 * 1.96, rel=0.15)
    assert unsure[1] - unsure[0] > 1.5 * (sure[1] - sure[0])


def test_the_nearest_of_several_rivals_counts_in_every_draw() -> None:
    # Each rival takes one of two coefficients over: which one is nearer is not known from the set.
    forms = [(np.array([[400.0]]), np.array([k])) for k in (0, 1)]
    doubtful = Hypothesis("a", ("a/form",), np.array([0.3, 0.3]), 0.01 * np.eye(2))
    alone, _ = spread(doubtful, forms[:1])
    both, _ = spread(doubtful, forms)
    assert alone == pytest.approx(6.0, rel=0.05)
    # The smaller of two normal draws lies 0.54 of their deviation (2) below the mean, by the median.
    assert both == pytest.approx(6.0 - 0.54 * 2.0, rel=0.06)
