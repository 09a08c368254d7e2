"""One leg of the bench with its third of plate D: meshes of the parts, and where they are held together.

Under a vertical load in the middle all legs do the same, turned by 120°, so one is enough: on the cut through the plate
displacements are those of the other cut, turned. Pieces A, B and C end on rectangles of the cells and of the plate and
follow them there (bonded contact). The order of the pieces: plate D, post C, upper cell, bracket B, lower cell, foot A.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rotorid.errors import InputError
from rotorid.identify.fem import cell, placement, plate
from rotorid.identify.fem.placement import Frame
from rotorid.identify.fem.sizes import Assumed, Sizes
from rotorid.identify.fem.tets import Pad, Tets, column, count

UP = np.array([0.0, 0.0, -1.0])
CELLS = ("upper cell", "lower cell")
PIECES = ("A", "B", "C", "D")


@dataclass(frozen=True)
class Bond:
    """A piece's end that follows the surface of another part."""

    piece: str
    on: str
    pad: Pad


@dataclass(frozen=True)
class Leg:
    """The model's geometry, in frame {T} (z down, origin on top of plate D)."""

    parts: Mapping[str, Tets]
    frames: Mapping[str, Frame]
    """Own frames of the cells and of plate D."""
    bonds: tuple[Bond, ...]
    base: Pad
    """Fixed to the table."""
    seat_m: float
    """Height of the surface that bears the load above the plate's top."""


def build(assumed: Assumed, sizes: Sizes, distances_m: Mapping[str, float], fineness: float) -> Leg:
    """Meshes of one leg.

    Parameters
    ----------
    assumed
        For the area that bears the load.
    sizes
        All other sizes.
    distances_m
        Table 2.3, by name [m].
    fineness
        Elements along each line, as a multiple of the coarsest mesh.

    Raises
    ------
    InputError
        Sizes that do not go together.
    """
    placed = placement.cells(distances_m)
    upper, lower = placed[1], placed[2]
    half = sizes.cell_side_m / 2
    if upper.force_m[2] - half <= sizes.plate_thickness_m:
        raise InputError("plate D is so thick that it meets the upper cells, expected a smaller plate_thickness_mm")
    pad = (sizes.cell_pad_m, sizes.cell_side_m)
    hung = Pad(upper.force_m + half * upper.inwards, upper.inwards, upper.axis, pad)
    under = np.append((hung.centre_m + sizes.post_in_m * upper.inwards)[:2], sizes.plate_thickness_m)
    top = Pad(under, UP, upper.axis, (sizes.post_side_m, sizes.cell_side_m))
    if np.linalg.norm(under[:2]) + np.hypot(*top.sides_m) / 2 > sizes.plate_radius_m:
        raise InputError("plate D does not cover the posts, expected a larger plate_radius_mm")
    # Under the upper cell's far end, not on a bolted face: from there a column would have to double back.
    leaves = Pad(_other_end(upper, sizes) - half * UP, -UP, upper.axis, (sizes.bracket_side_m, sizes.cell_side_m))
    arrives = Pad(
        lower.force_m + half * lower.inwards,
        -lower.inwards,
        np.cross(lower.axis, -lower.inwards),
        (sizes.cell_side_m, sizes.cell_pad_m),
    )
    held = Pad(_other_end(lower, sizes) - half * lower.inwards, lower.inwards, lower.axis, pad)
    outwards = -np.append(lower.inwards[:2], 0.0)
    ground = held.centre_m + sizes.foot_out_m * outwards / np.linalg.norm(outwards)
    base = Pad(np.append(ground[:2], sizes.foot_depth_m), UP, lower.axis, (sizes.foot_side_m, sizes.cell_side_m))
    counts = (count(1, fineness) + 1, count(1, fineness) + 1, count(3, fineness))
    frames = {name: _frame(place, sizes) for name, place in zip(CELLS, (upper, lower), strict=True)}
    frames["D"] = Frame(np.zeros(3), placement.turn(np.arctan2(under[1], under[0])).T)
    parts = {
        **{name: cell.mesh(sizes, fineness).put(frames[name]) for name in CELLS},
        "A": column("A", base, held, counts),
        "B": column("B", leaves, arrives, counts),
        "C": column("C", hung, top, counts),
        "D": plate.mesh(sizes, assumed.pressed_area_m2, fineness).put(frames["D"]),
    }
    bonds = (
        Bond("A", "lower cell", held),
        Bond("B", "upper cell", leaves),
        Bond("B", "lower cell", arrives),
        Bond("C", "upper cell", hung),
        Bond("C", "D", top),
    )
    return Leg(parts, frames, bonds, base, sizes.boss_height_m)


def _other_end(place: placement.Place, sizes: Sizes) -> np.ndarray:
    return place.force_m + sizes.cell_between_pads_m * place.axis


def _frame(place: placement.Place, sizes: Sizes) -> Frame:
    middle = place.force_m + sizes.cell_between_pads_m / 2 * place.axis
    return Frame(middle, np.stack([place.axis, place.sense, np.cross(place.axis, place.sense)]))
