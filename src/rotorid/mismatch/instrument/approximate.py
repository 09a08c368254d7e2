"""Believed values that only make up for the form of an effect, which is approximate.

A law of nature has one form, an effect of the catalogue has many: another laboratory's thrust curve, cable or room is
never quite that of any equation written down before. What a strong effect's form leaves follows the same inputs, is far
above the noise, and a believed value will fit it. So a value that seems wrong must also be needed where the effect is
free to have any smooth form: its contribution times hat functions of the load's size and of its own, and a little late.
Effects whose equation is geometry or a definition (`Effect.exact`) have that form and no other.

Gains of a reading that only look wrong because its characteristic is curved.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from rotorid.effects.catalogue import catalogue, ids_of
from rotorid.mismatch.decision import rules
from rotorid.mismatch.decision.decide import SMALLEST_CHANGE, WIDEST_TRUST, coefficients
from rotorid.mismatch.decision.select import KEEP_P, SHARE_OF_LARGEST
from rotorid.mismatch.instrument.model import ReadingModel, block_length, everything, restrain
from rotorid.mismatch.instrument.setup import averaged, pieces_of
from rotorid.mismatch.model.delivered import Values
from rotorid.mismatch.plant.regression import Regression, build
from rotorid.mismatch.plant.rows import Rows, Term
from rotorid.mismatch.plant.unknowns import UNKNOWNS

_SMALL_LOADS = 0.3
"""Share of the largest load up to which a load is small."""
_KNOTS = (0.0, 1 / 3, 2 / 3, 1.0)
"""Where the hat functions stand, as shares of the largest."""
_MOST_SHARE = 0.5
"""A value is weaker than an effect where it adds less than this share of what the effect explains by itself, and is not
needed where less than this share of what it adds remains given the effect's free form."""
_LATE_ROWS = (1, 2, 4, 8)
"""Rows by which a free form may also be late."""
_FREE = "free form"
_GAIN = "gain"


def hats(values: np.ndarray) -> np.ndarray:
    """Hat functions at KNOTS of values (n,) between 0 and 1, (n, 4): they add up to one."""
    return np.stack([np.interp(values, _KNOTS, row) for row in np.eye(len(_KNOTS))], axis=1)


def freed(model: ReadingModel, key: str, beta: np.ndarray, channels: list[int]) -> list[np.ndarray]:
    """Columns of a term's free form on the rows of every part, (n, 6, m), apart in each of the channels."""
    cols = model.regression.columns([key])
    parts = [r.x[:, :, cols] @ beta for r in model.rows]
    own_largest = np.maximum(np.max([np.abs(p).max(axis=0) for p in parts], axis=0), 1e-300)
    groups = [g for g in ([0, 1, 2], [3, 4, 5]) if set(g) & set(model.setup.instrument.loaded)]
    largest = np.array(model.setup.instrument.largest)
    out = []
    for part, load in zip(parts, _loads_of_rows(model), strict=True):
        gains = [np.ones((len(part), 1))]
        for g in groups:
            size = np.linalg.norm(load[:, g], axis=1) / np.linalg.norm(largest[g])
            gains.append(hats(np.minimum(size, 1.0))[:, 1:])
        block = []
        for c in channels:
            own = part[:, c, None]
            late = [np.concatenate([own[:1].repeat(min(rows, len(own)), axis=0), own[:-rows]]) for rows in _LATE_ROWS]
            shapes = [own * g for g in (*gains, hats(np.abs(own[:, 0]) / own_largest[c])[:, 1:-1])]
            columns = np.concatenate([*shapes, np.gradient(own, axis=0), *late], axis=1)
            block.append(np.eye(6)[c][None, :, None] * columns[:, None, :])
        out.append(np.concatenate(block, axis=2))
    return out


def _with_free(model: ReadingModel, keys: list[str], free: list[np.ndarray]) -> Regression:
    """The regression of some terms with the columns of a free form, key FREE, added."""
    regression, setup = model.regression, model.setup
    kept = [t for t in regression.terms if t.key in keys or t.kind != "effect"]
    cols = regression.columns([t.key for t in kept])
    size = free[0].shape[2]
    term = Term(_FREE, "nuisance", size=size, prior_sd=(np.inf,) * size)
    rows = [
        Rows(r.run, r.time_s, r.y, np.concatenate([r.x[:, :, cols], f], axis=2))
        for r, f in zip(model.rows, free, strict=True)
    ]
    per = block_length(setup, rows)
    out = build(rows, [*kept, term], regression.filters, everything, per / setup.rate_hz, setup.rate_hz)
    restrain(out, setup)
    return out


