"""One question in many places: does a model predict better where it was not fitted; do runs differ?

The fitted part of a set is cut into environments of at least five seconds, never across runs. Both models are fitted on
all environments but some and scored on those, so that every environment is scored by coefficients that never saw it
(leave-one-out over folds of environments; whole runs are left out where there are at least three). What A gains
on an environment is compared with what its extra part predicts there if its coefficients are right; environments that
hardly excite it do not vote.

An effect that is at work keeps what it promises, and does so in nearly every environment that excites it. One that
fills a gap left by another cause gains on average only (Pfister, Bauer and Peters, Learning stable and predictive
structures in kinetic systems, PNAS 2019, rank terms of differential equations by the same stability).

Errors of channels compared on masked rows: whether squares have grown, by blocks of a second.

Whether what is left of a channel has another mean in each run: something was changed between the flights.

A term that is the same in every run cannot explain it, and no input of a flight shows it. The means are compared by
an analysis of variance over blocks, whose own correlation widens it (a sensor's bias walks).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import f as f_distribution
from scipy.stats import norm

CHANNELS_OF_WRENCH = 6
ENVIRONMENT_S = 5.0
"""Length of an environment, s."""
LEAST_ENVIRONMENTS = 6
"""Fewer environments of ENVIRONMENT_S are made shorter ones, so that something is left to compare."""
LEAST_RUNS = 3
"""Fitted runs from which whole runs are left out."""
VOTES_FROM = 0.05
"""Predicted gain of an environment, relative to the largest of all, from which it votes."""


@dataclass(frozen=True)
class Comparison:
    """What model A gains over model B on environments that neither was fitted on, in whitened squares."""

    gained: np.ndarray
    """(environments,) squares that A leaves less than B."""
    promised: np.ndarray
    """(environments,) squares that A's extra part explains there if its coefficients are right."""
    seen: np.ndarray
    """(environments,) squares that the same part explains in all that was fitted when this one was left out."""
    doubt: np.ndarray
    """(environments,) squares by which the coefficients that A has more are expected to be off there, as little as the
    blocks that they were fitted on determine them."""
    fold: np.ndarray
    """(environments,) which were left out together."""

    @property
    def judges(self) -> np.ndarray:
        """Mask of the environments whose fold the coefficients fitted without it predict well enough.

        They must know the same change from as much of it, and with coefficients that are off by e squares A promises e
        more than there is and gains e less.
        """
        asked, off = (np.array([x[self.fold == f].sum() for f in self.fold]) for x in (self.promised, self.doubt))
        # Share of the promise that a true effect must be expected to keep on blocks left out, for these to judge: what
        # one run alone excites cannot be learnt from the others.
        least_expected = 0.6
        # What the fitted blocks must hold of the same change, relative to what is asked of the blocks left out: no form
        # is so true that what slow flights say of it could be held against a fast one.
        seen_elsewhere = 1.0
        return (self.seen >= seen_elsewhere * asked) & (asked - 2 * off >= least_expected * asked)

    @property
    def answers(self) -> bool:
        """Whether enough of what is promised lies where it may be judged."""
        whole = float(self.promised.sum())
        # Share of all that is promised on environments that may judge, from which leaving out whole runs is an answer.
        answered = 0.5
        return float(self.promised[self.judges].sum()) >= answered * whole if whole > 0 else False

    @property
    def votes(self) -> np.ndarray:
        """Mask of the environments that excite A's extra part and may judge it."""
        most = float(self.promised.max(initial=0.0))
        return self.judges & (self.promised > max(VOTES_FROM * most, 1e-12))

    @property
    def total(self) -> float:
        """Squares gained over all environments."""
        return float(self.gained.sum())

    @property
    def transfer(self) -> float:
        """Share of what was promised that is gained where it was not fitted; 1 where nothing votes."""
        own = self.votes
        promised = float(self.promised[own].sum())
        return float(self.gained[own].sum()) / promised if promised > 0 else 1.0

    @property
    def won(self) -> float:
        """Share of the voting environments in which A is better; 1 where nothing votes."""
        own = self.votes
        return float((self.gained[own] > 0).mean()) if own.any() else 1.0

    @property
    def expected_won(self) -> float:
        """Share of the voting environments in which A is better if its coefficients are right, by white noise alone."""
        own = self.votes
        return float(norm.cdf(np.sqrt(self.promised[own]) / 2).mean()) if own.any() else 1.0


