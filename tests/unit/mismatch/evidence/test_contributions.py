"""A contribution stands as it is unless much of it is noise; then the noise goes and what is plain stays. Errors of
channels compared by blocks of time. Commands that answer the gyroscope's noise look late although the rotors are
not.
"""

from dataclasses import replace

import numpy as np
import pytest

from rotorid.mismatch.evidence.comparison import growth
from rotorid.mismatch.evidence.rows import Contributions, Rows
from rotorid.mismatch.flight.prepare import prepare
from rotorid.mismatch.flight.wrench import closed_loop_bias_s
from tests.unit.mismatch.flights import quad, recorded
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


GAIN_N_M_S = 0.1
NOISE_RAD_S = 0.02
HOVER_RAD_S = 1000.0


def loop(moving_rad_s: float) -> tuple[list, list]:
    """Segments, and copies with more noise, of a hover whose roll command is −GAIN (motion + noise)."""
    vehicle, rng = quad(), np.random.default_rng(3)
    prepared = prepare(recorded(1, flight={"duration_s": 15.0}))
    per_n_m = -np.sign(vehicle.rotor_positions_m()[:, 1]) / (4 * 0.0884 * 1.3877e-6)
    plain, again = [], []
    for s in prepared.segments:
        smooth = np.convolve(rng.standard_normal(len(s.motion.time_s) + 20), np.ones(20) / np.sqrt(20), "valid")
        noise, more = NOISE_RAD_S * rng.standard_normal((2, len(s.motion.time_s)))
        motion = moving_rad_s * smooth[: len(noise)]
        moment = -GAIN_N_M_S * (motion + noise)
        command = np.sqrt(HOVER_RAD_S**2 + moment[:, None] * per_n_m)
        for out, rate in ((plain, motion + noise), (again, motion + noise + more)):
            body = np.stack([rate, 0 * rate, 0 * rate], axis=1)
            out.append(replace(s, command=command, motion=replace(s.motion, angular_velocity=body)))
    return plain, again


def test_a_loop_that_does_nothing_but_answer_noise_looks_late_by_inertia_over_gain():
    late = closed_loop_bias_s(*loop(0.0), quad(), 20.0)
    assert late == pytest.approx(2.489e-3 / GAIN_N_M_S, rel=0.15)


def test_a_loop_that_mostly_turns_the_vehicle_does_not():
    assert closed_loop_bias_s(*loop(20 * NOISE_RAD_S), quad(), 20.0) < 0.15 * 2.489e-3 / GAIN_N_M_S


def test_without_commands_there_is_no_echo():
    plain, again = ([replace(s, command=None) for s in part] for part in loop(0.0))
    assert closed_loop_bias_s(plain, again, quad(), 20.0) == 0.0
