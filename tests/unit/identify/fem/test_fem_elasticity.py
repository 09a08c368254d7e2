"""The solver against closed forms, exact solutions and statics."""

import numpy as np
import pytest

from rotorid_lab.fem import elasticity
from rotorid_lab.fem.elasticity import LooseParts, Pad, block, column, stacked
from rotorid_lab.fem.placement import Material
from rotorid_lab.fem.studies import FINENESSES, cantilever, kirsch_displacement_m, plate_with_hole
from tests.refusals import refused

STEEL = Material(200e9, 0.3)


def box(size, counts, at=(0.0, 0.0, 0.0)):
    """A box of tetrahedra."""
    x, y, z = (np.linspace(0, length, number + 1) for length, number in zip(size, counts, strict=True))
    profile = block(np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1))
    layers = np.stack([np.c_[profile.points_m, np.full(len(profile.points_m), height)] for height in z])
    return stacked(layers + np.array(at), profile.cells)


def held(body, fixed, given):
    """Displacements, shape (3, n), where those of `fixed` nodes are `given`."""
    stiffness = body.stiffness({name: STEEL for name in body.groups})
    start = np.where(fixed, given, 0.0)
    binding = elasticity.constraints(body.basis.N, [], np.tile(fixed, (3, 1)))
    moved = elasticity.solve(stiffness, binding, -(stiffness @ start.reshape(-1, 1)))[:, 0]
    return start + moved.reshape(3, -1)


def test_tetrahedra_fill_a_box_and_share_their_faces() -> None:
    mesh = box((2.0, 1.0, 3.0), (3, 2, 4))
    a, b, c, d = (mesh.points_m[mesh.cells[:, k]] for k in range(4))
    volumes = np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6
    assert np.abs(volumes).sum() == pytest.approx(6.0)
    faces = np.sort(mesh.cells[:, [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]].reshape(-1, 3), axis=1)
    kinds, times = np.unique(faces, axis=0, return_counts=True)
    assert set(times) == {1, 2}
    outside = mesh.points_m[kinds[times == 1]]
    area = np.linalg.norm(np.cross(outside[:, 1] - outside[:, 0], outside[:, 2] - outside[:, 0]), axis=1).sum() / 2
    assert area == pytest.approx(2 * (2 + 6 + 3))


def test_pure_bending_is_exact() -> None:
    """Quadratic elements hold the quadratic displacements of a bent bar, contraction across included."""
    body = LooseParts.of({"bar": box((0.3, 0.1, 0.1), (3, 2, 2))})
    x, y, z = body.nodes_m.T
    bend, nu = 0.01, STEEL.poisson
    exact = bend * np.array([x * z, -nu * y * z, (-(x**2) - nu * (z**2 - y**2)) / 2])
    outside = np.isin(np.arange(body.basis.N), body.basis.get_dofs(body.mesh.boundary_facets()).flatten())
    assert 0 < outside.sum() < body.basis.N
    moved = held(body, outside, exact)
    np.testing.assert_allclose(moved, exact, atol=1e-12)
    stress = body.stress(moved.ravel(), {"bar": STEEL})
    np.testing.assert_allclose(stress[0, 0], STEEL.modulus_pa * bend * z, atol=1.0)
    np.testing.assert_allclose(elasticity.von_mises(stress), np.abs(stress[0, 0]), atol=10.0)


