"""Mass, centre of mass and inertia of a vehicle from a table of its components, in place of CAD (thesis eq.
4.27).

Each component is a point, a box or a cylinder (axis along z) of even density; its inertia is moved to the
centre of mass by the theorem of parallel axes. A component with count 4 stands at the four corners (±x, ±y).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.errors import InputError

COLUMNS = ("component count mass_kg shape size_x_m size_y_m size_z_m x_m y_m z_m").split()
_SHAPES = ("point", "box", "cylinder")


def read_components(path: str | Path) -> pd.DataFrame:
    """The component table; InputError names the line and what was expected."""
    table = pd.read_csv(path)
    missing = [c for c in COLUMNS if c not in table.columns]
    if missing:
        raise InputError(f"{path}: column {missing[0]} is missing, expected {', '.join(COLUMNS)}")
    for number, row in enumerate(table.itertuples(), 2):
        if row.shape not in _SHAPES:
            raise InputError(f"{path}, line {number}: shape {row.shape!r}, expected {', '.join(_SHAPES)}")
        if row.count not in (1, 4):
            raise InputError(f"{path}, line {number}: count {row.count}, expected 1 or 4 (the four corners)")
        sizes = (row.mass_kg, row.size_x_m, row.size_y_m, row.size_z_m)
        if not row.mass_kg > 0 or not min(sizes) >= 0:
            raise InputError(f"{path}, line {number}: mass must be positive and sizes 0 or more, got {sizes}")
    return table


def own_inertia(shape: str, mass_kg: float, size_m: np.ndarray) -> np.ndarray:
    """Inertia (3, 3), kg m2, of a component about its own centre; `size_m` (3,), a cylinder's x size its diameter."""
    x, y, z = size_m
    if shape == "point":
        return np.zeros((3, 3))
    if shape == "cylinder":
        across = mass_kg * (3 * (x / 2) ** 2 + z**2) / 12
        return np.diag([across, across, mass_kg * (x / 2) ** 2 / 2])
    return mass_kg / 12 * np.diag([y**2 + z**2, x**2 + z**2, x**2 + y**2])


def compose(table: pd.DataFrame) -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, kg, of all components together, their centre of mass (3,), m, in the table's axes, and the inertia (3, 3),
    kg m2, about it."""
    masses, places, inertias = [], [], []
    for row in table.itertuples():
        size = np.array([row.size_x_m, row.size_y_m, row.size_z_m])
        # A box at a corner points along its diagonal; the four together are symmetric all the same.
        own = own_inertia(row.shape, row.mass_kg, size)
        corners = [(1, 1)] if row.count == 1 else [(1, 1), (1, -1), (-1, -1), (-1, 1)]
        for sx, sy in corners:
            masses.append(row.mass_kg)
            places.append([sx * row.x_m, sy * row.y_m, row.z_m])
            turn = _about_z(np.arctan2(sy * row.y_m, sx * row.x_m)) if row.count == 4 else np.eye(3)
            inertias.append(turn @ own @ turn.T)
    masses, places = np.array(masses), np.array(places)
    centre = masses @ places / masses.sum()
    total = np.zeros((3, 3))
    for mass, arm, own in zip(masses, places - centre, inertias, strict=True):
        total += own + mass * ((arm @ arm) * np.eye(3) - np.outer(arm, arm))
    return float(masses.sum()), centre, total


def _about_z(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
