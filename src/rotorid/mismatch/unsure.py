"""The model without the effects of which every number may be nothing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from rotorid.mismatch import rules
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

    One whose id has a form of fewer parameters that is sure takes that form instead. An interval takes in what an
    effect too weak to be stated would make of it.
    """
    while True:
        unsure = [key for key in model.selection.active if may_be_nothing(model, key)]
        if not rules.UNSURE(bool(unsure)):
            return model, values
        key = max(unsure, key=lambda k: model.selection.p_values[k])
        model = plainer(model, key) or without(model, key, UNSURE)
        values = values_of(model, ())


def may_be_nothing(model: WrenchModel, key: str) -> bool:
    """Whether the intervals of all parameters of a term hold zero; a term with nonlinear ones is not asked."""
    selection, search = model.selection, model.search
    term = search.terms[key]
    if term.effect in UNKNOWNS or term.run or not term.form.linear or term.form.nonlinear:
        return False
    found = estimates(model.regression, selection.fit, search, key, suggested(search, selection.active))
    return all(e.low <= 0.0 <= e.high for e in found)


def plainer(model: WrenchModel, key: str) -> WrenchModel | None:
    """The model with the id in a form of fewer parameters of which something is sure; None where there is none."""
    search, own = model.search, model.search.terms[key]
    others = [
        t
        for t in search.terms.values()
        if t.kind == "effect"
        and t.effect == own.effect
        and t.size < own.size
        and t.form.linear
        and not t.form.nonlinear
    ]
    for other in sorted(others, key=lambda t: -search.worth(exchanged(model, key, t.key))):
        trial = fitted_anew(model, exchanged(model, key, other.key))
        if search.failing(other.key, trial.selection.active)[0] is None and not may_be_nothing(trial, other.key):
            return trial if rules.PLAINER_FORM(True) else None
    return None


def exchanged(model: WrenchModel, key: str, other: str) -> list[str]:
    """Keys of the terms at work with one in another's place."""
    return [other if k == key else k for k in model.selection.active]
