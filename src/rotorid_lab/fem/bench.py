"""One leg of the bench and its load cell, meshed and solved, and what they say of the thesis's sentences (2.5.2).

Under a vertical load in the middle of plate D all legs do the same, turned by 120°, so one is enough: on the cut
through the plate displacements are those of the other cut, turned. Pieces A, B and C end on rectangles of the cells and
of the plate and follow them there (bonded contact). The order of the pieces: plate D, post C, upper cell, bracket B,
lower cell, foot A. Plate D is round with a round seat in its middle, on which the tube stands; a third of it belongs to
a leg.

The load cell is a bar with two holes across, joined by a slot (binocular bending beam), and its bridge of four gauges.
Own frame: x along the bar, from its middle to the end away from the vehicle, y the way of a positive force, z across.
Alone it is solved as it is calibrated (thesis fig. 2.32): one end clamped, the weight on the other.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
from scipy import sparse
from scipy.spatial import cKDTree

from rotorid.errors import InputError
from rotorid_lab.bench import Geometry, forces
from rotorid_lab.fem import elasticity, placement
from rotorid_lab.fem.elasticity import (
    Bound,
    Hole,
    LooseParts,
    Mesh,
    Pad,
    between,
    block,
    column,
    count,
    joined,
    mirrored,
    on,
    raised,
)
from rotorid_lab.fem.placement import LEGS, MATERIALS, THIRD, Assumed, Material, PartFrame, Sizes, materials

_CORNER = np.pi / 4
"""Angle about the hole's axis of the line from the hole to the corner of the block around it."""

_WALL = 1.5
"""Distance from the hole's axis to the end of that block, over half the bar's side."""
_NAME = "cell"
_UP = np.array([0.0, 0.0, -1.0])
_CELLS = ("upper cell", "lower cell")
_PIECES = ("A", "B", "C", "D")
DOWN = -_UP
_LEGS = len(placement.LEGS)
_GROUPS = dict.fromkeys(_CELLS, "cells") | dict.fromkeys(_PIECES, "pieces")
"""Material of each part."""
_PARTS = (*_CELLS, *_PIECES)
EVEN = 0.9
"""A plate moves evenly where its least displacement is at least this share of its largest."""
MIDDLE = 0.99
"""Its largest displacement is in its middle where the middle has at least this share of it."""
NEARLY = 0.1
"""Two stresses are nearly the same where they differ by at most this share."""


def _profile(sizes: Sizes, fineness: float) -> Mesh:
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


def mesh(sizes: Sizes, fineness: float) -> Mesh:
    """The bar in its own frame."""
    across = np.linspace(-0.5, 0.5, count(1, fineness) + 2) * sizes.cell_side_m
    return raised(_profile(sizes, fineness), across)


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


def _holes(name: str, sizes: Sizes, frame: PartFrame) -> list[Hole]:
    """The two holes of the cell `name` with this own frame."""
    reach = sizes.cell_between_holes_m / 2
    return [
        Hole(name, frame.origin_m + side * frame.axes[0], frame.axes[2], sizes.hole_radius_m)
        for side in (-reach, reach)
    ]


def _gauge_strains(body: LooseParts, name: str, sizes: Sizes, frame: PartFrame, moved_m: np.ndarray) -> np.ndarray:
    """Strain of the four gauges of the cell `name`, shape (4,): change of length of each grid over its length.

    `frame`: the cell's own. `moved_m`: displacements of all nodes [m], shape (n, 3).
    """
    first, last = (
        body.weights(frame.origin_m + ends @ frame.axes, name) @ moved_m @ frame.axes[0]
        for ends in _gauge_ends_m(sizes)
    )
    return (last - first) / sizes.gauge_length_m


def _bridge_strain(strains: np.ndarray) -> float:
    """What a full bridge makes of its four gauges: the mean of their strains, each with its sign."""
    return float(_GAUGE_SIGNS @ strains / len(_GAUGE_SIGNS))


