"""What is left of every channel where one stated effect is left out and all else is fitted anew.

This is what an effect is worth to the reader: the difference between the model with it and the model without it, on
runs that neither was fitted to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rotorid.effects.catalogue import ids_of
from rotorid.mismatch.decision.findings import ChannelTrace, Finding
from rotorid.mismatch.model.delivered import Values, residuals_of
from rotorid.mismatch.model.fitted import Fitted
from rotorid.mismatch.model.report_runs import rows_of, scaled_by_run
from rotorid.mismatch.model.within_trust import settled
from rotorid.mismatch.model.wrench import WrenchModel, path_segments
from rotorid.mismatch.plant.regression import Fit
from rotorid.mismatch.plant.rows import CHANNELS, Rows
from rotorid.mismatch.plant.speedpath import CommandChain, commanded_path
from rotorid.mismatch.posterior.status import CLAIMED


def without_each(
    found: Fitted,
    seen: WrenchModel,
    values: Values,
    fit: Fit,
    findings: list[Finding],
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
    for finding in findings:
        if finding.status not in CLAIMED or finding.id in out:
            continue
        own = [k for k in active if model.search.terms[k].effect == finding.id]
        in_chain = found.chain is not None and finding.id in {k for k, _ in found.chain.result.fit.chain}
        if own:
            fewer = settled(model, values, [k for k in active if k not in own])[0]
            left = residuals_of(seen, scaled_by_run(seen, fewer))
            out[finding.id] = on_traces(traces, seen.rows, left)
        elif in_chain and found.measured:
            out[finding.id] = _speeds_without(found, seen, finding.id, traces)
        elif in_chain:
            segments = path_segments(seen.prepared.segments, *chain_without(found, finding.id), _cutoff_of(seen))
            out[finding.id] = on_traces(traces, seen.rows, made_by(seen, segments, fit))
        elif finding.id in ids_of("air_moves", "all the time") and seen.wind is not None:
            still = [replace(s, motion=replace(s.motion, wind=without_wind(s, seen.wind))) for s in seen.segments]
            out[finding.id] = on_traces(traces, seen.rows, made_by(seen, still, fit))
        elif finding.id in ids_of("air_moves", "in windows") and seen.gusts:
            steady = np.zeros(3) if seen.wind is None else np.array([*seen.wind, 0.0])
            calm = [replace(s, motion=replace(s.motion, wind=steady)) for s in seen.segments]
            out[finding.id] = on_traces(traces, seen.rows, made_by(seen, calm, fit))
    return out


def _cutoff_of(model: WrenchModel) -> float:
    return model.prepared.thinner.cutoff_hz


def without_wind(segment, wind: np.ndarray) -> np.ndarray:
    """A segment's wind less a steady one (north, east), m/s."""
    return segment.motion.wind - np.array([*wind, 0.0])


def chain_without(found: Fitted, key: str) -> CommandChain:
    """What lies between command and speed with one id less.

    Fitted anew where speeds are measured. Where commands alone are, forces and moments are fitted with the chain as it
    is: it stays so but for the id, or the two would no longer belong together.
    """
    result = found.chain.result
    if found.measured:
        return found.chain._replace(result=replace(result, fit=result.without[key]))
    where = result.fit.slice_of(key)
    chain = tuple((k, f) for k, f in result.fit.chain if k != key)
    values = np.delete(result.fit.values, np.arange(where.start, where.stop))
    return found.chain._replace(result=replace(result, fit=replace(result.fit, chain=chain, values=values)))


def made_by(model: WrenchModel, segments, fit: Fit) -> list[np.ndarray]:
    """What a fit leaves of stretches that were changed, (n, 12) each."""
    rows = rows_of(model, segments)
    named = np.where(model.unnamed(fit.columns), 0.0, fit.beta)
    return [r.y - r.x[:, :, fit.columns] @ named for r in rows]


def on_traces(
    traces: Sequence[ChannelTrace], rows: Sequence[Rows], left: Sequence[np.ndarray]
) -> tuple[np.ndarray, ...]:
    """Residuals (n, channels) of every stretch on the traces; what is delivered where a trace is of none of them."""
    known = {}
    for r, part in zip(rows, left, strict=True):
        known |= {(r.run, first_s(r.time_s), CHANNELS[k]): values for k, values in enumerate(part.T)}
    return tuple(known.get((t.run, first_s(t.time_s), t.channel), t.named) for t in traces)


def _speeds_without(
    found: Fitted, seen: WrenchModel, key: str, traces: tuple[ChannelTrace, ...]
) -> tuple[np.ndarray, ...]:
    """Measured less modelled rotor speeds on the traces, with one id less between command and speed."""
    result, *rest = chain_without(found, key)
    thinner, known = seen.prepared.thinner, {}
    for r, segment in zip(seen.rows, seen.prepared.segments, strict=True):
        path = commanded_path(segment, result.fit.chain, result.fit.values, result.fit.shift_s, *rest, result.fit.holds)
        left = thinner(segment.motion.rotor_speed - path)
        known |= {(r.run, first_s(r.time_s), f"rotor_speed_{i + 1}"): own for i, own in enumerate(left.T)}
    return tuple(known.get((t.run, first_s(t.time_s), t.channel), t.named) for t in traces)


def first_s(time_s: np.ndarray) -> float:
    """First instant of a stretch; of one without rows infinity."""
    return float(time_s[0]) if len(time_s) else np.inf
