"""Eqs 2.3 to 2.9 with tables 2.2 and 2.3, against numbers done by hand."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from rotorid_lab.bench import (
    GF_N,
    PULLED,
    Geometry,
    cell_forces,
    cell_variance,
    force_covariance,
    force_matrix,
    forces,
    input_components,
    moments,
    read_geometry,
)
from rotorid_lab.bench_tests import lateral_as_vertical
from rotorid_lab.loadcell import fit_line
from tests.refusals import refused

TABLE = Path(__file__).parents[4] / "raw" / "thesis" / "table_2_3.csv"
GEOMETRY = read_geometry(TABLE)


def test_table_2_3_in_metres() -> None:
    assert GEOMETRY["L"] == pytest.approx(0.225) and GEOMETRY["D_246z"] == pytest.approx(0.050457916)


def test_input_components_by_hand() -> None:
    # Table 2.2 for a cell force of 1 N: 1/cos 60° = 2, 1/(cos 30° cos 45°) = 1.63299, 1/cos 45° = 1.41421.
    one = input_components(np.ones((1, 6)))
    assert one["f_1x"] == pytest.approx([2.0]) and one["f_2x"] == pytest.approx([1.6329932])
    assert one["f_1y"] == pytest.approx([1.1547005]) and one["f_2y"] == pytest.approx([2.8284271])
    assert one["f_4y"] == one["f_2z"] == pytest.approx([1.4142136])
    assert "f_4x" not in one and "f_3y" not in one and "f_1z" not in one


def test_one_newton_on_cell_1_by_hand() -> None:
    # ΣMx = 21.2 mm / cos 30° = 24.479651 mm, ΣMy = 21.2 mm × 2 = 42.4 mm, so
    # Fx = −42.4/225 = −0.1884444, Fy = 24.479651/225 = 0.1087984, Fz = −|1|.
    cells = np.array([[1.0, 0, 0, 0, 0, 0]])
    sums = moments(cells, GEOMETRY)
    assert sums[0, :2] == pytest.approx([0.024479651, 0.0424], rel=1e-6)
    # ΣMz = 2 × 64.08698 − 1.1547005 × 9.026285 mm
    assert sums[0, 2] == pytest.approx(0.12817396 - 0.010422656, rel=1e-6)
    assert forces(cells, GEOMETRY)[0] == pytest.approx([-0.1884444, 0.1087984, -1.0], rel=1e-6)


def test_one_newton_on_cell_2_by_hand() -> None:
    # f_2x = 1.6329932, f_2y = 2.8284271, f_2z = 1.4142136
    # ΣMy = −1.6329932 × 50.457916 + 1.4142136 × 68.585472 = −82.397434 + 96.994504 = 14.597070 mm
    # ΣMx = 2.8284271 × 50.457916 + 1.4142136 × 22.541324 = 142.716538 + 31.878246 = 174.594784 mm
    found = forces(np.array([[0, 1.0, 0, 0, 0, 0]]), GEOMETRY)[0]
    assert found == pytest.approx([-0.06487587, 0.77597682, -1.4142136], rel=1e-6)


def test_cells_1_3_5_count_with_their_absolute_value_along_z() -> None:
    pushed = forces(np.array([[-1.0, 0, 0, 0, 0, 0]]), GEOMETRY)[0]
    assert pushed == pytest.approx([0.1884444, -0.1087984, -1.0], rel=1e-6)
    lowered = forces(np.array([[0, 0, 0, -1.0, 0, 0]]), GEOMETRY)[0]
    assert lowered[2] == pytest.approx(1.4142136)


def test_a_lateral_load_becomes_vertical_by_absolute_values() -> None:
    answer = np.zeros((6, 3))  # V/N; lines of 1 N/V
    answer[[0, 2, 4], 0] = -0.5, 0.5, 0.25  # along x cells 1, 3 and 5 are bent, with signs
    answer[1, 1] = 1.0  # along y cell 2 alone, which pulls at 45 degrees
    line = SimpleNamespace(a0=3.0, a1=1 / (1e5 * GF_N))
    found = lateral_as_vertical(SimpleNamespace(response_v_n=answer), [line] * 6, GEOMETRY)
    assert found["x"] == pytest.approx({"force_z_n": -1.25, "absolute_n": -1.25})
    assert found["y"] == pytest.approx({"force_z_n": -np.sqrt(2), "absolute_n": 0.0})


def forces_by_matrix(cells_n: np.ndarray, geometry: Geometry) -> np.ndarray:
    """Eq. 2.9: the same as `forces`, by the matrix; N, shape (n, 3)."""
    force = cells_n @ force_matrix(geometry).T
    force[..., 2] -= np.abs(cells_n[..., PULLED]).sum(axis=-1)
    return force


def test_the_matrix_of_eq_2_9_is_the_same_as_the_equations() -> None:
    cells = np.random.default_rng(2).normal(0, 3, (50, 6))
    assert forces_by_matrix(cells, GEOMETRY) == pytest.approx(forces(cells, GEOMETRY), abs=1e-12)


def test_volts_to_newtons_by_hand() -> None:
    # a0 = 0.5 gf, a1 = 40 gf per 1e-5 V: 2e-5 V are 80.5 gf = 0.78943533 N.
    coefficients = np.array([[0.5, 40.0]] * 6)
    found = cell_forces(np.full((1, 6), 2e-5), coefficients)
    assert found == pytest.approx(np.full((1, 6), 80.5 * GF_N))
    assert found[0, 0] == pytest.approx(0.78943533, rel=1e-7)


def test_propagated_uncertainty_is_that_of_repeated_draws() -> None:
    rng = np.random.default_rng(4)
    weights = np.array([50.0, 100, 250, 500, 750, 950])
    volts, noise_v = np.array([[-5e-5, 3e-5, 4e-5, 6e-5, 4e-5, 3e-5]]), 2e-7

    def lines():
        return [fit_line((weights + rng.normal(0, 5, 6)) / 40, weights) for _ in range(6)]

    fixed = lines()
    cells = cell_forces(volts, np.array([[line.a0, line.a1] for line in fixed]))
    variance = cell_variance(volts, fixed, np.full(6, noise_v**2))
    stated = np.sqrt(np.diagonal(force_covariance(cells, variance, GEOMETRY), axis1=1, axis2=2))[0]
    drawn = []
    for _ in range(4000):
        shifted = np.array([rng.multivariate_normal([line.a0, line.a1], line.covariance) for line in fixed])
        drawn.append(forces(cell_forces(volts + rng.normal(0, noise_v, 6), shifted), GEOMETRY)[0])
    assert np.std(drawn, axis=0) == pytest.approx(stated, rel=0.05)


def test_a_missing_distance_is_named(tmp_path) -> None:
    table = tmp_path / "t.csv"
    table.write_text("distance,value_mm\nD_1x,9\n")
    refused(r"t\.csv: the distance D_2x is missing", read_geometry, table)
