"""Effects that look significant while wrong values are held at their belief, and vanish with the right ones."""

from __future__ import annotations

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.decision.findings import Finding
from rotorid.mismatch.model.delivered import FittedModel, Values
from rotorid.mismatch.plant.unknowns import UNKNOWNS

ABSORBED_P = 1e-6
"""About fifty terms are looked at."""
ABSORBED_GAIN = 50.0
"""Whitened squares: what a reader would have taken for an effect."""


def absorbed_findings(model: FittedModel, values: Values, findings: list[Finding]) -> list[Finding]:
    """A finding for every such effect that `findings` do not hold; none where no value is wrong."""
    if not values:
        return []
    search, regression, active = model.search, model.search.regression, model.selection.active
    held = [k for k in search.always if k not in values]
    base = regression.fit(held + active)
    taken, out = {f.id for f in findings}, {}
    for term in regression.terms:
        if term.kind != "effect" or term.effect in taken or term.effect in out or term.effect in UNKNOWNS:
            continue
        fit = regression.fit([*held, *active, term.key])
        p = regression.wald(fit, regression.columns([term.key]), search.blocks)
        if p < ABSORBED_P and fit.gain - base.gain > ABSORBED_GAIN:
            name = catalogue()[term.effect].name
            text = f"{name} looked significant with the believed values; the refitted values explain it"
            out[term.effect] = Finding(id=term.effect, status="absorbed", sentence=text, p_value=p)
    return list(out.values())
