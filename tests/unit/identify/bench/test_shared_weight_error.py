"""The error of one weight, from what it leaves in every cell alike."""

import numpy as np
import pytest

from rotorid.errors import InputError
from rotorid.identify.bench.loadcell import balance_disagreement, shared_weight_error

WEIGHTS = np.array([100.0, 200.0, 300.0, 400.0, 500.0, 600.0])
WITH_IT = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 1.0])


def readings(errors_gf: dict[int, float]) -> dict[int, np.ndarray]:
    """What cells with slopes 40, 41, ... read when the weight is off by so much on each."""
    return {cell: (WEIGHTS + error * WITH_IT - 0.1 * cell) / (39 + cell) for cell, error in errors_gf.items()}


def test_an_error_seen_by_every_cell_is_recovered() -> None:
    found = shared_weight_error(WEIGHTS, readings({1: -0.3, 2: -0.3, 3: -0.3}), WITH_IT)
    assert found.mean_gf == pytest.approx(-0.3, abs=1e-9)
    assert found.interval_95_gf == pytest.approx((-0.3, -0.3), abs=1e-9)


def test_the_interval_is_students_over_the_cells() -> None:
    # Mean -0.2, standard deviation 0.1, three cells: half width 4.30265 * 0.1 / sqrt(3) = 0.24841.
    found = shared_weight_error(WEIGHTS, readings({1: -0.3, 2: -0.2, 3: -0.1}), WITH_IT)
    assert found.by_cell_gf == pytest.approx((-0.3, -0.2, -0.1), abs=1e-9)
    assert found.interval_95_gf == pytest.approx((-0.44841, 0.04841), abs=1e-5)


def test_a_weight_in_every_load_cannot_be_told() -> None:
    with pytest.raises(InputError, match="part of some loads and not of others"):
        shared_weight_error(WEIGHTS, readings({1: 0.0, 2: 0.0}), np.ones(6))


def test_the_balances_are_compared_where_both_weighed(tmp_path) -> None:
    path = tmp_path / "weights.csv"
    path.write_text("element,ohaus_gf,mettler_gf,average_gf\na,101,99,100\nb,202,200,201\nc,50,,50\n")
    # (2 / 100 + 2 / 201) / 2
    assert balance_disagreement(path) == pytest.approx(0.0149751, abs=1e-7)
