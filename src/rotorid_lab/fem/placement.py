"""Where the cells sit and which way they give way (thesis tables 2.2, 2.3), and what the bench is made of, with ranges.

Frame {T}: x and y of the vehicle, z down, origin on top of plate D. The tube begins there and ends L above, at {B}.
The signs of eqs 2.3 to 2.5 and 2.8 fix the rest: the cells sit on two rings of three, 120° apart, and cells 2, 4 and 6
lie below cells 1, 3 and 5. One leg of the bench is a cell of each ring; the others are that leg turned by ±120°.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.io.text.files import read_yaml

THIRD = 2 * np.pi / 3
LEGS = ((1, 2), (5, 6), (3, 4))
"""Upper and lower cell of each leg; each leg is the one before it turned by 120° about z, from x to y."""
_AZIMUTH = {"upper": np.radians(-60.0), "lower": np.radians(30.0)}
"""Direction outwards across the bar of the first leg's cells, from x to y, by the factors of table 2.2."""
_SLOPE = {"upper": 0.0, "lower": np.radians(45.0)}
"""Angle between the direction in which a cell gives way and the table."""
_UNITS = {"_m2": ("_mm2", 1e-6), "_m": ("_mm", 1e-3), "_pa": ("_gpa", 1e9)}
"""Unit of a size, by the end of its name, in the file and as a share of the SI unit."""
MATERIALS = ("Al-6061", "PLA")


@dataclass(frozen=True)
class PartFrame:
    """A part's own frame in the bench's: own coordinates are (point - origin) @ axes.T."""

    origin_m: np.ndarray
    axes: np.ndarray


@dataclass(frozen=True)
class Place:
    """A cell of the first leg."""

    force_m: np.ndarray
    """Where its force is applied: the middle of the end towards the vehicle [m], shape (3,)."""
    axis: np.ndarray
    """Along the bar, from that end to the other, shape (3,)."""
    sense: np.ndarray
    """Direction of a positive force on it (positive F in eqs 2.3 to 2.8), shape (3,)."""
    inwards: np.ndarray
    """The one of its two bolted faces' normals that points at the axis of the bench, shape (3,)."""


def turn(angle: float) -> np.ndarray:
    """Matrix that turns vectors about z, from x to y, shape (3, 3)."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def cells(distances_m: Mapping[str, float]) -> dict[int, Place]:
    """Every cell, by its number."""
    first = {"upper": _upper(distances_m), "lower": _lower(distances_m)}
    placed = {}
    for leg, numbers in enumerate(LEGS):
        matrix = turn(leg * THIRD)
        for number, place in zip(numbers, first.values(), strict=True):
            placed[number] = Place(*(matrix @ vector for vector in vars(place).values()))
    return placed


def _upper(distances_m: Mapping[str, float]) -> Place:
    outwards = np.array([np.cos(_AZIMUTH["upper"]), np.sin(_AZIMUTH["upper"]), 0.0])
    place = np.array([distances_m["D_1x"], -distances_m["D_1y"], distances_m["D_135z"]])
    return Place(place, _along(_AZIMUTH["upper"]), outwards, -outwards)


def _lower(distances_m: Mapping[str, float]) -> Place:
    slope = _SLOPE["lower"]
    outwards = np.array([np.cos(_AZIMUTH["lower"]), np.sin(_AZIMUTH["lower"]), 0.0])
    up = np.array([0.0, 0.0, -1.0])
    sense = -np.cos(slope) * outwards + np.sin(slope) * up
    place = np.array([distances_m["D_2x"], -distances_m["D_2y"], distances_m["D_246z"]])
    return Place(place, _along(_AZIMUTH["lower"]), sense, sense)


def _along(azimuth: float) -> np.ndarray:
    """Horizontal direction across `azimuth`, towards larger angles."""
    return np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])


@dataclass(frozen=True)
class Sizes:
    """Sizes that the thesis does not print; workflow/bench_sizes.yaml says what each is of."""

    cell_length_m: float
    cell_side_m: float
    cell_between_pads_m: float
    cell_between_holes_m: float
    cell_ligament_m: float
    cell_slot_m: float
    cell_pad_m: float
    foot_depth_m: float
    foot_out_m: float
    foot_side_m: float
    bracket_side_m: float
    post_in_m: float
    post_side_m: float
    plate_radius_m: float
    plate_thickness_m: float
    boss_height_m: float
    gauge_length_m: float
    gauge_factor: float
    excitation_v: float
    poisson_aluminium: float
    poisson_pla: float
    cell_modulus_pa: float

    @property
    def hole_radius_m(self) -> float:
        """Radius of a hole of the cell."""
        return self.cell_side_m / 2 - self.cell_ligament_m


@dataclass(frozen=True)
class Assumed:
    """The assumed sizes, and the least and the largest that each may be."""

    sizes: Sizes
    low: Mapping[str, float]
    high: Mapping[str, float]
    pressed_area_m2: float
    """Area that bears the load (section 2.5.1)."""

    def variants(self) -> list[tuple[str, str, Sizes]]:
        """Each size at its least and at its largest, all others as assumed: its name, `low` or `high`, the sizes."""
        return [
            (name, end, replace(self.sizes, **{name: values[name]}))
            for name in self.low
            for end, values in (("low", self.low), ("high", self.high))
            if values[name] != getattr(self.sizes, name)
        ]

    def draw(self, rng: np.random.Generator) -> Sizes:
        """All sizes at once, each drawn evenly between its least and its largest."""
        return Sizes(**{name: float(rng.uniform(self.low[name], self.high[name])) for name in self.low})


@dataclass(frozen=True)
class Material:
    """A linear elastic isotropic material."""

    modulus_pa: float
    poisson: float

    @property
    def lame_pa(self) -> tuple[float, float]:
        """Lamé's constants λ and μ [Pa]."""
        e, nu = self.modulus_pa, self.poisson
        return e * nu / ((1 + nu) * (1 - 2 * nu)), e / (2 * (1 + nu))