@pytest.mark.parametrize(("counts", "tolerance"), [((2, 2, 2), 1e-9), ((3, 3, 2), 0.01), ((4, 4, 3), 0.01)])
def test_bonded_boxes_stretch_as_one(counts, tolerance) -> None:
    """Exact where the meshes meet, and nearly where they do not: nodes that follow a surface load it in points."""
    upper, lower = box((1.0, 1.0, 1.0), counts, (0.0, 0.0, 1.0)), box((1.0, 1.0, 1.0), (2, 2, 2))
    body = LooseParts.of({"lower": lower, "upper": upper})
    nodes = body.nodes_m
    own = body.nodes_of("upper")
    own = own[np.abs(nodes[own, 2] - 1) < 1e-9]
    bond = (own, body.weights(nodes[own], "lower"), np.eye(3))
    fixed = np.stack([np.abs(nodes[:, axis]) < 1e-9 for axis in range(3)])
    top = body.mesh.facets_satisfying(lambda x: x[2] > 2 - 1e-9, boundaries_only=True)
    assert body.area_m2(top) == pytest.approx(1.0)
    pull = 2e5
    load = body.traction(top, np.array([0.0, 0.0, pull]))
    binding = elasticity.constraints(len(nodes), [[bond]], fixed)
    stiffness = body.stiffness({"lower": STEEL, "upper": STEEL})
    moved = elasticity.solve(stiffness, binding, load[:, None])[:, 0].reshape(3, -1)
    above = nodes[:, 2] > 2 - 1e-9
    assert moved[2, above].mean() == pytest.approx(2 * pull / STEEL.modulus_pa, rel=tolerance)
    side = above & (nodes[:, 0] > 1 - 1e-9)
    assert moved[0, side].mean() == pytest.approx(-STEEL.poisson * pull / STEEL.modulus_pa, rel=3 * tolerance)


def test_what_is_not_held_is_refused() -> None:
    body = LooseParts.of({"box": box((1.0, 1.0, 1.0), (1, 1, 1))})
    free = elasticity.constraints(body.basis.N, [], np.zeros((3, body.basis.N), bool))
    refused("not held", elasticity.solve, body.stiffness({"box": STEEL}), free, np.ones((3 * body.basis.N, 1)))


def test_a_point_off_the_part_is_refused() -> None:
    body = LooseParts.of({"box": box((1.0, 1.0, 1.0), (1, 1, 1))})
    assert body.weights(np.array([[0.2, 0.3, 1.0]]), "box").sum() == pytest.approx(1.0)
    refused("box is not", body.weights, np.array([[0.2, 0.3, 1.2]]), "box")


def test_a_column_that_folds_is_refused() -> None:
    start = Pad(np.zeros(3), np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]), (1.0, 1.0))
    stop = Pad(np.array([0.1, 0.0, 0.1]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, -1.0]), (1.0, 1.0))
    refused("piece B folds", column, "B", start, stop, (2, 2, 4))


@pytest.mark.parametrize(
    ("case", "finest"),
    [
        (cantilever, {"deflection (m)": 0.0005, "stress (Pa)": 0.005}),
        (plate_with_hole, {"stress across (Pa)": 0.005, "stress along (Pa)": 0.04}),
    ],
)
def test_closed_forms_are_met_ever_better(case, finest) -> None:
    errors = {name: [] for name in finest}
    for fineness in FINENESSES:
        for row in case(fineness):
            errors[row["quantity"]].append(abs(row["error"]))
    for name, found in errors.items():
        assert found == sorted(found, reverse=True)
        assert found[-1] < finest[name], name
        assert found[-1] < found[-2] / 2


def test_kirschs_displacements_leave_the_hole_free() -> None:
    """Differences of the displacements themselves: no stress across the wall, three times the pull along it."""
    radius, pull, step = 0.01, 1e6, 1e-7
    lam, mu = STEEL.lame_pa
    for angle, along in ((np.pi / 2, 3 * pull), (0.0, -pull)):
        place = radius * np.array([np.cos(angle), np.sin(angle)])
        gradient = np.stack(
            [
                (
                    kirsch_displacement_m((place + way)[None], radius, pull, STEEL)
                    - kirsch_displacement_m((place - way)[None], radius, pull, STEEL)
                )[0]
                / (2 * step)
                for way in step * np.eye(2)
            ],
            axis=-1,
        )
        strain = (gradient + gradient.T) / 2
        stress = 2 * mu * strain + lam * np.trace(strain) * np.eye(2)
        out = np.array([np.cos(angle), np.sin(angle)])
        round_ = np.array([-out[1], out[0]])
        assert out @ stress @ out == pytest.approx(0.0, abs=1e-3 * pull)
        assert round_ @ stress @ round_ == pytest.approx(along, rel=1e-3)