def strain_per_newton(sizes: Sizes, material: Material, fineness: float) -> float:
    """Strain of the bridge per newton across the free end [1/N]."""
    frame = PartFrame(np.zeros(3), np.eye(3))
    body = LooseParts.of({_NAME: mesh(sizes, fineness)}, _holes(_NAME, sizes, frame))
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
    return _bridge_strain(_gauge_strains(body, _NAME, sizes, frame, moved.reshape(3, -1).T))


def build(assumed: Assumed, sizes: Sizes, distances_m: Mapping[str, float], fineness: float) -> Bench:
    """One leg in frame {T} (z down, origin on top of plate D), with all that binds it.

    `assumed`: for the area that bears the load. `sizes`: all other sizes. `distances_m`: table 2.3, by name [m].
    `fineness`: elements along each line, as a multiple of the coarsest mesh. InputError: sizes that do not go together.
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
    frames = {}
    for name, place in zip(_CELLS, (upper, lower), strict=True):
        axes = np.stack([place.axis, place.sense, np.cross(place.axis, place.sense)])
        frames[name] = PartFrame(place.force_m + sizes.cell_between_pads_m / 2 * place.axis, axes)
    frames["D"] = PartFrame(np.zeros(3), placement.turn(np.arctan2(under[1], under[0])).T)
    parts = {
        **{name: mesh(sizes, fineness).put(frames[name]) for name in _CELLS},
        "A": column("A", base, held, counts),
        "B": column("B", leaves, arrives, counts),
        "C": column("C", hung, top, counts),
        "D": _mesh(sizes, assumed.pressed_area_m2, fineness).put(frames["D"]),
    }
    bonds = (
        ("A", "lower cell", held),
        ("B", "upper cell", leaves),
        ("B", "lower cell", arrives),
        ("C", "upper cell", hung),
        ("C", "D", top),
    )
    walls = [hole for name in _CELLS for hole in _holes(name, sizes, frames[name])]
    return Bench(frames, bonds, base, sizes, LooseParts.of(parts, walls, _GROUPS))


def _other_end(place: placement.Place, sizes: Sizes) -> np.ndarray:
    return place.force_m + sizes.cell_between_pads_m * place.axis


def _mesh(sizes: Sizes, area_m2: float, fineness: float) -> Mesh:
    """Plate D between -60° and +60° about the x axis; z points down, the plate's top is at 0."""
    n = count(2, fineness)  # elements along each side of the rhombus in the middle
    # Radius of the corners of the polygon that has just the area which bears the load.
    seat_m = float(np.sqrt(2 * area_m2 / (6 * n * np.sin(2 * np.pi / (6 * n)))))
    core, whole = _flat(seat_m, sizes.plate_radius_m, n, count(4, fineness))
    plate = raised(whole, np.linspace(sizes.plate_thickness_m, 0, count(1, fineness) + 1))
    seat = raised(core, np.linspace(0, -sizes.boss_height_m, count(1, fineness) + 1))
    return joined([plate, seat])


