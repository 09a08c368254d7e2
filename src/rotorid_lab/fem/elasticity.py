"""Linear elasticity of isotropic bodies on quadratic tetrahedra, with parts bonded to each other, and their meshes.

A mesh is layers of tetrahedra: a triangulated profile moved along a path. Plates, columns and bars with holes across
need no mesh generator; the usual ones need libraries of a desktop (docs/decisions/0008-finite-elements.md). Its
unknowns are the displacements of its nodes (corners and middles of edges), first all of x, then all of y, then all of
z: shape (3 n,). The stiffness is a sum of matrices that hold no material, weighted by Lamé's constants, so that another
material needs no new integration. What binds nodes is a matrix C with u = C q; solved is CᵀKC q = Cᵀf.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree
from skfem import Basis, BilinearForm, ElementTetP2, FacetBasis, LinearForm, MeshTet, MeshTet2

from rotorid.errors import InputError
from rotorid_lab.fem.placement import Material, PartFrame

_FLATTEST = 0.05
"""Volume that a column's element must have at least, as a share of the usual one: flatter ones spoil the stress."""
_INTEGRATED = 3
"""Degree of the polynomials that are integrated exactly."""
_LEFT_OVER = 1e-6
"""Share of the forces that a solution may leave unbalanced."""
_OUTSIDE = 0.02
"""A point may lie outside of its tetrahedron by so much of its size: curved surfaces are meshed by flat ones."""


@dataclass(frozen=True)
class Mesh:
    """Triangles of a flat profile, or tetrahedra."""

    points_m: np.ndarray
    """Corners [m], shape (n, 2) or (n, 3)."""
    cells: np.ndarray
    """Indices of the corners of each triangle, shape (m, 3), or tetrahedron, shape (m, 4)."""

    def put(self, frame: PartFrame) -> Mesh:
        """Tetrahedra in the frame in which their own is `frame`."""
        return Mesh(frame.origin_m + self.points_m @ frame.axes, self.cells)


def count(coarsest: int, fineness: float) -> int:
    """Elements along a line that has `coarsest` in the coarsest mesh, `fineness` 1."""
    return int(np.ceil(coarsest * fineness - 1e-9))


def block(points_m: np.ndarray) -> Mesh:
    """A grid of points, shape (rows, columns, 2), each of its quadrilaterals cut in two along the shorter diagonal."""
    rows, columns = points_m.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    flat = points_m.reshape(-1, 2)
    through_ac = np.sum((flat[a] - flat[c]) ** 2, 1) <= np.sum((flat[b] - flat[d]) ** 2, 1) * (1 + 1e-9)
    first = np.where(through_ac[:, None], np.c_[a, b, c], np.c_[a, b, d])
    second = np.where(through_ac[:, None], np.c_[a, c, d], np.c_[b, c, d])
    return Mesh(flat, np.r_[first, second])


def between(inner_m: np.ndarray, outer_m: np.ndarray, layers: int) -> Mesh:
    """Layers between two polylines of equally many points, shape (n, 2) each."""
    share = np.linspace(0, 1, layers + 1)[:, None, None]
    return block((1 - share) * inner_m + share * outer_m)


def joined(parts: Sequence[Mesh], tolerance_m: float = 1e-9) -> Mesh:
    """Meshes as one, points within the tolerance of each other made one."""
    points = np.concatenate([part.points_m for part in parts])
    starts = np.cumsum([0] + [len(part.points_m) for part in parts[:-1]])
    cells = np.concatenate([part.cells + start for part, start in zip(parts, starts, strict=True)])
    near = cKDTree(points).query_ball_point(points, tolerance_m)
    kept, back = np.unique([min(same) for same in near], return_inverse=True)
    return Mesh(points[kept], back[cells])


def mirrored(part: Mesh, axis: int) -> Mesh:
    """The profile with the sign of one coordinate turned."""
    sign = np.ones(2)
    sign[axis] = -1
    return Mesh(part.points_m * sign, part.cells)


