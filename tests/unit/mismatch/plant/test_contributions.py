"""A contribution stands as it is unless much of it is noise; then the noise goes and what is plain stays."""

import numpy as np
import pytest

from rotorid.mismatch.plant.contributions import Contributions
from rotorid.mismatch.plant.rows import Rows
from tests.unit.mismatch.synthetic import coloured

RATE_HZ = 50.0
SIZE = 4000


def rows_of(columns: dict[str, np.ndarray]) -> list[Rows]:
    """One stretch per run with one column in the first channel."""
    out = []
    for run, column in columns.items():
        x = np.zeros((len(column), 12, 1))
        x[:, 0, 0] = column
        out.append(Rows(run, np.arange(len(column)) / RATE_HZ, np.zeros((len(column), 12)), x))
    return out


def contribution(truth: dict[str, np.ndarray], noise: float, beta: float = 2.0) -> dict[str, np.ndarray]:
    """What is made of columns seen through white noise, per run."""
    rng = np.random.default_rng(5)
    seen = {run: x + noise * rng.standard_normal(len(x)) for run, x in truth.items()}
    again = {run: x + noise * rng.standard_normal(len(x)) for run, x in seen.items()}
    parts = Contributions(rows_of(seen), rows_of(again), RATE_HZ).of(np.array([0]), np.array([beta]))
    return {run: part[:, 0] for run, part in zip(truth, parts, strict=True)}


def test_without_noise_a_contribution_is_column_times_coefficient():
    x = coloured(SIZE, 1.0, np.random.default_rng(1), pole=0.98)
    parts = Contributions(rows_of({"a": x})).of(np.array([0]), np.array([2.0]))
    assert np.array_equal(parts[0][:, 0], 2.0 * x)
    assert np.array_equal(contribution({"a": x}, 0.0)["a"], 2.0 * x)


def test_a_slow_contribution_is_cleared_of_white_noise():
    """Signal of one sigma below 0.2 Hz under white noise of one sigma: next to nothing of either is left over."""
    x = coloured(SIZE, 1.0, np.random.default_rng(1), pole=0.98)
    left = contribution({"a": x}, 1.0)["a"] - 2.0 * x
    assert left.std() < 0.5 * 2.0
    assert left.std() < 0.5 * (2.0 * x).std()


def test_a_run_in_which_nothing_acts_is_given_next_to_nothing():
    lively = coloured(SIZE, 1.0, np.random.default_rng(1), pole=0.98)
    parts = contribution({"a": lively, "b": np.zeros(SIZE)}, 1.0)
    assert parts["b"].std() < 0.3 * 2.0
    assert parts["a"].std() == pytest.approx(2.0 * lively.std(), rel=0.2)


def test_a_stretch_too_short_to_filter_keeps_its_contribution():
    parts = contribution({"a": np.zeros(8)}, 1.0)
    assert len(parts["a"]) == 8 and np.isfinite(parts["a"]).all()
