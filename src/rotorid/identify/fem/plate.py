"""A third of plate D: a round plate with a round seat in its middle, on which the tube stands."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from rotorid.identify.fem.placement import THIRD
from rotorid.identify.fem.sizes import Sizes
from rotorid.identify.fem.tets import Flat, Tets, block, count, joined, stacked


def seat_radius_m(area_m2: float, fineness: float) -> float:
    """Radius of the polygon's corners that has just the area which bears the load."""
    corners = 6 * _core(fineness)
    return float(np.sqrt(2 * area_m2 / (corners * np.sin(2 * np.pi / corners))))


def mesh(sizes: Sizes, area_m2: float, fineness: float) -> Tets:
    """The part between -60° and +60° about the x axis; z points down, the plate's top is at 0."""
    core, whole = _flat(seat_radius_m(area_m2, fineness), sizes.plate_radius_m, fineness)
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
