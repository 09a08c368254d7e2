"""Calibration of the load cells: a straight line from voltage to force, intervals, and readings that do not fit it.

Source: thesis section 2.7.2, eqs 2.10 to 2.13; intervals by Student's t, as for any least-squares line.

Readings that do not match their loads are named, with what the lines are without them. Nothing is left out by this: the
lines in use go through every reading, and whoever reads the result decides. A wrong point bends the line and widens the
scatter by which it is judged, and several wrong ones hide each other. So the line begins with the points that agree
best (least trimmed squares) and takes the others in, the nearest first. Once the nearest is beyond the limit of the
studentised residuals, it and those further off are outliers (Hadi and Simonoff 1993). The limit is that of Student's t,
Bonferroni's over all points and over the numbers of outliers that are tried.

Tensile tests of printed PLA (thesis 2.6.4, table 2.5, fig. 2.29): modulus, strength and 0.2 % yield.

- Stress is force over the section, strain displacement over the distance between grips.
- Modulus: slope of the straight part. It begins where the specimen is taut and is extended for as long as the
  line's largest residual stays within the noise; the foot, where the slack is removed, is left out.
- Strain is then counted from where that line meets zero stress (toe compensation).
- Yield: where the curve meets the line of the modulus moved by 0.2 % of strain. Strength: the largest stress.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.special import stdtrit as student_quantile

from rotorid.errors import InputError
from rotorid_acquire.io.logs import by_recording

FLAG_LEVEL = 0.01
"""Of good calibrations at most this share has a flag, or several, among all its points."""
_FEWEST_KEPT = 4
_ROUNDING = 1e-9
"""Scatter below this share of the range of y is that of the numbers' last digits."""
_OFFSET_STRAIN = 0.002
_FOOT_SHARE = 0.04
"""The straight part is looked for from this share of the strength on: below it the slack is still being removed."""
_FIRST_SHARE = 0.12
"""… and reaches at least up to this share."""
_NOISE_FACTOR = 4.0
"""Residuals beyond so many standard deviations of the noise end the straight part."""


@dataclass(frozen=True)
class LineFit:
    """A least-squares line y = a0 + a1 x and how well it is known."""

    a0: float
    """Intercept, unit of y (gf)."""
    a1: float
    """Slope, unit of y per unit of x (gf per 1e-5 V)."""
    r: float
    """Correlation coefficient, eq. 2.13."""
    residual_sd: float
    """Standard deviation of the residuals with n - 2 degrees of freedom, unit of y."""
    residual_rms: float
    """Root of the mean squared residual, unit of y."""
    covariance: tuple[tuple[float, float], tuple[float, float]]
    """Covariance of (a0, a1)."""
    degrees_of_freedom: int
    residuals: tuple[float, ...]

    def interval(self, which: int, level: float = 0.95) -> tuple[float, float]:
        """Confidence interval of a0 (`which` 0) or a1 (`which` 1)."""
        half = student_quantile(self.degrees_of_freedom, 0.5 + level / 2) * np.sqrt(self.covariance[which][which])
        centre = (self.a0, self.a1)[which]
        return float(centre - half), float(centre + half)


def mean_interval(values: np.ndarray | pd.Series) -> tuple[float, tuple[float, float]]:
    """Mean of two values or more and its 95 % interval by Student's t."""
    mean = values.mean()
    half = student_quantile(len(values) - 1, 0.975) * values.std(ddof=1) / np.sqrt(len(values))
    return float(mean), (float(mean - half), float(mean + half))


