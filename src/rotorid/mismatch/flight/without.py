"""The model of a flight with fewer of its parts: what each is worth on every run, and what is claimed alone at work.

An effect is worth the difference between the model with it and the model without it, all else fitted anew, on runs that
neither was fitted to. What is only suggested takes no part in what is delivered: believed values, nuisances and the
effects that stay are fitted anew without it.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from rotorid.effects.catalogue import moving_air
from rotorid.mismatch.decide.findings import ChannelTrace, Finding, first_s, on_traces
from rotorid.mismatch.decide.problem import Values
from rotorid.mismatch.decide.select import Selection
from rotorid.mismatch.decide.status import CLAIMED
from rotorid.mismatch.decide.ways import residuals_of, settled
from rotorid.mismatch.evidence.motion import Segment
from rotorid.mismatch.evidence.regression import Fit
from rotorid.mismatch.evidence.rows import Contributions
from rotorid.mismatch.evidence.speedpath import CommandChain
from rotorid.mismatch.evidence.unknowns import UNKNOWNS
from rotorid.mismatch.flight.every_run import rows_of, scaled_by_run
from rotorid.mismatch.flight.fitted import Fitted
from rotorid.mismatch.flight.prepare import assemble_rows
from rotorid.mismatch.flight.wrench import WrenchModel, path_segments, whitened


def chain_ids(found: Fitted) -> set[str]:
    """Ids of the effects between command and rotor speed."""
    return set() if found.chain is None else {key for key, _ in found.chain.result.fit.chain}


def chain_without(found: Fitted, ids: Collection[str]) -> CommandChain:
    """What lies between command and speed with fewer ids.

    Fitted anew where speeds are measured and one goes. Where commands alone are, forces and moments are fitted with the
    chain as it is: it stays so but for the ids, or the two would no longer belong together.
    """
    result = found.chain.result
    return found.chain._replace(result=(result if found.measured else replace(result, without={})).less(sorted(ids)))


def _moved_by(found: Fitted, model: WrenchModel) -> set[str]:
    """Ids that a model has in the motion of its stretches and in no term: rotors as commanded, air that moves."""
    air = {"all the time": model.wind is not None, "in windows": bool(model.gusts)}
    return (chain_ids(found) if found.commanded else set()) | {
        moving_air(how).id for how, blows in air.items() if blows
    }


def _stretches_without(
    found: Fitted, model: WrenchModel, segments: Sequence[Segment], ids: Collection[str]
) -> list[Segment]:
    """Stretches of a model without what some of its ids do to their motion."""
    segments, cutoff_hz = list(segments), model.prepared.thinner.cutoff_hz
    if found.commanded and (gone := chain_ids(found) & {*ids}):
        segments = path_segments(segments, chain_without(found, gone), cutoff_hz)
    steady = None if model.wind is None else np.array([*model.wind, 0.0])
    if moving_air("in windows").id in ids:
        segments = [replace(s, motion=replace(s.motion, wind=steady)) for s in segments]
    if moving_air("all the time").id in ids:
        segments = [replace(s, motion=replace(s.motion, wind=s.motion.wind - steady)) for s in segments]
    return segments


def with_only(found: Fitted, ids: Collection[str], values: Values) -> Fitted:
    """What was fitted with the effects `ids` and the wrong `values` alone; terms without a name stay.

    Rows are built anew where what goes lies between command and speed, or is air that moves.
    """
    model = found.model
    active = [k for k in model.selection.active if model.search.terms[k].effect in {*ids, *UNKNOWNS}]
    gone = chain_ids(found) - {*ids}
    if lost := _moved_by(found, model) - {*ids}:
        segments, noisy = (_stretches_without(found, model, s, lost) for s in (model.segments, model.noisy_segments))
        wind = None if moving_air("all the time").id in lost else model.wind
        gusts = () if moving_air("in windows").id in lost else model.gusts
        model = _rebuilt(replace(model, wind=wind, gusts=gusts), segments, noisy, active)
    fit = model.regression.fit([t.key for t in model.regression.terms if t.kind != "effect"] + active, jackknife=True)
    model = replace(model, selection=replace(model.selection, active=active, fit=fit))
    return replace(found, model=model, chain=chain_without(found, gone) if gone else found.chain, values=values)


def _rebuilt(model: WrenchModel, segments: list[Segment], noisy: list[Segment], active: Sequence[str]) -> WrenchModel:
    """A model's rows and regression on changed stretches, with its own noise and terms; nothing is searched."""
    prepared, old = model.prepared, model.regression
    kinds = {"effect"} if model.gusts else {"effect", "wind"}
    terms = [t for t in old.terms if t.kind not in kinds or t.key in active]
    rows = assemble_rows(prepared, terms, segments, model.effects)
    again = assemble_rows(prepared, terms, noisy, model.effects) if noisy else None
    return replace(
        model,
        terms=terms,
        rows=rows,
        regression=whitened(prepared, rows, terms, old.filters, segments, again, apart=True),
        segments=segments,
        noisy_segments=noisy,
        contributions=Contributions(rows, again, prepared.thinner.rate_hz),
        selection=Selection(list(active), model.selection.fit),
    )


def without_each(
    found: Fitted,
    seen: WrenchModel,
    values: Values,
    fit: Fit,
    findings: Sequence[Finding],
    traces: tuple[ChannelTrace, ...],
) -> dict[str, tuple[np.ndarray, ...]]:
    """To the id of every stated effect the residual (n,) of every trace without it, in the traces' order.

    Parameters
    ----------
    found, seen
        What was chosen, and the same with the rows of every run.
    values, fit
        The values called wrong, and what is delivered with all effects.
    findings, traces
        Those of the analysis. A mistake in the set has no model to leave it out of and is not in the answer.
    """
    out = {}
    model, active = found.model, found.model.selection.active
    for name in dict.fromkeys(f.id for f in findings if f.status in CLAIMED):
        own = [k for k in active if model.search.terms[k].effect == name]
        if own:
            fewer = settled(model, values, [k for k in active if k not in own])[0]
            out[name] = on_traces(traces, seen.rows, residuals_of(seen, scaled_by_run(seen, fewer)))
        elif found.measured and name in chain_ids(found):
            out[name] = _speeds_without(found, seen, name, traces)
        elif name in _moved_by(found, seen):
            made = rows_of(seen, _stretches_without(found, seen, seen.segments, [name]))
            named = np.where(seen.unnamed(fit.columns), 0.0, fit.beta)
            out[name] = on_traces(traces, seen.rows, [r.y - r.x[:, :, fit.columns] @ named for r in made])
    return out


def _speeds_without(
    found: Fitted, seen: WrenchModel, key: str, traces: tuple[ChannelTrace, ...]
) -> tuple[np.ndarray, ...]:
    """Measured less modelled rotor speeds on the traces, with one id less between command and speed."""
    chain = chain_without(found, [key])
    thinner, known = seen.prepared.thinner, {}
    for r, segment in zip(seen.rows, seen.prepared.segments, strict=True):
        left = thinner(segment.motion.rotor_speed - chain.speeds(segment))
        known |= {(r.run, first_s(r.time_s), f"rotor_speed_{i + 1}"): own for i, own in enumerate(left.T)}
    return tuple(known.get((t.run, first_s(t.time_s), t.channel), t.named) for t in traces)
