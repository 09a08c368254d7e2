"""From the selected terms of an instrument to a word on each id."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rotorid.effects.loading import CHANNELS
from rotorid.mismatch.decision import rules
from rotorid.mismatch.decision.decide import TermReport, estimates, findings_of
from rotorid.mismatch.decision.findings import Finding
from rotorid.mismatch.instrument.model import ReadingModel, active_values, nonlinear_deviation
from rotorid.mismatch.plant.rows import Term
from rotorid.mismatch.plant.unknowns import UNKNOWNS
from rotorid.mismatch.posterior.status import Estimate

SHOWS = 0.33
"""A channel counts where the contribution is at least this share of its strongest, in units of the noise."""
REACH = 1.96


def reading_findings(model: ReadingModel) -> list[Finding]:
    """Findings of the terms of a reading, each with the channels that it shows in, the strongest first."""
    fit, search = model.selection.fit, model.search

    def report_of(key: str) -> TermReport:
        size = search.ask.sizes_of(key, fit.beta[fit.places(model.regression.columns([key]))])
        order = np.argsort(-size)
        channels = tuple(CHANNELS[c] for c in order if size[c] > SHOWS * size[order[0]])
        others = search.alternatives(key, model.selection.active)
        return TermReport(active_values(model, key), parameters_of(model, key), channels, others)

    return findings_of(search, model.selection, report_of)


def parameters_of(model: ReadingModel, key: str) -> tuple[Estimate, ...]:
    """Parameters of a term at work with 95 % intervals."""
    term = model.search.terms[key]
    if not term.form.nonlinear:
        return estimates(model.regression, model.selection.fit, model.search, key)
    values, sd = active_values(model, key), nonlinear_deviation(model, key)
    return tuple(
        Estimate(p.symbol, float(v), p.unit, float(v - REACH * s), float(v + REACH * s))
        for p, v, s in zip(term.form.parameters, values, sd, strict=True)
    )


def with_plainer_forms(model: ReadingModel, again: Callable[[ReadingModel, list[Term]], ReadingModel]) -> ReadingModel:
    """The model with a plainer form of the same id wherever all numbers of a form may be nothing.

    A form of two time constants explains more than one of one and says nothing of either. `again(model, terms)`
    searches once more from a model's terms at work with others to choose from.
    """
    for key in list(model.selection.active):
        term = model.search.terms[key]
        if term.effect in UNKNOWNS or key not in model.selection.active:
            continue
        if not any(len(t.form.parameters) < len(term.form.parameters) for t in forms_beside(model, key)):
            continue
        if rules.PLAINER_FORM(all(p.low <= 0.0 <= p.high for p in parameters_of(model, key))):
            others = [t for t in model.terms if t.kind != "effect" or t.effect != term.effect or plainer(t, term)]
            model = again(model, others)
    return model


def forms_beside(model: ReadingModel, key: str) -> list[Term]:
    """Terms of the same id."""
    effect = model.search.terms[key].effect
    return [t for t in model.terms if t.kind == "effect" and t.effect == effect and t.key != key]


def plainer(one: Term, than: Term) -> bool:
    """Whether a term's form has fewer parameters than another's."""
    return len(one.form.parameters) < len(than.form.parameters)