def _flat(seat_m: float, rim_m: float, n: int, rings: int) -> tuple[Mesh, Mesh]:
    """The seat alone and the whole, from above, with n elements along each side of the rhombus in the middle."""
    i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
    larger = np.maximum(np.maximum(i, j), 1)
    share = np.maximum(i, j) / n
    angle = THIRD / 2 * np.where(i >= j, j / larger - 1, 1 - i / larger)
    round_ = seat_m * share[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    ends = seat_m * np.array([[np.cos(THIRD / 2), -np.sin(THIRD / 2)], [np.cos(THIRD / 2), np.sin(THIRD / 2)]])
    straight = (i[..., None] * ends[0] + j[..., None] * ends[1]) / n
    weight = share[..., None] ** 2
    core = block(weight * round_ + (1 - weight) * straight)
    radii = np.geomspace(seat_m, rim_m, rings + 1)
    angles = np.linspace(-THIRD / 2, THIRD / 2, 2 * n + 1)
    ring = block(np.stack([np.outer(radii, np.cos(angles)), np.outer(radii, np.sin(angles))], axis=-1))
    return core, joined([core, ring])


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

    frames: Mapping[str, PartFrame]
    """Own frames of the cells and of plate D."""
    bonds: tuple[tuple[str, str, Pad], ...]
    """A piece, the part whose surface its end follows, and that end."""
    base: Pad
    """Fixed to the table."""
    sizes: Sizes
    body: LooseParts

    @cached_property
    def binding(self) -> sparse.csr_matrix:
        """Bonds, the cut through the plate and the table, as the matrix of `elasticity.constraints`."""
        nodes = self.body.nodes_m
        bonds = []
        for piece, part, pad in self.bonds:
            own = self.body.nodes_of(piece)
            own = own[on(pad, nodes[own])]
            bonds.append((own, self.body.weights(nodes[own], part), np.eye(3)))
        fixed = np.zeros((3, len(nodes)), bool)
        foot = self.body.nodes_of("A")
        fixed[:, foot[on(self.base, nodes[foot])]] = True
        axis, cut = self._cut()
        fixed[:2, axis] = True
        return elasticity.constraints(len(nodes), [bonds, [cut]], fixed)

    def _cut(self) -> tuple[np.ndarray, Bound]:
        """Nodes on the axis, and those on one face of the cut, which follow those on the other, turned."""
        nodes = self.body.nodes_m
        plate = self.body.nodes_of("D")
        frame = self.frames["D"]
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
        return axis, (last, weights, matrix)

    @cached_property
    def seat(self) -> np.ndarray:
        """Facets that bear the load."""
        height = -self.sizes.boss_height_m
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
        return _gauge_strains(self.body, name, self.sizes, self.frames[name], solved.displacement_m)

    def narrow(self, name: str) -> np.ndarray:
        """Nodes of a cell's narrow sections: within the middle third of the walls above and below the holes."""
        frame = self.frames[name]
        nodes = self.body.nodes_of(name)
        own = np.abs((self.body.nodes_m[nodes] - frame.origin_m) @ frame.axes.T)
        off_hole = np.abs(own[:, 0] - self.sizes.cell_between_holes_m / 2)
        return nodes[(off_hole < self.sizes.hole_radius_m / 2) & (own[:, 1] > self.sizes.hole_radius_m / 2)]


def _ask(bench: Bench, solved: Solved, cell_strain: float, geometry: Geometry) -> dict[str, float | str]:
    """The answers of a solved bench per newton of load, downwards in the middle of plate D.

    `deformation_m` and `stress_pa`: largest displacement [m/N] and equivalent stress [Pa/N], `deformed_most` and
    `stressed_most` the parts where they are; `narrow_upper_pa` and `narrow_lower_pa`: largest stress in the narrow
    sections of a cell [Pa/N]; `plate_evenness` and `plate_middle`: least displacement of plate D, and that of its
    middle, over its largest; `force_upper_n` and `force_lower_n`: what a cell reads by its calibration `cell_strain`
    (strain of a single cell's bridge [1/N]), positive as in eqs 2.3 to 2.8; `equation_n`: vertical force by eq. 2.8
    from all six readings [N/N], where the load itself is +1. `geometry` is table 2.3.
    """
    body = bench.body
    moved = np.linalg.norm(solved.displacement_m, axis=1)
    part = np.array(body.names)[body.part_of_node]
    plate = body.nodes_of("D")
    middle = plate[np.hypot(*body.nodes_m[plate, :2].T) < 1e-9]
    narrow = [float(solved.von_mises_pa[bench.narrow(name)].max()) for name in _CELLS]
    read = [_bridge_strain(bench.gauge_strains(solved, name)) / cell_strain for name in _CELLS]
    six = np.empty(6)
    for numbers in LEGS:
        six[np.array(numbers) - 1] = read
    return {
        "deformation_m": float(moved.max()),
        "deformed_most": str(part[moved.argmax()]),
        "stress_pa": float(solved.von_mises_pa.max()),
        "stressed_most": str(part[solved.von_mises_pa.argmax()]),
        "narrow_upper_pa": narrow[0],
        "narrow_lower_pa": narrow[1],
        "plate_evenness": float(moved[plate].min() / moved[plate].max()),
        "plate_middle": float(moved[middle].max() / moved[plate].max()),
        "force_upper_n": read[0],
        "force_lower_n": read[1],
        "equation_n": float(forces(six, geometry)[2]),
    }


def by_part(bench: Bench, solved: Solved) -> dict[str, dict[str, float]]:
    """Largest displacement [m/N] and equivalent stress [Pa/N] of each part."""
    moved = np.linalg.norm(solved.displacement_m, axis=1)
    return {
        name: {"deformation_m": float(moved[own].max()), "stress_pa": float(solved.von_mises_pa[own].max())}
        for name in _PARTS
        for own in [bench.body.nodes_of(name)]
    }


Answers = Mapping[str, Mapping[str, float | str]]
"""What `_ask` gives, by the material of the pieces."""


def solve(
    assumed: Assumed, sizes: Sizes, moduli_pa: Mapping[str, float], geometry: Geometry, fineness: float
) -> tuple[Bench, float, dict[str, Solved], Answers]:
    """A bench on a mesh of this fineness, its cells' calibration [1/N], and by material how it is solved and what it
    answers."""
    bench = build(assumed, sizes, geometry, fineness)
    of = {name: materials(sizes, moduli_pa, name) for name in MATERIALS}
    cell_strain = strain_per_newton(sizes, of["PLA"]["cells"], fineness)
    solved = {name: bench.solve(of[name]) for name in MATERIALS}
    return bench, cell_strain, solved, {name: _ask(bench, solved[name], cell_strain, geometry) for name in MATERIALS}


def ratios(found: Answers) -> dict[str, float]:
    """PLA over aluminium: of the largest deformation, the largest stress, and the stress in the narrow sections [1]."""
    metal, plastic = (found[name] for name in MATERIALS)
    return {
        name.removesuffix("_m").removesuffix("_pa"): plastic[name] / metal[name]
        for name in ("deformation_m", "stress_pa", "narrow_upper_pa", "narrow_lower_pa")
    }


def judge_statements(table: pd.DataFrame) -> list[dict]:
    """Each sentence: whether it holds with all sizes as assumed, on how many benches it `holds`, and what follows.

    `table`: a bench a row, the first with all sizes as assumed; columns `ratio_deformation`, `ratio_narrow_upper`,
    `ratio_narrow_lower`; `plate_evenness`, `plate_middle` and `stressed_most` with `_aluminium` and with `_pla`.
    """
    even = table["plate_evenness_aluminium"] >= EVEN
    middle = (table["plate_middle_pla"] >= MIDDLE) & (table["plate_evenness_pla"] < table["plate_evenness_aluminium"])
    held = {
        "PLA deforms more than aluminium": table["ratio_deformation"] > 1,
        "aluminium's piece D deforms evenly": even,
        "PLA's piece D deforms most in its middle, and less evenly": middle,
        "the largest stresses lie in different pieces": table["stressed_most_aluminium"] != table["stressed_most_pla"],
        "the stress in an upper cell's narrow section is nearly the same": _nearly(table["ratio_narrow_upper"]),
        "the stress in a lower cell's narrow section is nearly the same": _nearly(table["ratio_narrow_lower"]),
    }
    return [
        {
            "statement": name,
            "on_assumed": bool(holds.iloc[0]),
            "holds": int(holds.sum()),
            "benches": len(holds),
            "word": "follows" if holds.all() else "depends on the assumed sizes" if holds.any() else "does not follow",
        }
        for name, holds in held.items()
    ]


def _nearly(ratio: pd.Series) -> pd.Series:
    return (ratio - 1).abs() <= NEARLY
