"""Meshes of tetrahedra made of layers: a triangulated profile that is moved along a path.

Plates, columns and bars with holes across need no mesh generator; the usual ones need libraries of a desktop
(docs/decisions/0008-finite-elements.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from rotorid.errors import InputError
from rotorid.identify.fem.placement import PartFrame

_FLATTEST = 0.05
"""Volume that a column's element must have at least, as a share of the usual one: flatter ones spoil the stress."""


@dataclass(frozen=True)
class Tets:
    """A mesh of tetrahedra."""

    points_m: np.ndarray
    """Corners [m], shape (n, 3)."""
    cells: np.ndarray
    """Indices of the corners of each tetrahedron, shape (m, 4)."""

    def put(self, frame: PartFrame) -> Tets:
        """The same mesh in the frame in which its own is `frame`."""
        return Tets(frame.origin_m + self.points_m @ frame.axes, self.cells)


@dataclass(frozen=True)
class Flat:
    """A triangulated profile."""

    points_m: np.ndarray
    """Corners [m], shape (n, 2)."""
    triangles: np.ndarray
    """Indices, shape (t, 3)."""


def count(coarsest: int, fineness: float) -> int:
    """Elements along a line that has `coarsest` in the coarsest mesh, `fineness` 1."""
    return int(np.ceil(coarsest * fineness - 1e-9))


def block(points_m: np.ndarray) -> Flat:
    """A grid of points, shape (rows, columns, 2), each of its quadrilaterals cut in two along the shorter diagonal."""
    rows, columns = points_m.shape[:2]
    index = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    flat = points_m.reshape(-1, 2)
    through_ac = np.sum((flat[a] - flat[c]) ** 2, 1) <= np.sum((flat[b] - flat[d]) ** 2, 1) * (1 + 1e-9)
    first = np.where(through_ac[:, None], np.c_[a, b, c], np.c_[a, b, d])
    second = np.where(through_ac[:, None], np.c_[a, c, d], np.c_[b, c, d])
    return Flat(flat, np.r_[first, second])


def between(inner_m: np.ndarray, outer_m: np.ndarray, layers: int) -> Flat:
    """Layers between two polylines of equally many points, shape (n, 2) each."""
    share = np.linspace(0, 1, layers + 1)[:, None, None]
    return block((1 - share) * inner_m + share * outer_m)


def joined(parts: Sequence[Flat], tolerance_m: float = 1e-9) -> Flat:
    """Profiles as one, points within the tolerance of each other made one."""
    points = np.concatenate([part.points_m for part in parts])
    starts = np.cumsum([0] + [len(part.points_m) for part in parts[:-1]])
    triangles = np.concatenate([part.triangles + start for part, start in zip(parts, starts, strict=True)])
    near = cKDTree(points).query_ball_point(points, tolerance_m)
    kept, back = np.unique([min(same) for same in near], return_inverse=True)
    return Flat(points[kept], back[triangles])


def mirrored(part: Flat, axis: int) -> Flat:
    """The profile with the sign of one coordinate turned."""
    sign = np.ones(2)
    sign[axis] = -1
    return Flat(part.points_m * sign, part.triangles)


def stacked(layers_m: np.ndarray, triangles: np.ndarray) -> Tets:
    """Tetrahedra between copies of a profile.

    Parameters
    ----------
    layers_m
        Its points in each layer [m], shape (layers + 1, n, 3).
    triangles
        Indices into one layer, shape (t, 3).

    Each prism is cut into three by the order of its corners' indices, so that neighbours agree on the diagonal of the
    face between them (Dompierre et al. 1999).
    """
    n = layers_m.shape[1]
    a, b, c = np.sort(triangles, axis=1).T
    prism = np.concatenate([np.c_[a, b, c, c + n], np.c_[a, b, b + n, c + n], np.c_[a, a + n, b + n, c + n]])
    steps = np.arange(len(layers_m) - 1) * n
    return Tets(layers_m.reshape(-1, 3), (prism + steps[:, None, None]).reshape(-1, 4))


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


def column(name: str, start: Pad, stop: Pad, counts: tuple[int, int, int]) -> Tets:
    """A bent column from one rectangle to another: each of its fibres is a cubic that leaves and arrives along `way`.

    Parameters
    ----------
    name
        Of the piece, for the message.
    counts
        Elements along the first side, the second side and the column.

    Raises
    ------
    InputError
        The column folds over itself.
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
    if not _upright(layers, profile.triangles):
        raise InputError(f"piece {name} folds over itself with these sizes; expected pads further apart or smaller")
    return stacked(layers, profile.triangles)


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
