"""Windows of a run in which a force in world axes comes and goes (a gust), found in the residual itself."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import uniform_filter1d

from rotorid.effects.catalogue import moving_air
from rotorid.effects.gust import window_form
from rotorid.mismatch.plant.rows import Term

_SMOOTHING_S = 0.6
_ALARM = 6.0
"""Robust standard deviations of the smoothed world force that open a window."""
_EDGE = 2.5
"""A window reaches to where the smoothed force falls below this many."""
_SHORTEST_S, _LONGEST_SHARE = 1.0, 0.5
"""A window is never shorter than the smoothing itself; one of a blip is as short."""
_KNOT_S = 0.6
_MOST_WINDOWS = 3


def windows(residual_body: np.ndarray, rotation: np.ndarray, time_s: np.ndarray):
    """Windows (start_s, stop_s, strength) of one stretch, strongest first.

    `residual_body` (n, 3) N; `rotation` (n, 3, 3). The scale is the median absolute deviation of the smoothed
    force over the stretch itself, so a lasting force does not count: that is a steady wind.
    """
    world = np.einsum("nij,nj->ni", rotation, residual_body)[:, :2]
    dt = float(np.median(np.diff(time_s)))
    smooth = uniform_filter1d(world - np.median(world, axis=0), max(3, int(_SMOOTHING_S / dt)), axis=0)
    scale = max(1.4826 * np.median(np.abs(smooth - np.median(smooth, axis=0)), axis=0).max(), 1e-12)
    strength = np.linalg.norm(smooth, axis=1) / scale
    found = []
    left = strength.copy()
    while len(found) < _MOST_WINDOWS:
        top = int(np.argmax(left))
        if left[top] < _ALARM:
            break
        low, high = top, top
        while low > 0 and strength[low - 1] > _EDGE:
            low -= 1
        while high < len(strength) - 1 and strength[high + 1] > _EDGE:
            high += 1
        left[low : high + 1] = 0.0
        length = (high - low) * dt
        if _SHORTEST_S <= length <= _LONGEST_SHARE * len(strength) * dt:
            found.append((float(time_s[low]), float(time_s[high]), float(strength[top])))
    return found


def gust_terms(run: str, found) -> list[Term]:
    """Terms for the windows of one run."""
    terms, gust = [], moving_air("in windows").id
    for start, stop, _ in found:
        knots = int(np.clip(round((stop - start) / _KNOT_S), 2, 12))
        form = window_form(start - 0.15, stop + 0.15, knots)
        size = len(form.parameters)
        terms.append(
            Term(
                f"{gust}/{run}/{start:.2f}",
                "effect",
                gust,
                form,
                (0.0,) * size,
                size,
                (np.inf,) * size,
                run=run,
                window=(run, start, stop),
            )
        )
    return terms
