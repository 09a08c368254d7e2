"""Rows of the regression by hand: rotor-level physics, both sides filtered alike, columns of believed values.
Empirical terms: which flights could tell them from effects with a name. Which errors of sensors the comparison
with another sensor estimates alone.
"""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.signal import upfirdn
from scipy.spatial.transform import Rotation

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import Contribution, Motion
from rotorid.effects.instant import Instants
from rotorid.mismatch.decide.selected import coefficients
from rotorid.mismatch.evidence.motion import Segment
from rotorid.mismatch.evidence.rows import (
    Thinner,
    assemble,
    at_centre,
    baseline_wrench,
    compared_alone,
    form_columns,
    offset_columns,
    project,
    residual,
    value_columns,
)
from rotorid.mismatch.evidence.unknowns import can_show
from rotorid.mismatch.flight.prepare import prepare
from rotorid.mismatch.flight.wrench import wrench_model
from rotorid.recordings import columns as c
from tests.unit.effects.flown import STEP_S, audit_vehicle, commands, motions, segment, start
from tests.unit.mismatch.flights import recorded, with_table
from tests.unit.vehicle.thesis import thesis_vehicle

ARM, CF, CQ, MASS = 0.0884, 1.3877e-6, 1.8558e-8, 0.652


def still(count: int = 1, **changes) -> Motion:
    """At rest with every rotor at 1000 rad/s."""
    zero = np.zeros((count, 3))
    values = dict(
        time_s=np.arange(count) / 100.0,
        rotor_speed=np.full((count, 4), 1000.0),
        angular_velocity=zero,
        angular_acceleration=zero,
        specific_force=np.tile([0.0, 0.0, -4 * CF * 1e6 / MASS], (count, 1)),
        rotation=np.tile(np.eye(3), (count, 1, 1)),
        velocity=zero,
    )
    return Motion(**(values | changes))


def one(motion: Motion, source: str = "accelerometer", **sources) -> Segment:
    return Segment("run", 100.0, motion, source, **sources)


def test_the_baseline_of_unequal_rotors_by_hand():
    """A faster front right rotor (1): more thrust, rolls left (−), pitches up (+), yaws right (+, ccw)."""
    motion = still(rotor_speed=np.array([[1100.0, 1000.0, 1000.0, 1000.0]]))
    force, arm, torque = baseline_wrench(motion, thesis_vehicle())
    extra = CF * (1100.0**2 - 1000.0**2)
    np.testing.assert_allclose(force, [[0, 0, -4 * CF * 1e6 - extra]], rtol=1e-12)
    np.testing.assert_allclose(arm, [[-extra * ARM, extra * ARM, 0]], rtol=1e-9)
    np.testing.assert_allclose(torque, [[0, 0, CQ * (1100.0**2 - 1000.0**2)]], rtol=1e-9)


def test_the_hub_of_a_turning_vehicle_moves_by_v_plus_omega_cross_r():
    """Yawing at 2 rad/s, flying forward at 3 m/s: the front right hub (d, d) has v = (3 − 2 d, 2 d, 0)."""
    motion = still(velocity=np.array([[3.0, 0, 0]]), angular_velocity=np.array([[0, 0, 2.0]]))
    hubs = Instants(motion, thesis_vehicle()).hub_velocity
    np.testing.assert_allclose([hubs[0, j][0] for j in range(3)], [3 - 2 * ARM, 2 * ARM, 0], rtol=1e-12)
    np.testing.assert_allclose([hubs[2, j][0] for j in range(3)], [3 + 2 * ARM, -2 * ARM, 0], rtol=1e-12)


