"""From columns to even stretches: rates, holes, derived quantities and time offsets, by hand. Height without its
sensor's flutter. A velocity that an autopilot made from its accelerometer is distinguished from one that another
sensor measured.
"""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from rotorid.mismatch.evidence.motion import (
    Segment,
    analysis_rate_hz,
    build_segments,
    continuous,
    estimated_full_speed,
    fresh_samples,
    full_speed,
    made_from_accelerometer,
    own_rate_hz,
    quiet_height,
    rates_from_attitude,
    rotation_matrices,
    stretches,
)
from rotorid.recordings import Run
from tests.unit.mismatch.evidence.test_rows import still
from tests.unit.mismatch.flights import COLUMNS, GRAVITY, quad, recorded

RATE_HZ, CUTOFF_HZ = 200.0, 20.0


@pytest.fixture(scope="module")
def run() -> Run:
    return recorded(1).runs[0]


def without(run: Run, *sensors: str) -> Run:
    return replace(run, table=run.table.drop(columns=[n for s in sensors for n in COLUMNS[s]]))


def test_a_held_reading_counts_once():
    t = np.arange(1000) / 500.0
    assert own_rate_hz(t, np.repeat(np.sin(np.arange(200.0)), 5)) == pytest.approx(100.0)
    assert own_rate_hz(t, np.sin(np.arange(1000.0))) == pytest.approx(500.0)
    missing = np.where(np.arange(1000) % 4 == 0, np.sin(np.arange(1000.0)), np.nan)
    assert own_rate_hz(t, missing) == pytest.approx(125.0)


def test_a_constant_column_is_no_held_reading():
    assert fresh_samples(np.full(50, 7.0)).all()
    assert list(fresh_samples(np.array([1.0, np.nan, 2.0, 3.0, 3.0]))) == [True, False, True, True, True]


