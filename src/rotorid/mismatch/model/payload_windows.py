"""When a payload is on board, where it is picked up or dropped in flight.

Added mass is seen in every half second by itself: by it the thrust exceeds what the accelerometer accounts for, and
off the centre it turns the vehicle. Where these loads are two plateaus with a sudden change between them in the
midst of a run, the higher one is a payload on board for so long. What drifts is none (a battery, ice), and what
differs between whole runs alone may be anything (other propellers, denser air). As for a gust, the instants are found
in held-out runs too; what is on board is learnt from the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import median_filter, uniform_filter1d

from rotorid.mismatch.model.wrench import WrenchModel
from rotorid.mismatch.plant.motion import Segment, stretches
from rotorid.mismatch.plant.rows import Term
from rotorid.mismatch.plant.unknowns import UNKNOWNS

_SEEN_IN = ((2, 0), (4, 1), (3, 2))
"""Channel and parameter of a load: its mass in the vertical force, its places in the moments of pitch and roll."""
_BLOCK_S = 0.5
_SMOOTHED_BLOCKS = 9
_SWITCH_COST = 30.0
"""Squares, in units of the blocks' own scatter, that taking up or dropping must explain."""
_LEAST_BLOCKS = 8
"""Blocks of either state, of all runs together."""
_LEAST_STEP = 3.0
"""Distance of the two plateaus in units of the scatter of a block."""
_MOST_DRIFT = 0.2
"""Share of the slow variation of the loads that the two plateaus may leave."""
_EDGE_S = 1.5
"""Distance from the border of two blocks within which the instant is looked for."""
Windows = tuple[tuple[float, float], ...]
"""(start_s, stop_s) of what is on board in a stretch, without end where it is on board from or to its end."""


def payload_windows_of(model: WrenchModel) -> list[Windows]:
    """When a payload seems to be on board in every stretch; empty where none is picked up or dropped in one's midst."""
    if not loads(model) or not np.isfinite(model.rows[0].y[:, _SEEN_IN[0][0]]).all():
        return []
    left, columns = _unexplained_loads(model)
    per = max(2, int(_BLOCK_S * model.prepared.thinner.rate_hz))
    aboard = two_plateaus([_block_loads(y, x, per) for y, x in zip(left, columns, strict=True)])
    if aboard is None:
        return []
    out = []
    for r, y, x, states in zip(model.rows, left, columns, aboard, strict=True):
        edges = [-np.inf, *(float(r.time_s[i]) for i in change_rows(states, y[:, 0], x[:, 0], per)), np.inf]
        first = 0 if len(states) and states[0] else 1
        out.append(tuple(zip(edges[first:-1:2], edges[first + 1 :: 2], strict=True)))
    return out


def loads(model: WrenchModel) -> list[Term]:
    """Terms of what may be there for a part of a run alone: the one in the model first, then that of fewest parameters.

    Rows of runs held out have the columns of what is in the model alone.
    """
    found = (t for t in model.search.terms.values() if t.form and t.form.comes_and_goes)
    return sorted(found, key=lambda t: (t.key not in model.selection.active, t.size))


def _unexplained_loads(model: WrenchModel) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """What the named effects but a payload leave in the channels of SEEN_IN that there are, and a payload's columns
    there, each (n, channels) of every stretch."""
    regression, fit = model.regression, model.selection.fit
    terms = model.search.terms
    aside = {loads(model)[0].effect, *UNKNOWNS}
    others = [k for k in model.selection.active if terms[k].effect not in aside and not terms[k].run]
    cols, own = regression.columns(others), regression.columns([loads(model)[0].key])
    beta = fit.beta[fit.places(cols)]
    present = [(c, p) for c, p in _SEEN_IN if np.isfinite(model.rows[0].y[:, c]).all()]
    left = [np.stack([r.y[:, c] - r.x[:, c][:, cols] @ beta for c, _ in present], axis=1) for r in model.rows]
    columns = [np.stack([r.x[:, c, own[p]] for c, p in present], axis=1) for r in model.rows]
    return left, columns


def _block_loads(left: np.ndarray, columns: np.ndarray, per: int) -> np.ndarray:
    """Mass, and mass times place, (blocks, channels) of `per` rows each, from residual and columns (n, channels)."""
    count = len(left) // per
    y, x = (part[: count * per].reshape(count, per, part.shape[1]) for part in (left, columns))
    return (x * y).sum(axis=1) / np.maximum((x**2).sum(axis=1), 1e-12)


