"""The load cell: a bar with two holes across, joined by a slot (binocular bending beam).

Own frame: x along the bar, from its middle to the end away from the vehicle, y the way of a positive force, z across.
"""

from __future__ import annotations

import numpy as np

from rotorid.errors import InputError
from rotorid.identify.fem.sizes import Sizes
from rotorid.identify.fem.tets import Flat, Tets, between, block, count, joined, mirrored, stacked

_CORNER = np.pi / 4
"""Angle about the hole's axis of the line from the hole to the corner of the block around it."""

_WALL = 1.5
"""Distance from the hole's axis to the end of that block, over half the bar's side."""


def profile(sizes: Sizes, fineness: float) -> Flat:
    """The bar from the side, with `fineness` times as many elements along each line as the coarsest has."""
    half, reach = sizes.cell_side_m / 2, sizes.cell_between_holes_m / 2
    beyond = reach + _WALL * half
    radius, slot, end = sizes.hole_radius_m, sizes.cell_slot_m / 2, sizes.cell_length_m / 2
    first = np.pi - np.arcsin(min(slot / radius, 1.0))
    inner = reach + radius * np.cos(first)
    if not (0 < slot < radius and inner > 0.05 * reach and beyond < end):
        raise InputError("the load cell's holes do not fit into its bar with these sizes")
    angles = np.r_[
        np.linspace(first, np.pi / 2, count(4, fineness) + 1),
        np.linspace(np.pi / 2, _CORNER, count(3, fineness) + 1)[1:],
    ]
    arc = np.c_[reach + radius * np.cos(angles), radius * np.sin(angles)]
    # Straight above the hole's axis the lines between hole and surface stand upright: that is the narrow section.
    above = np.interp(-angles, [-first, -np.pi / 2, -_CORNER], [inner, reach, beyond])
    straight = np.linspace(0, inner, count(1, fineness) + 1)[:-1]
    below = np.concatenate([np.c_[straight, np.full(len(straight), slot)], arc])
    top = np.c_[np.r_[straight, above], np.full(len(straight) + len(above), half)]
    layers = count(1, fineness)
    angles = np.linspace(_CORNER, 0, count(2, fineness) + 1)
    side_in = np.c_[reach + radius * np.cos(angles), radius * np.sin(angles)]
    height = half * angles / _CORNER
    side_out = np.c_[np.full(len(height), beyond), height]
    columns = np.linspace(beyond, end, count(2, fineness) + 1)
    rest = block(np.stack(np.meshgrid(columns, height, indexing="ij"), axis=-1))
    quarter = joined([between(below, top, layers), between(side_in, side_out, layers), rest])
    upper = joined([quarter, mirrored(quarter, 0)])
    return joined([upper, mirrored(upper, 1)])


def mesh(sizes: Sizes, fineness: float) -> Tets:
    """The bar in its own frame."""
    flat = profile(sizes, fineness)
    across = np.linspace(-0.5, 0.5, count(1, fineness) + 2) * sizes.cell_side_m
    layers = np.stack([np.c_[flat.points_m, np.full(len(flat.points_m), z)] for z in across])
    return stacked(layers, flat.triangles)


GAUGE_SIGNS = np.array([1.0, -1.0, 1.0, -1.0])
"""Sign of each gauge's strain under a positive force: it is also its sign in the bridge."""


def gauge_ends_m(sizes: Sizes) -> tuple[np.ndarray, np.ndarray]:
    """Ends of the four gauges' grids [m] in the cell's own frame, shape (4, 3) each.

    Each lies along the bar on the surface over a narrow section, at mid-width. A force in +y on the end towards the
    vehicle (at -x) stretches the first and the third.
    """
    reach, half, grid = sizes.cell_between_holes_m / 2, sizes.cell_side_m / 2, sizes.gauge_length_m / 2
    middles = np.array([[-reach, half, 0.0], [-reach, -half, 0.0], [reach, -half, 0.0], [reach, half, 0.0]])
    along = np.array([grid, 0.0, 0.0])
    return middles - along, middles + along