def in_file(name: str) -> tuple[str, float]:
    """Name of a size in the file, with the unit that it has there, and that unit in SI."""
    for end, (written, factor) in _UNITS.items():
        if name.endswith(end):
            return name.removesuffix(end) + written, factor
    return name, 1.0


def read_assumed(path: str | Path) -> Assumed:
    """The assumed sizes.

    Raises InputError: a size that is missing or unknown, or not [assumed, low, high] with 0 < low <= assumed <= high.
    """
    path = Path(path)
    held = read_yaml(path)
    if not isinstance(held, Mapping):
        raise InputError(f"{path}: expected a size on each line, as cell_length_mm: [80.0, 75.0, 85.0]")
    known = {in_file(size.name)[0]: size.name for size in fields(Sizes)}
    if strange := sorted(set(held) - set(known) - {"pressed_area_mm2"}):
        raise InputError(f"{path}: {strange[0]} is no size of the bench; expected one of {', '.join(known)}")
    middle, low, high = {}, {}, {}
    for written, name in known.items():
        values = held.get(written)
        if not (isinstance(values, list) and len(values) == 3 and all(isinstance(x, (int, float)) for x in values)):
            raise InputError(f"{path}: {written} is {values}, expected [assumed, low, high]")
        if not 0 < values[1] <= values[0] <= values[2] < np.inf:
            raise InputError(f"{path}: {written} is {values}, expected 0 < low <= assumed <= high")
        factor = in_file(name)[1]
        middle[name], low[name], high[name] = (float(value) * factor for value in values)
    area = held.get("pressed_area_mm2")
    if not isinstance(area, (int, float)) or not 0 < area < np.inf:
        raise InputError(f"{path}: pressed_area_mm2 is {area}, expected the area that bears the load, above 0")
    return Assumed(Sizes(**middle), low, high, float(area) * 1e-6)


def read_moduli(path: str | Path) -> dict[str, float]:
    """Elastic modulus [Pa] of the pieces by material, as table 2.4 prints it."""
    table = pd.read_csv(path).set_index("material")["modulus_gpa"]
    if missing := [name for name in MATERIALS if name not in table]:
        raise InputError(f"{path}: no row of the material {missing[0]}")
    return {name: float(table[name]) * 1e9 for name in MATERIALS}


def materials(sizes: Sizes, moduli_pa: Mapping[str, float], pieces: str) -> dict[str, Material]:
    """Materials of a bench whose pieces are of `pieces`: of `cells` and of `pieces`."""
    poisson = {"Al-6061": sizes.poisson_aluminium, "PLA": sizes.poisson_pla}
    return {
        "cells": Material(sizes.cell_modulus_pa, sizes.poisson_aluminium),
        "pieces": Material(moduli_pa[pieces], poisson[pieces]),
    }
