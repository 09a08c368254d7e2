"""Which vehicle is taken home: one number chooses among a few candidates, with or without derivatives.

The number is the mean, over the channels of force and moment and over what half a second of simulation from recorded
states is off by, of the logarithm of the error on what was left out of the fit (`Regression.folds`): whole
runs where there are three or more. Taken is the plainest candidate within one standard error of the best, among those
that hover and fly; without derivatives also one within three percent of one with them. No channel has a veto, and no
part is taken out by itself.

Stability and control derivatives of what a candidate vehicle leaves: a ridge regression a channel.

Rows are those where the candidate was not fitted, so that errors common to a run are left out with the run. A channel
has derivatives only where they take a tenth off its squares in the folds and help in half of them; quantities are
held at the edge of what was flown. Klein and Morelli, Aircraft System Identification, 2nd ed., ch. 5 (equation error,
collinearity).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Literal

import numpy as np
from scipy.stats import t as student

from rotorid.mismatch.evidence.regression import Fit
from rotorid.mismatch.flight.delivered import Values
from rotorid.recordings.vehicle import Derivative
from rotorid.vehicle.derivatives import CHANNELS, CONTROLS, QUANTITIES, table_of, unit_of, wrench

_PENALTIES = 10.0 ** np.arange(-4.0, 3.5, 0.5)
"""Of the ridge, times the number of rows; quantities are standardised."""
_MOST_LEFT = 0.9
"""Share of the squares where not fitted that derivatives may leave of a channel."""
_HELPS_IN = 0.5
"""Share of the folds in which they must leave less: what seven laboratories choose for the eighth, each in turn."""
_EDGE = 0.002
"""Share of the rows beyond each edge at which a quantity is held."""
_LEAST_FOLDS = 3
_LEAST_GAIN = 0.3
"""Share of what is asked that rotors make at least: less is what a controller leaves that cancels a disturbance."""
_DAMPED_BY = ("u", "v", "w", "p", "q", "r")
"""Of each channel the quantity that its own motion is: X_u, Y_v, Z_w, L_p, M_q and N_r are damping, or nothing."""
_PLAINEST_FIRST = (
    ("believed", False),
    ("refitted", False),
    ("named", False),
    ("named", True),
    ("refitted", True),
    ("believed", True),
)
"""Candidates by how much of them has no cause: derivatives next to named physics have less to say than those in its
place."""
_DRAWS = 400
_WORTH = 0.03
"""Logarithm of an error below which derivatives gain nothing that shows in flight."""


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
    x: np.ndarray, y: np.ndarray, fold: np.ndarray, controls: Mapping[str, tuple[str, float]] = MappingProxyType({})
) -> Learnt:
    """Derivatives by the quantities x (n, 12) of what is left of the channels, y (n, 6), N and N m.

    NaN is not recorded. `fold` (n,) numbers what is left out together; rows of -1 take no part. `controls` (as from
    `own_controls`) are used where they are exogenous. Intervals are the jackknife's over folds, by Student's t: what is
    common to a run is the same in all of its rows.
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
    if len(folds) < _LEAST_FOLDS or known.sum() < 2:
        return Learnt((), left_out)
    low, high = np.quantile(x[rows][:, known], [_EDGE, 1.0 - _EDGE], axis=0)
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
        beta, without, penalty = _ridge([(z[f], y[f, c]) for f in folds], kept)
        own = names.index(_DAMPED_BY[c]) if _DAMPED_BY[c] in names else 0
        if own and beta[own] > 0:
            # No air drives a motion on: a positive one is what a closed loop feigns, and flown it runs away.
            kept[own] = False
            beta, without, penalty = _ridge([(z[f], y[f, c]) for f in folds], kept)
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
    if both <= _LEAST_GAIN * float(asked @ asked):
        return False
    first, last = both / float(asked @ asked) - 1.0, float(felt @ felt) / both - 1.0
    return first * last > 0 and abs(first) <= 2.0 * abs(last)


def _ridge(parts: list[tuple[np.ndarray, np.ndarray]], kept: np.ndarray) -> tuple[np.ndarray, np.ndarray, float | None]:
    """Coefficients (k,) of all folds' rows, those without each fold, (folds, k), and the penalty that leaves least
    there; no penalty where the channel is better without any. Columns that are not kept, (k,), have 0; the first is a
    constant, which is not shrunk."""
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
    own = np.array([float(y @ y) for _, y in parts])
    best = int(np.argmin(left.sum(axis=0)))
    pays = left[:, best].sum() < _MOST_LEFT * own.sum() and np.mean(left[:, best] < own) >= _HELPS_IN
    beta, others = np.zeros(len(kept)), np.zeros((len(parts), len(kept)))
    beta[kept], others[:, kept] = solved(gram, right, size)[best], without[:, best]
    return beta, others, float(_PENALTIES[best]) if pays else None


