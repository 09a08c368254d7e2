"""Whether what is left of a channel has another mean in each run: something was changed between the flights.

A term that is the same in every run cannot explain it, and no input of a flight shows it. The means are compared by
an analysis of variance over blocks, whose own correlation widens it (a sensor's bias walks).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import f as f_distribution

_BLOCK_S = 2.0
_ALARM_P = 1e-6
_SMALLEST_SHARE_OF_NOISE = 0.5
"""Distance of a run's mean from the others', in units of the noise, below which it is not worth a word."""


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
    if p_value > _ALARM_P or np.ptp(list(means.values())) < 2 * _SMALLEST_SHARE_OF_NOISE * noise:
        return None
    return DifferingMeans(means, p_value)


def compared(runs: Sequence[str], parts: Sequence[np.ndarray], rate_hz: float) -> tuple[dict[str, float], float]:
    """Mean of each run's stretches (n,), and the p-value that all are one; 1 where there is nothing to compare.

    Of three runs and more each may be left out (the p-value counts every trial): in the run in which something changed
    the blocks differ too, and would pass for a noise that walks.
    """
    size = max(2, int(_BLOCK_S * rate_hz))
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