def test_drag_at_the_hubs_damps_yaw_and_drag_at_the_centre_does_not():
    """k ω = 0.1 N s/m a rotor. Yaw at 2 rad/s: each hub feels 0.1 · 2 · √2 d at arm √2 d: M = −4 · 0.4 d²."""
    forms = {f.name: f for f in catalogue()["rotor_drag"].forms(thesis_vehicle())}
    motion = still(velocity=np.array([[3.0, 0, 0]]), angular_velocity=np.array([[0, 0, 2.0]]))
    hubs = forms["at the hubs"].contribution(motion, thesis_vehicle(), np.array([1e-4]))
    np.testing.assert_allclose(hubs.force, [[-1.2, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(hubs.moment, [[0, 0, -1.6 * ARM**2]], atol=1e-12)
    centre = forms["at the centre of mass"].contribution(motion, thesis_vehicle(), np.array([1e-4]))
    np.testing.assert_allclose(centre.force, [[-1.2, 0, 0]], atol=1e-12)
    assert centre.moment is None


def test_axial_inflow_damps_roll_by_its_own_coefficient():
    """Roll at 1 rad/s: hubs on the right go down at d m/s and gain k ω d: M_x = −4 k ω d²."""
    form = catalogue()["axial_inflow"].forms(thesis_vehicle())[0]
    motion = still(angular_velocity=np.array([[1.0, 0, 0]]))
    added = form.contribution(motion, thesis_vehicle(), np.array([8e-5]))
    np.testing.assert_allclose(added.force, 0.0, atol=1e-12)
    np.testing.assert_allclose(added.moment, [[-4 * 0.08 * ARM**2, 0, 0]], atol=1e-12)


def test_a_wind_is_taken_from_the_velocity_in_body_axes():
    quarter = np.array([[[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]])  # nose to the east
    motion = still(velocity=np.array([[5.0, 0, 0]]), rotation=quarter, wind=np.array([2.0, 5.0, 0.0]))
    np.testing.assert_allclose(motion.air_velocity, [[0.0, 2.0, 0.0]], atol=1e-12)


def test_the_residual_is_measured_minus_believed():
    """A push of 0.5 N to the right and a roll of 10 rad/s² that no rotor makes."""
    motion = still(angular_acceleration=np.array([[10.0, 0, 0]]))
    pushed = replace(motion, specific_force=motion.specific_force + [0.0, 0.5 / MASS, 0.0])
    left = residual(one(pushed), thesis_vehicle())
    np.testing.assert_allclose(left["force"], [[0, 0.5, 0]], atol=1e-12)
    np.testing.assert_allclose(left["moment"], [[10 * 2.489e-3, 0, 0]], atol=1e-12)
    assert set(left) == {"force", "moment"}


def test_a_known_place_of_the_accelerometer_is_taken_out():
    """0.1 m forward, yawing at 3 rad/s with 20 rad/s²: a_x = −0.9, a_y = +2 m/s² too much."""
    vehicle = thesis_vehicle(accelerometer_position_m=(0.1, 0, 0))
    motion = still(angular_velocity=np.array([[0, 0, 3.0]]), angular_acceleration=np.array([[0, 0, 20.0]]))
    read = replace(motion, specific_force=motion.specific_force + [-0.9, 2.0, 0.0])
    np.testing.assert_allclose(at_centre(one(read), vehicle), motion.specific_force, atol=1e-12)
    # Derived from velocity there is no lever arm.
    np.testing.assert_allclose(at_centre(one(read, "velocity"), vehicle), read.specific_force)


def test_errors_of_sensors_reach_force_and_moment_through_mass_and_inertia():
    motion = still(angular_velocity=np.array([[0, 2.0, 0]]))
    error = Contribution(
        specific_force=np.array([[0.3, 0, 0]]),
        angular_velocity=np.array([[0.1, 0, 0]]),
        angular_acceleration=np.array([[0, 0, 4.0]]),
    )
    groups = ("force", "moment", "accelerometer", "gyroscope")
    added = project(error, one(motion), thesis_vehicle(), groups)
    np.testing.assert_allclose(added["force"], [[0.3 * MASS, 0, 0]])
    np.testing.assert_allclose(added["accelerometer"], [[0.3, 0, 0]])
    np.testing.assert_allclose(added["gyroscope"], [[0.1, 0, 0]])
    # δ × JΩ + Ω × Jδ = (0, 0, 0.1 · 2 (J_yy − J_xx)), and J δ' = (0, 0, 4 J_zz)
    np.testing.assert_allclose(added["moment"], [[0, 0, 0.2 * (2.5743e-3 - 2.489e-3) + 4 * 4.6838e-3]])
    assert set(project(error, one(motion), thesis_vehicle(), ("force",))) == {"force"}


@pytest.mark.parametrize("key", ["thrust", "torque", "mass", "arm"])
def test_a_value_that_is_one_percent_off_leaves_one_percent_of_its_column(key):
    """Flown with the true value, compared with the believed one."""
    from rotorid.mismatch.decide.values import changed_vehicle
    from rotorid.vehicle.simulator import simulate

    believed, change = audit_vehicle(), 0.01
    truth = changed_vehicle(believed, {key: change})
    trace = simulate(truth, commands(), 0.4, STEP_S, start())
    for motion in motions(trace):
        flown = segment(motion)
        force, arm, torque = baseline_wrench(motion, believed)
        left = residual(flown, believed)
        column = value_columns(key, flown, believed, tuple(left), {"force": force, "moment": arm + torque})
        for group, rest in left.items():
            expected = change * column.get(group, np.zeros_like(rest))
            # First order in the change.
            np.testing.assert_allclose(rest, expected, atol=0.02 * max(np.abs(rest).max(), 1e-9))


@pytest.mark.parametrize("axis", range(3))
def test_a_moment_of_inertia_that_is_one_percent_off_leaves_one_percent_of_its_column(axis):
    """Turning to and fro at 2 Hz about one axis: the believed J leaves −0.01 J dΩ/dt of what the rotors did."""
    vehicle, t = thesis_vehicle(), np.arange(1000) / 100.0
    rate, slope = np.zeros((1000, 3)), np.zeros((1000, 3))
    rate[:, axis] = 0.5 * np.sin(4 * np.pi * t)
    slope[:, axis] = 2 * np.pi * np.cos(4 * np.pi * t)
    inertia = vehicle.inertia_kg_m2.matrix()[axis, axis]
    flown = one(still(1000, time_s=t, angular_velocity=rate, angular_acceleration=slope))
    made = 1.01 * inertia * slope
    column = value_columns(f"inertia_{'xyz'[axis] * 2}", flown, vehicle, ("moment",), {"moment": made})["moment"]
    middle = slice(200, -200)
    np.testing.assert_allclose(
        0.01 * column[middle], (inertia * slope - made)[middle], atol=0.03 * np.abs(made).max() / 100
    )


@pytest.mark.parametrize("frequency_hz", [0.15, 0.45])
def test_an_inertia_shows_in_what_turns_slowly_and_not_in_what_never_ends(frequency_hz):
    """To and fro in 7 or in 2 seconds: the column is the moment; of one that lasts all along nothing is left."""
    vehicle, t = thesis_vehicle(), np.arange(12000) / 100.0
    flown = one(still(12000, time_s=t))
    turning = np.zeros((12000, 3))
    turning[:, 2] = 1e-3 * np.sin(2 * np.pi * frequency_hz * t)
    lasting = np.tile([0.0, 0.0, 1e-3], (12000, 1))
    column = value_columns("inertia_zz", flown, vehicle, ("moment",), {"moment": turning + lasting})["moment"]
    np.testing.assert_allclose(column[3000:-3000, 2], -turning[3000:-3000, 2], atol=2e-5)
    made = {"moment": turning + lasting}
    whole = value_columns("inertia_zz", flown, vehicle, ("moment",), made, low_frequencies=True)["moment"]
    np.testing.assert_allclose(whole[:, 2], -(turning + lasting)[:, 2], atol=1e-9)


def test_a_late_rotor_speed_leaves_its_slope_times_the_lateness():
    t = np.arange(400) / 100.0
    speed = 1000.0 + 50.0 * np.sin(2 * np.pi * t)[:, None] * np.ones(4)
    late = 1000.0 + 50.0 * np.sin(2 * np.pi * (t - 1e-3))[:, None] * np.ones(4)
    flown = still(400, time_s=t, rotor_speed=speed)
    flown = replace(flown, specific_force=baseline_wrench(flown, thesis_vehicle())[0] / MASS)
    read = one(replace(flown, rotor_speed=late))
    left = residual(read, thesis_vehicle())["force"]
    column = offset_columns("offset:rotors-accelerometer", read, thesis_vehicle(), ("force", "moment"))["force"]
    np.testing.assert_allclose(left[5:-5], 1e-3 * column[5:-5], atol=2e-4)


@pytest.mark.parametrize(("rate_hz", "step"), [(250.0, 6), (100.0, 2), (50.0, 1)])
def test_thinning_keeps_every_signal_at_its_own_instant(rate_hz, step):
    """A ramp passes a symmetric kernel unchanged: thinned ramp = thinned time stamps."""
    thin = Thinner(rate_hz, 20.0)
    t = np.arange(1003) / rate_hz
    assert thin.step == step and thin.rate_hz == rate_hz / step
    np.testing.assert_allclose(thin(t), thin.times(t), atol=1e-9)
    np.testing.assert_allclose(thin(np.stack([t, np.full(1003, 5.0)], axis=1))[:, 1], 5.0, atol=1e-12)


def test_thinning_is_a_weighted_sum_at_every_step_and_a_missing_column_stays_alone():
    """However it is computed: block by block where the steps are long."""
    rng, thin = np.random.default_rng(0), Thinner(500.0, 20.0)
    signal = rng.standard_normal((1003, 2, 2))
    assert thin.step == 12
    expected = upfirdn(thin.kernel, signal, axis=0)[len(thin.kernel) - 1 : len(signal)]
    first = -(len(thin.kernel) - 1) % thin.step
    np.testing.assert_allclose(thin(signal), expected[first :: thin.step], atol=1e-12)
    signal[:, 0, 1] = np.nan
    assert (np.isnan(thin(signal)) == np.isnan(signal[0])).all()


def test_rows_filter_both_sides_alike():
    """Force = 2 × a column with content up to the native rate: thinned alike, the factor is exact."""
    motion = still(600, velocity=np.random.default_rng(0).standard_normal((600, 3)))
    form = {f.name: f for f in catalogue()["rotor_drag"].forms(thesis_vehicle())}["independent of rotor speed"]
    added = form.contribution(motion, thesis_vehicle(), np.array([2.0])).force
    flown = one(replace(motion, specific_force=motion.specific_force + added / MASS))
    groups = ("force", "moment")
    thin = Thinner(100.0, 10.0)
    (column,) = form_columns(form, np.zeros(1), flown, thesis_vehicle(), groups)
    rows = assemble(flown, thesis_vehicle(), thin, [{group: thin(part) for group, part in column.items()}])
    assert rows.x.shape == (len(rows.time_s), 12, 1) and np.isnan(rows.y[:, 6:]).all()
    np.testing.assert_allclose(rows.y[:, :3], 2.0 * rows.x[:, :3, 0], atol=1e-12)
    known = assemble(flown, thesis_vehicle(), thin, [], known={"force": added})
    np.testing.assert_allclose(known.y[:, :3], 0.0, atol=1e-12)


def flown(spread_rad: float) -> np.ndarray:
    headings = spread_rad * np.random.default_rng(0).standard_normal(4000)
    return Rotation.from_euler("ZYX", np.stack([headings, 0.1 + 0 * headings, 0 * headings], axis=1)).as_matrix()


def test_a_moment_fixed_in_the_world_shows_on_a_vehicle_that_turns():
    assert can_show("unknown_heading", [flown(0.5)])
    assert not can_show("unknown_heading", [flown(0.1)])
    # Two flights that each keep their heading, one north and one east, tell it too.
    east = Rotation.from_euler("z", np.pi / 2).as_matrix() @ flown(0.1)
    assert can_show("unknown_heading", [flown(0.1), east])


def test_other_empirical_terms_and_unknown_attitudes_are_not_concerned():
    assert can_show("unknown_place", [flown(0.0)])
    assert can_show("unknown_heading", [None])


def test_errors_of_the_sensors_that_are_compared_and_nothing_else():
    prepared = prepare(recorded(1))
    channels, keys = compared_alone(prepared.terms, wrench_model(prepared, prepared.terms).rows)
    assert channels == [6, 7, 8, 9, 10, 11]
    assert {"gyro_error/scale", "accelerometer_error/bias", "imu_lever_arm/lever arm"} <= set(keys)
    assert not any(k.startswith(("rotor_drag", "com_offset", "offset:")) for k in keys)


def test_without_an_attitude_no_error_of_the_gyroscope_is_compared():
    def inertial(table: pd.DataFrame) -> pd.DataFrame:
        return table.drop(columns=[*c.QUATERNION, *c.VELOCITY, *c.POSITION])

    prepared = prepare(with_table(recorded(1), inertial))
    channels, keys = compared_alone(prepared.terms, wrench_model(prepared, prepared.terms).rows)
    assert (channels, keys) == ([], [])


def test_a_scale_of_the_gyroscope_is_told_rightly_beside_inertias_that_are_far_off():
    """The moments ask for another number: the believed inertias are a third too small."""

    def scaled(table: pd.DataFrame) -> pd.DataFrame:
        return table.assign(**{name: 1.08 * table[name] for name in c.ANGULAR_VELOCITY})

    recordings = with_table(recorded(2), scaled)
    vehicle = recordings.vehicle
    light = {k: v / 1.5 for k, v in vehicle.inertia_kg_m2.model_dump().items()}
    vehicle = vehicle.model_copy(update={"inertia_kg_m2": vehicle.inertia_kg_m2.model_copy(update=light)})
    prepared = prepare(replace(recordings, vehicle=vehicle))
    regression = wrench_model(prepared, prepared.terms).search.regression
    fit = regression.fit([*regression.keys_of("nuisance"), "gyro_error/scale"])
    beta, covariance = coefficients(regression, fit, "gyro_error/scale")
    # Ω_m = 1.08 Ω; columns hold the measured rates, so the coefficient is 0.08 / 1.08.
    assert np.all(np.abs(beta - 0.08 / 1.08) < 3 * np.sqrt(np.diag(covariance)))
    assert np.all(np.abs(beta - 0.08 / 1.08) < 0.02)
