"""The bench's model: statics, symmetry, materials; and the signal chain of a cell."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rotorid_acquire.io.wire import GAIN, REFERENCE_V
from rotorid_lab.fem import studies
from rotorid_lab.fem.bench import DOWN, build, judge_statements, solve, strain_per_newton
from rotorid_lab.fem.elasticity import on
from rotorid_lab.fem.placement import Material, materials, read_assumed
from rotorid_lab.fem.studies import counts_per_newton, printed_slope, volts_per_newton
from tests.refusals import refused

ROOT = Path(__file__).parents[4]


@pytest.fixture(scope="module")
def bench(assumed, geometry):
    return build(assumed, assumed.sizes, geometry, 1.0)


@pytest.fixture(scope="module")
def answers(assumed, moduli, geometry):
    return solve(assumed, assumed.sizes, moduli, geometry, 1.0)[-1]


def test_the_load_lies_on_the_printed_area_and_a_third_of_it_on_the_leg(bench, assumed) -> None:
    assert 3 * bench.body.area_m2(bench.seat) == pytest.approx(assumed.pressed_area_m2, rel=1e-9)
    assert assumed.pressed_area_m2 * 52.9e3 == pytest.approx(0.9575 * 9.80665, rel=1e-3)


def test_the_table_bears_the_leg_share_of_the_load(bench, assumed, moduli) -> None:
    """Reactions at the foot, from the stiffness: a third of the load, upwards."""
    of = materials(assumed.sizes, moduli, "PLA")
    moved = bench.solve(of).displacement_m.T.ravel()
    forces = (bench.body.stiffness(of) @ moved).reshape(3, -1)
    foot = bench.body.nodes_of("A")
    base = foot[on(bench.base, bench.body.nodes_m[foot])]
    assert len(base) > 4
    assert forces[2, base].sum() == pytest.approx(-DOWN[2] / 3, rel=1e-8)


def test_the_cut_through_the_plate_is_turned_into_itself(bench, assumed, moduli) -> None:
    moved = bench.solve(materials(assumed.sizes, moduli, "PLA")).displacement_m
    axis, (nodes, weights, turn) = bench._cut()
    assert len(axis) > 2 and len(nodes) > 10
    np.testing.assert_allclose(moved[nodes], weights @ moved @ turn.T, atol=1e-15)
    assert np.abs(moved[axis, :2]).max() < 1e-15 < moved[axis, 2].min()


def test_an_unlike_material_moves_what_it_must(answers) -> None:
    metal, plastic = answers["Al-6061"], answers["PLA"]
    assert plastic["deformation_m"] > 2 * metal["deformation_m"]
    assert plastic["plate_evenness"] < metal["plate_evenness"] < 1
    # A weight presses against the positive direction.
    assert metal["force_lower_n"] < 0 and plastic["force_lower_n"] < 0


def test_deformation_is_inverse_to_all_moduli_and_stress_is_not(bench) -> None:
    soft, hard = (
        bench.solve({"cells": Material(factor * 60e9, 0.33), "pieces": Material(factor * 2e9, 0.36)})
        for factor in (1, 2)
    )
    np.testing.assert_allclose(soft.displacement_m, 2 * hard.displacement_m, rtol=1e-6, atol=1e-16)
    np.testing.assert_allclose(soft.von_mises_pa, hard.von_mises_pa, rtol=1e-5, atol=1e-3)


def test_finer_meshes_agree_better(assumed, moduli, geometry) -> None:
    table, *_ = studies.mesh_study(assumed, moduli, geometry, (1.0, 1.5))
    for name in ("ratio_deformation", "ratio_narrow_lower", "equation_n_pla"):
        assert table[name].iloc[1] == pytest.approx(table[name].iloc[0], rel=0.03)


def test_loads_are_lines_through_nothing(answers) -> None:
    table = studies.loads(answers, [100.0, 200.0], 177.5e-6)
    assert table["pressure_pa"].iloc[0] == pytest.approx(0.980665 / 177.5e-6)
    for name in table:
        assert table[name].iloc[1] == pytest.approx(2 * table[name].iloc[0])


def test_a_cell_bends_as_four_hinges_do(assumed, moduli) -> None:
    """F d / 4 in each ligament gives the strain 3 F d / (2 E b t²) at its thinnest; a grid of 3 mm averages less."""
    sizes = replace(assumed.sizes, gauge_length_m=1e-3)
    cell = materials(sizes, moduli, "PLA")["cells"]
    for ligament in (1e-3, 1.5e-3):
        thin = replace(sizes, cell_ligament_m=ligament)
        hinge = 1.5 * sizes.cell_between_holes_m / (cell.modulus_pa * sizes.cell_side_m * ligament**2)
        assert 0.7 < strain_per_newton(thin, cell, 1.5) / hinge < 1.0


def test_volts_and_counts_by_hand(assumed) -> None:
    """500 µε at 5 V and a gauge factor of 2 are 5 mV."""
    volts = volts_per_newton(replace(assumed.sizes, excitation_v=5.0, gauge_factor=2.0), 500e-6)
    assert volts == pytest.approx(5e-3)
    assert counts_per_newton(volts) == pytest.approx(5e-3 / (2 * REFERENCE_V / GAIN) * (2**23 - 1))
    assert printed_slope(volts) == pytest.approx(1 / 500 / 9.80665e-3)
    assert printed_slope(printed_slope(volts)) == pytest.approx(volts)


def test_the_ligament_that_gives_a_sensitivity_does(assumed, moduli) -> None:
    found = studies.ligament_for(assumed.sizes, moduli, 1e-4, 1.0)
    again = studies.sensitivity(replace(assumed.sizes, cell_ligament_m=found), moduli, 1.0)
    assert again["volts_per_n"] == pytest.approx(1e-4, rel=0.03)
    refused("no ligament", studies.ligament_for, assumed.sizes, moduli, 1.0, 1.0)


def test_every_assumed_size_makes_a_bench_at_its_ends(assumed, geometry) -> None:
    for name, end, sizes in assumed.variants():
        assert build(assumed, sizes, geometry, 1.0).binding.shape[1] > 1000, (name, end)


def test_a_plate_that_meets_the_cells_is_refused(assumed, geometry) -> None:
    refused("plate_thickness_mm", build, assumed, replace(assumed.sizes, plate_thickness_m=0.02), geometry, 1.0)
    refused("plate_radius_mm", build, assumed, replace(assumed.sizes, plate_radius_m=0.03), geometry, 1.0)
    refused("do not fit", build, assumed, replace(assumed.sizes, cell_between_holes_m=0.08), geometry, 1.0)


@pytest.mark.parametrize(
    ("line", "wrong", "sentence"),
    [
        ("cell_slot_mm: [2.0, 1.0, 4.0]", "cell_slot_mm: [2.0, 3.0, 4.0]", "0 < low <= assumed <= high"),
        ("cell_slot_mm: [2.0, 1.0, 4.0]", "cell_slot_mm: 2.0", "expected \\[assumed, low, high\\]"),
        ("cell_slot_mm:", "cell_slit_mm:", "cell_slit_mm is no size"),
        ("pressed_area_mm2: 177.5", "pressed_area_mm2: 0", "pressed_area_mm2 is 0"),
    ],
)
def test_wrong_sizes_get_one_sentence(line, wrong, sentence, tmp_path) -> None:
    text = (ROOT / "workflow/bench_sizes.yaml").read_text(encoding="utf-8")
    assert line in text
    path = tmp_path / "sizes.yaml"
    path.write_text(text.replace(line, wrong), encoding="utf-8")
    refused(sentence, read_assumed, path)


def row(**changed):
    """A bench on which every statement holds."""
    held = {
        "ratio_deformation": 6.0, "ratio_narrow_upper": 1.05, "ratio_narrow_lower": 0.95,
        "plate_evenness_aluminium": 0.95, "plate_evenness_pla": 0.8, "plate_middle_pla": 1.0,
        "stressed_most_aluminium": "C", "stressed_most_pla": "lower cell",
    }  # fmt: skip
    return held | changed


@pytest.mark.parametrize(
    ("number", "changed"),
    [
        (0, {"ratio_deformation": 0.9}), (1, {"plate_evenness_aluminium": 0.85}), (2, {"plate_middle_pla": 0.9}),
        (3, {"stressed_most_pla": "C"}), (4, {"ratio_narrow_upper": 1.2}), (5, {"ratio_narrow_lower": 0.8}),
    ],
)  # fmt: skip
def test_a_statement_follows_depends_or_does_not(number, changed) -> None:
    held, not_held = row(), row(**changed)
    for rows, word in (
        ([held, held], "follows"),
        ([held, not_held], "depends on the assumed sizes"),
        ([not_held, not_held], "does not follow"),
    ):
        judged = judge_statements(pd.DataFrame(rows))[number]
        assert judged["word"] == word and judged["on_assumed"] == (rows[0] is held)
