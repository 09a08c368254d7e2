"""Believed values that only make up for the form of an effect, which is approximate.

A law of nature has one form, an effect of the catalogue has many: another laboratory's thrust curve, cable or room is
never quite that of any equation written down before. What a strong effect's form leaves follows the same inputs, is far
above the noise, and a believed value will fit it. So a value that seems wrong must also be needed where the effect is
free to have any smooth form: its contribution times hat functions of the load's size, of its own size and of the tilt,
each rotor's share of it apart, fading within a run, and a little late. Effects whose equation is geometry or a
definition (`Effect.exact`) have that form and no other.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.effects.loading import Loading
from rotorid.mismatch.decision import rules
from rotorid.mismatch.decision.decide import WIDEST_TRUST, coefficients
from rotorid.mismatch.decision.select import KEEP_P, SHARE_OF_LARGEST
from rotorid.mismatch.instrument.model import ReadingModel, block_length, everything, restrain
from rotorid.mismatch.instrument.setup import averaged, pieces_of
from rotorid.mismatch.plant.regression import Regression, build
from rotorid.mismatch.plant.rows import Rows, Term
from rotorid.mismatch.plant.unknowns import UNKNOWNS

KNOTS = (0.0, 1 / 3, 2 / 3, 1.0)
"""Where the hat functions stand, as shares of the largest."""
WEAKER = 0.5
"""A value is weaker than an effect where it adds less than this share of what the effect explains by itself."""
OF_ITS_OWN = 0.5
"""Share of what a value explains that must remain given the effect's free form."""
LATE_ROWS = (1, 2, 4, 8)
"""Rows by which a free form may also be late."""
FREE = "free form"
GAIN = "gain"


def own_inputs(loading: Loading, model: ReadingModel) -> dict[str, np.ndarray]:
    """What the gain of an effect may depend on smoothly, (n,) each between 0 and 1, on a stretch's samples."""
    setup, out = model.setup, {}
    for name, axes in (("force", [0, 1, 2]), ("moment", [3, 4, 5])):
        largest = float(np.linalg.norm([setup.instrument.largest[c] for c in axes]))
        if any(c in setup.instrument.loaded for c in axes) and largest > 0:
            out[name] = np.minimum(np.linalg.norm(loading.load[:, axes], axis=1) / largest, 1.0)
    if loading.attitude is not None and setup.instrument.tilts:
        tilt = np.hypot(*(np.sin(a) for a in loading.attitude))
        largest = max(float(np.hypot(*(np.sin(a) for a in x.attitude)).max()) for x in model.loadings)
        out["tilt"] = tilt / max(largest, 1e-9)
    return out


def rotor_shares(loading: Loading) -> np.ndarray:
    """Share of every rotor but the last in the thrust, (n, k − 1)."""
    speed = loading.motion.rotor_speed
    if speed is None or speed.shape[1] < 2:
        return np.zeros((loading.size, 0))
    return (speed**2 / np.maximum((speed**2).sum(axis=1, keepdims=True), 1.0))[:, :-1]


def hats(values: np.ndarray) -> np.ndarray:
    """Hat functions at KNOTS of values (n,) between 0 and 1, (n, 4): they add up to one."""
    return np.stack([np.interp(values, KNOTS, row) for row in np.eye(len(KNOTS))], axis=1)


def gains_of(model: ReadingModel) -> list[np.ndarray]:
    """By which an effect's contribution may be multiplied, (n, m) on the rows of every part."""
    setup, out = model.setup, []
    for x in model.loadings:
        columns = [np.ones((x.size, 1)), (x.run_time_s / max(setup.instrument.run_s, 1e-9))[:, None], rotor_shares(x)]
        columns += [hats(v)[:, 1:] for v in own_inputs(x, model).values()]
        whole = averaged(np.concatenate(columns, axis=1), setup.average)
        out += [whole[p] for p in pieces_of(x, setup.average)]
    return out


def contribution_of(model: ReadingModel, key: str, beta: np.ndarray) -> list[np.ndarray]:
    """What a term adds to the rows of every part, (n, 6)."""
    cols = model.regression.columns([key])
    return [r.x[:, :, cols] @ beta for r in model.rows]


def freed(model: ReadingModel, key: str, beta: np.ndarray, channels: list[int]) -> list[np.ndarray]:
    """Columns of a term's free form on the rows of every part, (n, 6, m), apart in each of the channels."""
    parts, gains = contribution_of(model, key, beta), gains_of(model)
    largest = np.maximum(np.max([np.abs(p).max(axis=0) for p in parts], axis=0), 1e-300)
    out = []
    for part, gain in zip(parts, gains, strict=True):
        blocks = []
        for c in channels:
            own = part[:, c]
            shapes = np.concatenate(
                [
                    own[:, None] * gain,
                    own[:, None] * hats(np.abs(own) / largest[c])[:, 1:-1],
                    np.gradient(own)[:, None],
                    *(later(own, rows)[:, None] for rows in LATE_ROWS),
                ],
                axis=1,
            )
            block = np.zeros((len(own), 6, shapes.shape[1]))
            block[:, c] = shapes
            blocks.append(block)
        out.append(np.concatenate(blocks, axis=2))
    return out


def later(values: np.ndarray, rows: int) -> np.ndarray:
    """Values (n,) some rows later, the first held before."""
    return np.concatenate([np.full(min(rows, len(values)), values[0]), values[:-rows]])[: len(values)]


def beside(model: ReadingModel, keys: list[str], free: list[np.ndarray]) -> Regression:
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


def sizes(model: ReadingModel, active: list[str]) -> dict[str, np.ndarray]:
    """Size of every term at work by channel, in units of the noise, (6,) each."""
    fit, regression = model.regression.fit(model.search.always + active), model.regression
    return {k: model.search.ask.sizes_of(k, coefficients(regression, fit, k)[0]) for k in active}


def left_of(model: ReadingModel, value: str, strong: str, active: list[str], channels: list[int]) -> float:
    """Share of what a believed value explains that remains given a free form of `strong`; 0 if it is not significant.

    The value is as free as one that is called wrong.
    """
    fit, loose = model.regression.fit([*model.search.always, *active]), {value: WIDEST_TRUST}
    small = beside(model, active, freed(model, strong, coefficients(model.regression, fit, strong)[0], channels))
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
    size, fit = sizes(model, active), regression.fit([*search.always, *active], loose=loose)
    own = search.ask.sizes_of(value, coefficients(regression, fit, value)[0])
    out = []
    for other in active:
        effect = search.terms[other].effect
        if effect in UNKNOWNS or catalogue()[effect].exact:
            continue
        rest = [k for k in (*search.always, *active) if k not in (value, other)]
        none, alone = regression.fit(rest).gain, regression.fit([*rest, other]).gain
        weak, both = (
            regression.fit([*rest, value], loose=loose).gain,
            regression.fit([*rest, other, value], loose=loose).gain,
        )
        if alone < weak or both - alone > WEAKER * (alone - none):
            continue
        shared = [c for c in model.setup.instrument.channels if size[other][c] > own[c] * SHARE_OF_LARGEST]
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
        if any(left_of(model, key, s, active, c) < OF_ITS_OWN for s, c in stronger_ones(model, key, active)):
            out.add(key)
    return out if rules.NEEDLESS_VALUE(bool(out)) else set()
