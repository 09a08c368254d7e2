"""Effects that are only what the form of a stronger one leaves over.

No form is more than nearly true. What it leaves behind may follow time, runs or load well enough to pass for another
effect: a loop of plays leaves what looks like creep, a curved characteristic a drift. So an effect that explains little
beside a strong one is asked whether it is still needed where the strong one is not held to its form, but may do
anything with its own inputs: hysteresis with plays of many widths on all loads, a characteristic with straight pieces,
creep with many time constants. What then is no longer needed is a remainder, and no further effect.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.effects.creep import followed
from rotorid.effects.hysteresis import play
from rotorid.effects.loading import Instrument, Loading, change_of_load
from rotorid.mismatch import rules
from rotorid.mismatch.instrument.model import ReadingModel, block_length, everything
from rotorid.mismatch.instrument.setup import averaged, pieces_of
from rotorid.mismatch.regression import Regression, build
from rotorid.mismatch.rows import Rows, Term
from rotorid.mismatch.select import ENTER_P
from rotorid.mismatch.unknowns import UNKNOWNS

BESIDE = 0.25
"""What an effect explains beside another's, below which it may be what the other's form leaves over."""
KEPT = 0.5
"""Share of what it explains that it must still explain beside the other in a free form."""
WIDTHS = (0.01, 0.03, 0.08, 0.2, 0.5)
KNOTS = (-0.8, -0.6, -0.4, -0.2, 0.2, 0.4, 0.6, 0.8)
LAGS_S = (0.5, 2.0, 8.0, 30.0, 120.0, 500.0)

Columns = list[tuple[int, np.ndarray]]
"""Channel and what is added there, (n,)."""


def _forces(instrument: Instrument) -> list[int]:
    return [c for c in instrument.channels if c < 3]


def any_loops(loading: Loading, instrument: Instrument) -> Columns:
    """Plays of many widths: of every force on every force of a bench, else of each channel's own load."""
    load, out = change_of_load(loading), []
    for source in instrument.loaded:
        targets = _forces(instrument) if instrument.bench else [source]
        for share in WIDTHS:
            width = share * instrument.largest[source]
            branch = (load[:, source] - play(load[:, source], width)) / width
            out += [(target, branch) for target in targets]
    return out


def any_curve(loading: Loading, instrument: Instrument) -> Columns:
    """Straight pieces over the load on the channel's own axis."""
    out = []
    for c in instrument.loaded:
        part = loading.load[:, c] / instrument.largest[c]
        out += [(c, np.maximum(part - k, 0.0) if k > 0 else np.minimum(part - k, 0.0)) for k in KNOTS]
    return out


def any_mixture(loading: Loading, instrument: Instrument) -> Columns:
    """Products of two loads on every channel of a bench."""
    forces = [c for c in instrument.loaded if c < 3] if instrument.bench else []
    parts = {c: loading.load[:, c] / instrument.largest[c] for c in forces}
    pairs = list(combinations_with_replacement(forces, 2))
    return [(t, parts[i] * parts[j]) for i, j in pairs for t in instrument.channels]


def any_drift(loading: Loading, instrument: Instrument) -> Columns:
    """Powers of the times and of the temperature, from nothing at their start."""
    inputs = [loading.run_time_s / instrument.run_s]
    if instrument.session_s > 0:
        inputs.append(loading.session_time_s / instrument.session_s)
    low, high = instrument.temperatures_c
    if high > low:
        inputs.append((loading.temperature_c - low) / (high - low))
    return [(c, x**power) for x in inputs for power in (1, 2, 3, 4) for c in instrument.channels]


def any_creep(loading: Loading, instrument: Instrument) -> Columns:
    """Lags of many time constants on the channel's own load."""
    lags = [followed(change_of_load(loading), tau, loading.dt_s) for tau in LAGS_S if tau < 3 * instrument.duration_s]
    return [(c, lag[:, c]) for lag in lags for c in instrument.loaded]


def any_timing(loading: Loading, instrument: Instrument) -> Columns:
    """Derivatives of the load, and its first times the time."""
    out, change = [], loading.load
    for order in range(3):
        change = np.gradient(change, loading.dt_s, axis=0)
        out += [(c, change[:, c]) for c in instrument.loaded]
        if order == 0:
            times = [loading.run_time_s, loading.session_time_s if instrument.session_clock else None]
            out += [(c, change[:, c] * t) for t in times if t is not None for c in instrument.loaded]
    return out


