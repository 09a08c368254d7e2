"""Every form of the catalogue that the search may choose can be reported: parameters, gain and channels."""

import numpy as np
import pytest

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.decision.decide import wrench_findings
from rotorid.mismatch.decision.select import Questions, Search, Selection
from rotorid.mismatch.plant.contributions import Contributions
from rotorid.mismatch.plant.regression import build
from rotorid.mismatch.plant.rows import Rows, Term
from rotorid.mismatch.plant.unknowns import UNKNOWNS
from tests.unit.mismatch.flights import quad
from tests.unit.mismatch.plant.test_regression import RATE_HZ

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
    fit = regression.fit([key], jackknife=True)
    selection = Selection([key], fit, {key: 1e-9})
    noise = np.array([0.5, *[np.nan] * 11])
    return wrench_findings(Contributions(rows), regression, search, selection, noise, {}, selection.fit)


@pytest.mark.parametrize("key", FORMS)
def test_a_form_is_told_with_its_linear_parameters(key):
    """Coefficients are 1 by construction."""
    effect_id, form = FORMS[key]
    (finding,) = [f for f in told(key) if f.id == effect_id]
    assert [p.symbol for p in finding.parameters] == [form.parameters[i].symbol for i in form.linear]
