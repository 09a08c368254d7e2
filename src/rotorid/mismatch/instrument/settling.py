"""Loads put on by hand: where the stated load is a step and the real one is not.

A bench's reference jumps from nothing to the weight; the weight swings. The moments after a step are left out where
readings differ from step to step by more than their noise: an instrument's own dynamics would repeat themselves.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rotorid.effects.loading import Loading

STEP_SHARE = 0.02
LEAST_STEPS = 4
CALM_SHARE = 1e-3
CALM_BEFORE_S, CALM_AFTER_S = 0.3, 1.0
LOOK_S = 3.0
EARLY_S = 0.8
BY_HAND = 1.5
"""Scatter in the first moments relative to the later scatter, from which loads count as put on by hand."""
SETTLED = 1.35
SMOOTH = 5
SLACK_S = 0.1
BEFORE_S = 0.1


def steps_of(loading: Loading, channel: int, largest: float) -> np.ndarray:
    """Samples at which a load jumps from one sample to the next and is constant before and after."""
    load, dt_s = loading.load[:, channel], loading.dt_s
    change = np.abs(np.diff(load))
    before, after = max(2, int(CALM_BEFORE_S / dt_s)), max(2, int(CALM_AFTER_S / dt_s))
    out = []
    for at in np.flatnonzero(change > STEP_SHARE * largest) + 1:
        calm = change[max(0, at - 1 - before) : at - 1].max(initial=0.0), change[at : at + after].max(initial=0.0)
        if max(calm) < CALM_SHARE * largest and at + after < len(load):
            out.append(at)
    return np.array(out, int)


def scatter(loadings: tuple[Loading, ...], channel: int, largest: float, dt_s: float) -> np.ndarray | None:
    """Scatter between steps of (reading − settled reading) by time after the step, own unit; None for few steps."""
    look = int(LOOK_S / dt_s)
    shapes = []
    for x in loadings:
        at = steps_of(x, channel, largest)
        ends = np.append(at, x.size)[1:]
        for start, stop in zip(at, ends, strict=True):
            if stop - start < look // 2 + 4:
                continue
            part = x.reading[start : min(stop, start + look), channel]
            settled = np.median(x.reading[start + (stop - start) // 2 : stop, channel])
            jump = x.load[start, channel] - x.load[start - 1, channel]
            shapes.append((np.append((part - settled) / jump, np.full(look - len(part), np.nan)), jump))
    if len(shapes) < LEAST_STEPS:
        return None
    covered = min(int(np.isfinite(s).sum()) for s, _ in shapes)
    normal = np.array([s[:covered] for s, _ in shapes])
    usual = np.median(normal, axis=0)
    jumps = np.array([j for _, j in shapes])
    return np.median(np.abs((normal - usual) * jumps[:, None]), axis=0) * 1.4826


def settling_s(loadings: tuple[Loading, ...], channels, largest, dt_s: float) -> float:
    """How long after a step the stated load cannot be relied on, s; 0 where it can."""
    longest = 0.0
    for c in channels:
        spread = scatter(loadings, c, largest[c], dt_s)
        if spread is None:
            continue
        smooth = np.sqrt(np.convolve(spread**2, np.ones(SMOOTH) / SMOOTH, mode="same"))
        late = float(np.median(spread[2 * len(spread) // 3 :]))
        early = float(np.sqrt(np.mean(spread[: max(3, int(EARLY_S / dt_s))] ** 2)))
        if early < BY_HAND * late:
            continue
        above = np.flatnonzero(smooth[:-SMOOTH] > SETTLED * late)
        longest = max(longest, (above[-1] + 1) * dt_s + SLACK_S if len(above) else 0.0)
    return longest


def without_settling(loadings: tuple[Loading, ...], channels, largest, wait_s: float) -> tuple[Loading, ...]:
    """Stretches with the samples from just before a step until it has settled marked as not to be used."""
    out = []
    for x in loadings:
        keep = np.ones(x.size, bool) if x.keep is None else x.keep.copy()
        for c in channels:
            for at in steps_of(x, c, largest[c]):
                t = x.time_s[at]
                keep &= ~((x.time_s > t - BEFORE_S) & (x.time_s < t + wait_s))
        out.append(replace(x, keep=keep))
    return tuple(out)
