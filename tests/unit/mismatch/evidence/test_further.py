"""What further terms would explain, all at once, is what each of them explains when it is fitted with the others."""

import numpy as np
import pytest

from rotorid.mismatch.evidence.regression import Regression, build
from rotorid.mismatch.evidence.rows import Rows, Term

RATE_HZ, SIZE = 20.0, 2000
SIZES = {"mass": 1, "arm": 1, "one": 1, "three": 3, "copy": 1, "never": 2}


def regression(noise: float = 0.0, apart: tuple[str, ...] = ()) -> Regression:
    """Two believed values, of which one asks for more than its trust, and terms of one and of several columns; the last
    column of `three` is a copy of the term `copy`, and `never` acts nowhere."""
    rng = np.random.default_rng(5)
    x = np.zeros((SIZE, 12, sum(SIZES.values())))
    x[:, 3, :6] = rng.standard_normal((SIZE, 6)) @ (np.eye(6) + 0.3)
    x[:, 9, 2] = x[:, 3, 2]
    x[:, 3, 6] = x[:, 3, 5]
    y = np.full((SIZE, 12), np.nan)
    y[:, 3] = x[:, 3] @ [0.9, 0.02, 0.3, 0.2, -0.3, 0.1, 0.1, 0.0, 0.0] + rng.standard_normal(SIZE)
    y[:, 9] = 0.2 * x[:, 9, 2] + rng.standard_normal(SIZE)
    terms = [
        Term(k, "value" if k in ("mass", "arm") else "effect", size=n, prior_sd=(0.05 if k == "mass" else np.inf,) * n)
        for k, n in SIZES.items()
    ]
    again = np.where(x != 0, x + noise * rng.standard_normal(x.shape), 0.0)
    rows, noisy = (Rows("a", np.arange(SIZE) / RATE_HZ, y, own) for own in (x, again))
    filters = {c: np.array([1.25, -0.75]) for c in (3, 9)}
    return build([rows], terms, filters, lambda *_: True, 1.0, RATE_HZ, [noisy] if noise else None, (9,), apart)


@pytest.mark.parametrize("noise", [0.0, 0.1, 2.0])
@pytest.mark.parametrize("apart", [(), ("one",)])
def test_each_further_term_explains_what_it_does_alone_with_the_others(noise, apart):
    further = ["one", "three", "copy", "never"]
    for base in (["mass", "arm"], ["mass", "arm", "one"], ["mass", "arm", "copy"]):
        asked = [k for k in further if k not in base]
        at_once, one_by_one = regression(noise, apart), regression(noise, apart)
        np.testing.assert_allclose(
            at_once.explained_with(base, asked), [one_by_one.explained([*base, k]) for k in asked], rtol=1e-6
        )
    assert abs(one_by_one.solution(base).beta[0]) == pytest.approx(0.15, rel=1e-3)  # held at its limit


def test_what_is_asked_again_is_not_made_again():
    made = regression()
    first = made.explained_with(["mass"], ["one", "three"])
    made._all_explained = None
    assert made.explained_with(["mass"], ["three", "one"]) == first[::-1]
    assert made.explained(["one", "mass"]) == first[0]
