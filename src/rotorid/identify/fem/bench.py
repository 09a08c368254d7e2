"""The bench under a vertical load in the middle of plate D: meshes of one leg, and the leg solved for any material.

Under such a load all legs do the same, turned by 120°, so one is enough: on the cut through the plate displacements are
those of the other cut, turned. Pieces A, B and C end on rectangles of the cells and of the plate and follow them there
(bonded contact). The order of the pieces: plate D, post C, upper cell, bracket B, lower cell, foot A. Plate D is round
with a round seat in its middle, on which the tube stands; a third of it belongs to a leg.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from rotorid.errors import InputError
from rotorid.identify.fem import cell, elasticity, placement
from rotorid.identify.fem.cell import gauge_strains, holes
from rotorid.identify.fem.elasticity import Bound, LooseParts
from rotorid.identify.fem.placement import THIRD, PartFrame
from rotorid.identify.fem.sizes import Assumed, Material, Sizes
from rotorid.identify.fem.tets import Flat, Pad, Tets, block, column, count, joined, on, stacked

_UP = np.array([0.0, 0.0, -1.0])
CELLS = ("upper cell", "lower cell")
PIECES = ("A", "B", "C", "D")
DOWN = -_UP
_LEGS = len(placement.LEGS)
_GROUPS = dict.fromkeys(CELLS, "cells") | dict.fromkeys(PIECES, "pieces")
"""Material of each part."""


@dataclass(frozen=True)
class _Bond:
    """A piece's end that follows the surface of another part."""

    piece: str
    on: str
    pad: Pad


@dataclass(frozen=True)
class _Leg:
    """The model's geometry, in frame {T} (z down, origin on top of plate D)."""

    parts: Mapping[str, Tets]
    frames: Mapping[str, PartFrame]
    """Own frames of the cells and of plate D."""
    bonds: tuple[_Bond, ...]
    base: Pad
    """Fixed to the table."""
    seat_m: float
    """Height of the surface that bears the load above the plate's top."""


def _build(assumed: Assumed, sizes: Sizes, distances_m: Mapping[str, float], fineness: float) -> _Leg:
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
    top = Pad(under, _UP, upper.axis, (sizes.post_side_m, sizes.cell_side_m))
    if np.linalg.norm(under[:2]) + np.hypot(*top.sides_m) / 2 > sizes.plate_radius_m:
        raise InputError("plate D does not cover the posts, expected a larger plate_radius_mm")
    # Under the upper cell's far end, not on a bolted face: from there a column would have to double back.
    leaves = Pad(_other_end(upper, sizes) - half * _UP, -_UP, upper.axis, (sizes.bracket_side_m, sizes.cell_side_m))
    arrives = Pad(
        lower.force_m + half * lower.inwards,
        -lower.inwards,
        np.cross(lower.axis, -lower.inwards),
        (sizes.cell_side_m, sizes.cell_pad_m),
    )
    held = Pad(_other_end(lower, sizes) - half * lower.inwards, lower.inwards, lower.axis, pad)
    outwards = -np.append(lower.inwards[:2], 0.0)
    ground = held.centre_m + sizes.foot_out_m * outwards / np.linalg.norm(outwards)
    base = Pad(np.append(ground[:2], sizes.foot_depth_m), _UP, lower.axis, (sizes.foot_side_m, sizes.cell_side_m))
    counts = (count(1, fineness) + 1, count(1, fineness) + 1, count(3, fineness))
    frames = {name: _frame(place, sizes) for name, place in zip(CELLS, (upper, lower), strict=True)}
    frames["D"] = PartFrame(np.zeros(3), placement.turn(np.arctan2(under[1], under[0])).T)
    parts = {
        **{name: cell.mesh(sizes, fineness).put(frames[name]) for name in CELLS},
        "A": column("A", base, held, counts),
        "B": column("B", leaves, arrives, counts),
        "C": column("C", hung, top, counts),
        "D": _mesh(sizes, assumed.pressed_area_m2, fineness).put(frames["D"]),
    }
    bonds = (
        _Bond("A", "lower cell", held),
        _Bond("B", "upper cell", leaves),
        _Bond("B", "lower cell", arrives),
        _Bond("C", "upper cell", hung),
        _Bond("C", "D", top),
    )
    return _Leg(parts, frames, bonds, base, sizes.boss_height_m)


def _other_end(place: placement.Place, sizes: Sizes) -> np.ndarray:
    return place.force_m + sizes.cell_between_pads_m * place.axis


def _frame(place: placement.Place, sizes: Sizes) -> PartFrame:
    middle = place.force_m + sizes.cell_between_pads_m / 2 * place.axis
    return PartFrame(middle, np.stack([place.axis, place.sense, np.cross(place.axis, place.sense)]))


