"""The model without the effects of which every number may be nothing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from rotorid.mismatch.decide import estimates, suggested
from rotorid.mismatch.delivered import Values
from rotorid.mismatch.findings import Reason
from rotorid.mismatch.unknowns import UNKNOWNS
from rotorid.mismatch.wrench import WrenchModel

UNSURE = Reason("unsure", "none of it at all is within its interval")

ValuesOf = Callable[[WrenchModel, Sequence[str]], Values]
"""The believed values that a model's recordings contradict, less those refused."""


def without(model: WrenchModel, key: str, reason: str) -> WrenchModel:
    """The model with one effect less, all else fitted anew."""
    fewer = fitted_anew(model, [k for k in model.selection.active if k != key])
    reasons = {**fewer.selection.not_established, model.search.terms[key].effect: reason}
    return replace(fewer, selection=replace(fewer.selection, not_established=reasons))


def fitted_anew(model: WrenchModel, active: list[str]) -> WrenchModel:
    """The model with the terms of `active` alone."""
    search = model.search
    regression = search.regression
    fit = regression.fit(search.always + active, jackknife=True)
    p_values = {k: regression.wald(fit, regression.columns([k]), search.blocks) for k in active}
    return replace(model, selection=replace(model.selection, active=active, fit=fit, p_values=p_values))


def without_unsure(model: WrenchModel, values: Values, values_of: ValuesOf) -> tuple[WrenchModel, Values]:
    """The model less the effects of which every parameter may be zero, and its wrong values; the least sure goes first.

    An interval takes in what an effect too weak to be stated would make of it.
    """
    while True:
        selection, search = model.selection, model.search
        beside = suggested(search, selection.active)
        unsure = []
        for key in selection.active:
            term = search.terms[key]
            if term.effect in UNKNOWNS or term.run or not term.form.linear or term.form.nonlinear:
                continue
            found = estimates(model.regression, selection.fit, search, key, beside)
            if all(e.low <= 0.0 <= e.high for e in found):
                unsure.append(key)
        if not unsure:
            return model, values
        model = without(model, max(unsure, key=lambda k: selection.p_values[k]), UNSURE)
        values = values_of(model, ())
