"""The load cell: a bar with two holes across, joined by a slot (binocular bending beam), and its bridge of four gauges.

Own frame: x along the bar, from its middle to the end away from the vehicle, y the way of a positive force, z across.
Alone it is solved as it is calibrated (thesis fig. 2.32): one end clamped, the weight on the other.
"""

from __future__ import annotations

import numpy as np

from rotorid.errors import InputError
from rotorid.identify.fem import elasticity
from rotorid.identify.fem.elasticity import Hole, LooseParts
from rotorid.identify.fem.placement import PartFrame
from rotorid.identify.fem.sizes import Material, Sizes
from rotorid.identify.fem.tets import Flat, Pad, Tets, between, block, count, joined, mirrored, on, stacked

_CORNER = np.pi / 4
"""Angle about the hole's axis of the line from the hole to the corner of the block around it."""

_WALL = 1.5
"""Distance from the hole's axis to the end of that block, over half the bar's side."""
_NAME = "cell"


def _profile(sizes: Sizes, fineness: float) -> Flat:
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
    flat = _profile(sizes, fineness)
    across = np.linspace(-0.5, 0.5, count(1, fineness) + 2) * sizes.cell_side_m
    layers = np.stack([np.c_[flat.points_m, np.full(len(flat.points_m), z)] for z in across])
    return stacked(layers, flat.triangles)


_GAUGE_SIGNS = np.array([1.0, -1.0, 1.0, -1.0])
"""Sign of each gauge's strain under a positive force: it is also its sign in the bridge."""


def _gauge_ends_m(sizes: Sizes) -> tuple[np.ndarray, np.ndarray]:
    """Ends of the four gauges' grids [m] in the cell's own frame, shape (4, 3) each.

    Each lies along the bar on the surface over a narrow section, at mid-width. A force in +y on the end towards the
    vehicle (at -x) stretches the first and the third.
    """
    reach, half, grid = sizes.cell_between_holes_m / 2, sizes.cell_side_m / 2, sizes.gauge_length_m / 2
    middles = np.array([[-reach, half, 0.0], [-reach, -half, 0.0], [reach, -half, 0.0], [reach, half, 0.0]])
    along = np.array([grid, 0.0, 0.0])
    return middles - along, middles + along


def holes(name: str, sizes: Sizes, frame: PartFrame) -> list[Hole]:
    """The two holes of the cell `name` with this own frame."""
    reach = sizes.cell_between_holes_m / 2
    return [
        Hole(name, frame.origin_m + side * frame.axes[0], frame.axes[2], sizes.hole_radius_m)
        for side in (-reach, reach)
    ]


def gauge_strains(body: LooseParts, name: str, sizes: Sizes, frame: PartFrame, moved_m: np.ndarray) -> np.ndarray:
    """Strain of the four gauges of the cell `name`, shape (4,): change of length of each grid over its length.

    Parameters
    ----------
    frame
        The cell's own.
    moved_m
        Displacements of all nodes [m], shape (n, 3).
    """
    first, last = (
        body.weights(frame.origin_m + ends @ frame.axes, name) @ moved_m @ frame.axes[0]
        for ends in _gauge_ends_m(sizes)
    )
    return (last - first) / sizes.gauge_length_m


def bridge_strain(strains: np.ndarray) -> float:
    """What a full bridge makes of its four gauges: the mean of their strains, each with its sign."""
    return float(_GAUGE_SIGNS @ strains / len(_GAUGE_SIGNS))


def strain_per_newton(sizes: Sizes, material: Material, fineness: float) -> float:
    """Strain of the bridge per newton across the free end [1/N]."""
    frame = PartFrame(np.zeros(3), np.eye(3))
    body = LooseParts.of({_NAME: mesh(sizes, fineness)}, holes(_NAME, sizes, frame))
    half, reach = sizes.cell_side_m / 2, sizes.cell_between_pads_m / 2
    pad = Pad(np.array([reach, -half, 0.0]), frame.axes[1], frame.axes[0], (sizes.cell_pad_m, sizes.cell_side_m))
    end = np.array([-reach, half, 0.0])
    nodes = body.nodes_m
    binding = elasticity.constraints(len(nodes), [], np.tile(on(pad, nodes), (3, 1)))
    across = np.zeros(len(nodes))
    # The weight's resultant acts in the middle of the pad; how it spreads there does not reach the gauges.
    weights = body.weights(end[None], _NAME)
    across[weights.indices] = weights.data
    forces = np.concatenate([np.zeros(len(nodes)), across, np.zeros(len(nodes))])
    moved = elasticity.solve(body.stiffness({_NAME: material}), binding, forces[:, None])[:, 0]
    return bridge_strain(gauge_strains(body, _NAME, sizes, frame, moved.reshape(3, -1).T))
