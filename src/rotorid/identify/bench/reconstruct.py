"""From the six cells' forces to the force on the vehicle (thesis 2.4, tables 2.2 and 2.3, eqs 2.3 to 2.9).

The bench is a cantilever: a force along one axis at a time follows from a sum of moments (x, y) or of the cells'
forces (z). With loads along several axes at once the six readings do not determine six unknowns (thesis 2.4),
and the equations are then no more than an attempt. Axes are the vehicle's, z down; forces in newtons.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.identify.bench.loadcell import LineFit

GF_N = 9.80665e-3
"""Newtons in a gram-force."""
_C30, _C45, _C60 = np.cos(np.radians([30.0, 45.0, 60.0]))

_DISTANCES = ("D_1x D_2x D_4x D_5x D_6x D_1y D_2y D_3y D_4y D_5y D_6y D_135z D_246z L").split()
PULLED = (0, 2, 4)
"""Cells 1, 3, 5: their absolute value enters eq. 2.8."""
CELLS = tuple(f"cell_{i}_v" for i in range(1, 7))
FORCES = ("force_x_n", "force_y_n", "force_z_n")
DIRECTION = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, -1.0)}
"""Unit vector of a load, body axes: along z it pulls upwards, as thrust does."""


@dataclass(frozen=True)
class Geometry:
    """Table 2.3: distances from {T} to where each cell takes its force, m."""

    distance_m: dict[str, float]

    def __getitem__(self, name: str) -> float:
        return self.distance_m[name]

    @cached_property
    def matrix(self) -> np.ndarray:
        """M of eq. 2.9, shape (3, 6): cells' forces to the force on the vehicle, but for the |F| of cells 1, 3, 5."""
        d = self.distance_m
        length = d["L"]
        return np.array(
            [
                [
                    -d["D_135z"] / (_C60 * length),
                    (d["D_246z"] / _C30 - d["D_2x"]) / (_C45 * length),
                    d["D_135z"] / length,
                    d["D_4x"] / (_C45 * length),
                    -d["D_135z"] / (_C60 * length),
                    -(d["D_246z"] / _C30 - d["D_6x"]) / (_C45 * length),
                ],
                [
                    d["D_135z"] / (_C30 * length),
                    (d["D_246z"] / _C60 + d["D_2y"]) / (_C45 * length),
                    0.0,
                    (d["D_4y"] - d["D_246z"]) / (_C45 * length),
                    -d["D_135z"] / (_C30 * length),
                    (d["D_246z"] / _C60 - d["D_6y"]) / (_C45 * length),
                ],
                [0.0, -1 / _C45, 0.0, -1 / _C45, 0.0, -1 / _C45],
            ]
        )


def read_geometry(path: str | Path) -> Geometry:
    """Table 2.3 from a CSV with the columns `distance` and `value_mm`. Raises InputError where one is missing."""
    table = pd.read_csv(path)
    if not {"distance", "value_mm"} <= set(table.columns):
        raise InputError(f"{path}: expected the columns distance and value_mm")
    values = dict(zip(table["distance"], table["value_mm"] / 1000, strict=True))
    missing = [name for name in _DISTANCES if name not in values]
    if missing:
        raise InputError(f"{path}: the distance {missing[0]} is missing")
    return Geometry({name: float(values[name]) for name in _DISTANCES})


def input_components(cells_n: np.ndarray) -> dict[str, np.ndarray]:
    """Table 2.2: input forces f_nx, f_ny, f_nz of the cells' perpendicular forces, shape (n,) each, N.

    What the table gives as "N/A" is left out: that cell does not feel that axis.
    """
    f = {i + 1: np.asarray(cells_n, float)[..., i] for i in range(6)}
    return {
        "f_1x": f[1] / _C60,
        "f_2x": f[2] / (_C30 * _C45),
        "f_3x": f[3],
        "f_5x": f[5] / _C60,
        "f_6x": f[6] / (_C30 * _C45),
        "f_1y": f[1] / _C30,
        "f_2y": f[2] / (_C60 * _C45),
        "f_4y": f[4] / _C45,
        "f_5y": f[5] / _C30,
        "f_6y": f[6] / (_C60 * _C45),
        "f_2z": f[2] / _C45,
        "f_4z": f[4] / _C45,
        "f_6z": f[6] / _C45,
    }