def _left_of(model: ReadingModel, value: str, strong: str, active: list[str], channels: list[int]) -> float:
    """Share of what a believed value explains that remains given a free form of `strong`; 0 if it is not significant.

    The value is as free as one that is called wrong.
    """
    fit, loose = model.regression.fit([*model.search.always, *active]), {value: WIDEST_TRUST}
    small = _with_free(model, active, freed(model, strong, coefficients(model.regression, fit, strong)[0], channels))
    every = [*model.search.always, *active]
    rest = [k for k in every if k != value]
    with_it = small.fit([_FREE, *every], loose=loose)
    if small.wald(with_it, small.columns([value]), int(small.training.sum())) > KEEP_P:
        return 0.0
    before = small.fit(every, loose=loose).gain - small.fit(rest).gain
    return float((with_it.gain - small.fit([_FREE, *rest]).gain) / max(before, 1e-9))


def _stronger_ones(model: ReadingModel, value: str, active: list[str]) -> list[tuple[str, list[int]]]:
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
        if gain(*rest, other) < gain(*rest, value) or added > _MOST_SHARE * explained:
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
    for key in (v for v in set(values) - settled if not v.startswith(_GAIN)):
        if any(_left_of(model, key, s, active, c) < _MOST_SHARE for s, c in _stronger_ones(model, key, active)):
            out.add(key)
    return out if rules.NEEDLESS_VALUE(bool(out)) else set()


def curved_gains(model: ReadingModel, values: Values) -> set[str]:
    """Gains called wrong given a curved characteristic that is right at small loads, or right over all of them.

    The gain of a curve is a convention: a reading that saturates is right at small loads, one with a dead band nearly
    so over all, and the slope that a polynomial has at no load is neither. A wrong calibration is off in both.
    """
    instrument = model.setup.instrument
    if not any(model.search.terms[k].effect in characteristics() for k in model.selection.active):
        return set()
    out = set()
    for key, (change, _) in values.items():
        of_key = [c for c in instrument.loaded if c < 3 and key in ("gain", f"gain_{'xyz'[c]}")]
        for share in (_SMALL_LOADS, 1.0) if of_key else ():
            # Channels may curve to either side: what they have in common is the gain.
            slope = np.mean([_slope_of(model, c, share * instrument.largest[c]) for c in of_key])
            if np.sign(change) * slope < SMALLEST_CHANGE:
                out.add(key)
    return out if rules.CURVED_GAIN(bool(out)) else set()


def characteristics() -> frozenset[str]:
    """Ids of a sensor's curves."""
    return ids_of("curve_of_load") & ids_of("kind", "sensor")


def _slope_of(model: ReadingModel, channel: int, most: float) -> float:
    """Slope, less one, of a reading over loads up to `most` in size, less all effects but a curved characteristic."""
    fit, search = model.selection.fit, model.search
    others = [k for k in model.selection.active if search.terms[k].effect not in characteristics()]
    known = np.isin(fit.columns, model.regression.columns(others))
    load, left = [], []
    for rows, loads in zip(model.rows, _loads_of_rows(model), strict=True):
        used = np.abs(loads[:, channel]) < most
        load.append(loads[used, channel])
        left.append((rows.y[:, channel] - rows.x[:, channel][:, fit.columns[known]] @ fit.beta[known])[used])
    columns = np.stack([np.concatenate(load), np.ones(sum(map(len, load)))], axis=1)
    return float(np.linalg.lstsq(columns, np.concatenate(left), rcond=1e-9)[0][0])


def _loads_of_rows(model: ReadingModel) -> list[np.ndarray]:
    """Loads (n, 6) of every part that has rows, in their order."""
    count = model.setup.average
    return [averaged(x.load, count)[p] for x in model.loadings for p in pieces_of(x, count)]
