"""Loads put on by hand: where the stated load is a step and the real one is not.

A bench's reference jumps from nothing to the weight; the weight swings. The moments after a step are left out where
readings differ from step to step by more than their noise: an instrument's own dynamics would repeat themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rotorid.effects.loading import Loading

_STEP_SHARE = 0.02
"""Change from sample to sample, as a share of the largest load, from which a load jumps."""
_LEAST_STEPS = 4
_CALM_S, _LOOK_S = 0.8, 3.0
"""Time before and after a step without another, and time after it that is looked at."""
_BY_HAND, _SETTLED = 1.5, 1.35
"""Scatter relative to the later scatter, in the first moments, from which loads count as put on by hand, and from which
a reading has not settled."""
_SMOOTH = 5
"""Samples over which the scatter is smoothed."""
_SLACK_S = 0.1
"""Time left out before a step, and after the readings have settled."""


def _steps_of(loading: Loading, channel: int, largest: float) -> np.ndarray:
    """Samples at which a load jumps from one sample to the next and does not before and after."""
    jumps = np.abs(np.diff(loading.load[:, channel])) > _STEP_SHARE * largest
    calm = max(2, int(_CALM_S / loading.dt_s))
    at = np.flatnonzero(jumps) + 1
    alone = [not jumps[max(0, k - 1 - calm) : k - 1].any() and not jumps[k : k + calm].any() for k in at]
    return at[np.array(alone, bool) & (at + calm < loading.size)]


def _scatter(loadings: Sequence[Loading], channel: int, largest: float, dt_s: float) -> np.ndarray | None:
    """Scatter between steps of (reading − settled reading) by time after the step, own unit; None for few steps."""
    look = int(_LOOK_S / dt_s)
    shapes, jumps = [], []
    for x in loadings:
        at = _steps_of(x, channel, largest)
        for start, stop in zip(at, np.append(at, x.size)[1:], strict=True):
            if stop - start < look // 2 + 4:
                continue
            part = x.reading[start : min(stop, start + look), channel]
            jumps.append(x.load[start, channel] - x.load[start - 1, channel])
            settled = np.median(x.reading[start + (stop - start) // 2 : stop, channel])
            shapes.append((part - settled) / jumps[-1])
    if len(shapes) < _LEAST_STEPS:
        return None
    normal = np.array([s[: min(map(len, shapes))] for s in shapes])
    usual = np.median(normal, axis=0)
    return np.median(np.abs((normal - usual) * np.array(jumps)[:, None]), axis=0) * 1.4826


def settling_s(loadings: Sequence[Loading], channels, largest, dt_s: float) -> float:
    """How long after a step the stated load cannot be relied on, s; 0 where it can."""
    longest = 0.0
    for c in channels:
        spread = _scatter(loadings, c, largest[c], dt_s)
        if spread is None:
            continue
        smooth = np.sqrt(np.convolve(spread**2, np.ones(_SMOOTH) / _SMOOTH, mode="same"))
        late = float(np.median(spread[2 * len(spread) // 3 :]))
        early = float(np.sqrt(np.mean(spread[: max(3, int(_CALM_S / dt_s))] ** 2)))
        if early < _BY_HAND * late:
            continue
        above = np.flatnonzero(smooth[:-_SMOOTH] > _SETTLED * late)
        longest = max(longest, (above[-1] + 1) * dt_s + _SLACK_S if len(above) else 0.0)
    return longest


def without_settling(loadings: Sequence[Loading], channels, largest, wait_s: float) -> tuple[Loading, ...]:
    """Stretches with the samples from just before a step until it has settled marked as not to be used."""
    out = []
    for x in loadings:
        keep = np.ones(x.size, bool) if x.keep is None else x.keep.copy()
        for c in channels:
            for at in _steps_of(x, c, largest[c]):
                t = x.time_s[at]
                keep &= ~((x.time_s > t - _SLACK_S) & (x.time_s < t + wait_s))
        out.append(replace(x, keep=keep))
    return tuple(out)
