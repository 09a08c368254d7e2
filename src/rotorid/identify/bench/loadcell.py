"""Calibration of the load cells: a straight line from voltage to force, with intervals.

Source: thesis section 2.7.2, eqs 2.10 to 2.13; intervals by Student's t, as for any least-squares line.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.special import stdtrit as student_quantile

from rotorid.errors import InputError


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


def fit_line(x: Sequence[float], y: Sequence[float]) -> LineFit:
    """Least-squares line through (x, y), eqs 2.10 to 2.13.

    Parameters
    ----------
    x, y
        Readings and known values, shape (n,), n at least 3.

    Raises
    ------
    InputError
        Fewer than three points, unequal lengths, or all readings equal.
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


@dataclass(frozen=True)
class _SharedWeightError:
    """What all cells agree on about the error of one weight."""

    mean_gf: float
    """True weight minus printed weight [gf], mean over the cells."""
    interval_95_gf: tuple[float, float]
    """Student's t over the cells, which are independent instruments."""
    by_cell_gf: tuple[float, ...]


def shared_weight_error(
    weights_gf: np.ndarray, readings: dict[int, np.ndarray], contains: np.ndarray
) -> _SharedWeightError:
    """Error of one weight, from the residuals that it would leave in every cell alike.

    Each cell's line is fitted with one unknown more, d: weight + d * contains = a0 + a1 * reading.

    Parameters
    ----------
    weights_gf
        Known weights [gf], shape (n,), n at least 4.
    readings
        Readings of each of at least two cells, any unit, shape (n,) each.
    contains
        1 where the weight in question is part of the load, otherwise 0, shape (n,).
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
    mean = float(np.mean(found))
    half = student_quantile(len(found) - 1, 0.975) * np.std(found, ddof=1) / np.sqrt(len(found))
    return _SharedWeightError(mean, (mean - float(half), mean + float(half)), tuple(found))