def stacked(layers_m: np.ndarray, triangles: np.ndarray) -> Mesh:
    """Tetrahedra between copies of a profile.

    `layers_m`: its points in each layer [m], shape (layers + 1, n, 3). `triangles`: indices into one layer, shape
    (t, 3).

    Each prism is cut into three by the order of its corners' indices, so that neighbours agree on the diagonal of the
    face between them (Dompierre et al. 1999).
    """
    n = layers_m.shape[1]
    a, b, c = np.sort(triangles, axis=1).T
    prism = np.concatenate([np.c_[a, b, c, c + n], np.c_[a, b, b + n, c + n], np.c_[a, a + n, b + n, c + n]])
    steps = np.arange(len(layers_m) - 1) * n
    return Mesh(layers_m.reshape(-1, 3), (prism + steps[:, None, None]).reshape(-1, 4))


def raised(profile: Mesh, heights_m: np.ndarray) -> Mesh:
    """Tetrahedra between copies of a profile at heights [m], shape (layers + 1,)."""
    layers = np.stack([np.c_[profile.points_m, np.full(len(profile.points_m), z)] for z in heights_m])
    return stacked(layers, profile.cells)


@dataclass(frozen=True)
class Pad:
    """A rectangle on a surface, on which a column begins or ends."""

    centre_m: np.ndarray
    """Shape (3,)."""
    way: np.ndarray
    """Unit vector along which the column passes through it, shape (3,)."""
    along: np.ndarray
    """Unit vector of its first side, shape (3,), across `way`."""
    sides_m: tuple[float, float]
    """Its first and its second side [m]."""

    @property
    def across(self) -> np.ndarray:
        """Unit vector of its second side, shape (3,)."""
        return np.cross(self.way, self.along)

    def grid_m(self, columns: int, rows: int) -> np.ndarray:
        """Points [m], shape ((columns + 1) * (rows + 1), 3)."""
        u, v = np.meshgrid(
            np.linspace(-0.5, 0.5, columns + 1) * self.sides_m[0],
            np.linspace(-0.5, 0.5, rows + 1) * self.sides_m[1],
            indexing="ij",
        )
        return self.centre_m + u.reshape(-1, 1) * self.along + v.reshape(-1, 1) * self.across


def column(name: str, start: Pad, stop: Pad, counts: tuple[int, int, int]) -> Mesh:
    """A bent column from one rectangle to another: each of its fibres is a cubic that leaves and arrives along `way`.

    `name`: of the piece, for the message. `counts`: elements along the first side, the second side and the column.
    Raises InputError: the column folds over itself.
    """
    profile = block(np.stack(np.meshgrid(*(np.arange(k + 1.0) for k in counts[:2]), indexing="ij"), axis=-1))
    first, last = start.grid_m(*counts[:2]), stop.grid_m(*counts[:2])
    reach = np.linalg.norm(stop.centre_m - start.centre_m)
    s = np.linspace(0, 1, counts[2] + 1)[:, None, None]
    layers = (
        (2 * s**3 - 3 * s**2 + 1) * first
        + (s**3 - 2 * s**2 + s) * reach * start.way
        + (3 * s**2 - 2 * s**3) * last
        + (s**3 - s**2) * reach * stop.way
    )
    if not _upright(layers, profile.cells):
        raise InputError(f"piece {name} folds over itself with these sizes; expected pads further apart or smaller")
    return stacked(layers, profile.cells)


def _upright(layers_m: np.ndarray, triangles: np.ndarray) -> bool:
    """Whether every triangle of every layer has the next and the last layer well on its proper sides."""
    a, b, c = (layers_m[:, corner] for corner in triangles.T)
    normal = np.cross(b - a, c - a)
    rise = np.diff(a, axis=0), np.diff(b, axis=0), np.diff(c, axis=0)
    sides = np.array([np.sum(normal[part] * way, -1) for part in (slice(-1), slice(1, None)) for way in rise])
    sides = sides / np.median(sides)
    return bool(np.all(sides > _FLATTEST))


