"""Believed values that only make up for the form of an effect, which is approximate.

A law of nature has one form, an effect of the catalogue has many: another laboratory's thrust curve, cable or room is
never quite that of any equation written down before. What a strong effect's form leaves follows the same inputs, is far
above the noise, and a believed value will fit it. So a value that seems wrong must also be needed where the effect is
free to have any smooth form: its contribution times hat functions of the load's size and of its own, and a little late.
Effects whose equation is geometry or a definition (`Effect.exact`) have that form and no other.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.decision import rules
from rotorid.mismatch.decision.decide import WIDEST_TRUST, coefficients
from rotorid.mismatch.decision.select import KEEP_P, SHARE_OF_LARGEST
from rotorid.mismatch.instrument.curved_gain import loads_of_rows
from rotorid.mismatch.instrument.model import ReadingModel, block_length, everything, restrain
from rotorid.mismatch.plant.regression import Regression, build
from rotorid.mismatch.plant.rows import Rows, Term
from rotorid.mismatch.plant.unknowns import UNKNOWNS

KNOTS = (0.0, 1 / 3, 2 / 3, 1.0)
"""Where the hat functions stand, as shares of the largest."""
MOST_SHARE = 0.5
"""A value is weaker than an effect where it adds less than this share of what the effect explains by itself, and is not
needed where less than this share of what it adds remains given the effect's free form."""
LATE_ROWS = (1, 2, 4, 8)
"""Rows by which a free form may also be late."""
FREE = "free form"
GAIN = "gain"


def hats(values: np.ndarray) -> np.ndarray:
    """Hat functions at KNOTS of values (n,) between 0 and 1, (n, 4): they add up to one."""
    return np.stack([np.interp(values, KNOTS, row) for row in np.eye(len(KNOTS))], axis=1)


def freed(model: ReadingModel, key: str, beta: np.ndarray, channels: list[int]) -> list[np.ndarray]:
    """Columns of a term's free form on the rows of every part, (n, 6, m), apart in each of the channels."""
    cols = model.regression.columns([key])
    parts = [r.x[:, :, cols] @ beta for r in model.rows]
    own_largest = np.maximum(np.max([np.abs(p).max(axis=0) for p in parts], axis=0), 1e-300)
    groups = [g for g in ([0, 1, 2], [3, 4, 5]) if set(g) & set(model.setup.instrument.loaded)]
    largest = np.array(model.setup.instrument.largest)
    out = []
    for part, load in zip(parts, loads_of_rows(model), strict=True):
        gains = [np.ones((len(part), 1))]
        for g in groups:
            size = np.linalg.norm(load[:, g], axis=1) / np.linalg.norm(largest[g])
            gains.append(hats(np.minimum(size, 1.0))[:, 1:])
        block = []
        for c in channels:
            own = part[:, c, None]
            late = [np.concatenate([own[:1].repeat(min(rows, len(own)), axis=0), own[:-rows]]) for rows in LATE_ROWS]
            shapes = [own * g for g in (*gains, hats(np.abs(own[:, 0]) / own_largest[c])[:, 1:-1])]
            columns = np.concatenate([*shapes, np.gradient(own, axis=0), *late], axis=1)
            block.append(np.eye(6)[c][None, :, None] * columns[:, None, :])
        out.append(np.concatenate(block, axis=2))
    return out


def with_free(model: ReadingModel, keys: list[str], free: list[np.ndarray]) -> Regression:
    """The regression of some terms with the columns of a free form, key FREE, added."""
    regression, setup = model.regression, model.setup
    kept = [t for t in regression.terms if t.key in keys or t.kind != "effect"]
    cols = regression.columns([t.key for t in kept])
    size = free[0].shape[2]
    term = Term(FREE, "nuisance", size=size, prior_sd=(np.inf,) * size)
    rows = [
        Rows(r.run, r.time_s, r.y, np.concatenate([r.x[:, :, cols], f], axis=2))
        for r, f in zip(model.rows, free, strict=True)
    ]
    per = block_length(setup, rows)
    out = build(rows, [*kept, term], regression.filters, everything, per / setup.rate_hz, setup.rate_hz)
    restrain(out, setup)
    return out


def left_of(model: ReadingModel, value: str, strong: str, active: list[str], channels: list[int]) -> float:
    """Share of what a believed value explains that remains given a free form of `strong`; 0 if it is not significant.

    The value is as free as one that is called wrong.
    """
    fit, loose = model.regression.fit([*model.search.always, *active]), {value: WIDEST_TRUST}
    small = with_free(model, active, freed(model, strong, coefficients(model.regression, fit, strong)[0], channels))
    every = [*model.search.always, *active]
    rest = [k for k in every if k != value]
    with_it = small.fit([FREE, *every], loose=loose)
    if small.wald(with_it, small.columns([value]), int(small.training.sum())) > KEEP_P:
        return 0.0
    before = small.fit(every, loose=loose).gain - small.fit(rest).gain
    return float((with_it.gain - small.fit([FREE, *rest]).gain) / max(before, 1e-9))


def stronger_ones(model: ReadingModel, value: str, active: list[str]) -> list[tuple[str, list[int]]]:
    """Terms at work that by themselves explain far more than a believed value adds to them, with the channels they
    share.

    Not by the sizes in the fit: two that make up for each other's form are both large.
    """
    search, regression, loose = model.search, model.regression, {value: WIDEST_TRUST}

    def size(key, fit):
        return search.ask.sizes_of(key, coefficients(regression, fit, key)[0])

    def gain(*keys):
        return regression.fit(list(keys), loose=loose if value in keys else None).gain

    every = [*search.always, *active]
    fit, own = regression.fit(every), size(value, regression.fit(every, loose=loose))
    out = []
    for other in active:
        effect = search.terms[other].effect
        if effect in UNKNOWNS or catalogue()[effect].exact:
            continue
        rest = [k for k in (*search.always, *active) if k not in (value, other)]
        explained, added = gain(*rest, other) - gain(*rest), gain(*rest, other, value) - gain(*rest, other)
        if gain(*rest, other) < gain(*rest, value) or added > MOST_SHARE * explained:
            continue
        shared = [c for c in model.setup.instrument.channels if size(other, fit)[c] > own[c] * SHARE_OF_LARGEST]
        if shared:
            out.append((other, shared))
    return out


def needless_values(model: ReadingModel, values: Iterable[str]) -> set[str]:
    """Of believed values that seem wrong those that only make up for the form of an effect at work.

    Also those that a form's own parameters say again: another power of the speed has no C_F to believe.
    """
    active = model.selection.active
    settled = {v for k in active for v in model.search.terms[k].form.takes_up}
    out = settled & set(values)
    # Any smooth characteristic has a slope of its own: of gains the curve itself is asked (`curved_gain`).
    for key in (v for v in set(values) - settled if not v.startswith(GAIN)):
        if any(left_of(model, key, s, active, c) < MOST_SHARE for s, c in stronger_ones(model, key, active)):
            out.add(key)
    return out if rules.NEEDLESS_VALUE(bool(out)) else set()
