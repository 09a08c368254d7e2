"""Stability and control derivatives of what a candidate vehicle leaves: a ridge regression a channel.

Rows are those where the candidate was not fitted, so that errors common to a run are left out with the run. A channel
has derivatives only where they take a tenth off its squares in the folds and help in half of them; quantities are
held at the edge of what was flown. Klein and Morelli, Aircraft System Identification, 2nd ed., ch. 5 (equation error,
collinearity).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from scipy.stats import t as student

from rotorid.recordings.vehicle import Derivative
from rotorid.vehicle.derivatives import CHANNELS, CONTROLS, QUANTITIES, table_of, unit_of, wrench

_PENALTIES = 10.0 ** np.arange(-4.0, 3.5, 0.5)
"""Of the ridge, times the number of rows; quantities are standardised."""
_LEVELLED = ("force_x", "force_y")
_DAMPED_BY = ("u", "v", "w", "p", "q", "r")
"""Of each channel the quantity that its own motion is: X_u, Y_v, Z_w, L_p, M_q and N_r are damping, or nothing."""


@dataclass(frozen=True)
class Learnt:
    """Derivatives, and what they predict of the rows that they were learnt from."""

    derivatives: tuple[Derivative, ...]
    left_out: np.ndarray
    """(n, 6) N and N m, each row by derivatives learnt without its fold; 0 in channels without any."""
    without: tuple[tuple[Derivative, ...], ...] = ()
    """Derivatives learnt without each fold."""

    def of(self, x: np.ndarray) -> np.ndarray:
        """What they add at quantities (n, 12), (n, 6), N and N m; 0 where a quantity is unknown."""
        return np.nan_to_num(wrench(x, *table_of(self.derivatives)))


def learn(
    x: np.ndarray,
    y: np.ndarray,
    fold: np.ndarray,
    controls: Mapping[str, tuple[str, float]] = MappingProxyType({}),
    of_the_day: bool = False,
) -> Learnt:
    """Derivatives by the quantities x (n, 12) of what is left of the channels, y (n, 6), N and N m.

    NaN is not recorded. `fold` (n,) numbers what is left out together; rows of -1 take no part. `controls` (as from
    `own_controls`) are used where they are exogenous. Intervals are the jackknife's over folds, by Student's t: what is
    common to a run is the same in all of its rows. A constant force along x or y that is `of_the_day`, its levelling as
    well as the vehicle, is fitted and left out.
    """
    known = np.isfinite(x).mean(axis=0) > 0.5
    known[QUANTITIES.index(CONTROLS[0]) :] = False  # what a controller commands follows what disturbs it
    state = known.copy()
    rows = (fold >= 0) & np.isfinite(x[:, known]).all(axis=1)
    asked = {}
    for channel, (quantity, unit) in controls.items():
        c, k = CHANNELS.index(channel), QUANTITIES.index(quantity)
        own = rows & np.isfinite(x[:, k]) & np.isfinite(y[:, c])
        if own.any() and _exogenous(x[own][:, state], unit * x[own, k], y[own, c]):
            known[k], asked[channel] = True, quantity
    rows &= np.isfinite(x[:, known]).all(axis=1)
    folds = [np.flatnonzero(rows & (fold == k)) for k in np.unique(fold[rows])]
    left_out = np.zeros((len(x), len(CHANNELS)))
    least_folds = 3
    if len(folds) < least_folds or known.sum() < 2:
        return Learnt((), left_out)
    edge = 0.002  # Share of the rows beyond each edge at which a quantity is held.
    low, high = np.quantile(x[rows][:, known], [edge, 1.0 - edge], axis=0)
    held = np.clip(x[:, known], low, high)
    middle, scale = held[rows].mean(axis=0), held[rows].std(axis=0)
    middle[0], scale[0] = 0.0, 1.0
    z = (held - middle) / np.maximum(scale, 1e-12)
    names = [q for q, there in zip(QUANTITIES, known, strict=True) if there]
    out: list[Derivative] = []
    apart: list[list[Derivative]] = [[] for _ in folds]
    for c, channel in enumerate(CHANNELS):
        if not np.isfinite(y[rows, c]).all():
            continue
        kept = np.array([q not in CONTROLS or q == asked.get(channel) for q in names])
        parts = [(z[f], y[f, c]) for f in folds]
        level = middle / np.maximum(scale, 1e-12) if of_the_day and channel in _LEVELLED else None
        beta, without, penalty = _ridge(parts, kept, level)
        own = names.index(_DAMPED_BY[c]) if _DAMPED_BY[c] in names else 0
        if own and beta[own] > 0:
            # No air drives a motion on: a positive one is what a closed loop feigns, and flown it runs away.
            kept[own] = False
            beta, without, penalty = _ridge(parts, kept, level)
        if penalty is None:
            continue
        for f, b in zip(folds, without, strict=True):
            left_out[f, c] = z[f] @ b
        values, others = (_about_zero(b, middle, scale) for b in (beta, without))
        count = len(folds)
        spread = np.sqrt((count - 1) / count * ((others - others.mean(axis=0)) ** 2).sum(axis=0))
        reach = student.ppf(0.975, count - 1) * spread
        out += [
            Derivative(
                channel=channel,
                quantity=q,
                unit=unit_of(channel, q),
                value=float(value),
                interval_95=(float(value - r), float(value + r)),
                low=float(a),
                high=float(b),
            )
            for q, value, r, a, b in zip(names, values, reach, low, high, strict=True)
            if q not in CONTROLS or q == asked.get(channel)
        ]
        at = [names.index(d.quantity) for d in out if d.channel == channel]
        for own, changed in zip(apart, others[:, at], strict=True):
            own += [d.model_copy(update={"value": float(v)}) for d, v in zip(out[-len(at) :], changed, strict=True)]
    return Learnt(tuple(out), left_out, tuple(map(tuple, apart)))


def _about_zero(beta: np.ndarray, middle: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Coefficients (..., k) of the quantities themselves from those of the standardised ones, the constant first."""
    slopes = beta / np.maximum(scale, 1e-12)
    slopes[..., 0] = beta[..., 0] - slopes[..., 1:] @ middle[1:]
    return slopes