def on(pad: Pad, points_m: np.ndarray, tolerance_m: float = 1e-7) -> np.ndarray:
    """Which points, shape (n, 3), lie on a rectangle."""
    offset = points_m - pad.centre_m
    return (
        (np.abs(offset @ pad.way) < tolerance_m)
        & (np.abs(offset @ pad.along) < pad.sides_m[0] / 2 + tolerance_m)
        & (np.abs(offset @ pad.across) < pad.sides_m[1] / 2 + tolerance_m)
    )


@dataclass(frozen=True)
class Hole:
    """A round hole through a part."""

    part: str
    middle_m: np.ndarray
    """A point on its axis [m], shape (3,)."""
    axis: np.ndarray
    """Unit vector, shape (3,)."""
    radius_m: float

    def from_axis_m(self, points_m: np.ndarray) -> np.ndarray:
        """Vectors from the axis to points [m], shape (k, 3)."""
        offset = points_m - self.middle_m
        return offset - np.outer(offset @ self.axis, self.axis)


@dataclass(frozen=True)
class LooseParts:
    """Parts with a mesh each, not yet held together."""

    names: tuple[str, ...]
    """Of the parts."""
    mesh: MeshTet
    part: np.ndarray
    """Index of each tetrahedron's part, shape (m,)."""
    groups: tuple[str, ...]
    """Name of the material of each part."""

    @classmethod
    def of(
        cls, parts: Mapping[str, Mesh], holes: Sequence[Hole] = (), groups: Mapping[str, str] | None = None
    ) -> LooseParts:
        """All parts in one mesh; edges between corners on the wall of a hole are bent onto it.

        `groups` names the material of each part; without it each part has one of its own name.
        """
        starts = np.cumsum([0] + [len(tets.points_m) for tets in parts.values()])
        points = np.concatenate([tets.points_m for tets in parts.values()])
        cells = np.concatenate([tets.cells + start for tets, start in zip(parts.values(), starts, strict=False)])
        part = np.repeat(np.arange(len(parts)), [len(tets.cells) for tets in parts.values()])
        flat = MeshTet(points.T.copy(), cells.T.copy(), validate=False)
        mesh = _bent(flat, part, tuple(parts), holes) if holes else flat
        return cls(tuple(parts), mesh, part, tuple((groups or {}).get(name, name) for name in parts))

    @property
    def group(self) -> np.ndarray:
        """Name of each tetrahedron's material, shape (m,)."""
        return np.array(self.groups)[self.part]

    @cached_property
    def basis(self) -> Basis:
        """Quadratic shape functions of one component, with points that integrate products of their gradients."""
        return Basis(self.mesh, ElementTetP2(), intorder=_INTEGRATED)

    @property
    def nodes_m(self) -> np.ndarray:
        """Places of the nodes [m], shape (n, 3)."""
        return self.basis.doflocs.T

    @cached_property
    def part_of_node(self) -> np.ndarray:
        """Index of each node's part, shape (n,)."""
        found = np.empty(self.basis.N, int)
        found[self.basis.element_dofs] = self.part
        return found

    def nodes_of(self, name: str) -> np.ndarray:
        """Indices of a part's nodes."""
        return np.flatnonzero(self.part_of_node == self.names.index(name))

    @cached_property
    def _products(self) -> dict[str, dict[tuple[int, int], sparse.csr_matrix]]:
        """∫ ∂φ/∂x_a ∂ψ/∂x_b over all of each material: shape (n, n) each, by (a, b)."""
        found = {}
        for name in dict.fromkeys(self.groups):
            own = np.flatnonzero(self.group == name)
            basis = Basis(self.mesh, ElementTetP2(), intorder=_INTEGRATED, elements=own)
            half = {(a, b): _product(a, b).assemble(basis) for a in range(3) for b in range(a, 3)}
            found[name] = half | {(b, a): matrix.T.tocsr() for (a, b), matrix in half.items() if a != b}
        return found

    def stiffness(self, materials: Mapping[str, Material]) -> sparse.csr_matrix:
        """Stiffness [N/m], shape (3 n, 3 n); `materials` by the names of `groups`."""
        blocks = [[0, 0, 0], [0, 0, 0], [0, 0, 0]]
        for name, products in self._products.items():
            lam, mu = materials[name].lame_pa
            trace = sum(products[c, c] for c in range(3))
            for a in range(3):
                for b in range(3):
                    # Component a of the virtual displacement, b of the displacement.
                    blocks[a][b] = blocks[a][b] + lam * products[a, b] + mu * products[b, a]
                    if a == b:
                        blocks[a][b] = blocks[a][b] + mu * trace
        return sparse.bmat(blocks, format="csr")

    def traction(self, facets: np.ndarray, force_n: np.ndarray) -> np.ndarray:
        """Nodal forces, shape (3 n,), of an even load on facets (their indices) with this resultant, shape (3,)."""
        basis = FacetBasis(self.mesh, ElementTetP2(), facets=facets, intorder=3)
        share = LinearForm(lambda v, w: v).assemble(basis)
        return np.concatenate([share / share.sum() * component for component in force_n])

    def area_m2(self, facets: np.ndarray) -> float:
        """Area of facets."""
        return float(FacetBasis(self.mesh, ElementTetP2(), facets=facets, intorder=1).dx.sum())

    def weights(self, points_m: np.ndarray, name: str) -> sparse.csr_matrix:
        """What the nodes' values count at points, shape (k, 3), of a part: shape (k, n).

        Raises InputError: a point that is not in or on the part.
        """
        own = np.flatnonzero(self.part == self.names.index(name))
        corners = self.mesh.p[:, self.mesh.t[:, own]].transpose(2, 1, 0)
        local = np.einsum(
            "mab,kmb->kma",
            np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)),
            points_m[:, None] - corners[:, 0],
        )
        inside = np.minimum(local.min(axis=-1), 1 - local.sum(axis=-1))
        best = inside.argmax(axis=1)
        rows = np.arange(len(points_m))
        if (inside[rows, best] < -_OUTSIDE).any():
            raise InputError(f"a part is bonded to {name} where {name} is not; the sizes do not go together")
        elements, local = own[best], local[rows, best].T
        shape = np.array([self.basis.elem.lbasis(local, i)[0] for i in range(self.basis.Nbfun)])
        columns = self.basis.element_dofs[:, elements]
        return sparse.csr_matrix(
            (shape.ravel(), (np.tile(rows, len(shape)), columns.ravel())), (len(rows), self.basis.N)
        )

    def gradients(self, displacement_m: np.ndarray) -> np.ndarray:
        """∂u_a/∂x_b at the nodes of each tetrahedron, shape (3, 3, m, 10), from displacements, shape (3 n,)."""
        parts = displacement_m.reshape(3, -1)
        return np.array([np.asarray(self._at_nodes.interpolate(component).grad) for component in parts])

    @cached_property
    def _at_nodes(self) -> Basis:
        """The same shape functions, looked at in the nodes; its weights are of no use."""
        places = self.basis.elem.doflocs.T
        return Basis(self.mesh, ElementTetP2(), quadrature=(places, np.full(places.shape[1], 0.1)))

    def stress(self, displacement_m: np.ndarray, materials: Mapping[str, Material]) -> np.ndarray:
        """Stress at the nodes [Pa], shape (3, 3, n): mean over the tetrahedra that meet there."""
        gradient = self.gradients(displacement_m)
        strain = (gradient + gradient.transpose(1, 0, 2, 3)) / 2
        lam, mu = np.array([materials[name].lame_pa for name in self.groups]).T[:, self.part, None]
        stress = 2 * mu * strain + lam * np.trace(strain) * np.eye(3)[:, :, None, None]
        places = self.basis.element_dofs.T.ravel()
        count = np.bincount(places, minlength=self.basis.N)
        summed = [[np.bincount(places, stress[a, b].ravel(), self.basis.N) for b in range(3)] for a in range(3)]
        return np.array(summed) / count