def moments(cells_n: np.ndarray, geometry: Geometry) -> np.ndarray:
    """Eqs 2.3 to 2.5: sums of moments about the axes of {T}, N m, shape (n, 3), of cells' forces (n, 6), N."""
    f, d = input_components(cells_n), geometry.distance_m
    about_x = (
        (f["f_1y"] - f["f_5y"]) * d["D_135z"]
        + (f["f_2y"] - f["f_4y"] + f["f_6y"]) * d["D_246z"]
        + f["f_2z"] * d["D_2y"]
        + f["f_4z"] * d["D_4y"]
        - f["f_6z"] * d["D_6y"]
    )
    about_y = (
        (f["f_1x"] - f["f_3x"] + f["f_5x"]) * d["D_135z"]
        + (f["f_6x"] - f["f_2x"]) * d["D_246z"]
        + f["f_2z"] * d["D_2x"]
        - f["f_4z"] * d["D_4x"]
        - f["f_6z"] * d["D_6x"]
    )
    about_z = (
        f["f_1x"] * d["D_1y"]
        - f["f_2x"] * d["D_2y"]
        + f["f_3x"] * d["D_3y"]
        - f["f_5x"] * d["D_5y"]
        - f["f_6x"] * d["D_6y"]
        - f["f_1y"] * d["D_1x"]
        - f["f_2y"] * d["D_2x"]
        - f["f_4y"] * d["D_4x"]
        + f["f_5y"] * d["D_5x"]
        + f["f_6y"] * d["D_6x"]
    )
    return np.stack([about_x, about_y, about_z], axis=-1)


def forces(cells_n: np.ndarray, geometry: Geometry) -> np.ndarray:
    """Eqs 2.6 to 2.8: force on the vehicle, N, shape (n, 3), of cells' forces (n, 6), N."""
    cells_n = np.asarray(cells_n, float)
    sums, f = moments(cells_n, geometry), input_components(cells_n)
    pulled = np.abs(cells_n[..., PULLED]).sum(axis=-1)
    along_z = -(pulled + f["f_2z"] + f["f_4z"] + f["f_6z"])
    return np.stack([-sums[..., 1] / geometry["L"], sums[..., 0] / geometry["L"], along_z], axis=-1)


def cell_forces(volts: np.ndarray, coefficients_gf: np.ndarray) -> np.ndarray:
    """Cells' forces, N, shape (n, 6), of tared voltages (n, 6), V, by eq. 2.10.

    `coefficients_gf` has shape (6, 2): a0 in gf and a1 in gf per 1e-5 V.
    """
    coefficients = np.asarray(coefficients_gf, float)
    return (coefficients[:, 0] + coefficients[:, 1] * np.asarray(volts, float) * 1e5) * GF_N


def cell_variance(volts: np.ndarray, lines: list[LineFit], reading_variance_v2: np.ndarray) -> np.ndarray:
    """Variance of the cells' forces, N², shape (n, 6): the lines' covariances and the readings' noise.

    Parameters
    ----------
    volts
        Tared voltages, V, shape (n, 6).
    lines
        Calibration of each cell, gf against 1e-5 V.
    reading_variance_v2
        Variance of each voltage, V², shape (n, 6) or (6,).
    """
    x = np.atleast_2d(np.asarray(volts, float)) * 1e5
    noise = np.broadcast_to(np.asarray(reading_variance_v2, float), x.shape) * 1e10
    out = np.empty_like(x)
    for i, line in enumerate(lines):
        (v00, v01), (_, v11) = line.covariance
        out[:, i] = v00 + 2 * x[:, i] * v01 + x[:, i] ** 2 * v11 + line.a1**2 * noise[:, i]
    return out * GF_N**2


def force_covariance(cells_n: np.ndarray, variance_n2: np.ndarray, geometry: Geometry) -> np.ndarray:
    """Covariance of the reconstructed force, N², shape (n, 3, 3), to first order (cells are independent)."""
    cells_n = np.atleast_2d(np.asarray(cells_n, float))
    slope = np.repeat(geometry.matrix[None], len(cells_n), axis=0)
    slope[:, 2, PULLED] -= np.sign(cells_n[:, PULLED])
    return np.einsum("nij,nj,nkj->nik", slope, np.atleast_2d(variance_n2), slope)
