"""Effects of an instrument that are of no use on the runs held out.

What is established lowers an error there. An effect that is at work on the runs held out and lowers the error of none
of its channels was of the runs fitted: slow noise (1/f) bends them as creep or a drift would. An effect whose numbers
belong to single runs (an offset of each) says nothing of other runs, so it is only told apart from a cause that does:
where, without it, something else explains the runs held out better, that is at work instead.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from rotorid.mismatch.channel_errors import excited, growth, helps
from rotorid.mismatch.findings import Reason
from rotorid.mismatch.instrument.decide import main_channels
from rotorid.mismatch.instrument.model import REFUTED, ReadingModel, block_length, of_single_runs
from rotorid.mismatch.instrument.values import Values, delivered, held_out, settled
from rotorid.mismatch.unknowns import UNKNOWNS

HELP_Z = 0.5
"""Standard errors by which the squares of one channel that an effect acts in must grow without it: it has been found
already, in the runs fitted, so doubt is not held against it beyond the coin's."""
USELESS = Reason("use", "without it the error on the runs held out is no larger in any channel that it acts in")
OF_OTHER_RUNS = Reason(
    "other_runs", "something else explains the runs held out, of which its numbers for single runs say nothing"
)

Again = Callable[[list[str], dict[str, str]], ReadingModel]
"""Searches once more from the terms of a list, without the ids refused."""

ValuesOf = Callable[[ReadingModel], Values]
"""The believed values that a model's recordings contradict."""


def without_useless(model: ReadingModel, again: Again, values_of: ValuesOf) -> ReadingModel:
    """The model less what is of no use on the runs held out, searched anew without it, the least useful first."""
    while (key := useless(model, values_of)) is not None:
        model = refusing(model, key, USELESS, again)
    for key in [k for k in model.selection.active if of_single_runs(k)]:
        other = refusing(model, key, OF_OTHER_RUNS, again)
        gains = [m.search.held_out_gain(m.selection.active) for m in (model, other)]
        if None not in gains and gains[1] > gains[0] + REFUTED and useless(other, values_of) is None:
            model = other
    return model


def refusing(model: ReadingModel, key: str, reason: str, again: Again) -> ReadingModel:
    """The model searched anew without a term's id."""
    effect = model.search.terms[key].effect
    found = again([k for k in model.selection.active if k != key], {**model.search.refused, effect: reason})
    told = {**model.selection.not_established, **found.selection.not_established, effect: reason}
    kept = {found.search.terms[k].effect for k in found.selection.active}
    told = {e: r for e, r in told.items() if e not in kept}
    return replace(found, selection=replace(found.selection, not_established=told))


def useless(model: ReadingModel, values_of: ValuesOf) -> str | None:
    """The term at work that helps least on the rows held out, if it does not help there at all; None if all do.

    Judged by what is delivered with it and without it.
    """
    regression, search, active = model.regression, model.search, model.selection.active
    held, per, values = held_out(model), block_length(model.setup, model.rows), values_of(model)

    def left(keys: list[str]) -> list[np.ndarray]:
        return delivered(model, settled(model, values, keys)[0])

    with_it, found = left(active), []
    fit = regression.fit(search.always + active)
    for key in active:
        if search.terms[key].effect in UNKNOWNS or of_single_runs(key):
            continue
        cols = regression.columns([key])
        beta = fit.beta[fit.places(cols)]
        channels = [c for c in main_channels(model, key) if excited([r.x[:, c, cols] @ beta for r in model.rows], held)]
        change = growth(with_it, left([k for k in active if k != key]), held, per)
        found.append((helps(*change, channels), key))
    least = min(found, default=None)
    return least[1] if least is not None and least[0] < HELP_Z else None