def _seat_radius_m(area_m2: float, fineness: float) -> float:
    """Radius of the polygon's corners that has just the area which bears the load."""
    corners = 6 * _core(fineness)
    return float(np.sqrt(2 * area_m2 / (corners * np.sin(2 * np.pi / corners))))


def _mesh(sizes: Sizes, area_m2: float, fineness: float) -> Tets:
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


@dataclass(frozen=True)
class Solved:
    """What a load of 1 N downwards on the whole bench does."""

    displacement_m: np.ndarray
    """Of each node [m/N], shape (n, 3)."""
    von_mises_pa: np.ndarray
    """At each node [Pa/N], shape (n,)."""


@dataclass(frozen=True)
class Bench:
    """A leg's mesh with all that binds it, for one set of sizes."""

    leg: _Leg
    sizes: Sizes
    body: LooseParts

    @classmethod
    def of(cls, assumed: Assumed, sizes: Sizes, distances_m: Mapping[str, float], fineness: float) -> Bench:
        """The bench of these sizes; InputError where they do not go together."""
        leg = _build(assumed, sizes, distances_m, fineness)
        walls = [hole for name in CELLS for hole in holes(name, sizes, leg.frames[name])]
        return cls(leg, sizes, LooseParts.of(leg.parts, walls, _GROUPS))

    @cached_property
    def binding(self) -> sparse.csr_matrix:
        """Bonds, the cut through the plate and the table, as the matrix of `elasticity.constraints`."""
        nodes = self.body.nodes_m
        bonds = []
        for bond in self.leg.bonds:
            own = self.body.nodes_of(bond.piece)
            own = own[on(bond.pad, nodes[own])]
            bonds.append(Bound(own, self.body.weights(nodes[own], bond.on), np.eye(3)))
        fixed = np.zeros((3, len(nodes)), bool)
        foot = self.body.nodes_of("A")
        fixed[:, foot[on(self.leg.base, nodes[foot])]] = True
        axis, cut = self._cut()
        fixed[:2, axis] = True
        return elasticity.constraints(len(nodes), [bonds, [cut]], fixed)

    def _cut(self) -> tuple[np.ndarray, Bound]:
        """Nodes on the axis, and those on one face of the cut, which follow those on the other, turned."""
        nodes = self.body.nodes_m
        plate = self.body.nodes_of("D")
        frame = self.leg.frames["D"]
        own = (nodes[plate] - frame.origin_m) @ frame.axes.T
        radius, angle = np.hypot(own[:, 0], own[:, 1]), np.arctan2(own[:, 1], own[:, 0])
        axis = plate[radius < 1e-9]
        first, last = (
            plate[(radius >= 1e-9) & (np.abs(angle - end) < 1e-6)]
            for end in (-placement.THIRD / 2, placement.THIRD / 2)
        )
        matrix = placement.turn(placement.THIRD)
        distance, match = cKDTree(nodes[first] @ matrix.T).query(nodes[last])
        if len(first) != len(last) or distance.max() > 1e-8:
            raise InputError("the two faces of the cut through plate D have different meshes")
        weights = sparse.csr_matrix((np.ones(len(last)), (np.arange(len(last)), first[match])), (len(last), len(nodes)))
        return axis, Bound(last, weights, matrix)

    @cached_property
    def seat(self) -> np.ndarray:
        """Facets that bear the load."""
        height = -self.leg.seat_m
        return self.body.mesh.facets_satisfying(lambda x: np.abs(x[2] - height) < 1e-9, boundaries_only=True)

    @cached_property
    def load(self) -> np.ndarray:
        """Nodal forces [N], shape (3 n,), of this leg's share of 1 N downwards on the seat."""
        return self.body.traction(self.seat, DOWN / _LEGS)

    def solve(self, of: Mapping[str, Material]) -> Solved:
        """Displacements and equivalent stresses of a bench of these materials (`cells`, `pieces`)."""
        moved = elasticity.solve(self.body.stiffness(of), self.binding, self.load[:, None])[:, 0]
        stress = elasticity.von_mises(self.body.stress(moved, of))
        return Solved(moved.reshape(3, -1).T, stress)

    def gauge_strains(self, solved: Solved, name: str) -> np.ndarray:
        """Strain [1/N] of the four gauges of a cell, shape (4,)."""
        return gauge_strains(self.body, name, self.sizes, self.leg.frames[name], solved.displacement_m)

    def narrow(self, name: str) -> np.ndarray:
        """Nodes of a cell's narrow sections: within the middle third of the walls above and below the holes."""
        frame = self.leg.frames[name]
        nodes = self.body.nodes_of(name)
        own = np.abs((self.body.nodes_m[nodes] - frame.origin_m) @ frame.axes.T)
        off_hole = np.abs(own[:, 0] - self.sizes.cell_between_holes_m / 2)
        return nodes[(off_hole < self.sizes.hole_radius_m / 2) & (own[:, 1] > self.sizes.hole_radius_m / 2)]
