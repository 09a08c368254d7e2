"""Joint generalised least squares over blocks of time, with intervals that hold for coloured residuals.

Each channel is whitened by an autoregressive filter estimated from the residual of the fullest model; then all
rows are reduced to Gram matrices of short blocks. Fits, tests, leave-run-out scores and cluster-robust
covariances of any subset of terms follow from those matrices alone, so the cost of a search over the catalogue
does not depend on the number of samples.

Noisy regressors: `bias_gram` and `bias_cross` hold what the sensors' own noise adds to XᵀX and Xᵀy (learnt by
adding the same noise once more); they are subtracted, which removes the attenuation (corrected least squares,
Fuller, Measurement Error Models, 1987, ch. 2).

What each of many further terms would explain given the same others: one solution of those, all terms at once.

A further term borders the normal equations of the others by its few columns (Schur's complement), so what it explains
follows from the inverse of theirs. It is what `Regression.explained` says of the two together, to rounding.

Noise of the rotors' speeds and of the gyroscope that is more than its white part.

The white part is read from the highest frequencies of each sensor. A tachometer that averages, or a filter before the
log, leaves far more in the band that is analysed; as a regressor it would shrink every value that multiplies it. In
that band the rotors' moment is often noise alone, and what is left of the balance shows it: noise of the modelled side
is in the residual with the other sign, noise of the measured side with its own.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.linalg import solve_toeplitz
from scipy.signal import csd
from scipy.special import chdtrc, fdtrc

from rotorid.mismatch.evidence.comparison import LEAST_RUNS, Comparison, environments, folds
from rotorid.mismatch.evidence.motion import Segment
from rotorid.mismatch.evidence.rows import Rows, Term, Thinner, baseline_wrench, residual
from rotorid.recordings import Vehicle
from rotorid.recordings.signal.kernels import causal

Within = Callable[[str, float], bool | None]
"""Of a run and an instant of it, s, whether they are fitted, held out (False) or in a gap (None)."""
NOISE_BAND = (0.5, 0.85)
"""Band, as shares of the cutoff, in which noise is distinguished from motion."""
AGREEMENT = {"accelerometer": 0.05, "gyroscope": 0.02}
"""Two instruments that agree to within this (m/s2, rad/s; one sigma) are called equal."""
MOST_ATTENUATION = 0.3
"""Largest share of a direction's energy that may be noise of the regressors themselves; beyond it nothing is said."""
DOUBT_OF_CORRECTION = 0.5
_MOST_REMEMBERED = 2000
"""Fits that a regression remembers."""
_MOST_EXPLAINED = 100_000
"""Models of which a regression remembers what they explain."""
_MOST_DISTRUST = 3.0
"""Standard deviations of trust that a believed value may be off."""
VALUE_LIMITS = (0.15, 0.4)
"""A believed value moves by at most MOST_DISTRUST times its trust, but at least and at most by these shares: a
mismatch that needs a third of the arm is no wrong ruler."""
_HOLD = 1e6
_RIDGE = 1e-10
"""Trace of ridge on every normal matrix, in units of its diagonal."""
NEVER_EXCITED = 1e-24
"""Diagonal of a normal matrix up to which a column is not excited at all."""


def _autocovariance(parts: list[np.ndarray], order: int) -> np.ndarray:
    """Pooled autocovariance at lags 0 to `order` of stretches that do not touch each other."""
    total = sum(len(p) for p in parts)
    return np.array([sum(float(p[k:] @ p[: len(p) - k]) for p in parts if len(p) > k) for k in range(order + 1)]) / max(
        total, 1
    )