def fit_line(x: Sequence[float], y: Sequence[float]) -> LineFit:
    """Least-squares line through (x, y), eqs 2.10 to 2.13.

    `x`, `y`: readings and known values, shape (n,), n at least 3. InputError: fewer than three points, unequal lengths,
    or all readings equal.
    """
    x, y = np.asarray(x, float), np.asarray(y, float)
    n = len(x)
    if n < 3 or len(y) != n:
        raise InputError(f"a line with intervals needs at least 3 pairs, found {n} readings and {len(y)} values")
    if np.ptp(x) == 0:
        raise InputError("all readings are equal, so no slope can be found")
    sxx = n * np.sum(x**2) - np.sum(x) ** 2
    syy = n * np.sum(y**2) - np.sum(y) ** 2
    sxy = n * np.sum(x * y) - np.sum(x) * np.sum(y)
    a1 = sxy / sxx
    a0 = y.mean() - a1 * x.mean()
    residuals = y - (a0 + a1 * x)
    variance = np.sum(residuals**2) / (n - 2)
    spread = sxx / n  # sum of squared deviations of x
    slope_var = variance / spread
    cross = -x.mean() * slope_var
    intercept_var = variance * (1 / n + x.mean() ** 2 / spread)
    return LineFit(
        a0=float(a0),
        a1=float(a1),
        r=float(sxy / np.sqrt(sxx * syy)) if syy > 0 else float("nan"),
        residual_sd=float(np.sqrt(variance)),
        residual_rms=float(np.sqrt(np.mean(residuals**2))),
        covariance=((float(intercept_var), float(cross)), (float(cross), float(slope_var))),
        degrees_of_freedom=n - 2,
        residuals=tuple(float(v) for v in residuals),
    )


def read_calibration_table(path: str | Path) -> tuple[np.ndarray, dict[int, np.ndarray]]:
    """Weights (gf) and readings of each cell (1e-5 V) from a table laid out as the thesis's table 2.7."""
    table = pd.read_csv(path)
    cells = [name for name in table.columns if name.startswith("cell_")]
    if "weight_gf" not in table or not cells:
        raise InputError(f"{path}: expected the columns weight_gf and cell_1_1e-5_v, cell_2_1e-5_v, ...")
    readings = {int(name.split("_")[1]): table[name].to_numpy(float) for name in cells}
    return table["weight_gf"].to_numpy(float), readings


def as_readings(weights_gf: np.ndarray, readings: dict[int, np.ndarray]) -> pd.DataFrame:
    """The table that `read_calibration_table` reads, one row a reading: `id` (its line), `cell`, `weight_gf` and
    `reading_10uv` (1e-5 V)."""
    names = [f"line {number}" for number in range(2, len(weights_gf) + 2)]
    parts = [
        pd.DataFrame({"id": names, "cell": cell, "weight_gf": weights_gf, "reading_10uv": reading})
        for cell, reading in readings.items()
    ]
    return pd.concat(parts, ignore_index=True)


def check_weights(weights_path: str | Path, table_path: str | Path) -> float:
    """Largest difference (gf) between a combination's printed weight and the sum of its elements."""
    weights = pd.read_csv(weights_path).set_index("element")["average_gf"]
    worst = 0.0
    for row in pd.read_csv(table_path).itertuples(index=False):
        total = sum(weights[element] for element in row.elements.split(" + "))
        worst = max(worst, abs(total - row.weight_gf))
    return float(worst)


def balance_disagreement(weights_path: str | Path) -> float:
    """Median share by which the first balance reads above the second, over elements weighed on both."""
    table = pd.read_csv(weights_path).dropna()
    return float(((table["ohaus_gf"] - table["mettler_gf"]) / table["average_gf"]).median())


def shared_weight_error(
    weights_gf: np.ndarray, readings: dict[int, np.ndarray], contains: np.ndarray
) -> tuple[float, tuple[float, float], tuple[float, ...]]:
    """Error of one weight, true minus printed [gf], from the residuals that it would leave in every cell alike.

    Mean over the cells, its 95 % interval (Student's t over the cells, which are independent instruments), and by cell.
    Each cell's line is fitted with one unknown more, d: weight + d * contains = a0 + a1 * reading.

    `weights_gf`: known weights [gf], shape (n,), n at least 4. `readings`: readings of each of at least two cells, any
    unit, shape (n,) each. `contains`: 1 where the weight in question is part of the load, otherwise 0, shape (n,).
    """
    if len(readings) < 2 or len(weights_gf) < 4:
        raise InputError("an error shared by cells needs at least 2 cells and 4 loads")
    found = []
    for reading in readings.values():
        columns = np.column_stack([np.ones(len(reading)), reading, -contains])
        solution, _, rank, _ = np.linalg.lstsq(columns, weights_gf, rcond=None)
        if rank < 3:
            raise InputError("the weight in question must be part of some loads and not of others")
        found.append(float(solution[2]))
    return *mean_interval(np.array(found)), tuple(found)


