"""The model of a flight with fewer of its parts: what is only suggested takes no part in what is delivered.

Believed values, nuisances and the effects that stay are fitted anew without it.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from rotorid.effects.catalogue import moving_air
from rotorid.mismatch.decision.select import Selection
from rotorid.mismatch.model.delivered import Values
from rotorid.mismatch.model.fitted import Fitted
from rotorid.mismatch.model.leave_one_out import chain_without, without_wind
from rotorid.mismatch.model.prepare import assemble_rows
from rotorid.mismatch.model.wrench import WrenchModel, block_seconds, path_segments
from rotorid.mismatch.plant.contributions import Contributions
from rotorid.mismatch.plant.motion import Segment
from rotorid.mismatch.plant.regression import build
from rotorid.mismatch.plant.split import training_rule
from rotorid.mismatch.plant.two_sensors import compared_alone
from rotorid.mismatch.plant.unknowns import UNKNOWNS


def with_only(found: Fitted, ids: Collection[str], values: Values) -> Fitted:
    """What was fitted with the effects `ids` and the wrong `values` alone; terms without a name stay.

    Rows are built anew where what goes lies between command and speed, or is air that moves.
    """
    model, chain = found.model, found.chain
    active = [k for k in model.selection.active if model.search.terms[k].effect in {*ids, *UNKNOWNS}]
    gone = sorted(chain_ids(found) - set(ids))
    for key in gone:
        chain = chain_without(replace(found, chain=chain), key)
    still = model.wind is not None and moving_air("all the time").id not in ids
    calm = bool(model.gusts) and moving_air("in windows").id not in ids
    if (gone and found.commanded) or still or calm:
        segments, noisy = model.segments, model.noisy_segments
        if gone and found.commanded:
            cutoff = model.prepared.thinner.cutoff_hz
            segments, noisy = (path_segments(s, *chain, cutoff) for s in (segments, noisy))
        steady = None if model.wind is None else np.array([*model.wind, 0.0])
        if calm:
            segments, noisy = ([in_air(s, steady) for s in own] for own in (segments, noisy))
        if still:
            segments, noisy = ([in_air(s, without_wind(s, model.wind)) for s in own] for own in (segments, noisy))
        own = {"wind": None if still else model.wind, "gusts": () if calm else model.gusts}
        model = rebuilt(replace(model, **own), segments, noisy, active)
    fit = model.regression.fit([t.key for t in model.regression.terms if t.kind != "effect"] + active, jackknife=True)
    model = replace(model, selection=replace(model.selection, active=active, fit=fit))
    return replace(found, model=model, chain=chain, values=values)


def in_air(segment: Segment, wind: np.ndarray | None) -> Segment:
    """A stretch in air that moves by `wind` (3,) or (n, 3), m/s, world axes; still for None."""
    return replace(segment, motion=replace(segment.motion, wind=wind))


def rebuilt(
    model: WrenchModel, segments: Sequence[Segment], noisy: Sequence[Segment], active: Sequence[str]
) -> WrenchModel:
    """A model's rows and regression on changed stretches, with its own noise and terms; nothing is searched."""
    prepared, old = model.prepared, model.regression
    kinds = {"effect"} if model.gusts else {"effect", "wind"}
    terms = [t for t in old.terms if t.kind not in kinds or t.key in active]
    rows = assemble_rows(prepared, terms, list(segments), model.effects)
    again = assemble_rows(prepared, terms, list(noisy), model.effects) if noisy else None
    rate = prepared.thinner.rate_hz
    rule = training_rule(prepared.split, list(segments))
    block_s, alone = block_seconds(rows, rate), compared_alone(terms, rows)
    regression = build(rows, terms, old.filters, rule, block_s, rate, again, *alone)
    return replace(
        model,
        terms=terms,
        rows=rows,
        regression=regression,
        segments=list(segments),
        noisy_segments=list(noisy),
        contributions=Contributions(rows, again, rate),
        selection=Selection(list(active), model.selection.fit),
    )


def chain_ids(found: Fitted) -> set[str]:
    """Ids of the effects between command and rotor speed."""
    return set() if found.chain is None else {key for key, _ in found.chain.result.fit.chain}