def autoregression(parts: list[np.ndarray], floor: float = 0.0) -> np.ndarray:
    """Whitening filter (1, -a_1, …, -a_p)/σ of a coloured residual; the order by Akaike's criterion.

    `floor` is the one-sigma of white noise assumed on top.
    """
    total = sum(len(p) for p in parts)
    highest_ar_order = 12
    highest = int(min(highest_ar_order, max(1, total // 50)))
    covariance = _autocovariance(parts, highest)
    if covariance[0] <= 0:
        return np.array([1.0])
    # White part assumed in every residual, as a share of its variance: recordings smoothed before they were stored have
    # almost no energy at high frequency, and whitening must not make that corner decide.
    white_share = 0.01
    covariance[0] += white_share * covariance[0] + floor**2
    best = (np.inf, np.array([1.0 / np.sqrt(covariance[0])]))
    for order in range(0, highest + 1):
        a = solve_toeplitz(covariance[:order], covariance[1 : order + 1]) if order else np.zeros(0)
        variance = covariance[0] - a @ covariance[1 : order + 1]
        if variance <= 0:
            break
        criterion = total * np.log(variance) + 2 * order
        if criterion < best[0]:
            best = (criterion, np.concatenate([[1.0], -a]) / np.sqrt(variance))
    return best[1]


@dataclass(frozen=True)
class Solution:
    """Coefficients of some terms on the training blocks."""

    columns: np.ndarray
    beta: np.ndarray
    gain: float
    """Whitened squares explained on the training blocks."""

    def places(self, columns: np.ndarray) -> list[int]:
        """Where columns of the regression stand among those fitted."""
        at = list(self.columns)
        return [at.index(c) for c in columns]


@dataclass(frozen=True)
class Fit(Solution):
    """A fit of some terms: coefficients, covariance and what is left."""

    covariance: np.ndarray
    """Cluster-robust covariance, never below the model's own, shape (k, k)."""
    residual_square: np.ndarray
    """Whitened squared residual of every block (training and held out), shape (blocks,)."""


@dataclass(frozen=True)
class _Apart:
    """Products of some channels alone, by which the coefficients of some terms are estimated.

    The normal equations of those terms hold these products; all others see every channel, with those terms as they
    come out. What the model of the other channels lacks cannot reach them then (Plummer, Cuts in Bayesian graphical
    models, Statistics and Computing 25, 2015).
    """

    columns: np.ndarray
    """Columns of the terms, (m,), ascending."""
    gram: np.ndarray
    """Their products with all columns, (blocks, m, K)."""
    cross: np.ndarray
    """(blocks, m)."""
    bias_gram: np.ndarray
    """(m, K), as in `Regression`."""
    bias_cross: np.ndarray
    channels: np.ndarray
    """Numbers of those channels."""

    def before(self, kept: int) -> _Apart:
        """The same without the columns from `kept` on."""
        return replace(self, gram=self.gram[:, :, :kept], bias_gram=self.bias_gram[:, :kept])


@dataclass(frozen=True)
class _ByChannel:
    """Products of the fitted blocks channel by channel, summed over environments."""

    channels: np.ndarray
    """(C,) of the twelve."""
    gram: np.ndarray
    """(C, E, K, K)."""
    cross: np.ndarray
    """(C, E, K)."""
    square: np.ndarray
    """(C, E)."""
    environment: np.ndarray
    """(blocks,) number of each block's environment; −1 for one that is not fitted."""
    bias_gram: np.ndarray
    """(C, K, K) what the noise of the regressors adds over all blocks, fitted or not."""
    bias_cross: np.ndarray
    """(C, K)."""

    def projected(self, kept: int, follows: np.ndarray, alone: np.ndarray) -> _ByChannel:
        """The same with what the columns from `kept` on take of the others taken out (`Regression.without_winds`)."""
        count, environments = self.square.shape
        gram = np.zeros((count, environments, kept, kept))
        cross, square = np.zeros((count, environments, kept)), np.zeros((count, environments))
        bias_gram, bias_cross = np.zeros((count, kept, kept)), np.zeros((count, kept))
        for c in range(count):
            for e in range(environments):
                own = self.gram[c, e], self.cross[c, e], self.square[c, e]
                gram[c, e], cross[c, e], square[c, e] = projected(*own, kept, follows, alone)
            noise = self.bias_gram[c], self.bias_cross[c], 0.0
            bias_gram[c], bias_cross[c], _ = projected(*noise, kept, follows, alone)
        return replace(self, gram=gram, cross=cross, square=square, bias_gram=bias_gram, bias_cross=bias_cross)


@dataclass(frozen=True)
class _Products:
    """Products of all columns over parts of the fitted blocks: `environments`, folds, all of them."""

    blocks: np.ndarray
    """(P,) in each part."""
    gram: np.ndarray
    """(P, K, K)."""
    cross: np.ndarray
    """(P, K)."""
    apart: np.ndarray
    """(P, m, K), as in `_Apart`; m is 0 where nothing is estimated apart."""
    apart_cross: np.ndarray
    """(P, m)."""

    def over(self, part: np.ndarray, count: int) -> _Products:
        """Summed over parts again; `part` (P,) says which of `count` each belongs to."""
        one = (part == np.arange(count)[:, None]).astype(float)
        return _Products(*(np.tensordot(one, x, 1) for x in self._all))

    def without(self, part: int) -> _Products:
        """All of them but one, as a single part."""
        return _Products(*(x.sum(axis=0, keepdims=True) - x[part : part + 1] for x in self._all))

    @property
    def _all(self) -> tuple[np.ndarray, ...]:
        return self.blocks, self.gram, self.cross, self.apart, self.apart_cross


@dataclass
class Regression:
    """Gram matrices of all terms over blocks of time."""

    terms: list[Term]
    start: dict[str, int]
    gram: np.ndarray
    """(blocks, K, K)."""
    cross: np.ndarray
    """(blocks, K)."""
    square: np.ndarray
    """(blocks,)."""
    run: np.ndarray
    """Run number of each block."""
    training: np.ndarray
    """Mask of the blocks to fit."""
    precision: np.ndarray
    """Prior precision of every column, (K,)."""
    bias_gram: np.ndarray
    bias_cross: np.ndarray
    filters: dict[int, np.ndarray]
    """Whitening filter of each channel."""
    names: dict[str, int]
    """Number of each run."""
    memory: int = 0
    """Blocks over which the noise of neighbours may still be alike (1/f noise of a sensor at rest)."""
    block_s: float = 1.0
    """Length of a block, s."""
    rate_hz: float = 1.0
    """Rate of the rows."""
    blocks_of_rows: tuple[np.ndarray, ...] = ()
    """Of every stretch the block that each of its rows is in, (n,); -1 where it is in none."""
    apart: _Apart | None = None
    """Terms that some of the channels alone estimate; None where all channels estimate all."""
    by_channel: _ByChannel | None = None
    """Products of the fitted blocks channel by channel, where they were asked for."""

    def keys_of(self, *kinds: str) -> list[str]:
        """Keys of the terms of some kinds."""
        return [t.key for t in self.terms if t.kind in kinds]

    def columns(self, keys: Iterable[str]) -> np.ndarray:
        """Column numbers of terms, in the order given."""
        parts = [self._where[k] for k in keys]
        return np.concatenate(parts) if parts else np.zeros(0, int)

    def __post_init__(self):
        # Blocks last in memory: what is read of a pair of columns are all of its blocks.
        self.gram = np.ascontiguousarray(self.gram.transpose(1, 2, 0)).transpose(2, 0, 1)
        self._where = {t.key: self.start[t.key] + np.arange(t.size) for t in self.terms}
        self._total_gram = self.gram.transpose(1, 2, 0) @ self.training.astype(float)
        self._total_cross = self.cross[self.training].sum(axis=0)
        self._place_apart = np.full(len(self._total_cross), -1)
        if self.apart is not None:
            self._place_apart[self.apart.columns] = np.arange(len(self.apart.columns))
        self.limit = np.full(len(self._total_cross), np.inf)
        for term in self.terms:
            if term.kind == "value":
                self.limit[self.start[term.key]] = np.clip(_MOST_DISTRUST * term.prior_sd[0], *VALUE_LIMITS)
        self._number = {t.key: 1 << i for i, t in enumerate(self.terms)}
        self._explained: dict[int, float] = {}
        self._solutions: dict[int, Solution] = {}
        self._fits: dict[tuple, Fit] = {}
        self._left_out: dict[tuple, tuple[np.ndarray, np.ndarray, np.ndarray]] = {}

    def again(
        self, rows: list[Rows], terms: Sequence[Term], noisy: list[Rows] | None = None, within: Within | None = None
    ) -> Regression:
        """The regression of other rows and terms with these whitening filters and blocks, by channel, too.

        `noisy` and `within` as in `build`.
        """
        return build(rows, list(terms), self.filters, within, self.block_s, self.rate_hz, noisy, by_channel=True)

    def with_room(self, least: float) -> Regression:
        """The same with believed values that may move by at least a share `least`."""
        wider = replace(self)  # fits remembered are those of the narrower limits
        values = self.columns(self.keys_of("value"))
        wider.limit = self.limit.copy()
        wider.limit[values] = np.maximum(self.limit[values], least)
        return wider

    def narrowed(self, places: Mapping[str, np.ndarray]) -> Regression:
        """The same where of some terms (keys of `places`) these columns of their own (numbers from 0) count alone."""
        narrow = replace(self)
        narrow.limit = self.limit
        narrow._where = self._where | {key: self._where[key][at] for key, at in places.items()}
        return narrow

    def given(self, cols: np.ndarray, beta: np.ndarray) -> Regression:
        """The same where the coefficients `beta` (k,) of the columns `cols` are known: what they add is taken off."""
        pulls = self.gram[:, :, cols] @ beta
        square = self.square - 2 * self.cross[:, cols] @ beta + pulls[:, cols] @ beta
        apart = self.apart
        if apart is not None:
            apart = replace(
                apart,
                cross=apart.cross - apart.gram[:, :, cols] @ beta,
                bias_cross=apart.bias_cross - apart.bias_gram[:, cols] @ beta,
            )
        known = replace(
            self,
            cross=self.cross - pulls,
            square=square,
            bias_cross=self.bias_cross - self.bias_gram[:, cols] @ beta,
            apart=apart,
        )
        known.limit = self.limit
        return known

    def without_winds(self) -> Regression:
        """The same without the winds of single runs: every other column less what they take of it.

        A wind has two columns for every knot, hundreds where it never rests, and each acts in a few blocks. Their
        share of any fit is linear in the other coefficients (Frisch, Waugh and Lovell), so it is taken out once:
        fits, gains, block scores and robust covariances of the others are those of the whole. The winds stand last,
        so column numbers stay.
        """
        winds = [t for t in self.terms if t.kind == "wind" and t.run]
        if not winds:
            return self
        cols = self.columns([t.key for t in winds])
        kept = cols.min()
        if cols.max() + 1 != len(self.precision) or len(cols) != len(self.precision) - kept:
            raise ValueError("the winds of single runs must be the last columns")
        every = np.arange(len(self.precision))
        gram, cross, bias, bias_cross = self.normal(every)
        normal = gram - bias + np.diag(self.precision)
        inverse = ridge_inverse(normal[kept:, kept:])
        # A wind follows the other coefficients b as `alone + follows @ b`.
        follows, alone = -inverse @ normal[kept:, :kept], inverse @ (cross - bias_cross)[kept:]
        blocks = [
            projected(*of_block, kept, follows, alone)
            for of_block in zip(self.gram, self.cross, self.square, strict=True)
        ]
        bias_gram, bias_cross, _ = projected(self.bias_gram, self.bias_cross, 0.0, kept, follows, alone)
        return replace(
            self,
            terms=[t for t in self.terms if t not in winds],
            start={k: v for k, v in self.start.items() if v < kept},
            gram=np.array([b[0] for b in blocks]),
            cross=np.array([b[1] for b in blocks]),
            square=np.array([b[2] for b in blocks]),
            precision=self.precision[:kept],
            bias_gram=bias_gram,
            bias_cross=bias_cross,
            # No wind of a single run acts in the channels of which others are estimated apart.
            apart=None if self.apart is None else self.apart.before(kept),
            by_channel=None if self.by_channel is None else self.by_channel.projected(kept, follows, alone),
        )

    def _apart(self, cols: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which of some columns are estimated apart, and where they stand among those that are."""
        place = self._place_apart[cols]
        return np.flatnonzero(place >= 0), place[place >= 0]

    def _equations(
        self, whole: tuple[np.ndarray, ...], cols: np.ndarray, of: _Products | None = None
    ) -> tuple[np.ndarray, ...]:
        """What `normal` gives, in the rows of terms estimated apart with the products of their channels alone."""
        where, own = self._apart(cols)
        if not len(where):
            return whole
        gram, cross, bias, bias_cross = (part.copy() for part in whole)
        of = self._fitted if of is None else of
        share, grid = of.blocks[0] / len(self.training), (own[:, None], cols)
        gram[where], cross[where] = of.apart[0][grid], of.apart_cross[0, own]
        noise = self.apart.bias_gram[grid] * share
        # As `limited_bias`, column by column: these channels' products alone are no symmetric matrix.
        most = MOST_ATTENUATION * gram[where, where] / np.maximum(noise[np.arange(len(where)), where], 1e-300)
        bias[where] = noise * np.minimum(1.0, most)[:, None]
        bias_cross[where] = self.apart.bias_cross[own] * share * np.minimum(1.0, most)
        return gram, cross, bias, bias_cross

    def normal(self, cols: np.ndarray, of: _Products | None = None) -> tuple[np.ndarray, ...]:
        """Products of columns with each other (k, k) and with the response (k,), and the noise's of both, over all
        fitted blocks or a part of them."""
        grid = (cols[:, None], cols)
        if of is None:
            share, gram, cross = self.training.mean(), self._total_gram[grid], self._total_cross[cols]
        else:
            share, gram, cross = of.blocks[0] / len(self.training), of.gram[0][grid], of.cross[0, cols]
        bias = limited_bias(gram, self.bias_gram[grid] * share)
        return gram, cross, bias, self.bias_cross[cols] * share

    def fit(self, keys: Iterable[str], *, jackknife: bool = False, loose: dict[str, float] | None = None) -> Fit:
        """Fit terms on the training blocks; `loose` widens priors (term to one-sigma).

        Remembered: a search asks for the same ones over and over.
        """
        keys = tuple(keys)
        asked = keys, jackknife, tuple(sorted((loose or {}).items()))
        if asked not in self._fits:
            making_room(self._fits, _MOST_REMEMBERED)[asked] = self._fit(keys, jackknife, loose)
        return self._fits[asked]

    def _fit(self, keys: tuple[str, ...], jackknife: bool, loose: dict[str, float] | None) -> Fit:
        cols, mask = self.columns(keys), self.training
        whole = self.normal(cols)
        gram, cross, bias, bias_cross = self._equations(whole, cols)
        where, own = self._apart(cols)
        precision = self.precision
        if loose:
            precision = precision.copy()
            for key, sd in loose.items():
                precision[self.columns([key])] = 1.0 / sd**2
        prior = precision[cols]
        normal = _raised(gram - bias, prior)
        beta, inverse, held, at = bounded(normal, cross - bias_cross, self.limit[cols])
        self._fit_held_out_scales(cols, beta)
        count = int(mask.sum())
        every, explained = self.gram.transpose(1, 2, 0)[cols[:, None], cols], self.cross[:, cols]
        pull = (beta @ every).T
        scores = (explained - pull)[mask]
        if len(where):
            apart = self.apart.gram[:, own[:, None], cols]
            scores[:, where] = (self.apart.cross[:, own] - apart @ beta)[mask]
        scores -= (bias_cross - bias @ beta) / count
        if jackknife:
            blocks = every.transpose(2, 0, 1)[mask]
            if len(where):
                blocks[:, where] = apart[mask]
            scores = np.linalg.solve(np.eye(len(cols)) - (blocks - bias / count) @ inverse, scores[:, :, None])[:, :, 0]
        spread = spread_of(scores, self.run[mask], self.memory) * count / max(count - 1, 1)
        robust = inverse @ spread @ inverse.T
        # With the ridge, or two columns that are copies of each other would seem to be known.
        uncorrected = _raised(gram, prior + held)
        noise = _raised(uncorrected, _RIDGE * normal.diagonal())
        noise[:, where] = noise[where].T
        plain = inverse @ noise @ inverse.T
        # The noise level is itself an estimate: half of the correction is taken as its one-sigma.
        without = ridge_inverse(uncorrected) @ (cross + held * at)
        values = np.isfinite(self.limit[cols])
        shift = trusted(DOUBT_OF_CORRECTION * (beta - without), normal, values, precision[cols])
        covariance = at_least(robust, plain) + np.outer(shift, shift)
        # What the regressors' noise adds to a block is no misfit: left in, a model that shrinks them all would be best.
        _, _, bias, bias_cross = whole
        added = float(beta @ bias @ beta - 2 * beta @ bias_cross) / count
        rss = self.square - 2 * explained @ beta + pull @ beta - added
        gain = float((self.square - rss)[mask].sum())
        return Fit(cols, beta, gain, covariance, rss)

    def _fit_held_out_scales(self, cols: np.ndarray, beta: np.ndarray, left_out: np.ndarray | None = None) -> None:
        """Coefficients of a run's own scale where that run is not fitted: found in the run itself, in place.

        `left_out` (blocks,) are not fitted either.
        """
        mask = self.training if left_out is None else self.training & ~left_out
        for term in self.terms:
            if term.kind != "nuisance" or not term.run:
                continue
            column = self.start[term.key]
            where = np.flatnonzero(cols == column)
            own = self.run == self.names.get(term.run, -1)
            if not own.any() or not len(where) or (own & mask).any():
                continue
            gram = self.gram[own, column][:, cols].sum(axis=0)
            beta[where] = 0.0
            left = self.cross[own, column].sum() - gram @ beta
            beta[where] = left / (gram[where[0]] + self.precision[column])

    def explained(self, keys: Iterable[str]) -> float:
        """Whitened squares that terms explain on the training blocks: the gain of `fit` without the rest of it.

        Remembered whatever the order: exchanges and simplifications come back to the same sets again and again.
        """
        asked = self.set_of(keys)
        if asked not in self._explained:
            making_room(self._explained, _MOST_EXPLAINED)[asked] = self._solved(asked).gain
        return self._explained[asked]

    def explained_with(self, keys: Sequence[str], further: Sequence[str]) -> list[float]:
        """The same of terms with each of `further` ones, (m,)."""
        base = self.set_of(keys)
        sets = [base | self._number[key] for key in further]
        new = [i for i, asked in enumerate(sets) if asked not in self._explained]
        known = making_room(self._explained, _MOST_EXPLAINED)
        if len(new) > 1:
            known.update(self._all_explained(base, [(sets[i], self._where[further[i]]) for i in new]))
        return [known[s] if s in known else self.explained([*keys, k]) for s, k in zip(sets, further, strict=True)]

    def _all_explained(self, base: int, further: list[tuple[int, np.ndarray]]) -> dict[int, float]:
        """What sets explain that are `base` and some columns more each, but for those with very noisy regressors."""
        padded = np.arange(max(len(own) for _, own in further)) + self._equations_of_all.count
        columns = np.array([np.append(own, padded[len(own) :]) for _, own in further])
        found, noisy = self._equations_of_all.explained(self._columns_in(base), columns, _HOLD, MOST_ATTENUATION)
        return {asked: float(e) for (asked, _), e, unknown in zip(further, found, noisy, strict=True) if not unknown}

    @cached_property
    def _equations_of_all(self) -> _Equations:
        """The equations of all columns, as `_solved` has them of some."""
        count = len(self.precision)
        every, size = np.arange(count), count + max(t.size for t in self.terms)
        noise, noise_cross = self.bias_gram * self.training.mean(), self.bias_cross * self.training.mean()
        whole = self._total_gram, self._total_cross, noise, noise_cross
        gram, cross, bias, bias_cross = self._equations(whole, every)
        normal = _raised(gram - bias, self.precision)
        scale, unit = inverse_root(normal.diagonal()), inverse_root(self._total_gram.diagonal())

        def padded(matrix: np.ndarray, by: np.ndarray, ridge: float = 0.0) -> np.ndarray:
            out = np.zeros((size,) * matrix.ndim)
            out[(slice(count),) * matrix.ndim] = matrix * by[:, None] * by if matrix.ndim == 2 else matrix * by
            # What is never excited stays at nothing, and says nothing of the others.
            return _raised(out, np.append(np.where(by > 0, ridge, 1.0), np.ones(size - count))) if ridge else out

        with np.errstate(divide="ignore"):
            limit = np.append(self.limit / scale, np.full(size - count, np.inf))
        return _Equations(
            count=count,
            normal=padded(normal, scale, _RIDGE),
            right=padded(cross - bias_cross, scale),
            gram=padded(self._total_gram - noise, scale),
            cross=padded(self._total_cross - noise_cross, scale),
            limit=limit,
            energy=padded(self._total_gram, unit, 1e-9),
            noise=padded(noise, unit),
        )

    def solution(self, keys: Iterable[str]) -> Solution:
        """What `fit` finds on the training blocks without how well it is known; columns ascend."""
        asked = self.set_of(keys)
        if asked not in self._solutions:
            making_room(self._solutions, _MOST_REMEMBERED)[asked] = self._solved(asked)
        return self._solutions[asked]

    def _solved(self, asked: int) -> Solution:
        cols = self._columns_in(asked)
        whole = self.normal(cols)
        gram, cross, bias, bias_cross = self._equations(whole, cols)
        beta = bounded(_raised(gram - bias, self.precision[cols]), cross - bias_cross, self.limit[cols])[0]
        gram, cross, bias, bias_cross = whole
        return Solution(cols, beta, float(2 * (cross - bias_cross) @ beta - beta @ (gram - bias) @ beta))

    def set_of(self, keys: Iterable[str]) -> int:
        """Terms as a number with a bit for each, whatever their order."""
        out = 0
        for key in keys:
            out |= self._number[key]
        return out

    def _columns_in(self, asked: int) -> np.ndarray:
        """Columns of the terms of a set, ascending."""
        return self.columns([t.key for t in self.terms if asked & self._number[t.key]])

    @property
    def leaves_runs(self) -> bool:
        """Whether enough runs are fitted to leave out whole ones: errors are common to a run."""
        return len(np.unique(self.run[self.training])) >= LEAST_RUNS

    def folds(self, whole_runs: bool | None = None) -> np.ndarray:
        """Fold of every block (blocks,), -1 for one that is not fitted; blocks of a fold are left out together.

        Default is what everything that is judged where it was not fitted goes by: whole runs where there are enough.
        """
        run, whole = self.run[self.training], self.leaves_runs if whole_runs is None else whole_runs
        out = np.full(len(self.training), -1)
        out[self.training] = folds(environments(run, self.block_s), run, whole)
        return out

    @cached_property
    def _environment(self) -> np.ndarray:
        """Number of the environment of every fitted block."""
        return environments(self.run[self.training], self.block_s)

    @cached_property
    def _environments(self) -> _Products:
        """Products of the fitted blocks summed over environments."""
        one = (self._environment == np.arange(int(self._environment.max(initial=-1)) + 1)[:, None]).astype(float)
        gram, cross = self.gram.transpose(1, 2, 0)[:, :, self.training], self.cross[self.training]
        own = (np.zeros((len(cross), 0, gram.shape[0])), np.zeros((len(cross), 0)))
        if self.apart is not None:
            own = self.apart.gram[self.training], self.apart.cross[self.training]
        apart = (np.tensordot(one, x, 1) for x in own)
        return _Products(one.sum(axis=1), (gram @ one.T).transpose(2, 0, 1), one @ cross, *apart)

    @cached_property
    def _fitted(self) -> _Products:
        """Products of all fitted blocks."""
        return self._environments.over(np.zeros(len(self._environments.blocks)), 1)

    @cached_property
    def _folds(self) -> dict[bool, list[_Products]]:
        """Products of the fitted blocks without each fold in turn, whole runs or environments left out."""
        out = {}
        for whole in (True, False):
            fold = self._fold_of_environments(whole)
            parts = self._environments.over(fold, count := int(fold.max(initial=-1)) + 1)
            out[whole] = [parts.without(part) for part in range(count)]
        return out

    def _fold_of_environments(self, whole_runs: bool) -> np.ndarray:
        """Fold of every environment: no environment is in two."""
        return self.folds(whole_runs)[self.training][np.unique(self._environment, return_index=True)[1]]

    def left_out_together(self) -> np.ndarray:
        """Number of the run (or, of fewer than LEAST_RUNS, of the piece) of every block (blocks,); -1 if not fitted."""
        run, out = self.run[self.training], np.full(len(self.training), -1)
        pieces = run if self.leaves_runs else environments(run, self.block_s)
        out[self.training] = np.unique(pieces, return_inverse=True)[1]
        return out

    def of_rows(self, of_block: np.ndarray) -> list[np.ndarray]:
        """What is known of every block, (blocks,), at the rows of every stretch, (n,) each; -1 for rows of no block."""
        known = np.append(of_block, -1)
        return [known[b] for b in self.blocks_of_rows]

    def left_out(
        self, keys: Iterable[str], whole_runs: bool, loose: dict[str, float] | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Columns (k,) of terms and their coefficients fitted without each fold in turn, (folds, k)."""
        return self._without_folds(keys, whole_runs, loose)[:2]

    def _without_folds(
        self, keys: Iterable[str], whole_runs: bool, loose: dict[str, float] | None = None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """As `left_out`, with the covariance of the coefficients for white noise, (folds, k, k)."""
        asked = tuple(keys), whole_runs, tuple(sorted((loose or {}).items()))
        if asked not in self._left_out:
            most_left_out = 200  # Models of which a regression remembers the fits without each fold.
            making_room(self._left_out, most_left_out)[asked] = self._leave_out(*asked)
        return self._left_out[asked]

    def _leave_out(self, keys, whole_runs, loose) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        kinds = {t.key: t for t in self.terms}
        winds = [k for k in keys if kinds[k].kind == "wind" and kinds[k].run]
        if winds:
            return self._leave_out_in_wind([k for k in keys if k not in winds], winds, whole_runs, loose)
        cols, fold, parts = self.columns(keys), self.folds(whole_runs), self._folds[whole_runs]
        precision = self.precision
        if loose:
            precision = precision.copy()
            for key, sd in loose:
                precision[self.columns([key])] = 1.0 / sd**2
        found, inverses = [], []
        unknown = 1e12  # Variance of a coefficient of which nothing is known.
        for out in range(fold.max() + 1):
            gram, cross, bias, bias_cross = self._equations(self.normal(cols, parts[out]), cols, parts[out])
            normal = _raised(gram - bias, precision[cols])
            beta, inverse = bounded(normal, cross - bias_cross, self.limit[cols])[:2]
            found.append(beta)
            # Of a column that only this fold excites nothing is known without it.
            dead = np.diag(normal) <= NEVER_EXCITED
            inverses.append(np.where(np.diag(dead), unknown, inverse))
            self._fit_held_out_scales(cols, found[-1], fold == out)
        return cols, np.array(found), np.array(inverses)

    def _leave_out_in_wind(self, keys, winds, whole_runs, loose) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The same where winds of single runs blow: they belong to the run and are found in it, left out or not."""
        cols, betas, known = self.without_winds()._without_folds(keys, whole_runs, dict(loose))
        own = self.columns(winds)
        both = np.concatenate([cols, own])
        gram, cross, bias, bias_cross = self.normal(both)
        normal, right, count = gram - bias + np.diag(self.precision[both]), cross - bias_cross, len(cols)
        inverse = ridge_inverse(normal[count:, count:])
        blowing = (right[count:, None] - normal[count:, :count] @ betas.T).T @ inverse
        # The winds are of the run that is left out, so their own errors are not those of another run's numbers.
        inverses = np.zeros((len(betas), len(both), len(both)))
        inverses[:, :count, :count] = known
        return both, np.concatenate([betas, blowing], axis=1), inverses

    def compare(
        self, more: list[str], fewer: list[str], loose: dict[str, float] | None = None, whole_runs: bool | None = None
    ) -> Comparison:
        """The model of the terms `more` against that of `fewer`, on environments that neither was fitted on.

        Whole runs are left out where there are enough of them and where what is asked of one run is seen in the
        others; else environments of every run in turn.
        """
        if whole_runs is None:
            if not self.leaves_runs:
                return self.compare(more, fewer, loose, False)
            apart = self.compare(more, fewer, loose, True)
            return apart if apart.answers else self.compare(more, fewer, loose, False)
        more_of, fewer_of = (self._without_folds(keys, whole_runs, loose) for keys in (more, fewer))
        (cols, a, _), (others, b, _) = more_of, fewer_of
        fold = self._fold_of_environments(whole_runs)
        a, b = a[fold], b[fold]
        left, grams = [], []
        for c, beta in ((cols, a), (others, b)):
            gram, cross = self._noise_free(c)
            quadratic = np.einsum("ek,ekl,el->e", beta, gram, beta, optimize=True)
            left.append(quadratic - 2 * np.einsum("ek,ek->e", cross, beta))
            grams.append(gram)
        shift, gram = a.copy(), grams[0]
        shared = np.isin(cols, others)
        at = [list(others).index(c) for c in cols[shared]]
        shift[:, shared] -= b[:, at]
        promised = np.einsum("ek,ekl,el->e", shift, gram, shift, optimize=True)
        # What the fitted environments of each fold hold of the same change of coefficients.
        every = gram.sum(axis=0)
        seen = np.empty(len(fold))
        for out in np.unique(fold):
            own = fold == out
            one = shift[own][0]
            seen[own] = one @ (every - gram[own].sum(axis=0)) @ one
        doubt = self._doubt(cols, more_of[2][fold]) - self._doubt(others, fewer_of[2][fold])
        return Comparison(left[1] - left[0], promised, seen, doubt, fold)

    def _noise_free(self, cols: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gram matrices (environments, k, k) and cross products (environments, k) less the regressors' noise in each.

        Coefficients that the noise does not shrink promise, and leave, no more than the signal in the columns: scored
        on noisy columns a true one would keep 1 − 2 λ of its promise where a share λ of the energy is noise.
        """
        _, _, bias, bias_cross = self.normal(cols)
        parts = self._environments
        share = parts.blocks / parts.blocks.sum()
        gram, cross = parts.gram[:, cols[:, None], cols], parts.cross[:, cols]
        return gram - share[:, None, None] * bias, cross - share[:, None] * bias_cross

    def _doubt(self, cols: np.ndarray, inverses: np.ndarray) -> np.ndarray:
        """Squares that errors of coefficients (environments, k, k) fitted without an environment's fold are expected to
        make in it, (environments,)."""
        return np.einsum("ekl,ekl->e", self._environments.gram[:, cols[:, None], cols], inverses)

    def products(self, cols: np.ndarray) -> np.ndarray:
        """Products of columns on the training blocks, (k, k)."""
        return self._total_gram[np.ix_(cols, cols)]

    def shown(self, key: str) -> np.ndarray:
        """Which columns of a term act in any row fitted, (k,)."""
        return np.diag(self._total_gram)[self.columns([key])] > 0

    def between_runs(self, fit: Solution, key: str) -> tuple[np.ndarray, float]:
        """Variance between runs of a term's coefficients (0 where runs agree), and the p-value that they agree.

        Per run the term is refitted with all other coefficients held (DerSimonian and Laird's moment estimate).
        """
        cols = self.columns([key])
        where = fit.places(cols)
        rest = [i for i in range(len(fit.columns)) if i not in where]
        apart, own = self._apart(cols)
        source, at = (self.apart, own) if len(apart) else (self, cols)
        owns = source.gram[:, at[:, None], cols]
        lefts = source.cross[:, at] - source.gram[:, at[:, None], fit.columns[rest]] @ fit.beta[rest]
        every = np.diag(owns[self.training].sum(axis=0))
        estimates, variances = [], []
        for run in np.unique(self.run[self.training]):
            mask = self.training & (self.run == run)
            if mask.sum() < 5:
                continue
            own, cross = owns[mask], lefts[mask]
            total = own.sum(axis=0)
            if total[0, 0] < 1e-3 * every[0]:
                continue  # the effect is hardly excited in this run
            inverse = np.linalg.pinv(total, rcond=1e-10, hermitian=True)
            beta = inverse @ cross.sum(axis=0)
            scores = cross - own @ beta
            robust = inverse @ (scores.T @ scores) @ inverse
            estimates.append(beta)
            # A coefficient that a run does not excite says nothing there: a height of mass on a level mount.
            silent = np.diag(total) < 1e-3 * every
            variances.append(np.where(silent, np.inf, np.maximum(np.diag(robust), np.diag(inverse))))
        if len(estimates) < 2:
            return np.zeros(len(cols)), 1.0
        b, v = np.array(estimates), np.maximum(np.array(variances), 1e-100)
        w = 1.0 / v
        mean = (w * b).sum(axis=0) / np.maximum(w.sum(axis=0), 1e-300)
        q = (w * (b - mean) ** 2).sum(axis=0)
        degrees = np.maximum((w > 0).sum(axis=0) - 1, 1)
        scale = w.sum(axis=0) - (w**2).sum(axis=0) / np.maximum(w.sum(axis=0), 1e-300)
        spread = np.maximum(0.0, (q - degrees) / np.maximum(scale, 1e-300))
        p = float(min(1.0, len(cols) * chdtrc(degrees, q).min()))
        return spread / len(b), p

    def beyond(self, keys: list[str], key: str, beta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Columns and coefficients of a term's own part: what `keys` would absorb of it is taken off.

        No value absorbs more than MOST_DISTRUST times its trust allows.
        """
        others, own = self.columns(keys), self.columns([key])
        gram = self._total_gram
        normal = _raised(gram[others[:, None], others], self.precision[others])
        with np.errstate(divide="ignore"):
            most = _MOST_DISTRUST / np.sqrt(self.precision[others])
        taken = bounded(normal, -gram[others[:, None], own] @ beta, most)[0]
        return np.concatenate([others, own]), np.concatenate([taken, beta])

    def column_noise(self, key: str) -> float:
        """Share of the energy of a term of one column, on the training blocks, that is noise of its regressors."""
        (column,) = self.columns([key])
        energy = self._total_gram[column, column]
        return float(self.training.mean() * self.bias_gram[column, column] / energy) if energy > 0 else 0.0

    def own_part(self, keys: list[str], key: str, beta: np.ndarray) -> tuple[float, float]:
        """Share of a term's energy along `beta` that the others of `keys` could not take over, and the share of that
        which is noise of the regressors."""
        cols, direction = self.beyond([k for k in keys if k != key], key, beta)
        own, grid = self.columns([key]), (cols[:, None], cols)
        whole = beta @ self._total_gram[own[:, None], own] @ beta
        energy = direction @ self._total_gram[grid] @ direction
        noise = self.training.mean() * (direction @ self.bias_gram[grid] @ direction)
        return float(energy / max(whole, 1e-300)), float(noise / max(energy, 1e-300))

    def wald(self, fit: Fit, cols: np.ndarray, count: int) -> float:
        """p-value that the coefficients of `cols` are zero, Hotelling's T² over blocks."""
        where = fit.places(cols)
        return hotelling(quadratic_form(fit.beta[where], fit.covariance[np.ix_(where, where)]), len(where), count)


def making_room(memory: dict, most: int) -> dict:
    """A memory for one more, emptied where it holds `most`."""
    if len(memory) >= most:
        memory.clear()
    return memory


def hotelling(statistic: float, q: int, count: int) -> float:
    """p-value of Hotelling's T² of q coefficients over blocks."""
    if count - q < 2:
        return 1.0
    return float(fdtrc(q, count - q, max(statistic, 0.0) * (count - q) / (q * (count - 1))))


def projected(
    gram: np.ndarray, cross: np.ndarray, square: float, kept: int, follows: np.ndarray, alone: np.ndarray
) -> tuple[np.ndarray, np.ndarray, float]:
    """Gram matrix (kept, kept), cross products and square of a block whose columns from `kept` on have the
    coefficients `alone + follows @ b`, b those of the columns before."""
    acting = np.flatnonzero(np.diag(gram)[kept:])
    last, follows, alone = kept + acting, follows[acting], alone[acting]
    mixed, own = gram[:kept, last], gram[np.ix_(last, last)]
    shared = mixed @ follows
    inner = gram[:kept, :kept] + shared + shared.T + follows.T @ own @ follows
    left = cross[last] - own @ alone
    outer = cross[:kept] - mixed @ alone + follows.T @ left
    return inner, outer, square - float(alone @ (cross[last] + left))


def trusted(shift: np.ndarray, normal: np.ndarray, values: np.ndarray, precision: np.ndarray) -> np.ndarray:
    """A doubt about coefficients (k,) with no believed value doubted by more than its prior one-sigma.

    Where a recording knows a ratio alone (thrust over mass), both values walk along it with anything; all that hangs
    on their common scale would be as doubtful as that. What the values' share does to the others goes with it.
    """
    most = 1.0 / np.sqrt(np.maximum(precision[values], 1e-300))
    walk = np.abs(shift[values])
    factor = float(np.min(most / np.maximum(walk, most))) if values.any() else 1.0
    if factor == 1.0:
        return shift
    out, others = shift.copy(), ~values
    follows = -ridge_inverse(normal[np.ix_(others, others)]) @ normal[np.ix_(others, values)] @ shift[values]
    out[values] *= factor
    out[others] -= (1.0 - factor) * follows
    return out


def inverse_root(diagonal: np.ndarray) -> np.ndarray:
    """1/√ of a Gram matrix's diagonal; zero for a column that is never excited, so that it stays at zero."""
    return np.where(diagonal <= NEVER_EXCITED, 0.0, 1.0 / np.sqrt(np.maximum(diagonal, NEVER_EXCITED)))


def _raised(matrix: np.ndarray, by: np.ndarray | float) -> np.ndarray:
    """A square matrix with more on its diagonal."""
    out = matrix.copy()
    out.flat[:: len(out) + 1] += by
    return out


def bounded(normal: np.ndarray, right: np.ndarray, limit: np.ndarray):
    """Solution of normal equations with |solution| within `limit` (n,): solution, inverse, and what holds it where.

    The one that is furthest out is held at its limit by an overwhelming prior, until none is out.
    """
    held, at = np.zeros(len(right)), np.zeros(len(right))
    inverse = ridge_inverse(normal)
    for _ in range(len(right) + 1):
        solution = inverse @ (right + held * at)
        out = np.abs(solution) / limit
        out[held > 0] = 0.0
        if out.max(initial=0.0) <= 1.0:
            break
        worst = int(out.argmax())
        held[worst] = _HOLD * max(normal[worst, worst], 1e-300)
        at[worst] = np.sign(solution[worst]) * limit[worst]
        # One more number on the diagonal is a change of rank one (Sherman and Morrison).
        column, row = inverse[:, worst], inverse[worst]
        inverse = inverse - column[:, None] * row * (held[worst] / (1.0 + held[worst] * column[worst]))
    return solution, inverse, held, at


def ridge_inverse(matrix: np.ndarray) -> np.ndarray:
    """Inverse of a symmetric normal matrix, scaled to unit diagonal, with a trace of ridge."""
    scale = inverse_root(matrix.diagonal())
    units = scale[:, None] * scale
    return np.linalg.inv(_raised(matrix * units, _RIDGE)) * units


def limited_bias(gram: np.ndarray, bias: np.ndarray) -> np.ndarray:
    """The noise's Gram matrix, held to MOST_ATTENUATION of the energy in every direction."""
    if not len(gram):
        return bias
    scale = inverse_root(gram.diagonal())
    units = scale[:, None] * scale
    within = bias * units
    if within.trace() <= MOST_ATTENUATION * 1e-9:
        return bias  # less than the limit in any direction that is kept below
    scaled = _raised(gram * units, 1e-9)
    if np.linalg.solve(scaled, within).trace() <= MOST_ATTENUATION:
        return bias  # the shares of all directions together are no more
    values, vectors = np.linalg.eigh(scaled)
    values = np.maximum(values, 1e-9)
    back = vectors / np.sqrt(values)
    inner = back.T @ within @ back
    share, turn = np.linalg.eigh((inner + inner.T) / 2)
    if share[-1] <= MOST_ATTENUATION:
        return bias
    root = (vectors * np.sqrt(values)) @ turn
    unscale = np.where(scale > 0, 1.0 / np.where(scale > 0, scale, 1.0), 0.0)
    return (root * np.minimum(share, MOST_ATTENUATION)) @ root.T * np.outer(unscale, unscale)


def spread_of(scores: np.ndarray, runs: np.ndarray, memory: int) -> np.ndarray:
    """Sum of products of the blocks' scores (n, k), and of those up to `memory` apart in one run, (k, k).

    Newey and West, A simple, positive semi-definite, heteroskedasticity and autocorrelation consistent covariance
    matrix, Econometrica 55, 1987.
    """
    total = scores.T @ scores
    for lag in range(1, min(memory, len(scores) - 1) + 1):
        same = runs[lag:] == runs[:-lag]
        product = scores[lag:][same].T @ scores[:-lag][same]
        total += (1.0 - lag / (memory + 1)) * (product + product.T)
    return total


def at_least(robust: np.ndarray, plain: np.ndarray) -> np.ndarray:
    """A covariance that is in no direction smaller than the classical one."""
    # Coefficients differ by many powers of ten (kg m2 and relative changes): compare in units of their own.
    unit = np.sqrt(np.maximum(np.diag(plain), 0.0))
    scale = np.where(unit > 0, 1.0 / np.where(unit > 0, unit, 1.0), 0.0)
    values, vectors = np.linalg.eigh((plain + plain.T) / 2 * np.outer(scale, scale))
    values = np.maximum(values, 1e-12)
    root = vectors * np.sqrt(values)
    back = vectors / np.sqrt(values)
    inner = back.T @ (robust * np.outer(scale, scale)) @ back
    v, u = np.linalg.eigh((inner + inner.T) / 2)
    return root @ (u * np.maximum(v, 1.0)) @ u.T @ root.T * np.outer(unit, unit)


def quadratic_form(values: np.ndarray, covariance: np.ndarray) -> float:
    """valuesᵀ covariance⁻¹ values, in units of the coefficients' own standard errors."""
    unit = np.sqrt(np.maximum(covariance.diagonal(), 1e-300))
    size, vectors = np.linalg.eigh(covariance / (unit[:, None] * unit))
    known = np.abs(size) > 1e-10 * np.abs(size).max(initial=0.0)
    return float(((values / unit @ vectors)[known] ** 2 / size[known]).sum())


def _whiten(rows: Rows, channel: int, taps: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Whitened y (n,) and `columns` of x (n, k) of one channel (one at a time: all would be large)."""
    return causal(taps, rows.y[:, channel]), causal(taps, rows.x[:, channel, columns])


def _acting(rows: Sequence[Rows], channel: int) -> np.ndarray:
    """Columns that say something in a channel: many say nothing there (a moment in a force)."""
    return np.flatnonzero(np.any([r.x[:, channel].any(axis=0) for r in rows], axis=0))


def full_fit_residuals(
    rows: list[Rows], precision: np.ndarray, colours: dict[int, np.ndarray] | None = None
) -> tuple[list[np.ndarray], np.ndarray]:
    """Residuals (n, 12) of every term fitted at once, channels weighted by their own spread (two rounds).

    `colours` are whitening filters of channels whose columns exceed the noise only through them: weighed evenly over
    all frequencies, their noise would be fitted and what they explain be left, to be taken for the channel's own noise.
    """
    colours = colours or {}
    channels = np.flatnonzero(np.isfinite(rows[0].y).all(axis=0))
    size = rows[0].x.shape[2]
    beta = np.zeros(size)
    left = [r.y for r in rows]
    used = {c: _acting(rows, c) for c in channels}
    for _ in range(2):
        gram, cross = np.zeros((size, size)), np.zeros(size)
        for c in channels:
            taps = colours.get(c, np.ones(1))
            weight = 1.0 / (np.concatenate([causal(taps, part[:, c]) for part in left]).std() + 1e-12)
            for r in rows:
                y, x = _whiten(r, c, taps, used[c])
                x = x * weight
                gram[np.ix_(used[c], used[c])] += x.T @ x
                cross[used[c]] += x.T @ (y * weight)
        gram += np.diag(precision)
        scale = inverse_root(np.diag(gram))
        beta = scale * np.linalg.solve(gram * np.outer(scale, scale) + 1e-7 * np.eye(size), cross * scale)
        left = [r.y - r.x @ beta for r in rows]
    return left, beta


def build(
    rows: list[Rows],
    terms: list[Term],
    filters: dict[int, np.ndarray],
    within: Within | None,
    block_s: float,
    rate_hz: float,
    noisy: list[Rows] | None = None,
    estimated_by: Collection[int] = (),
    apart: Iterable[str] = (),
    by_channel: bool = False,
) -> Regression:
    """Gram matrices of whitened rows; `noisy` are the same rows with the sensors' noise added once more.

    `within` of a block's run and middle, s, is True for one to fit, False for one held out, None for a gap; without it
    all are fitted. The channels
    `estimated_by` alone estimate the terms `apart` (`_Apart`). `by_channel` keeps the products channel by channel, too.
    """
    start, at = {}, 0
    for term in terms:
        start[term.key] = at
        at += term.size
    per_block = max(2, int(round(block_s * rate_hz)))
    longest = max(len(f) for f in filters.values()) - 1
    own = np.sort([start[t.key] + i for t in terms if t.key in set(apart) for i in range(t.size)]).astype(int)
    names = {name: i for i, name in enumerate(dict.fromkeys(r.run for r in rows))}
    parts_of, blocks_of_rows, runs, training = _blocks_of(rows, names, per_block, longest, within)
    count = len(runs)
    fitted = np.array([t is True for t in training])
    gram, cross, square = np.zeros((at, at, count)), np.zeros((count, at)), np.zeros(count)
    own_gram, own_cross = np.zeros((count, len(own), at)), np.zeros((count, len(own)))
    bias_gram, bias_cross = np.zeros((at, at)), np.zeros(at)
    own_bias, own_bias_cross = np.zeros((len(own), at)), np.zeros(len(own))
    kept = _empty_by_channel(np.array(list(filters)), runs, fitted, per_block / rate_hz, at) if by_channel else None
    for k, (r, parts) in enumerate(zip(rows, parts_of, strict=True)):
        if not parts:
            continue  # shorter than the whitening reaches: it says nothing
        first = blocks_of_rows[k][0]
        here = slice(first, first + len(parts))
        for place, (channel, taps) in enumerate(filters.items()):
            used = _acting([r] if noisy is None else [r, noisy[k]], channel)
            grid = np.ix_(used, used)
            y, x = (values[longest:] for values in _whiten(r, channel, taps, used))
            # Of the columns used those that this channel estimates apart: where they stand among them, and in `own`.
            ours = np.flatnonzero(np.isin(used, own)) if channel in estimated_by else np.zeros(0, int)
            ours_at = np.searchsorted(own, used[ours])
            ours_grid = np.ix_(ours_at, used)
            if noisy is not None:
                y_again, x_again = (values[longest:] for values in _whiten(noisy[k], channel, taps, used))
                shift = x_again - x
                noise, with_y = shift.T @ shift, shift.T @ (y_again - y)
                bias_gram[grid] += noise
                bias_cross[used] += with_y
                own_bias[ours_grid] += noise[ours]
                own_bias_cross[ours_at] += with_y[ours]
                if kept is not None:
                    kept.bias_gram[place][grid] += noise
                    kept.bias_cross[place, used] += with_y
            products = np.array([x[part].T @ x[part] for part in parts])
            with_y = np.array([x[part].T @ y[part] for part in parts])
            squares = np.array([y[part] @ y[part] for part in parts])
            gram[(*grid, here)] += products.transpose(1, 2, 0)
            cross[here, used] += with_y
            square[here] += squares
            if len(ours):
                own_gram[(here, *ours_grid)] += products[:, ours]
                own_cross[here, ours_at] += with_y[:, ours]
            if kept is not None:
                for b, e in enumerate(kept.environment[here]):
                    if e >= 0:
                        kept.gram[place, e][grid] += products[b]
                        kept.cross[place, e, used] += with_y[b]
                        kept.square[place, e] += squares[b]
    precision = np.concatenate([1.0 / np.square(np.broadcast_to(t.prior_sd, (t.size,)).astype(float)) for t in terms])
    return Regression(
        terms,
        start,
        gram.transpose(2, 0, 1),
        cross,
        square,
        np.array(runs),
        fitted,
        precision,
        bias_gram,
        bias_cross,
        filters,
        names,
        block_s=per_block / rate_hz,
        rate_hz=rate_hz,
        blocks_of_rows=tuple(blocks_of_rows),
        apart=_Apart(own, own_gram, own_cross, own_bias, own_bias_cross, np.array(sorted(estimated_by), int))
        if len(own)
        else None,
        by_channel=kept,
    )


def _blocks_of(
    rows: list[Rows], names: dict[str, int], per_block: int, longest: int, within: Within | None
) -> tuple[list[list[slice]], list[np.ndarray], list[int], list[bool | None]]:
    """Of every stretch its blocks as places behind the whitening's reach `longest`, and of each of its rows the block;
    of every block the run's number, and whether it is fitted."""
    parts_of, blocks_of_rows = [], []
    runs: list[int] = []
    training: list[bool | None] = []
    for r in rows:
        size = len(r.y) - longest
        blocks_of_rows.append(np.full(len(r.y), -1))
        places = [] if size < 2 else np.array_split(np.arange(size), max(1, size // per_block))
        parts_of.append([slice(int(own[0]), int(own[-1]) + 1) for own in places])
        for b, part in enumerate(parts_of[-1], len(runs)):
            blocks_of_rows[-1][longest + part.start : longest + part.stop] = b
        if parts_of[-1]:
            blocks_of_rows[-1][:longest] = len(runs)
        runs += [names[r.run]] * len(parts_of[-1])
        middles = [
            r.time_s[min(len(r.time_s) - 1, longest + (part.start + part.stop - 1) // 2)] for part in parts_of[-1]
        ]
        training += [within is None or within(r.run, float(middle)) for middle in middles]
    return parts_of, blocks_of_rows, runs, training


def _empty_by_channel(
    channels: np.ndarray, runs: list[int], fitted: np.ndarray, block_s: float, columns: int
) -> _ByChannel:
    """Products of no rows yet, for every channel and environment of the fitted blocks."""
    environment = np.full(len(runs), -1)
    environment[fitted] = environments(np.array(runs)[fitted], block_s)
    count = int(environment.max(initial=0)) + 1
    # Environments of which products are kept channel by channel; those of a longer flight are joined.
    most_environments = 120
    environment //= -(-count // most_environments)  # joined where they are more than that
    count = int(environment.max(initial=0)) + 1
    return _ByChannel(
        channels=channels,
        environment=environment,
        gram=np.zeros((len(channels), count, columns, columns)),
        cross=np.zeros((len(channels), count, columns)),
        square=np.zeros((len(channels), count)),
        bias_gram=np.zeros((len(channels), columns, columns)),
        bias_cross=np.zeros((len(channels), columns)),
    )


@dataclass(frozen=True)
class _Equations:
    """Normal equations of all K columns on the blocks fitted, and what they are judged by, in scaled columns.

    After the K columns stand some that are nothing: terms of fewer columns than the largest are filled up with them.
    """

    count: int
    """K."""
    normal: np.ndarray
    """(K, K) the noise of the regressors taken off, with priors and ridge."""
    right: np.ndarray
    """(K,)."""
    gram: np.ndarray
    """(K, K) of every channel, the noise of the regressors taken off."""
    cross: np.ndarray
    """(K,)."""
    limit: np.ndarray
    """(K,) the furthest that a coefficient may be."""
    energy: np.ndarray
    """(K, K) products as they are, scaled to a unit diagonal, with a trace of ridge."""
    noise: np.ndarray
    """(K, K) what the noise adds to `energy`."""

    def explained(
        self, base: np.ndarray, further: np.ndarray, hold: float, most_noise: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Squares explained by columns `base` (k,) with each of `further` (m, s), and where they are not known, (m,).

        They are not known here where more than a share `most_noise` of all directions together is noise, or where
        columns are so much alike that the complement is nothing but rounding. What is further out than its limit, the
        worst first, is held there by a prior of precision `hold`.
        """
        shape, flat = further.shape, further.ravel()
        diagonal = further[:, :, None], further[:, None, :]
        inverse = np.linalg.inv(self.normal[base[:, None], base])
        row, column = self.normal[flat[:, None], base], self.normal[base[:, None], flat]
        behind = (inverse @ column).T.reshape(*shape, -1)
        ahead = row.reshape(*shape, -1)
        own = np.linalg.inv(self.normal[diagonal] - ahead @ behind.swapaxes(1, 2))
        start = inverse @ self.right[base]
        beta = (own @ (self.right[further] - ahead @ start)[:, :, None])[:, :, 0]
        others = start - (beta[:, None] @ behind)[:, 0]
        values = np.flatnonzero(np.isfinite(self.limit[base]))
        # Columns of the inverse of all that belong to what is limited.
        taken = own @ (row @ inverse[:, values]).reshape(*shape, -1)
        rest = inverse[:, values] + behind.swapaxes(1, 2) @ taken
        pull = _held_by(others[:, values], rest[:, values], self.limit[base[values]], hold)
        others += (rest @ pull[:, :, None])[:, :, 0]
        beta -= (taken @ pull[:, :, None])[:, :, 0]
        mixed = self.gram[base[:, None], flat].T.reshape(*shape, -1)
        towards = others @ self.gram[base[:, None], base] + 2 * (beta[:, None] @ mixed)[:, 0]
        found = 2 * others @ self.cross[base] + 2 * (beta * self.cross[further]).sum(axis=1)
        found -= (towards * others).sum(axis=1) + ((self.gram[diagonal] @ beta[:, :, None])[:, :, 0] * beta).sum(axis=1)
        # Largest element of the inverse of scaled equations (1 / (1 - R²) of a column) of which rounding leaves enough.
        most_alike = 1e6
        alike = np.maximum(np.abs(own).max(axis=(1, 2)), np.abs(inverse).max(initial=0.0)) > most_alike
        return found, alike | (self._noise_share(base, further) > most_noise)

    def _noise_share(self, base: np.ndarray, further: np.ndarray) -> np.ndarray:
        """Shares of all directions of the columns that are noise, added up, (m,)."""
        shape, flat, diagonal = further.shape, further.ravel(), (further[:, :, None], further[:, None, :])
        if not self.noise.any():
            return np.zeros(len(further))
        inverse, noise = np.linalg.inv(self.energy[base[:, None], base]), self.noise[base[:, None], base]
        mixed = self.energy[base[:, None], flat]
        behind = inverse @ mixed
        own = self.energy[diagonal] - mixed.T.reshape(*shape, -1) @ behind.T.reshape(*shape, -1).swapaxes(1, 2)
        # vᵀ noise v of the directions v = (−behind, 1) of the further columns.
        turned = (noise @ behind - 2 * self.noise[base[:, None], flat]).T.reshape(*shape, -1)
        added = self.noise[diagonal] + turned @ behind.T.reshape(*shape, -1).swapaxes(1, 2)
        return (inverse * noise).sum() + np.trace(np.linalg.solve(own, added), axis1=1, axis2=2)


def _held_by(at: np.ndarray, inverse: np.ndarray, limit: np.ndarray, hold: float) -> np.ndarray:
    """What pulls at coefficients `at` (m, q) so that none is beyond its limit (q,), (m, q).

    The one that is furthest out is held, until none is out; `inverse` (m, q, q) says what a pull moves.
    """
    held, wanted, pull, moved = np.zeros(at.shape, bool), np.zeros(at.shape), np.zeros(at.shape), at
    for _ in range(at.shape[1]):
        out = np.where(held, 0.0, np.abs(moved) / limit)
        beyond = np.flatnonzero(out.max(axis=1, initial=0.0) > 1.0)
        if not len(beyond):
            break
        worst = out[beyond].argmax(axis=1)
        held[beyond, worst] = True
        wanted[beyond, worst] = np.sign(moved[beyond, worst]) * limit[worst]
        system = np.where(held[:, :, None] & held[:, None], inverse, 0.0)
        system[:, np.arange(len(limit)), np.arange(len(limit))] += np.where(held, 1.0 / hold, 1.0)
        pull = np.linalg.solve(system, np.where(held, wanted - at, 0.0)[:, :, None])
        moved, pull = at + (inverse @ pull)[:, :, 0], pull[:, :, 0]
    return pull


def noise_factors(
    segments: list[Segment], noisy: list[Segment], vehicle: Vehicle, thinner: Thinner
) -> dict[str, np.ndarray]:
    """Sensor (`rotors`, `gyroscope`) to the factors by which its noise in the band exceeds that of the `noisy` copies.

    The gyroscope's are of its axes, (3,); of the rotors, which are alike, one, (1,). Sensors without a word here are
    as noisy as assumed, or their noise is hidden by motion in the band.
    """
    squares = {"rotors": np.full(3, np.nan), "gyroscope": np.full(3, np.nan)}
    sides = [(_sides(a, vehicle, thinner), _sides(b, vehicle, thinner)) for a, b in zip(segments, noisy, strict=True)]
    sides = [pair for pair in sides if None not in pair]
    if not sides:
        return {}
    rate_hz, band = thinner.rate_hz, tuple(share * thinner.cutoff_hz for share in NOISE_BAND)
    mostly_noise = 0.3  # Share of a side's power in the band that must be noise before it says how much noise there is.
    for c in range(3):
        left = [measured[:, c] - modelled[:, c] for (measured, modelled), _ in sides]
        whole = band_power(left, rate_hz, band)
        for sensor, side, sign in (("gyroscope", 0, 1.0), ("rotors", 1, -1.0)):
            own = [a[side][:, c] for a, _ in sides]
            added = [b[side][:, c] - a[side][:, c] for a, b in sides]
            power, assumed = band_power(own, rate_hz, band), band_power(added, rate_hz, band)
            found = min(sign * band_power(left, rate_hz, band, own), whole)
            if assumed > 0 and found > mostly_noise * power:
                squares[sensor][c] = found / assumed
    ratios = {"gyroscope": squares["gyroscope"], "rotors": squares["rotors"][np.isfinite(squares["rotors"])]}
    ratios["rotors"] = np.median(ratios["rotors"], keepdims=True) if len(ratios["rotors"]) else np.ones(1)
    factors = {sensor: np.sqrt(found) for sensor, found in ratios.items()}
    # A sensor with more noise than that was filtered before it was recorded: what is left in the band may be the
    # model's own.
    least_factor, most_factor = 1.2, 10.0
    plain = {s: np.where((f > least_factor) & (f < most_factor), f, 1.0) for s, f in factors.items()}
    return {sensor: factor for sensor, factor in plain.items() if (factor > 1.0).any()}


def _sides(segment: Segment, vehicle: Vehicle, thinner: Thinner) -> tuple[np.ndarray, np.ndarray] | None:
    """Measured and modelled moment of a segment's rows, (n, 3) each; None where either is unknown."""
    groups = residual(segment, vehicle)
    if "moment" not in groups or not segment.measured_speed:
        return None
    _, arm, torque = baseline_wrench(segment.motion, vehicle)
    modelled = thinner(arm + torque)
    return thinner(groups["moment"]) + modelled, modelled


def band_power(
    one: list[np.ndarray], rate_hz: float, band_hz: tuple[float, float], other: list[np.ndarray] | None = None
) -> float:
    """Mean power density of stretches in a band of frequency, or its real cross density with `other` stretches."""
    total, weight = 0.0, 0
    shortest_rows = 32
    for a, b in zip(one, one if other is None else other, strict=True):
        if len(a) >= shortest_rows:
            frequency, density = csd(a, b, fs=rate_hz, nperseg=min(len(a), 256))
            inside = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
            total, weight = total + float(density[inside].real.mean()) * len(a), weight + len(a)
    return total / max(weight, 1)