def flag_readings(readings: pd.DataFrame) -> pd.DataFrame:
    """The readings with what their cell's other readings say of them, in three more columns.

    `readings`: one row a reading of any number of cells: `id`, `cell`, `weight_gf`, `reading_10uv` (1e-5 V). Returns
    the same rows with `reading_says_gf` (load by the line through the unflagged readings), `studentised` (residual over
    its standard uncertainty; NaN where a cell has too few readings to test) and `flag` (what is wrong, empty where
    nothing is).
    """
    parts = []
    for _, part in readings.groupby("cell", sort=False):
        found = find_outliers(part["reading_10uv"], part["weight_gf"], len(readings))
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


def flags_as_dict(part: pd.DataFrame) -> dict:
    """One cell's flagged readings and, where there are any, its line without them, for a JSON file.

    `part` has the cell's rows of the table that `flag_readings` gives.
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


def flag_warnings(cells: Sequence[Mapping], flagged: pd.DataFrame) -> list[str]:
    """Sentences on each flagged reading, on each line that has some, and on each cell that could not be tested.

    `cells` have `cell`, `a1_gf_per_10uv`, `r` and what `flags_as_dict` gives; `flagged` is of `flag_readings`.
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


_FLAG_COLUMNS = "cell id weight_gf reading_says_gf studentised flag a1_with a1_without r_with r_without".split()


def flags_as_table(cells: Sequence[Mapping]) -> pd.DataFrame:
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
    return pd.DataFrame(rows, columns=_FLAG_COLUMNS)


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


def find_outliers(x: Sequence[float], y: Sequence[float], tests: int) -> _Outliers:
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
        if distance[nearest] > _limit(kept.sum() - 2, tests * most):
            break
        kept[nearest] = True
    studentised = _studentised(x, y, kept, floor)
    for i in np.flatnonzero(kept):
        others = kept.copy()
        others[i] = False
        if np.ptp(x[others]) > 0:
            studentised[i] = _studentised(x, y, others, floor)[i]
    line = whole if kept.all() else fit_line(x[kept], y[kept])
    return _Outliers(~kept, studentised, _limit(kept.sum() - 2, tests * most), line, True)


def _limit(freedom: int, tests: int) -> float:
    """Student's t that none of `tests` residuals exceeds but in a share FLAG_LEVEL of cases."""
    return float(-student_quantile(freedom, FLAG_LEVEL / (2 * tests)))


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