def _exogenous(state: np.ndarray, asked: np.ndarray, left: np.ndarray) -> bool:
    """Whether what is left of a channel, (n,), says by how much more or less the rotors make than is `asked`, (n,).

    A controller that fights a disturbance asks against it: regressed on what is asked, what is felt then shows too
    small a gain, and what is asked, regressed on what is felt, too large a one. The true gain lies between (Klepper and
    Leamer 1984). It is known where none of the gains between is nearer to one, as stated, than to the first, which is
    what is learnt.
    """
    asked, felt = (v - state @ np.linalg.lstsq(state, v, rcond=None)[0] for v in (asked, asked + left))
    both = float(asked @ felt)
    # Share of what is asked that rotors make at least: less is what a controller leaves that cancels a disturbance.
    least_gain = 0.3
    if both <= least_gain * float(asked @ asked):
        return False
    first, last = both / float(asked @ asked) - 1.0, float(felt @ felt) / both - 1.0
    return first * last > 0 and abs(first) <= 2.0 * abs(last)


def _ridge(
    parts: list[tuple[np.ndarray, np.ndarray]], kept: np.ndarray, level: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, float | None]:
    """Coefficients (k,) of all folds' rows, those without each fold, (folds, k), and the penalty that leaves least
    there; no penalty where the channel is better without any. Columns that are not kept, (k,), have 0; the first is a
    constant, which is not shrunk, and which with a `level`, the columns at zero, is such that nothing is made there."""
    parts = [(x[:, kept], y) for x, y in parts]
    grams, rights = np.array([x.T @ x for x, _ in parts]), np.array([x.T @ y for x, y in parts])
    sizes = np.array([len(y) for _, y in parts])

    def solved(gram: np.ndarray, right: np.ndarray, count: int) -> np.ndarray:
        """(penalties, k)."""
        weight = np.ones(len(right))
        weight[0] = 0.0
        normal = gram + count * (_PENALTIES[:, None, None] * np.diag(weight) + 1e-9 * np.eye(len(right)))
        return np.linalg.solve(normal, np.broadcast_to(right[:, None], (len(_PENALTIES), len(right), 1)))[:, :, 0]

    gram, right, size = grams.sum(axis=0), rights.sum(axis=0), int(sizes.sum())
    without = np.array([solved(gram - g, right - r, size - n) for g, r, n in zip(grams, rights, sizes, strict=True)])
    left = np.array([((y[:, None] - x @ b.T) ** 2).sum(axis=0) for (x, y), b in zip(parts, without, strict=True)])
    best = int(np.argmin(left.sum(axis=0)))
    whole, without = solved(gram, right, size)[best], without[:, best]
    if level is not None:
        for b in (whole, *without):
            b[0] = b[1:] @ level[kept][1:]
    left = np.array([((y - x @ b) ** 2).sum() for (x, y), b in zip(parts, without, strict=True)])
    own = np.array([float(y @ y) for _, y in parts])
    most_left = 0.9  # Share of the squares where not fitted that derivatives may leave of a channel.
    # Share of the folds in which they must leave less: what seven laboratories choose for the eighth, each in turn.
    helps_in = 0.5
    pays = left.sum() < most_left * own.sum() and np.mean(left < own) >= helps_in
    beta, others = np.zeros(len(kept)), np.zeros((len(parts), len(kept)))
    beta[kept], others[:, kept] = whole, without
    return beta, others, float(_PENALTIES[best]) if pays else None