FREE: dict[str, Callable[[Loading, Instrument], Columns]] = {
    "hysteresis": any_loops,
    "load_nonlinearity": any_curve,
    "crosstalk": any_mixture,
    "compliance": any_mixture,
    "zero_drift": any_drift,
    "creep": any_creep,
    "clock_skew": any_timing,
    "delay": any_timing,
    "amplifier_filter": any_timing,
    "structural_resonance": any_timing,
}
"""What an effect may do with its own inputs where it is not held to a form."""


@dataclass(frozen=True)
class Remainder:
    """An effect that is what the form of stronger ones leaves over."""

    key: str
    kept: float
    """Share of what it explains that it still explains where the stronger ones are free."""
    reason: str


def remainder(model: ReadingModel) -> Remainder | None:
    """Of the effects at work the one that is least needed where stronger ones have a free form; None if all are."""
    regression, search = model.regression, model.search
    active = model.selection.active
    whole = regression.explained(search.always + active)
    alone = {k: whole - regression.explained(search.always + [x for x in active if x != k]) for k in active}
    named = [k for k in active if search.terms[k].effect not in UNKNOWNS]
    free_ids = {e for e, columns in FREE.items() if columns(model.loadings[0], model.setup.instrument)}
    found = []
    for key in named:
        strong = [k for k in named if alone[key] < BESIDE * alone[k] and search.terms[k].effect in free_ids]
        if not strong:
            continue
        ids = tuple(dict.fromkeys(search.terms[k].effect for k in strong))
        free = freed(model, ids)
        keys = [*search.always, *active, *(f"free/{e}" for e in ids)]
        kept = (free.explained(keys) - free.explained([k for k in keys if k != key])) / max(alone[key], 1e-9)
        p = free.wald(free.fit(keys), free.columns([key]), search.blocks)
        if kept < KEPT or p > ENTER_P:
            names = " and ".join(catalogue()[e].name for e in ids)
            found.append(Remainder(key, kept, f"{names} in a freer form explains it"))
    return min(found, key=lambda r: r.kept, default=None)


def freed(model: ReadingModel, ids: tuple[str, ...]) -> Regression:
    """The regression of what is at work and, beside it, what the effects `ids` may do without a form."""
    setup, instrument, search = model.setup, model.setup.instrument, model.search
    chosen = [t for t in model.terms if t.key in (*search.always, *model.selection.active)]
    kept = model.regression.columns([t.key for t in chosen])
    channels, rows, sizes = list(instrument.channels), [], {}
    at = 0
    for loading in model.loadings:
        whole = []
        for effect in ids:
            columns = FREE[effect](loading, instrument)
            sizes[effect] = len(columns)
            for channel, values in columns:
                added = np.zeros((loading.size, 6))
                added[:, channel] = values
                whole.append(averaged(added, setup.average))
        for piece in pieces_of(loading, setup.average):
            r = model.rows[at]
            at += 1
            free = np.stack([w[piece] for w in whole], axis=2)
            free[:, [c for c in range(6) if c not in channels]] = 0.0
            rows.append(Rows(r.run, r.time_s, r.y, np.concatenate([r.x[:, :, kept], free], axis=2)))
    freely = [Term(f"free/{e}", "free", e, size=sizes[e], prior_sd=(np.inf,) * sizes[e]) for e in ids]
    per = block_length(setup, rows)
    return build(rows, [*chosen, *freely], model.regression.filters, everything, per / setup.rate_hz, setup.rate_hz)


def without_remainders(model: ReadingModel, again: Callable[[list[str], dict[str, str]], ReadingModel]) -> ReadingModel:
    """The model without effects that are only what others leave over; `again(active, refused)` searches once more."""
    refused: dict[str, str] = {}
    while rules.REMAINDER((found := remainder(model)) is not None):
        refused[model.search.terms[found.key].effect] = found.reason
        model = again([k for k in model.selection.active if k != found.key], dict(refused))
    if not refused:
        return model
    told = {**model.selection.not_established, **refused}
    return replace(model, selection=replace(model.selection, not_established=told))