def test_a_quarter_turn_of_yaw_takes_forward_to_east():
    half = np.sqrt(0.5)
    (rotation,) = rotation_matrices(np.array([[half, 0.0, 0.0, half]]))
    np.testing.assert_allclose(rotation @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(rotation @ [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], atol=1e-15)


def test_quaternions_that_flip_their_sign_are_made_continuous():
    out = continuous(np.array([[1.0, 0, 0, 0], [-0.99, 0, 0, -0.1], [np.nan] * 4, [0.98, 0, 0, 0.15]]))
    np.testing.assert_allclose(out[:2, 0], [1.0, 0.99])
    assert np.isnan(out[2]).all() and out[3, 0] == 0.98


def test_rates_of_a_steady_turn():
    """A yaw of 0.3 rad/s: q = (cos 0.15 t, 0, 0, sin 0.15 t)."""
    t = np.array([0.0, 1.0, 4.0])
    q = np.stack([np.cos(0.15 * t), 0 * t, 0 * t, np.sin(0.15 * t)], axis=1)
    slope = 0.15 * np.stack([-np.sin(0.15 * t), 0 * t, 0 * t, np.cos(0.15 * t)], axis=1)
    np.testing.assert_allclose(rates_from_attitude(q, slope), [[0.0, 0.0, 0.3]] * 3, atol=1e-15)


def test_stretches_by_hand():
    assert stretches(np.array([True, True, False, True])) == [(0, 2), (3, 4)]
    assert stretches(np.zeros(3, bool)) == []


def test_throttle_scale_that_carries_the_weight():
    """At half throttle throughout, full throttle turns twice as fast as hover."""
    hover = np.sqrt(0.652 * GRAVITY / (4 * 1.3877e-6))
    assert estimated_full_speed(quad(), np.full((10, 4), 0.5)) == pytest.approx(2 * hover)


def test_the_slowest_needed_sensor_sets_the_cutoff(run):
    assert analysis_rate_hz((run,), quad(), 20.0) == (pytest.approx(200.0), 20.0)
    table = run.table.copy()
    for name in COLUMNS["gyroscope"]:
        table[name] = table[name].where(np.arange(len(table)) % 8 == 0)
    assert analysis_rate_hz((replace(run, table=table),), quad(), 20.0)[1] == pytest.approx(0.4 * 25.0)
    # Rotors that came four times a second, joined by a curve, hold nothing quicker; ten times a second they do.
    for rate_hz, cutoff_hz in ((4.0, 1.6), (10.0, 20.0)):
        joined = replace(run, joined_hz={"rotor_speed_1_rad_s": rate_hz})
        assert analysis_rate_hz((joined,), quad(), 20.0)[1] == pytest.approx(cutoff_hz)


def test_everything_recorded_is_read_as_it_is(run):
    (segment,) = build_segments(run, quad(), RATE_HZ, CUTOFF_HZ)
    motion = segment.motion
    index = np.round(motion.time_s * RATE_HZ).astype(int)
    np.testing.assert_allclose(motion.rotor_speed, run.array(COLUMNS["rotors"])[index])
    np.testing.assert_allclose(motion.specific_force, run.array(COLUMNS["accelerometer"])[index])
    assert segment.force_source == "accelerometer" and motion.accelerometer is motion.specific_force
    world = np.einsum("nij,nj->ni", motion.rotation, motion.velocity)
    np.testing.assert_allclose(world, run.array(COLUMNS["velocity"])[index], atol=1e-9)
    assert motion.height is None and motion.voltage is None and segment.command is None


def test_what_is_missing_is_derived_and_said_so(run):
    (full,) = build_segments(run, quad(), RATE_HZ, CUTOFF_HZ)
    (velocity,) = build_segments(without(run, "accelerometer"), quad(), RATE_HZ, CUTOFF_HZ)
    (position,) = build_segments(without(run, "accelerometer", "velocity", "gyroscope"), quad(), RATE_HZ, CUTOFF_HZ)
    assert (velocity.force_source, position.force_source) == ("velocity", "position")
    assert velocity.motion.accelerometer is None and velocity.kinematic_specific_force is None
    assert position.motion.gyroscope is None
    size = min(full.motion.size, position.motion.size)
    # Noise of the derived reading, but no bias and no scale: regression on the accelerometer's own gives one.
    measured, derived = full.motion.specific_force[:size, 2], velocity.motion.specific_force[:size, 2]
    assert np.polyfit(measured - measured.mean(), derived, 1)[0] == pytest.approx(1.0, abs=0.12)
    assert derived.mean() == pytest.approx(measured.mean(), abs=0.02)
    rates = position.motion.angular_velocity[:size] - full.motion.angular_velocity[:size]
    assert np.abs(rates.mean(axis=0)).max() < 0.01


def test_a_long_hole_splits_the_run_and_a_short_one_is_bridged(run):
    table = run.table.copy()
    name = COLUMNS["gyroscope"][0]
    table.loc[1000:1003, name] = np.nan
    (whole,) = build_segments(replace(run, table=table), quad(), RATE_HZ, CUTOFF_HZ)
    table.loc[2000:2040, name] = np.nan
    first, second = build_segments(replace(run, table=table), quad(), RATE_HZ, CUTOFF_HZ)
    assert first.motion.time_s[-1] < 10.0 < 10.2 < second.motion.time_s[0]
    assert whole.motion.time_s[-1] == second.motion.time_s[-1]


def test_a_shift_undoes_a_late_sensor():
    late = recorded(3, late_s={"gyroscope": 0.04}).runs[0]
    (truth,) = build_segments(recorded(3).runs[0], quad(), RATE_HZ, CUTOFF_HZ)
    (spoiled,) = build_segments(late, quad(), RATE_HZ, CUTOFF_HZ)
    (mended,) = build_segments(late, quad(), RATE_HZ, CUTOFF_HZ, shift_s={"gyroscope": 0.04})

    def difference(segment):
        both = np.intersect1d(np.round(truth.motion.time_s, 4), np.round(segment.motion.time_s, 4))
        a = truth.motion.angular_velocity[np.isin(np.round(truth.motion.time_s, 4), both)]
        b = segment.motion.angular_velocity[np.isin(np.round(segment.motion.time_s, 4), both)]
        return np.sqrt(np.mean((a - b) ** 2))

    # Two independent noises of 0.012 rad/s are left.
    assert difference(mended) == pytest.approx(0.012 * np.sqrt(2), rel=0.1)
    assert difference(spoiled) > 1.5 * difference(mended)


def test_throttle_is_a_command_by_the_upper_limit(run):
    table = run.table.copy()
    for i, name in enumerate(COLUMNS["rotors"], 1):
        table[f"throttle_{i}"] = table.pop(name) / 2500.0
    vehicle = quad(rotor_speed_limits_rad_s=[0, 2500])
    (segment,) = build_segments(replace(run, table=table), vehicle, RATE_HZ, CUTOFF_HZ)
    index = np.round(segment.motion.time_s * RATE_HZ).astype(int)
    np.testing.assert_allclose(segment.command, run.array(COLUMNS["rotors"])[index], rtol=1e-12)
    assert not segment.measured_speed and segment.motion.rotor_speed is segment.motion.rotor_speed


def test_height_from_the_ground_and_unknown_columns_kept(run):
    table = run.table.assign(payload_state=np.linspace(0, 1, len(run.table)))
    (segment,) = build_segments(Run("r", pd.DataFrame(table)), quad(ground_z_m=0.5), RATE_HZ, CUTOFF_HZ)
    # Less the flutter of the position, which is below a centimetre.
    np.testing.assert_allclose(segment.motion.height, 0.5 - segment.motion.position[:, 2], atol=0.01)
    assert list(segment.extra) == ["payload_state"] and len(segment.extra["payload_state"]) == segment.motion.size


def test_one_full_speed_for_all_runs(run):
    """Throttles of 0.4 and 0.6 in two runs: their mean square of 0.26 carries the weight, not each by itself."""
    names = [f"throttle_{i}" for i in range(1, 5)]
    runs = [Run(n, run.table.assign(**dict.fromkeys(names, u))) for n, u in (("a", 0.4), ("b", 0.6))]
    hover = np.sqrt(0.652 * GRAVITY / (4 * 1.3877e-6))
    assert full_speed(runs, quad()) == pytest.approx(hover / np.sqrt(0.26))
    assert full_speed(runs, quad(rotor_speed_limits_rad_s=[0, 2500])) == 2500.0
    assert full_speed([run], quad()) is None


DT_S = 0.004
TIME_S = DT_S * np.arange(2500)
TRUE_M = 0.5 - 0.4 * np.sin(0.6 * TIME_S) ** 2 + 0.005 * np.sin(20 * TIME_S)
CLIMB_M_S = np.gradient(TRUE_M, DT_S)


def noisy(size_m: float) -> np.ndarray:
    return TRUE_M + size_m * np.random.default_rng(0).standard_normal(len(TRUE_M))


def test_the_flutter_goes_and_what_moves_stays():
    """White noise of 8 mm at 250 Hz through 1 Hz: σ √(1 / (2 √π · 0.1325 s · 250 Hz)) = 0.74 mm."""
    left = quiet_height(noisy(0.008), CLIMB_M_S, DT_S) - TRUE_M
    assert left.std() == pytest.approx(0.00074, rel=0.35) and abs(left).max() < 0.004


def test_a_bias_of_the_climb_hardly_moves_it():
    """0.05 m/s too much of climb: the slow part takes it back, at the ends later by 0.11 s times the bias."""
    found = quiet_height(TRUE_M, CLIMB_M_S + 0.05, DT_S)
    np.testing.assert_allclose(found[250:-250], TRUE_M[250:-250], atol=2e-5)
    assert abs(found - TRUE_M).max() < 0.007


def test_without_a_climb_only_the_fast_goes():
    slow = 0.5 - 0.4 * np.sin(0.6 * TIME_S) ** 2
    np.testing.assert_allclose(quiet_height(slow, None, DT_S)[100:-100], slow[100:-100], atol=6e-4)


def test_holes_stay_holes():
    holed = noisy(0.0)
    holed[500:600] = np.nan
    found = quiet_height(holed, CLIMB_M_S, DT_S)
    assert np.isnan(found[500:600]).all()
    np.testing.assert_allclose(found[600:], TRUE_M[600:], atol=1e-4)
    assert np.isnan(quiet_height(np.full(9, np.nan), None, DT_S)).all()


READ_HZ, COUNT = 100.0, 6000


@pytest.mark.parametrize("integrated", [True, False])
def test_a_velocity_that_integrates_the_accelerometers_noise_is_no_second_witness(integrated):
    rng = np.random.default_rng(3)
    noise = 0.1 * rng.standard_normal((COUNT, 3))
    velocity = np.cumsum(noise, axis=0) / READ_HZ if integrated else 0.01 * rng.standard_normal((COUNT, 3))
    motion = replace(
        still(COUNT, time_s=np.arange(COUNT) / READ_HZ),
        accelerometer=noise,
        velocity=velocity,
        rotation=np.broadcast_to(np.eye(3), (COUNT, 3, 3)),
    )
    assert made_from_accelerometer([Segment("a", READ_HZ, motion, "accelerometer")], 20.0) == integrated