def two_plateaus(loads: Sequence[np.ndarray]) -> list[np.ndarray] | None:
    """Whether a payload is on board by blocks of every stretch; None where loads (blocks, k) are not two plateaus."""
    steps = np.concatenate([np.diff(part, axis=0) for part in loads])
    if len(steps) < 4 * _LEAST_BLOCKS:
        return None
    scatter = 1.4826 * np.median(np.abs(steps), axis=0) / np.sqrt(2)
    if not (scatter > 0).all():
        return None
    scaled = [part / scatter for part in loads]
    smooth = [median_filter(part, (_SMOOTHED_BLOCKS, 1), mode="nearest") for part in scaled]
    low, high = np.quantile(np.concatenate(smooth)[:, 0], (0.05, 0.95))
    states = [part[:, 0] > (low + high) / 2 for part in smooth]
    for _ in range(20):
        everything, inside = np.concatenate(scaled), np.concatenate(states)
        if min(inside.sum(), (~inside).sum()) < _LEAST_BLOCKS:
            return None
        plateaus = np.stack([everything[~inside].mean(axis=0), everything[inside].mean(axis=0)])
        again = [_cheapest_states(part, plateaus) for part in scaled]
        same = all(np.array_equal(a, b) for a, b in zip(again, states, strict=True))
        states = again
        if same:
            break
    step = plateaus[1] - plateaus[0]
    if not any(np.diff(s).any() for s in states) or step[0] < _LEAST_STEP:
        return None
    rest = [part - plateaus[s.astype(int)] for part, s in zip(scaled, states, strict=True)]
    return states if _slow_variance(rest) < _MOST_DRIFT * _slow_variance(scaled) else None


def _slow_variance(parts: Sequence[np.ndarray]) -> float:
    """Variance of what is slower than SMOOTHED_BLOCKS in stretches (blocks, k), all k together."""
    smooth = np.concatenate([uniform_filter1d(p, _SMOOTHED_BLOCKS, axis=0, mode="nearest") for p in parts if len(p)])
    return float(smooth.var(axis=0).sum())


def _cheapest_states(loads: np.ndarray, plateaus: np.ndarray) -> np.ndarray:
    """States (blocks,) of least squares from two plateaus (2, k), each change at SWITCH_COST (Viterbi)."""
    costs = ((loads[:, None, :] - plateaus[None]) ** 2).sum(axis=2)
    total, came = np.zeros(2), np.zeros((len(costs), 2), int)
    for i, cost in enumerate(costs):
        moved = total[::-1] + _SWITCH_COST
        came[i] = np.where(moved < total, [1, 0], [0, 1])
        total = np.minimum(total, moved) + cost
    state, out = int(np.argmin(total)), np.zeros(len(costs), bool)
    for i in range(len(costs) - 1, -1, -1):
        out[i] = bool(state)
        state = came[i, state]
    return out


def change_rows(states: np.ndarray, left: np.ndarray, column: np.ndarray, per: int) -> list[int]:
    """Rows at which the vertical force (n,) changes from one plateau to the other, near where the blocks do."""
    state_of = np.repeat(states, per)
    y, x = left[: len(state_of)], column[: len(state_of)]
    mass = [float((x * y)[state_of == s].sum() / max((x**2)[state_of == s].sum(), 1e-12)) for s in (False, True)]
    errors = np.stack([(y - m * x) ** 2 for m in mass])
    edges = []
    for block in np.flatnonzero(np.diff(states)) + 1:
        middle, reach = block * per, int(_EDGE_S / _BLOCK_S * per)
        start, stop = max(0, middle - reach), min(len(y), middle + reach)
        before, after = int(states[block - 1]), int(states[block])
        gain = np.cumsum(errors[after, start:stop] - errors[before, start:stop])
        edges.append(start + int(np.argmax(gain)) + 1)
    return edges


def with_payload_on_board(segments: Sequence[Segment], windows: Sequence[Windows]) -> list[Segment]:
    """Segments that say when a payload is on board, from the windows of each."""
    out = []
    for s, own in zip(segments, windows, strict=True):
        aboard = np.zeros(s.motion.size)
        for start, stop in own:
            aboard[(s.motion.time_s >= start) & (s.motion.time_s < stop)] = 1.0
        out.append(replace(s, motion=replace(s.motion, on_board=aboard)))
    return out


def changes(segments: Sequence[Segment]) -> int:
    """How often a payload is picked up or dropped inside a segment."""
    return sum(int(np.abs(np.diff(s.motion.on_board)).sum()) for s in segments)


def on_board(segments: Sequence[Segment]) -> tuple[tuple[str, float, float], ...]:
    """(run, start_s, stop_s) of a payload as segments say it; empty where they say nothing (on board throughout)."""
    found = []
    for s in segments:
        if s.motion.on_board is not None:
            for start, stop in stretches(s.motion.on_board > 0.5):
                found.append((s.run, float(s.motion.time_s[start]), float(s.motion.time_s[stop - 1])))
    return tuple(found)