def evaluate(
    displacement_mm: np.ndarray, force_n: np.ndarray, gauge_mm: float, section_mm2: float
) -> tuple[dict, pd.DataFrame]:
    """Figures of one specimen, with their units, and its curve (`strain`, compensated for the slack, and `stress_pa`).

    `displacement_mm`, `force_n`: samples, shape (n,), from before the specimen is taut to after it broke. `gauge_mm`,
    `section_mm2`: distance between grips and cross-section. InputError: no straight part of at least five samples, or a
    curve that never meets the 0.2 % line.
    """
    displacement, force = np.asarray(displacement_mm, float), np.asarray(force_n, float)
    stress, strain = force / section_mm2 * 1e6, displacement / gauge_mm
    peak = int(np.argmax(stress))
    strength = float(stress[peak])
    first = int(np.argmax(stress > _FOOT_SHARE * strength))
    last = int(np.argmax(stress > _FIRST_SHARE * strength))
    noise = _noise(stress[: peak + 1])
    last = max(last, first + 4)
    if last >= peak:
        raise InputError("no straight part of at least five samples before the largest force")
    while last < peak:
        longer = fit_line(strain[first : last + 2], stress[first : last + 2])
        if np.max(np.abs(longer.residuals)) > _NOISE_FACTOR * noise:
            break
        last += 1
    line = fit_line(strain[first : last + 1], stress[first : last + 1])
    zero = -line.a0 / line.a1
    strain = strain - zero
    broken = int(peak + np.argmax(np.append(stress[peak:], 0.0) < 0.5 * strength))
    yield_strain, yield_pa = _offset_yield(strain[: peak + 1], stress[: peak + 1], line.a1)
    low, high = line.interval(1)
    figures = {
        "modulus_gpa": line.a1 / 1e9,
        "modulus_low_95_gpa": low / 1e9,
        "modulus_high_95_gpa": high / 1e9,
        "strength_mpa": strength / 1e6,
        "yield_mpa": yield_pa / 1e6,
        "yield_strain": yield_strain,
        "proportional_mpa": float(stress[last]) / 1e6,  # where the straight part ends
        "break_strain": float(strain[broken - 1]),
        "slack_mm": float(zero * gauge_mm),
        "straight_samples": last - first + 1,
    }
    return figures, pd.DataFrame({"strain": strain[:broken], "stress_pa": stress[:broken]})


def _noise(stress: np.ndarray) -> float:
    """Standard deviation of the readings from their third differences, which a smooth curve does not show."""
    third = np.diff(stress, 3)
    return float(1.4826 * np.median(np.abs(third)) / np.sqrt(20))


def _offset_yield(strain: np.ndarray, stress: np.ndarray, modulus: float) -> tuple[float, float]:
    """Strain and stress where the curve falls below the line moved by 0.2 % of strain."""
    above = stress - modulus * (strain - _OFFSET_STRAIN)
    loaded = np.flatnonzero(strain > _OFFSET_STRAIN)
    below = loaded[above[loaded] <= 0]
    if len(below) == 0:
        raise InputError("the curve never meets the line of 0.2 % plastic strain: the specimen broke before it yielded")
    i = below[0]
    share = above[i - 1] / (above[i - 1] - above[i])
    return (
        float(strain[i - 1] + share * (strain[i] - strain[i - 1])),
        float(stress[i - 1] + share * (stress[i] - stress[i - 1])),
    )


def specimens(samples: pd.DataFrame, sessions: pd.DataFrame) -> tuple[pd.DataFrame, pd.DataFrame]:
    """One row a specimen with its figures, and all curves (`infill_percent specimen strain stress_pa`)."""
    parts = by_recording(samples)
    rows, curves = [], []
    for session in sessions.itertuples():
        table = parts[session.id]
        table = table[table["quality"] == 0]
        try:
            found, curve = evaluate(
                table["displacement_mm"].to_numpy(),
                table["force_n"].to_numpy(),
                session.gauge_length_mm,
                session.cross_section_mm2,
            )
        except InputError as error:
            raise InputError(f"{session.id}: {error}") from None
        infill = int(session.infill_percent)
        rows.append({"infill_percent": infill, "specimen": session.specimen} | found)
        curves.append(curve.assign(infill_percent=infill, specimen=session.specimen))
    return pd.DataFrame(rows), pd.concat(curves, ignore_index=True)


def by_infill(table: pd.DataFrame, printed: pd.DataFrame) -> pd.DataFrame:
    """Mean of each infill's specimens with its 95 % interval, next to the thesis's table 2.5.

    `printed` has the columns `infill_percent modulus_gpa strength_mpa yield_mpa`.
    """
    known = printed.set_index("infill_percent")
    rows = []
    for infill, part in table.groupby("infill_percent"):
        row = {"infill_percent": infill, "specimens": len(part)}
        for name in ("modulus_gpa", "strength_mpa", "yield_mpa"):
            mean, (low, high) = mean_interval(part[name])
            row |= {name: mean, f"{name}_low_95": low, f"{name}_high_95": high}
            row[f"{name}_thesis"] = known.loc[infill, name] if infill in known.index else np.nan
        rows.append(row)
    return pd.DataFrame(rows)