@dataclass(frozen=True)
class Candidate:
    """A vehicle that may be taken home."""

    model: Literal["believed", "refitted", "named"]
    values: Values
    """Values called wrong."""
    active: tuple[str, ...]
    """Terms of effects at work."""
    fit: Fit | None
    moved: Values
    """Values moved within their trust."""
    left: np.ndarray
    """What it leaves of all fitted stretches where it was not fitted, (n, 6), N and N m."""
    learnt: Learnt | None = None
    """Its derivatives; None without."""
    flown: np.ndarray = field(default_factory=lambda: np.zeros((0, 2, 1)))
    """Mean squares of the errors of windows simulated forward, and their number, (channels, 2, units)."""

    @property
    def name(self) -> tuple[str, bool]:
        """Which of PLAINEST_FIRST it is."""
        return self.model, self.learnt is not None

    def with_derivatives(self, learnt: Learnt) -> Candidate:
        """The candidate with derivatives of what it leaves."""
        return replace(self, learnt=learnt, left=self.left - learnt.left_out)


@dataclass(frozen=True)
class CandidateScore:
    """A candidate's number."""

    candidate: Candidate
    score: float
    """Mean logarithm of the error over the believed vehicle's."""
    standard_error: float
    """Of its difference from the best candidate's, by drawing runs (or pieces) anew."""
    unfit: str = ""
    """Why it does not hover or fly; empty where it does, or was not asked."""


@dataclass(frozen=True)
class Ground:
    """The rows on which candidates are compared."""

    unit: np.ndarray
    """(n,) number of the run (or piece) of each row; -1 for a row that is not judged."""
    places: Mapping[str, tuple[np.ndarray, np.ndarray]]
    """Of every run the instants of its rows, s, and their units, (m,) each."""

    @property
    def units(self) -> int:
        """Number of units."""
        return int(self.unit.max(initial=-1)) + 1

    def unit_at(self, run: str, time_s: np.ndarray) -> np.ndarray:
        """Unit of a run at instants (n,): that of the next row; -1 where there is none."""
        times, units = self.places.get(run, (np.zeros(0), np.zeros(0, int)))
        if not len(times):
            return np.full(len(time_s), -1)
        return units[np.minimum(np.searchsorted(times, time_s), len(times) - 1)]

    def squares(self, left: np.ndarray) -> np.ndarray:
        """Squares of what is left of channels, (n, channels), and their number, (channels, 2, units)."""
        judged, count = self.unit >= 0, self.units
        unit = self.unit[judged]
        return np.array([[np.bincount(unit, s, count), np.bincount(unit, None, count)] for s in left[judged].T ** 2])

    def compared(self, candidates: Sequence[Candidate]) -> np.ndarray:
        """Mask of the channels that every candidate says something of, (channels,)."""
        return np.all([np.isfinite(c.left[self.unit >= 0]).all(axis=0) for c in candidates], axis=0)


def _mean_logarithm(sums: np.ndarray) -> np.ndarray:
    """Mean logarithm of the root mean squares, from squares and their numbers, (..., quantities, 2)."""
    return 0.5 * np.log(np.maximum(sums[..., 0], 1e-300) / np.maximum(sums[..., 1], 1.0)).mean(axis=-1)


def compared(candidates: Sequence[Candidate], ground: Ground) -> list[CandidateScore]:
    """Every candidate's number, the candidates in the order of PLAINEST_FIRST; the believed vehicle is among them."""
    ordered = sorted(candidates, key=lambda c: _PLAINEST_FIRST.index(c.name))
    known = ground.compared(ordered)
    every = [[ground.squares(c.left[:, known]), *([c.flown] if len(c.flown) else [])] for c in ordered]
    squares = np.array([np.concatenate(parts) for parts in every])
    units = squares.shape[-1]
    drawn = np.random.default_rng(0).integers(0, units, (_DRAWS, units))
    weights = np.array([np.ones(units), *(np.bincount(d, minlength=units) for d in drawn)])
    scores = _mean_logarithm((squares @ weights.T).transpose(0, 3, 1, 2))
    best = int(np.argmin(scores[:, 0]))
    doubt = (scores[:, 1:] - scores[best, 1:]).std(axis=1)
    believed = next(i for i, c in enumerate(ordered) if c.name == ("believed", False))
    return [
        CandidateScore(c, float(s - scores[believed, 0]), float(d))
        for c, s, d in zip(ordered, scores[:, 0], doubt, strict=True)
    ]


def _least_gain(plain: CandidateScore, best: CandidateScore) -> float:
    """By how much the best must be ahead of a plainer one, if by derivatives alone."""
    return _WORTH if best.candidate.learnt is not None and plain.candidate.learnt is None else 0.0


def choose(
    candidates: Sequence[Candidate], ground: Ground, unfit: Callable[[Candidate], str]
) -> tuple[CandidateScore, list[CandidateScore]]:
    """The candidate to deliver, and all with their numbers; the believed vehicle where none hovers and flies."""
    kept, faults = list(candidates), {}
    while True:
        scored = compared(kept, ground)
        best = min(scored, key=lambda s: s.score)
        first = next(s for s in scored if s.score - best.score <= max(s.standard_error, _least_gain(s, best)))
        # Only who may be chosen is flown; the best, too, for the others are measured by it.
        asked = {s.candidate.name: s.candidate for s in (best, first) if s.candidate.name != ("believed", False)}
        failing = {name: why for name, candidate in asked.items() if (why := unfit(candidate))}
        if not failing:
            known = {s.candidate.name: s for s in scored}
            every = [
                known.get(s.candidate.name, replace(s, unfit=faults.get(s.candidate.name, "")))
                for s in compared(candidates, ground)
            ]
            return first, every
        faults |= failing
        kept = [c for c in kept if c.name not in failing]