def _bent(flat: MeshTet, part: np.ndarray, names: tuple[str, ...], holes: Sequence[Hole]) -> MeshTet2:
    """The mesh with quadratic edges, those on the holes' walls round."""
    mesh = MeshTet2.from_mesh(flat)
    places = mesh.doflocs.copy()
    corners = flat.p.shape[1]
    for hole in holes:
        own = np.unique(flat.t2e[:, part == names.index(hole.part)])
        ends = [np.linalg.norm(hole.from_axis_m(flat.p[:, flat.edges[end, own]].T), axis=1) for end in (0, 1)]
        wall = own[np.all(np.abs(np.array(ends) - hole.radius_m) < 1e-9, axis=0)]
        middle = places[:, corners + wall].T
        out = hole.from_axis_m(middle)
        out *= (hole.radius_m / np.linalg.norm(out, axis=1) - 1)[:, None]
        places[:, corners + wall] += out.T
    bent = MeshTet2(places, mesh.t, validate=False)
    size = bent.mapping().detDF(ElementTetP2().doflocs.T)
    if np.any(np.sign(size) != np.sign(size[:, :1])):
        raise InputError("a hole's wall bends an element over; expected a finer mesh or a thicker wall")
    return bent


def _product(a: int, b: int) -> BilinearForm:
    return BilinearForm(lambda u, v, w: u.grad[b] * v.grad[a])


