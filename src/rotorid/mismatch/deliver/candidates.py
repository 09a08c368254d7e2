"""Which vehicle is taken home: one number chooses among a few candidates.

The number is the mean, over the channels of force and moment and over what half a second of simulation from recorded
states is off by, of the logarithm of the error on what was left out of the fit (`Regression.folds`): whole
runs where there are three or more. Taken is the plainest candidate within one standard error of the best, among those
that hover and fly; without derivatives also one within three percent of one with them. No channel has a veto, and no
part is taken out by itself.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from rotorid.mismatch.decide.problem import Values
from rotorid.mismatch.deliver.derivatives import Learnt
from rotorid.mismatch.evidence.regression import Fit

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
        found = [[np.bincount(unit, s, count), np.bincount(unit, None, count)] for s in left[judged].T ** 2]
        return np.array(found).reshape(-1, 2, count)

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
    draws = 400
    drawn = np.random.default_rng(0).integers(0, units, (draws, units))
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
    worth = 0.03  # Logarithm of an error below which derivatives gain nothing that shows in flight.
    return worth if best.candidate.learnt is not None and plain.candidate.learnt is None else 0.0


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
