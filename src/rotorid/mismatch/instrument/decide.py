"""From the selected terms of an instrument to a word on each id."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.effects.loading import CHANNELS
from rotorid.mismatch.decide import estimates
from rotorid.mismatch.findings import Estimate, Finding
from rotorid.mismatch.instrument.approximate import Companion
from rotorid.mismatch.instrument.model import (
    ReadingModel,
    active_values,
    doubt_of_form,
    nonlinear_deviation,
)
from rotorid.mismatch.unknowns import UNKNOWNS

SHOWS = 0.33
"""A channel counts where the contribution is at least this share of its strongest, in units of the noise."""
REACH = 1.96
ALIKE = {("tare_offset", "mass")}


def main_channels(model: ReadingModel, key: str) -> list[int]:
    """Channels that a term shows in, the strongest first."""
    fit, regression = model.selection.fit, model.regression
    cols = regression.columns([key])
    beta = fit.beta[fit.places(cols)]
    size = model.search.ask.sizes_of(key, beta)
    order = np.argsort(-size)
    return [int(c) for c in order if size[c] > SHOWS * size[order[0]]]


def findings_of(model: ReadingModel, company: tuple[Companion, ...] = ()) -> list[Finding]:
    """A finding for every term that entered, and for those that looked like something and did not survive.

    `company` are effects that only made up for the form of a term: one that in any form does as well as it is an
    alternative to it.
    """
    effects, search, selection = catalogue(), model.search, model.selection
    out = []
    for key in selection.active:
        if search.terms[key].effect in UNKNOWNS:
            continue  # told as unexplained
        term, effect = search.terms[key], effects[search.terms[key].effect]
        channels = main_channels(model, key)
        values = active_values(model, key)
        if term.form.nonlinear:
            sd = nonlinear_deviation(model, key, model.loadings)
            parameters = tuple(
                Estimate(p.symbol, float(v), p.unit, float(v - REACH * s), float(v + REACH * s))
                for p, v, s in zip(term.form.parameters, values, sd, strict=True)
            )
        else:
            parameters = estimates(model.regression, selection.fit, search, key)
        parameters = wider(parameters, doubt_of_form(model, key, model.loadings))
        either = [c.effect for c in company if c.stronger == key and c.either]
        alternatives = [*alternatives_of(model, key), *either]
        out.append(
            Finding(
                id=term.effect,
                status="ambiguous" if alternatives else "established",
                form=term.form,
                values=tuple(float(v) for v in values),
                equation=term.form.equation,
                sentence=effect.sentence,
                parameters=parameters,
                p_value=selection.p_values[key],
                channels=tuple(CHANNELS[c] for c in channels),
                alternatives=tuple(sorted({term.effect, *alternatives})) if alternatives else (),
            )
        )
    named = {a for f in out for a in f.alternatives}
    for effect_id, reason in selection.not_established.items():
        if effect_id in named or effect_id in UNKNOWNS:
            continue
        name = effects[effect_id].name
        text, rule = f"{name} did not hold: {reason}", getattr(reason, "rule", "")
        out.append(Finding(id=effect_id, status="not_established", sentence=text, rule=rule))
    return out


def wider(parameters: tuple[Estimate, ...], doubt: np.ndarray) -> tuple[Estimate, ...]:
    """Estimates whose intervals hold a further one-sigma each, (p,)."""
    out = []
    for p, sd in zip(parameters, doubt, strict=True):
        low, high = (float(np.hypot(p.value - edge, REACH * sd)) for edge in (p.low, p.high))
        out.append(replace(p, low=p.value - low, high=p.value + high))
    return tuple(out)


def alternatives_of(model: ReadingModel, key: str) -> list[str]:
    """Ids that could stand in for a term on these data."""
    return model.search.alternatives(key, model.selection.active)
