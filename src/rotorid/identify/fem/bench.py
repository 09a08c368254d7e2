"""One leg of the bench with its third of plate D: meshes of the parts, and where they are held together.

Under a vertical load in the middle all legs do the same, turned by 120°, so one is enough: on the cut through the plate
displacements are those of the other cut, turned. Pieces A, B and C end on rectangles of the cells and of the plate and
follow them there (bonded contact). The order of the pieces: plate D, post C, upper cell, bracket B, lower cell, foot A.

A third of plate D: a round plate with a round seat in its middle, on which the tube stands.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from rotorid.errors import InputError
from rotorid.identify.fem import cell, placement
from rotorid.identify.fem.placement import THIRD, PartFrame
from rotorid.identify.fem.sizes import Assumed, Sizes
from rotorid.identify.fem.tets import Flat, Pad, Tets, block, column, count, joined, stacked

UP = np.array([0.0, 0.0, -1.0])
CELLS = ("upper cell", "lower cell")
PIECES = ("A", "B", "C", "D")


@dataclass(frozen=True)
class _Bond:
    """A piece's end that follows the surface of another part."""

    piece: str
    on: str
    pad: Pad


@dataclass(frozen=True)
class Leg:
    """The model's geometry, in frame {T} (z down, origin on top of plate D)."""

    parts: Mapping[str, Tets]
    frames: Mapping[str, PartFrame]
    """Own frames of the cells and of plate D."""
    bonds: tuple[_Bond, ...]
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
    frames["D"] = PartFrame(np.zeros(3), placement.turn(np.arctan2(under[1], under[0])).T)
    parts = {
        **{name: cell.mesh(sizes, fineness).put(frames[name]) for name in CELLS},
        "A": column("A", base, held, counts),
        "B": column("B", leaves, arrives, counts),
        "C": column("C", hung, top, counts),
        "D": mesh(sizes, assumed.pressed_area_m2, fineness).put(frames["D"]),
    }
    bonds = (
        _Bond("A", "lower cell", held),
        _Bond("B", "upper cell", leaves),
        _Bond("B", "lower cell", arrives),
        _Bond("C", "upper cell", hung),
        _Bond("C", "D", top),
    )
    return Leg(parts, frames, bonds, base, sizes.boss_height_m)


def _other_end(place: placement.Place, sizes: Sizes) -> np.ndarray:
    return place.force_m + sizes.cell_between_pads_m * place.axis


def _frame(place: placement.Place, sizes: Sizes) -> PartFrame:
    middle = place.force_m + sizes.cell_between_pads_m / 2 * place.axis
    return PartFrame(middle, np.stack([place.axis, place.sense, np.cross(place.axis, place.sense)]))


def _seat_radius_m(area_m2: float, fineness: float) -> float:
    """Radius of the polygon's corners that has just the area which bears the load."""
    corners = 6 * _core(fineness)
    return float(np.sqrt(2 * area_m2 / (corners * np.sin(2 * np.pi / corners))))


def mesh(sizes: Sizes, area_m2: float, fineness: float) -> Tets:
    """The part between -60° and +60° about the x axis; z points down, the plate's top is at 0."""
    core, whole = _flat(_seat_radius_m(area_m2, fineness), sizes.plate_radius_m, fineness)
    plate = _raised(whole, np.linspace(sizes.plate_thickness_m, 0, count(1, fineness) + 1))
    seat = _raised(core, np.linspace(0, -sizes.boss_height_m, count(1, fineness) + 1))
    points = np.concatenate([plate.points_m, seat.points_m])
    cells = np.concatenate([plate.cells, seat.cells + len(plate.points_m)])
    kept, back = np.unique([min(same) for same in cKDTree(points).query_ball_point(points, 1e-9)], return_inverse=True)
    return Tets(points[kept], back[cells])


def _core(fineness: float) -> int:
    """Elements along each side of the rhombus in the middle."""
    return count(2, fineness)


def _flat(seat_m: float, rim_m: float, fineness: float) -> tuple[Flat, Flat]:
    """The seat alone and the whole, from above."""
    n = _core(fineness)
    i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
    larger = np.maximum(np.maximum(i, j), 1)
    share = np.maximum(i, j) / n
    angle = THIRD / 2 * np.where(i >= j, j / larger - 1, 1 - i / larger)
    round_ = seat_m * share[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    ends = seat_m * np.array([[np.cos(THIRD / 2), -np.sin(THIRD / 2)], [np.cos(THIRD / 2), np.sin(THIRD / 2)]])
    straight = (i[..., None] * ends[0] + j[..., None] * ends[1]) / n
    weight = share[..., None] ** 2
    core = block(weight * round_ + (1 - weight) * straight)
    radii = np.geomspace(seat_m, rim_m, count(4, fineness) + 1)
    angles = np.linspace(-THIRD / 2, THIRD / 2, 2 * n + 1)
    ring = block(np.stack([np.outer(radii, np.cos(angles)), np.outer(radii, np.sin(angles))], axis=-1))
    return core, joined([core, ring])


def _raised(flat: Flat, heights_m: np.ndarray) -> Tets:
    layers = np.stack([np.c_[flat.points_m, np.full(len(flat.points_m), z)] for z in heights_m])
    return stacked(layers, flat.triangles)
