"""The recorded separation is measured between the forms that the question was asked of."""

from types import SimpleNamespace

import numpy as np
import pytest

from rotorid.mismatch.evidence.regression import build
from rotorid.mismatch.evidence.rows import Rows, Term
from rotorid_proof.next_flight import as_asked

RATE = 40.0


def regression(symbols: tuple[str, ...]):
    """A cause a and a rival b of one coefficient per symbol; b's of the symbol `copy` is a's own column."""
    form = SimpleNamespace(
        linear=tuple(range(len(symbols))), parameters=tuple(SimpleNamespace(symbol=s) for s in symbols)
    )
    terms = [
        Term("a/form", "effect", "a"),
        Term("b/all", "effect", "b", form, (), len(symbols), (np.inf,) * len(symbols)),
    ]
    rng = np.random.default_rng(0)
    x = np.zeros((800, 12, 1 + len(symbols)))
    x[:, 0] = rng.standard_normal((800, 1 + len(symbols)))
    for at, symbol in enumerate(symbols, 1):
        if symbol == "copy":
            x[:, 0, at] = x[:, 0, 0]
    y = np.zeros((800, 12))
    y[:, 0] = 0.5 * x[:, 0, 0]
    rows = [Rows("run", np.arange(800) / RATE, y, x)]
    return build(rows, terms, {0: np.array([1.0])}, lambda run, t: True, 1.0, RATE)


def test_a_rival_that_has_more_coefficients_in_both_sets_has_those_of_the_first() -> None:
    first, joint = regression(("one",)), regression(("copy", "one"))
    assert joint.explained(["b/all"]) == pytest.approx(joint.explained(["a/form"]), rel=1e-6)
    asked = as_asked(first, joint)
    assert asked.columns(["b/all"]).tolist() == [2]
    assert asked.explained(["b/all"]) < 0.1 * asked.explained(["a/form"])


def test_forms_of_the_same_coefficients_stay() -> None:
    joint = regression(("copy", "one"))
    asked = as_asked(regression(("copy", "one")), joint)
    assert asked.columns(["b/all"]).tolist() == joint.columns(["b/all"]).tolist()
