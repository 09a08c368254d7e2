"""A contribution stands as it is unless much of it is noise; then the noise goes and what is plain stays. Errors of
channels compared by blocks of time. Commands that answer the gyroscope's noise look late although the rotors are
not.
"""

import numpy as np
import pytest

from rotorid.mismatch.evidence.comparison import growth
from rotorid.mismatch.evidence.rows import Contributions, Rows
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
    assert left.std() < 0.5 * 2.0 and left.std() < 0.5 * (2.0 * x).std()


def test_a_run_in_which_nothing_acts_is_given_next_to_nothing():
    lively = coloured(SIZE, 1.0, np.random.default_rng(1), pole=0.98)
    parts = contribution({"a": lively, "b": np.zeros(SIZE)}, 1.0)
    assert parts["b"].std() < 0.3 * 2.0
    assert parts["a"].std() == pytest.approx(2.0 * lively.std(), rel=0.2)


def test_a_stretch_too_short_to_filter_keeps_its_contribution():
    parts = contribution({"a": np.zeros(8)}, 1.0)
    assert len(parts["a"]) == 8 and np.isfinite(parts["a"]).all()


PER = 10


def parts(scale: float, blocks: int = 20, seed: int = 0) -> np.ndarray:
    """Residual (n, 12) of which the second channel is `scale` times noise of one sigma."""
    left = np.random.default_rng(seed).standard_normal((blocks * PER, 12))
    left[:, 1] *= scale
    return left


def test_a_channel_twice_as_large_has_grown_and_no_other():
    before = parts(1.0)
    after = before * np.array([1.0, 2.0, *[0.5] * 10])
    ratio, z = growth([before], [after], [np.ones(len(before), bool)], PER)
    assert np.allclose(ratio, [1.0, 2.0, 0.5, 0.5, 0.5, 0.5])
    assert (z > 2.0).tolist() == [False, True, False, False, False, False]


def test_only_masked_rows_count():
    before = parts(1.0)
    after = before.copy()
    after[: 10 * PER, 1] *= 5.0
    held = np.arange(len(before)) >= 10 * PER
    ratio, _ = growth([before], [after], [held], PER)
    assert np.allclose(ratio, 1.0)
    assert growth([before], [after], [~held], PER)[1][1] > 2.0


def test_one_bad_second_of_twenty_is_no_proof():
    before = parts(1.0)
    after = before.copy()
    after[:PER, 1] *= 8.0
    ratio, z = growth([before], [after], [np.ones(len(before), bool)], PER)
    assert ratio[1] > 1.1 and z[1] < 2.0


def test_too_short_a_part_says_nothing():
    before = parts(1.0, blocks=5)
    ratio, z = growth([before], [3 * before], [np.ones(len(before), bool)], PER)
    assert np.all(ratio == 1.0) and not z.any()
