"""Names the readings of a calibration that do not match their loads, and says what the lines are without them.

Nothing is left out by this: the lines in use go through every reading, and whoever reads the result decides.

Points that a straight line does not explain, at a stated level, by their studentised residuals.

A wrong point bends the line and widens the scatter by which it is judged, and several wrong ones hide each other. So
the line begins with the points that agree best (least trimmed squares) and takes the others in, the nearest first. Once
the nearest is beyond the limit, it and those further off are outliers (Hadi and Simonoff 1993). The limit is that of
Student's t, Bonferroni's over all points and over the numbers of outliers that are tried.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
import pandas as pd
from scipy.special import stdtrit as student_quantile

from rotorid.identify.bench.loadcell import LineFit, fit_line

LEVEL = 0.01
"""Of good calibrations at most this share has a flag, or several, among all its points."""
_FEWEST_KEPT = 4
_ROUNDING = 1e-9
"""Scatter below this share of the range of y is that of the numbers' last digits."""


def flag(readings: pd.DataFrame) -> pd.DataFrame:
    """The readings with what their cell's other readings say of them, in three more columns.

    Parameters
    ----------
    readings
        One row a reading of any number of cells: `id`, `cell`, `weight_gf`, `reading_10uv` (1e-5 V).

    Returns
    -------
    pd.DataFrame
        The same rows with `reading_says_gf` (load by the line through the unflagged readings), `studentised` (residual
        over its standard uncertainty; NaN where a cell has too few readings to test) and `flag` (what is wrong, empty
        where nothing is).
    """
    parts = []
    for _, part in readings.groupby("cell", sort=False):
        found = find(part["reading_10uv"], part["weight_gf"], len(readings))
        says = found.line.a0 + found.line.a1 * part["reading_10uv"].to_numpy()
        loads = part["weight_gf"].to_numpy(float)
        parts.append(
            part.assign(
                reading_says_gf=says,
                studentised=found.studentised,
                flag=[_reason(i, loads, says, found) if found.flagged[i] else "" for i in range(len(part))],
            )
        )
    return pd.concat(parts).loc[readings.index]


def _reason(i: int, loads: np.ndarray, says: np.ndarray, found: _Outliers) -> str:
    """Which load was on instead, where one that is known explains the reading within the limit of the test."""
    within = abs((loads[i] - says[i]) / found.studentised[i]) * found.limit
    if abs(says[i] - found.line.a0) <= within:
        return "no load was on"
    nearest = loads[np.argmin(np.abs(loads - says[i]))]
    if abs(nearest - says[i]) <= within:
        return f"the load on it was the one of {nearest:g} gf"
    return "load and reading do not match"


def as_dict(part: pd.DataFrame) -> dict:
    """One cell's flagged readings and, where there are any, its line without them, for a JSON file.

    `part` has the cell's rows of the table that `flag` gives.
    """
    flagged = part[part["flag"] != ""]
    if flagged.empty:
        return {"flagged": [], "without_flagged": None}
    kept = part[part["flag"] == ""]
    line = fit_line(kept["reading_10uv"], kept["weight_gf"])
    columns = ["id", "weight_gf", "reading_says_gf", "studentised", "flag"]
    return {
        "flagged": flagged[columns].to_dict("records"),
        "without_flagged": {
            "a0_gf": line.a0,
            "a1_gf_per_10uv": line.a1,
            "a1_interval_95": line.interval(1),
            "r": line.r,
        },
    }


def warnings(cells: Sequence[Mapping], flagged: pd.DataFrame) -> list[str]:
    """Sentences on each flagged reading, on each line that has some, and on each cell that could not be tested.

    `cells` have `cell`, `a1_gf_per_10uv`, `r` and what `as_dict` gives; `flagged` is the table that `flag` gives.
    """
    sentences = []
    for cell in cells:
        name = f"cell {cell['cell']}"
        for reading in cell["flagged"]:
            sentences.append(
                f"{name}, {reading['id']}: {reading['weight_gf']:g} gf as noted, {reading['reading_says_gf']:.2f} gf "
                f"by its reading: {reading['flag']} (studentised residual {reading['studentised']:.0f})"
            )
        if without := cell["without_flagged"]:
            sentences.append(
                f"{name}: slope {cell['a1_gf_per_10uv']:.4f} gf per 1e-5 V and r {cell['r']:.6f} with the "
                f"flagged readings, {without['a1_gf_per_10uv']:.4f} and {without['r']:.6f} without; "
                "the line in use has them all"
            )
        part = flagged[flagged["cell"] == cell["cell"]]
        if part["studentised"].isna().all():
            sentences.append(f"{name}: {len(part)} readings are too few or too alike to find a wrong one by")
    return sentences


COLUMNS = "cell id weight_gf reading_says_gf studentised flag a1_with a1_without r_with r_without".split()


def as_table(cells: Sequence[Mapping]) -> pd.DataFrame:
    """The flagged readings of all cells, one row each, with slope and r of their cell with and without them."""
    rows = [
        {
            "cell": cell["cell"],
            **reading,
            "a1_with": cell["a1_gf_per_10uv"],
            "a1_without": cell["without_flagged"]["a1_gf_per_10uv"],
            "r_with": cell["r"],
            "r_without": cell["without_flagged"]["r"],
        }
        for cell in cells
        for reading in cell["flagged"]
    ]
    return pd.DataFrame(rows, columns=COLUMNS)


@dataclass(frozen=True)
class _Outliers:
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


def find(x: Sequence[float], y: Sequence[float], tests: int, level: float = LEVEL) -> _Outliers:
    """Points of y over x, shape (n,) each, that lie off their line; at most a third of them.

    `tests` is the number of points among which none should be flagged by chance, those of other lines included.
    Raises InputError as `fit_line` does.
    """
    x, y = np.asarray(x, float), np.asarray(y, float)
    n, floor = len(x), _ROUNDING * np.ptp(y)
    whole = fit_line(x, y)
    most = min(n // 3, n - _FEWEST_KEPT)
    kept = _agreeing(x, y, n - most) if most > 0 else np.ones(n, bool)
    tested = bool(most > 0 and np.ptp(x[kept]) > 0)
    if not tested:
        return _Outliers(np.zeros(n, bool), np.full(n, np.nan), np.nan, whole, False)
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
    return _Outliers(~kept, studentised, _limit(kept.sum() - 2, tests * most, level), line, True)


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
