"""The calibration line against hand-computed numbers and the thesis's tables; the error of one weight."""

from pathlib import Path

import numpy as np
import pytest

from rotorid.errors import InputError
from rotorid_lab.loadcell import (
    balance_disagreement,
    check_weights,
    fit_line,
    read_calibration_table,
    shared_weight_error,
)
from tests.refusals import refused

THESIS = Path(__file__).parents[4] / "raw" / "thesis"

# Least squares on tables 2.6 and 2.7 as printed, from the project's map of the thesis.
EXPECTED_A1 = [39.7564, 37.2655, 40.8995, 39.9265, 42.4705, 39.4702]
EXPECTED_A0 = [-0.0743, -0.3463, 0.1056, 0.0245, 0.1179, 0.0856]
# Six loads, and those that one element is part of.
WEIGHTS = np.array([100.0, 200.0, 300.0, 400.0, 500.0, 600.0])
WITH_IT = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 1.0])


def test_a_line_by_hand() -> None:
    # x = 0, 1, 2, y = 0, 1, 3: slope 3/2, intercept -1/6, residuals 1/6, -1/3, 1/6, variance 1/6 on 1 degree.
    fit = fit_line([0, 1, 2], [0, 1, 3])
    assert fit.a1 == pytest.approx(1.5) and fit.a0 == pytest.approx(-1 / 6)
    assert fit.residuals == pytest.approx((1 / 6, -1 / 3, 1 / 6))
    assert fit.residual_sd == pytest.approx(np.sqrt(1 / 6))
    assert fit.residual_rms == pytest.approx(np.sqrt(1 / 18))
    assert fit.r == pytest.approx(3 / np.sqrt(2 * 14 / 3))
    assert fit.covariance[1][1] == pytest.approx(1 / 12)
    assert fit.covariance[0][0] == pytest.approx(1 / 6 * (1 / 3 + 1 / 2))
    assert fit.covariance[0][1] == pytest.approx(-1 / 12)
    # Student's t for 97.5 % and one degree of freedom is 12.7062.
    half = 12.7062 / np.sqrt(12)
    assert fit.interval(1) == pytest.approx((1.5 - half, 1.5 + half), rel=1e-5)


def test_intervals_cover_the_truth_as_often_as_they_say() -> None:
    rng = np.random.default_rng(3)
    x = np.linspace(1, 24, 8)
    hits = 0
    for _ in range(2000):
        low, high = fit_line(x, 0.1 + 40 * x + rng.normal(0, 0.15, 8)).interval(1)
        hits += low < 40 < high
    assert 0.935 < hits / 2000 < 0.965


def test_the_thesis_s_table_gives_the_expected_coefficients() -> None:
    weights, readings = read_calibration_table(THESIS / "table_2_7.csv")
    fits = [fit_line(readings[cell], weights) for cell in range(1, 7)]
    assert [round(fit.a1, 4) for fit in fits] == EXPECTED_A1
    assert [round(fit.a0, 4) for fit in fits] == EXPECTED_A0
    assert 0.07 < min(fit.residual_rms for fit in fits)
    assert max(fit.residual_rms for fit in fits) < 0.16
    assert all(fit.r > 0.999999 for fit in fits)


def test_the_combinations_weigh_what_their_elements_do() -> None:
    assert check_weights(THESIS / "table_2_6.csv", THESIS / "table_2_7.csv") < 1e-9


def test_messages(tmp_path: Path) -> None:
    refused("needs at least 3 pairs, found 2 readings and 2 values", fit_line, [1, 2], [1, 2])
    refused("all readings are equal", fit_line, [1, 1, 1], [1, 2, 3])
    (tmp_path / "t.csv").write_text("a,b\n1,2\n")
    refused("expected the columns weight_gf and cell_1", read_calibration_table, tmp_path / "t.csv")


def readings_off_by(errors_gf: dict[int, float]) -> dict[int, np.ndarray]:
    """What cells with slopes 40, 41, ... read when the weight is off by so much on each."""
    return {cell: (WEIGHTS + error * WITH_IT - 0.1 * cell) / (39 + cell) for cell, error in errors_gf.items()}


def test_an_error_seen_by_every_cell_is_recovered() -> None:
    mean, interval, _ = shared_weight_error(WEIGHTS, readings_off_by({1: -0.3, 2: -0.3, 3: -0.3}), WITH_IT)
    assert mean == pytest.approx(-0.3, abs=1e-9)
    assert interval == pytest.approx((-0.3, -0.3), abs=1e-9)


def test_the_interval_is_students_over_the_cells() -> None:
    # Mean -0.2, standard deviation 0.1, three cells: half width 4.30265 * 0.1 / sqrt(3) = 0.24841.
    _, interval, by_cell = shared_weight_error(WEIGHTS, readings_off_by({1: -0.3, 2: -0.2, 3: -0.1}), WITH_IT)
    assert by_cell == pytest.approx((-0.3, -0.2, -0.1), abs=1e-9)
    assert interval == pytest.approx((-0.44841, 0.04841), abs=1e-5)


def test_a_weight_in_every_load_cannot_be_told() -> None:
    with pytest.raises(InputError, match="part of some loads and not of others"):
        shared_weight_error(WEIGHTS, readings_off_by({1: 0.0, 2: 0.0}), np.ones(6))


def test_the_balances_are_compared_where_both_weighed(tmp_path) -> None:
    path = tmp_path / "weights.csv"
    path.write_text("element,ohaus_gf,mettler_gf,average_gf\na,101,99,100\nb,202,200,201\nc,50,,50\n")
    # (2 / 100 + 2 / 201) / 2
    assert balance_disagreement(path) == pytest.approx(0.0149751, abs=1e-7)