def von_mises(stress: np.ndarray) -> np.ndarray:
    """Equivalent stress of tensors, shape (3, 3, ...)."""
    deviator = stress - np.trace(stress) / 3 * np.eye(3).reshape(3, 3, *[1] * (stress.ndim - 2))
    return np.sqrt(1.5 * np.einsum("ab...,ab...->...", deviator, deviator))


Bound = tuple[np.ndarray, sparse.csr_matrix, np.ndarray]
"""Nodes that follow others, shape (k,), each row of their displacements as weights of others', shape (k, n), and the
matrix that turns what they follow, shape (3, 3)."""


def constraints(nodes: int, bound: Sequence[Sequence[Bound]], fixed: np.ndarray) -> sparse.csr_matrix:
    """The matrix C of u = C q, shape (3 n, free unknowns).

    `nodes`: their number n. `bound`: in stages: nodes that others follow in one stage may follow others in a later one,
    not the other way round. `fixed`: which displacements are 0, shape (3, n).
    """
    whole = sparse.identity(3 * nodes, format="csr")
    for stage in bound:
        keep = np.ones(nodes)
        moved = [[sparse.csr_matrix((nodes, nodes)) for _ in range(3)] for _ in range(3)]
        for own, weights, turn in stage:
            keep[own] = 0
            put = sparse.csr_matrix((np.ones(len(own)), (own, np.arange(len(own)))), (nodes, len(own)))
            for a, b in np.argwhere(turn != 0):
                moved[a][b] = moved[a][b] + turn[a, b] * (put @ weights)
        whole = whole @ (sparse.bmat(moved, format="csr") + sparse.diags(np.tile(keep, 3)))
    used = np.asarray(abs(whole).sum(axis=0)).ravel() > 0
    return whole[:, np.flatnonzero(used & ~fixed.ravel())]


def solve(stiffness: sparse.csr_matrix, binding: sparse.csr_matrix, forces: np.ndarray) -> np.ndarray:
    """Displacements [m], shape (3 n, loads), under nodal forces [N], shape (3 n, loads).

    Factors of a symmetric matrix in the order of least degree; for these long, thin bodies they stay small.

    Raises InputError: parts that can move freely.
    """
    reduced = (binding.T @ stiffness @ binding).tocsc()
    given = binding.T @ forces
    try:
        factors = splu(reduced, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        free = factors.solve(given)
    except RuntimeError:
        free = np.full_like(given, np.nan)
    if not np.linalg.norm(reduced @ free - given) <= _LEFT_OVER * np.linalg.norm(given):
        raise InputError("the parts are not held: the stiffness has no inverse")
    return binding @ free
