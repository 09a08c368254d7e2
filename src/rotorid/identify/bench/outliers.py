"""Points that a straight line does not explain, at a stated level, by their studentised residuals.

A wrong point bends the line and widens the scatter by which it is judged, and several wrong ones hide each other. So
the line begins with the points that agree best (least trimmed squares) and takes the others in, the nearest first. Once
the nearest is beyond the limit, it and those further off are outliers (Hadi and Simonoff 1993). The limit is that of
Student's t, Bonferroni's over all points and over the numbers of outliers that are tried.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.special import stdtrit as student_quantile

from rotorid.identify.bench.loadcell import LineFit, fit_line

LEVEL = 0.01
"""Of good calibrations at most this share has a flag, or several, among all its points."""
FEWEST_KEPT = 4
ROUNDING = 1e-9
"""Scatter below this share of the range of y is that of the numbers' last digits."""


@dataclass(frozen=True)
class Outliers:
    """What a line says of each point, shape (n,) each."""

    flagged: np.ndarray
    studentised: np.ndarray
    """Residual from the line through the other unflagged points over its standard uncertainty."""
    limit: float
    """Of the studentised residual's size; the line has two degrees of freedom less than unflagged points."""
    line: LineFit
    """Through the unflagged points."""
    tested: bool
    """False for too few points, or too many at one reading: then nothing is flagged."""


def find(x: Sequence[float], y: Sequence[float], tests: int, level: float = LEVEL) -> Outliers:
    """Points of y over x, shape (n,) each, that lie off their line; at most a third of them.

    `tests` is the number of points among which none should be flagged by chance, those of other lines included.
    Raises InputError as `fit_line` does.
    """
    x, y = np.asarray(x, float), np.asarray(y, float)
    n, floor = len(x), ROUNDING * np.ptp(y)
    whole = fit_line(x, y)
    most = min(n // 3, n - FEWEST_KEPT)
    kept = _agreeing(x, y, n - most) if most > 0 else np.ones(n, bool)
    tested = bool(most > 0 and np.ptp(x[kept]) > 0)
    if not tested:
        return Outliers(np.zeros(n, bool), np.full(n, np.nan), np.nan, whole, False)
    while not kept.all():
        distance = np.abs(_studentised(x, y, kept, floor))
        distance[kept] = np.inf
        nearest = int(np.argmin(distance))
        if distance[nearest] > _limit(kept.sum() - 2, tests * most, level):
            break
        kept[nearest] = True
    studentised = _studentised(x, y, kept, floor)
    for i in np.flatnonzero(kept):
        others = kept.copy()
        others[i] = False
        if np.ptp(x[others]) > 0:
            studentised[i] = _studentised(x, y, others, floor)[i]
    line = whole if kept.all() else fit_line(x[kept], y[kept])
    return Outliers(~kept, studentised, _limit(kept.sum() - 2, tests * most, level), line, True)


def _limit(freedom: int, tests: int, level: float) -> float:
    """Student's t that none of `tests` residuals exceeds but in a share `level` of cases."""
    return float(-student_quantile(freedom, level / (2 * tests)))


def _studentised(x: np.ndarray, y: np.ndarray, kept: np.ndarray, floor: float) -> np.ndarray:
    """Residuals of all points from the line through the kept ones, each over the uncertainty of a new point there."""
    line = fit_line(x[kept], y[kept])
    offset = x - x[kept].mean()
    growth = 1 + 1 / kept.sum() + offset**2 / np.sum(offset[kept] ** 2)
    return (y - line.a0 - line.a1 * x) / (max(line.residual_sd, floor) * np.sqrt(growth))


def _agreeing(x: np.ndarray, y: np.ndarray, count: int) -> np.ndarray:
    """The `count` points with the least sum of squares about a line through two of them, as a mask (n,)."""
    first, second = np.array(list(combinations(range(len(x)), 2))).T
    apart = x[first] != x[second]
    first, second = first[apart], second[apart]
    slopes = (y[second] - y[first]) / (x[second] - x[first])
    squares = (y - y[first, None] - slopes[:, None] * (x - x[first, None])) ** 2
    best = squares[np.argmin(np.sort(squares, axis=1)[:, :count].sum(axis=1))]
    mask = np.zeros(len(x), bool)
    mask[np.argsort(best, kind="stable")[:count]] = True
    return mask
