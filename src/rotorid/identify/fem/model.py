"""The bench under a vertical load in the middle of plate D: one leg solved, for pieces of any material."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.spatial import cKDTree

from rotorid.errors import InputError
from rotorid.identify.fem import bench, elasticity, placement
from rotorid.identify.fem.bench import CELLS, PIECES, UP, Leg
from rotorid.identify.fem.elasticity import Bound, LooseParts
from rotorid.identify.fem.gauges import gauge_strains, holes
from rotorid.identify.fem.sizes import Assumed, Material, Sizes
from rotorid.identify.fem.tets import on

DOWN = -UP
LEGS = len(placement.LEGS)
GROUPS = dict.fromkeys(CELLS, "cells") | dict.fromkeys(PIECES, "pieces")
"""Material of each part."""


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

    leg: Leg
    sizes: Sizes
    body: LooseParts

    @classmethod
    def of(cls, assumed: Assumed, sizes: Sizes, distances_m: Mapping[str, float], fineness: float) -> Bench:
        """The bench of these sizes; InputError where they do not go together."""
        leg = bench.build(assumed, sizes, distances_m, fineness)
        walls = [hole for name in CELLS for hole in holes(name, sizes, leg.frames[name])]
        return cls(leg, sizes, LooseParts.of(leg.parts, walls, GROUPS))

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
        return self.body.traction(self.seat, DOWN / LEGS)

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
