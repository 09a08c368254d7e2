"""Where the cells sit and which way they give way, from the thesis's tables 2.2 and 2.3.

Frame {T}: x and y of the vehicle, z down, origin on top of plate D. The tube begins there and ends L above, at {B}.
The signs of eqs 2.3 to 2.5 and 2.8 fix the rest: the cells sit on two rings of three, 120° apart, and cells 2, 4 and 6
lie below cells 1, 3 and 5. One leg of the bench is a cell of each ring; the others are that leg turned by ±120°.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

THIRD = 2 * np.pi / 3
LEGS = ((1, 2), (5, 6), (3, 4))
"""Upper and lower cell of each leg; each leg is the one before it turned by 120° about z, from x to y."""
_AZIMUTH = {"upper": np.radians(-60.0), "lower": np.radians(30.0)}
"""Direction outwards across the bar of the first leg's cells, from x to y, by the factors of table 2.2."""
_SLOPE = {"upper": 0.0, "lower": np.radians(45.0)}
"""Angle between the direction in which a cell gives way and the table."""


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