def environments(run: np.ndarray, seconds: float) -> np.ndarray:
    """Number of the environment of every block (n,), given its run's number and the blocks' length in seconds."""
    total = len(run) * seconds
    shortest_s = 1.0
    length = max(shortest_s, min(ENVIRONMENT_S, total / LEAST_ENVIRONMENTS))
    per = max(1, int(round(length / seconds)))
    out, at = np.zeros(len(run), int), 0
    for number in np.unique(run):
        own = np.flatnonzero(run == number)
        for part in np.array_split(own, max(1, len(own) // per)):
            out[part] = at
            at += 1
    return out


def folds(environment: np.ndarray, run: np.ndarray, whole_runs: bool) -> np.ndarray:
    """Fold of every block (n,): blocks of one fold are left out together, whole runs or environments in turn."""
    most_folds = 8
    if whole_runs:
        return np.searchsorted(np.unique(run), run) % most_folds
    return environment % min(most_folds, int(environment.max(initial=0)) + 1)


def growth(
    before: list[np.ndarray], after: list[np.ndarray], held: list[np.ndarray], per: int
) -> tuple[np.ndarray, np.ndarray]:
    """Ratio of the held-out errors after and before of each wrench channel, and its growth in standard errors.

    Squares are compared by blocks of `per` rows; without enough of them nothing is said (ratio 1, growth 0).
    """
    blocks = []
    for b, a, mask in zip(before, after, held, strict=True):
        rows = np.flatnonzero(mask)
        if len(rows) >= per:
            parts = np.array_split(rows, len(rows) // per)
            squares = [x[:, :CHANNELS_OF_WRENCH] ** 2 for x in (b, a)]
            blocks += [[s[p].mean(axis=0) for s in squares] for p in parts]
    if not _long_enough(held, per):
        return np.ones(CHANNELS_OF_WRENCH), np.zeros(CHANNELS_OF_WRENCH)
    was, now = np.array(blocks).transpose(1, 0, 2)
    change = now - was
    doubt = change.std(axis=0, ddof=1) / np.sqrt(len(change))
    ratio = np.sqrt(now.mean(axis=0) / np.maximum(was.mean(axis=0), 1e-300))
    return np.nan_to_num(ratio, nan=1.0), np.nan_to_num(change.mean(axis=0) / np.maximum(doubt, 1e-300))


def _long_enough(held: list[np.ndarray], per: int) -> bool:
    """Whether there are enough blocks of `per` rows held out."""
    least_blocks = 8
    return sum(int(mask.sum()) // per for mask in held) >= least_blocks


@dataclass(frozen=True)
class DifferingMeans:
    """Means of a channel that differ between runs."""

    means: Mapping[str, float]
    """Run to the mean of what is left, in the channel's unit."""
    p_value: float

    def mean_square(self, runs: Sequence[str], counts: Sequence[int]) -> float:
        """Mean square of the means over stretches of `counts` samples, each of a run."""
        return float(np.average([self.means.get(run, 0.0) ** 2 for run in runs], weights=counts))


def apart(runs: Sequence[str], parts: Sequence[np.ndarray], rate_hz: float, noise: float) -> DifferingMeans | None:
    """Means of stretches (n,), each of a run, where runs differ beyond doubt and matter; None where they do not."""
    means, p_value = compared(runs, parts, rate_hz)
    alarm_p = 1e-6
    # Distance of a run's mean from the others', in units of the noise, below which it is not worth a word.
    smallest_share_of_noise = 0.5
    if p_value > alarm_p or np.ptp(list(means.values())) < 2 * smallest_share_of_noise * noise:
        return None
    return DifferingMeans(means, p_value)


def compared(runs: Sequence[str], parts: Sequence[np.ndarray], rate_hz: float) -> tuple[dict[str, float], float]:
    """Mean of each run's stretches (n,), and the p-value that all are one; 1 where there is nothing to compare.

    Of three runs and more each may be left out (the p-value counts every trial): in the run in which something changed
    the blocks differ too, and would pass for a noise that walks.
    """
    block_s = 2.0
    size = max(2, int(block_s * rate_hz))
    blocks: dict[str, list[np.ndarray]] = {}
    for run, part in zip(runs, parts, strict=True):
        count = len(part) // size
        if count:
            blocks.setdefault(run, []).append(part[: count * size].reshape(count, size).mean(axis=1))
    means = {run: float(np.concatenate(own).mean()) for run, own in blocks.items()}
    trials = [blocks]
    if len(blocks) > 2:
        trials += [{run: own for run, own in blocks.items() if run != out} for out in blocks]
    return means, min(1.0, len(trials) * min(_alike(trial, means) for trial in trials))


def _alike(blocks: Mapping[str, list[np.ndarray]], means: Mapping[str, float]) -> float:
    """p-value that means of blocks, by run and stretch, vary between runs as they do within."""
    counts = np.array([sum(len(b) for b in own) for own in blocks.values()])
    freedom = int(counts.sum() - len(counts))
    if len(blocks) < 2 or freedom < 3:
        return 1.0
    rest = [b - means[run] for run, own in blocks.items() for b in own]
    within = sum(float(r @ r) for r in rest) / freedom
    lagged = sum(float(r[1:] @ r[:-1]) for r in rest)
    correlation = float(np.clip(lagged / max(within * freedom, 1e-300), 0.0, 0.9))
    within *= (1 + correlation) / (1 - correlation)
    values = np.array([means[run] for run in blocks])
    middle = counts @ values / counts.sum()
    between = float(counts @ (values - middle) ** 2) / (len(values) - 1)
    return float(f_distribution.sf(between / max(within, 1e-300), len(values) - 1, freedom))
