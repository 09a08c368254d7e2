"""Steps of a reading: quantisation that is coarse relative to the noise."""

from __future__ import annotations

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.effects.loading import CHANNELS, UNITS
from rotorid.mismatch.decision.findings import Finding
from rotorid.mismatch.posterior.status import Estimate
from rotorid.recordings import columns as c

_COARSE_SHARE = 0.25
"""Share of the noise's variance that the steps must make, q²/12 relative to σ²."""
_LEAST_SAMPLES = 200
_ON_GRID = 0.99
_OFF_GRID = 0.02
"""Distance to the grid, as a share of a step, that still counts as on it."""


def step_of(values: np.ndarray) -> float:
    """Step of a grid that readings lie on, 0.0 if they lie on none.

    The step is the smallest difference between two different values that is not rounding; nearly every value must
    then lie on the grid.
    """
    values = values[np.isfinite(values)]
    levels = np.unique(np.round(values, 9))
    if len(levels) < 3 or len(levels) > 0.5 * len(values):
        return 0.0
    gaps = np.diff(levels)
    step = float(np.min(gaps[gaps > 1e-3 * np.median(gaps)]))
    # Refine: the mean of all gaps in units of the step.
    step = float(np.sum(gaps) / np.sum(np.round(gaps / step)))
    off = np.abs(gaps / step - np.round(gaps / step))
    return step if np.mean(off < _OFF_GRID) >= _ON_GRID else 0.0


def quantisation(setup, noise: np.ndarray) -> tuple[Finding | None, str | None]:
    """Finding where steps make a good part of the noise; or the reason why it cannot be tested."""
    effect = catalogue()["quantisation"]
    names = c.FORCE + c.MOMENT
    total = sum(len(r.table) for r in setup.recordings.runs)
    if total < _LEAST_SAMPLES:
        return None, "too few samples to see the steps of the reading"
    found = []
    for k in setup.instrument.channels:
        values = np.concatenate([r.column(names[k]) for r in setup.recordings.runs])
        step = step_of(values)
        sigma = _noise_of_samples(setup.loadings, k)
        if step and step**2 / 12 > _COARSE_SHARE * max(sigma**2, 1e-300) and step < 1e3 * max(sigma, step / 12):
            found.append((k, step, sigma))
    if not found:
        return None, None
    return (
        Finding(
            id="quantisation",
            status="established",
            equation="y = q round(F/q)",
            sentence=effect.sentence,
            parameters=tuple(
                Estimate(f"q_{CHANNELS[k]}", step, UNITS[k], step * (1 - 1e-3), step * (1 + 1e-3))
                for k, step, _ in found
            ),
            p_value=1e-12,
            channels=tuple(CHANNELS[k] for k, _, _ in found),
        ),
        None,
    )


def _noise_of_samples(loadings, channel: int) -> float:
    """One sigma of a sample's noise by second differences of reading less load, robust against sudden changes."""
    parts = [np.diff((x.reading - x.load)[:, channel], 2) for x in loadings if x.size > 4]
    if not parts:
        return 0.0
    second = np.concatenate(parts)
    # A coarse reading often does not change at all, so that a median would be zero: rms of the calmer nine tenths.
    calm = np.sort(np.abs(second))[: max(1, int(0.9 * len(second)))]
    return float(np.sqrt(np.mean(calm**2) / 6.0) * 1.25)
