"""Problems with a known answer, solved by the same code as the bench: a cantilever, and a plate with a round hole."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rotorid.identify.fem import elasticity
from rotorid.identify.fem.elasticity import Body, Hole
from rotorid.identify.fem.sizes import Material
from rotorid.identify.fem.tets import block, count, stacked

BEAM = Material(68.9e9, 0.0)
"""Without contraction across, for which beam theory's clamped end is exact."""
PLATE = Material(68.9e9, 0.33)
FINENESSES = (1.0, 2.0, 4.0)


@dataclass(frozen=True)
class Checked:
    """A computed number and the closed form's."""

    case: str
    quantity: str
    """With its unit."""
    fineness: float
    nodes: int
    computed: float
    closed_form: float

    @property
    def error(self) -> float:
        """Difference as a share of the closed form."""
        return self.computed / self.closed_form - 1


def cantilever(fineness: float, length_m: float = 0.08, side_m: float = 0.01, force_n: float = 1.0) -> list[Checked]:
    """A clamped square bar with a force across its free end: deflection there and stress halfway.

    Deflection of a beam with shear, F l³ / (3 E I) + 6 F l / (5 G A); stress F (l/2) (h/2) / I.
    """
    across = np.linspace(0, side_m, count(1, fineness) + 1)
    profile = block(np.stack(np.meshgrid(across, across, indexing="ij"), axis=-1))
    along = np.linspace(0, length_m, 2 * count(4, fineness) + 1)
    layers = np.stack([np.c_[np.full(len(profile.points_m), x), profile.points_m] for x in along])
    body = Body.of({"beam": stacked(layers, profile.triangles)})
    materials = {"beam": BEAM}
    nodes = body.nodes_m
    end = body.mesh.facets_satisfying(lambda x: x[0] > length_m - 1e-9, boundaries_only=True)
    load = body.traction(end, np.array([0.0, 0.0, force_n]))
    binding = elasticity.constraints(len(nodes), [], np.tile(nodes[:, 0] < 1e-9, (3, 1)))
    moved = elasticity.solve(body.stiffness(materials), binding, load[:, None])[:, 0]
    stress = body.stress(moved, materials)[0, 0]
    inertia = side_m**4 / 12
    middle = np.argmin(np.abs(nodes - [length_m / 2, side_m / 2, 0.0]).sum(axis=1))
    tip = np.argmin(np.abs(nodes - [length_m, side_m / 2, side_m / 2]).sum(axis=1))
    shear = 1.2 * force_n * length_m / (BEAM.lame_pa[1] * side_m**2)
    deflection = force_n * length_m**3 / (3 * BEAM.modulus_pa * inertia) + shear
    return [
        Checked("cantilever", "deflection (m)", fineness, len(nodes), float(moved.reshape(3, -1)[2, tip]), deflection),
        Checked(
            "cantilever",
            "stress (Pa)",
            fineness,
            len(nodes),
            float(stress[middle]),
            force_n * (length_m - nodes[middle, 0]) * side_m / 2 / inertia,
        ),
    ]


def plate_with_hole(fineness: float, radius_m: float = 0.005, pull_pa: float = 1e6) -> list[Checked]:
    """A quarter of a plate under tension along x, with Kirsch's displacements on a circle of four radii.

    Plane strain, so that the contraction counts; stress at the hole across the tension is 3 times the tension, along it
    -1 times (Kirsch 1898).
    """
    angles = np.linspace(0, np.pi / 2, count(4, fineness) + 1)
    radii = np.geomspace(radius_m, 4 * radius_m, count(3, fineness) + 1)
    profile = block(np.stack([np.outer(radii, np.cos(angles)), np.outer(radii, np.sin(angles))], axis=-1))
    flat = profile.points_m
    layers = np.stack([np.c_[flat, np.full(len(flat), z)] for z in (0, radius_m / 2)])
    up = np.array([0.0, 0.0, 1.0])
    holes = [Hole("plate", np.zeros(3), up, scale * radius_m) for scale in (1, 4)]
    body = Body.of({"plate": stacked(layers, profile.triangles)}, holes)
    materials = {"plate": PLATE}
    nodes = body.nodes_m
    known = np.hypot(nodes[:, 0], nodes[:, 1]) > 4 * radius_m - 1e-9
    given = np.zeros((3, len(nodes)))
    given[:2, known] = kirsch_displacement_m(nodes[known, :2], radius_m, pull_pa, PLATE).T
    fixed = np.stack([known | (nodes[:, 0] < 1e-9), known | (nodes[:, 1] < 1e-9), np.ones(len(nodes), bool)])
    stiffness = body.stiffness(materials)
    binding = elasticity.constraints(len(nodes), [], fixed)
    moved = given.ravel() + elasticity.solve(stiffness, binding, -(stiffness @ given.reshape(-1, 1)))[:, 0]
    stress = body.stress(moved, materials)
    above = np.flatnonzero(np.hypot(nodes[:, 0], nodes[:, 1] - radius_m) < 1e-9)
    edge = np.flatnonzero(np.hypot(nodes[:, 0] - radius_m, nodes[:, 1]) < 1e-9)
    return [
        Checked("plate with a hole", name, fineness, len(nodes), float(component[at].mean()), factor * pull_pa)
        for name, component, at, factor in (
            ("stress across (Pa)", stress[0, 0], above, 3.0),
            ("stress along (Pa)", stress[1, 1], edge, -1.0),
        )
    ]


def kirsch_displacement_m(places_m: np.ndarray, radius_m: float, pull_pa: float, material: Material) -> np.ndarray:
    """Displacement [m], shape (k, 2), in an endless plate with a hole under tension along x, plane strain."""
    mu, kappa = material.lame_pa[1], 3 - 4 * material.poisson
    r, angle = np.hypot(*places_m.T) / radius_m, np.arctan2(places_m[:, 1], places_m[:, 0])
    scale = pull_pa * radius_m / (8 * mu)
    two = np.cos(2 * angle)
    outwards = scale * (r * (kappa - 1 + 2 * two) + 2 / r * (1 + (kappa + 1) * two) - 2 / r**3 * two)
    round_ = scale * (-2 * r + 2 / r * (1 - kappa) - 2 / r**3) * np.sin(2 * angle)
    c, s = np.cos(angle), np.sin(angle)
    return np.stack([outwards * c - round_ * s, outwards * s + round_ * c], axis=-1)


def all_checks() -> list[Checked]:
    """Every problem on every mesh."""
    return [row for case in (cantilever, plate_with_hole) for fineness in FINENESSES for row in case(fineness)]
