"""The simulator against closed forms, against itself compiled, and against RotorPy."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from rotorid.effects.catalogue import catalogue
from rotorid.effects.instant import body_of
from rotorid.vehicle import fast
from rotorid.vehicle.attitude import (
    euler_from_quaternion,
    quaternion_from_euler,
    rotation_from_quaternion,
)
from rotorid.vehicle.control import AttitudePid, training_reference
from rotorid.vehicle.mixer import allocation_matrix, wrench_matrix
from rotorid.vehicle.simulator import (
    Commands,
    Disturbance,
    Motors,
    Start,
    WhiteNoise,
    recording,
    simulate,
)
from rotorid_lab.inertias import ExcitedHold, Multisine
from tests.unit.vehicle.thesis import D, thesis_vehicle

CF, CQ = 1.3877e-6, 1.8558e-8


def still(k=4):
    return Commands(np.array([0.0]), np.zeros((1, k)))


def test_wrench_matrix_is_equation_4_31():
    expected = np.array(
        [
            [CF, CF, CF, CF],
            [-CF * D, CF * D, CF * D, -CF * D],
            [CF * D, CF * D, -CF * D, -CF * D],
            [CQ, -CQ, CQ, -CQ],
        ]
    )
    np.testing.assert_allclose(wrench_matrix(thesis_vehicle()), expected, rtol=1e-14)


def test_allocation_is_the_true_inverse_and_not_equation_4_32_as_printed():
    found = allocation_matrix(thesis_vehicle())
    f, m, q = 1 / CF, 1 / (CF * D), 1 / CQ
    true = 0.25 * np.array([[f, -m, m, q], [f, m, m, -q], [f, m, -m, q], [f, -m, -m, -q]])
    np.testing.assert_allclose(found, true, rtol=1e-12)
    printed = true.copy()
    printed[3, 3] = 0.25 * q  # the slip of the thesis
    assert not np.allclose(wrench_matrix(thesis_vehicle()) @ printed, np.eye(4), atol=1e-3)


def test_allocation_says_when_rotors_cannot_do_it():
    same = thesis_vehicle(rotors=[dict(x_m=D, y_m=D, spin="ccw")] * 4)
    with pytest.raises(ValueError, match="cannot set thrust, roll, pitch and yaw independently"):
        allocation_matrix(same)


def test_rotation_matrix_is_equation_4_10():
    phi, theta, psi = 0.3, -0.5, 1.1
    c, s = np.cos, np.sin
    expected = np.array(
        [
            [
                c(theta) * c(psi),
                s(phi) * s(theta) * c(psi) - c(phi) * s(psi),
                c(phi) * s(theta) * c(psi) + s(phi) * s(psi),
            ],
            [
                c(theta) * s(psi),
                s(phi) * s(theta) * s(psi) + c(phi) * c(psi),
                c(phi) * s(theta) * s(psi) - s(phi) * c(psi),
            ],
            [-s(theta), s(phi) * c(theta), c(phi) * c(theta)],
        ]
    )
    quaternion = quaternion_from_euler([phi, theta, psi])
    np.testing.assert_allclose(rotation_from_quaternion(quaternion), expected, atol=1e-14)
    np.testing.assert_allclose(euler_from_quaternion(quaternion), [phi, theta, psi], atol=1e-14)


def test_euler_rates_are_equation_4_14():
    """A small turn by body rates changes the Euler angles by W Ω dt."""
    euler, rates, dt = np.array([0.4, -0.3, 2.0]), np.array([0.7, -0.2, 0.5]), 1e-6
    still_quaternion = quaternion_from_euler(euler)
    turn = np.concatenate([[1.0], 0.5 * rates * dt])
    a, b = still_quaternion[0], still_quaternion[1:]
    turned = np.concatenate([[a * turn[0] - b @ turn[1:]], a * turn[1:] + turn[0] * b + np.cross(b, turn[1:])])
    change = (euler_from_quaternion(turned / np.linalg.norm(turned)) - euler) / dt
    (sin_roll, sin_pitch, _), (cos_roll, cos_pitch, _) = np.sin(euler), np.cos(euler)
    w = np.array(
        [
            [1.0, sin_roll * sin_pitch / cos_pitch, cos_roll * sin_pitch / cos_pitch],
            [0.0, cos_roll, -sin_roll],
            [0.0, sin_roll / cos_pitch, cos_roll / cos_pitch],
        ]
    )
    np.testing.assert_allclose(change, w @ rates, atol=1e-5)


def test_free_fall():
    trace = simulate(thesis_vehicle(), still(), 1.0, 0.01)
    np.testing.assert_allclose(trace.position[0, -1], [0, 0, 4.905], atol=1e-12)
    np.testing.assert_allclose(trace.specific_force, 0, atol=1e-15)


def test_equation_4_17_in_a_tilted_climb():
    euler = np.array([[0.2, -0.3, 0.5]])
    speeds = np.full((1, 4), 1200.0)
    trace = simulate(thesis_vehicle(), Commands(np.array([0.0]), speeds), 0.001, 0.001, Start(euler_rad=euler))
    thrust = 4 * CF * 1200.0**2
    phi, theta, psi = euler[0]
    c, s = np.cos, np.sin
    by_hand = -thrust / 0.652 * np.array(
        [
            c(phi) * s(theta) * c(psi) + s(phi) * s(psi),
            c(phi) * s(theta) * s(psi) - s(phi) * c(psi),
            c(phi) * c(theta),
        ]
    ) + [0, 0, 9.81]
    np.testing.assert_allclose(trace.velocity[0, -1] / 0.001, by_hand, rtol=1e-9)


def test_torque_free_tumbling_keeps_energy_and_momentum():
    """An asymmetric body about its middle axis (unstable, so errors would show), 10 s."""
    vehicle = thesis_vehicle()
    start = Start(angular_velocity_rad_s=np.array([[0.01, 8.0, 0.02]]))
    trace = simulate(vehicle, still(), 10.0, 0.001, start)
    inertia = vehicle.inertia_kg_m2.matrix()
    rates = trace.angular_velocity[0]
    energy = 0.5 * np.einsum("ni,ij,nj->n", rates, inertia, rates)
    assert np.ptp(energy) / energy[0] < 1e-9
    momentum = np.einsum(
        "nij,nj->ni",
        rotation_from_quaternion(trace.quaternion[0]),
        trace.angular_velocity[0] @ inertia,
    )
    np.testing.assert_allclose(momentum, momentum[:1].repeat(len(momentum), 0), atol=1e-9 * 0.02)
    assert np.abs(trace.angular_velocity[0, :, 1] - 8.0).max() > 5  # it did tumble


def test_precession_of_a_symmetric_body_has_the_closed_form():
    """Ω turns about z at (J_zz - J_xx) / J_xx · r: 5 s, by hand."""
    vehicle = thesis_vehicle(inertia_kg_m2=dict(xx=2.5e-3, yy=2.5e-3, zz=4.5e-3))
    start = Start(angular_velocity_rad_s=np.array([[1.0, 0.0, 6.0]]))
    trace = simulate(vehicle, still(), 5.0, 0.001, start)
    angle = (4.5 - 2.5) / 2.5 * 6.0 * trace.time_s
    np.testing.assert_allclose(trace.angular_velocity[0, :, 0], np.cos(angle), atol=1e-8)
    np.testing.assert_allclose(trace.angular_velocity[0, :, 1], np.sin(angle), atol=1e-8)


def test_asymmetric_precession_agrees_with_jacobi_elliptic_functions():
    from scipy.special import ellipj

    jx, jy, jz = 2.489e-3, 2.5743e-3, 4.6838e-3
    p0, r0 = 2.0, 5.0
    trace = simulate(thesis_vehicle(), still(), 5.0, 0.0005, Start(angular_velocity_rad_s=np.array([[p0, 0.0, r0]])))
    # Spin about the largest axis; standard solution with q(0) = 0: p = p0 cn, q = q1 sn, r = r0 dn.
    two_t, h2 = jx * p0**2 + jz * r0**2, (jx * p0) ** 2 + (jz * r0) ** 2
    rate = np.sqrt((jz - jy) * (h2 - two_t * jx) / (jx * jy * jz))
    m = (jy - jx) * (two_t * jz - h2) / ((jz - jy) * (h2 - two_t * jx))
    q1 = np.sqrt((two_t * jz - h2) / (jy * (jz - jy)))
    sn, cn, dn, _ = ellipj(rate * trace.time_s, m)
    np.testing.assert_allclose(trace.angular_velocity[0], np.stack([p0 * cn, q1 * sn, r0 * dn], 1), atol=1e-9)


@pytest.mark.parametrize("step_s", [0.02])
def test_the_integrator_is_of_fourth_order(step_s):
    start = Start(angular_velocity_rad_s=np.array([[3.0, 4.0, 2.0]]))

    def end(step):
        return simulate(thesis_vehicle(), still(), 1.0, step, start).angular_velocity[0, -1]

    best = end(step_s / 32)
    errors = [np.linalg.norm(end(step_s / 2**i) - best) for i in range(3)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    np.testing.assert_allclose(orders, 4.0, atol=0.15)


def test_motor_lag_closed_form():
    trace = simulate(
        thesis_vehicle(),
        Commands(np.array([0.0]), np.full((1, 4), 1000.0)),
        0.5,
        0.001,
        Start(rotor_speed_rad_s=np.full((1, 4), 500.0)),
        Motors(0.05),
    )
    np.testing.assert_allclose(trace.rotor_speed[0, :, 0], 1000 - 500 * np.exp(-trace.time_s / 0.05), rtol=1e-7)


def wiggle(steps=1000, dt=0.001):
    t = dt * np.arange(steps)
    return 1073.0 * (1 + 0.03 * np.sin(2 * np.pi * t[:, None] * np.array([1.0, 1.3, 1.7, 2.1])))


def test_vehicles_of_a_batch_do_not_touch_each_other():
    start = Start(
        position_m=np.zeros((2, 3)),
        velocity_m_s=np.zeros((2, 3)),
        euler_rad=np.array([[0.0, 0, 0], [0.3, 0.1, 1.0]]),
        angular_velocity_rad_s=np.array([[0.0, 0, 0], [1.0, 2, 3]]),
    )
    drag = catalogue()["rotor_drag"].forms(thesis_vehicle())[0]
    effects = [(drag, np.full(len(drag.parameters), 1e-5))]
    controller = Commands(0.001 * np.arange(300), wiggle(300))
    both = simulate(thesis_vehicle(), controller, 0.3, 0.001, start, effects=effects)
    one = Start(euler_rad=start.euler_rad[1:], angular_velocity_rad_s=start.angular_velocity_rad_s[1:])
    alone = simulate(thesis_vehicle(), controller, 0.3, 0.001, one, effects=effects)
    np.testing.assert_allclose(both.position[1], alone.position[0], atol=1e-13)


def rotorpy_vehicle(tau=0.03):
    """The thesis's vehicle in RotorPy's axes: x forward, y left, z up."""
    return dict(
        mass=0.652,
        Ixx=2.489e-3,
        Iyy=2.5743e-3,
        Izz=4.6838e-3,
        Ixy=0.0,
        Ixz=0.0,
        Iyz=0.0,
        c_Dx=0.0,
        c_Dy=0.0,
        c_Dz=0.0,
        num_rotors=4,
        rotor_pos={
            "r1": np.array([D, -D, 0]),
            "r2": np.array([D, D, 0]),
            "r3": np.array([-D, D, 0]),
            "r4": np.array([-D, -D, 0]),
        },
        # A ccw rotor's reaction is clockwise: negative about z up.
        rotor_directions=np.array([-1, 1, -1, 1]),
        rotor_speed_min=0,
        rotor_speed_max=3000,
        k_eta=CF,
        k_m=CQ,
        k_d=1.1e-5,
        k_z=2.3e-5,
        k_h=3.4e-3,
        k_flap=0.0,
        tau_m=tau,
        motor_noise_std=0.0,
    )


UP_LEFT = np.array([1.0, -1.0, -1.0])
"""From forward-right-down to forward-left-up and back."""


@pytest.mark.parametrize("aero", [False, True])
def test_trajectory_of_rotorpy(aero):
    """The same commands, lag, drag at the hubs, inflow and translational lift: states agree along 2 s."""
    from rotorpy.vehicles.multirotor import Multirotor

    dt, steps = 0.002, 1000
    commands = wiggle(steps, dt)
    state = dict(
        x=np.zeros(3),
        v=np.array([2.0, 1.0, -0.5]) * UP_LEFT,
        q=np.array([0, 0, 0, 1.0]),
        w=np.array([0.3, -0.4, 0.5]) * UP_LEFT,
        wind=np.zeros(3),
        rotor_speeds=np.full(4, 1050.0),
    )
    peer = Multirotor(rotorpy_vehicle(), state, aero=aero, integrator_kwargs=dict(method="RK45", rtol=1e-9, atol=1e-9))
    states = [state]
    for i in range(steps):
        states.append(peer.step(states[-1], dict(cmd_motor_speeds=commands[i]), dt))
    vehicle = thesis_vehicle()
    effects = []
    if aero:
        for name, values in (
            ("rotor_drag", [1.1e-5]),
            ("axial_inflow", [2.3e-5]),
            ("translational_lift", [3.4e-3]),
        ):
            form = next(
                f for f in catalogue()[name].forms(vehicle) if len(f.parameters) == len(values) and "hub" in f.name
            )
            effects.append((form, values))
    start = Start(
        velocity_m_s=np.array([[2.0, 1.0, -0.5]]),
        angular_velocity_rad_s=np.array([[0.3, -0.4, 0.5]]),
        rotor_speed_rad_s=np.full((1, 4), 1050.0),
    )
    trace = simulate(vehicle, Commands(dt * np.arange(steps), commands), 2.0, dt, start, Motors(0.03), effects)
    peers = {key: np.array([s[key] for s in states]) for key in ("x", "v", "w", "q")}
    scale = np.abs(peers["x"]).max()
    assert scale > 2.0
    np.testing.assert_allclose(trace.position[0], peers["x"] * UP_LEFT, atol=1e-6)
    np.testing.assert_allclose(trace.velocity[0], peers["v"] * UP_LEFT, atol=1e-6)
    np.testing.assert_allclose(trace.angular_velocity[0], peers["w"] * UP_LEFT, atol=1e-6)
    quaternion = peers["q"][:, [3, 0, 1, 2]] * [1, 1, -1, -1]
    sign = np.sign(np.sum(quaternion * trace.quaternion[0], axis=1))[:, None]
    np.testing.assert_allclose(trace.quaternion[0], sign * quaternion, atol=1e-6)


def read_as(euler_rad: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """States of four rotors' vehicles at rest with these attitudes (n, 3), and no errors of reading them."""
    states = np.zeros((len(euler_rad), 17))
    states[:, 3:7] = quaternion_from_euler(euler_rad)
    return states, np.zeros_like(euler_rad)


def test_pid_by_hand():
    """Rotors whose squares are a thrust of 100 N and a moment each, 0.1 s apart, at angles of 0, then −error."""
    gains, error = ((2.0, 2, 2), (3.0, 3, 3), (0.0, 0.5, 0.5)), np.array([0.1, 0.0, -0.2])
    allocation, reference = np.column_stack([np.ones(3), np.eye(3)]), np.array([[0.0, 0.0, 0.0, 100.0]])
    loop = fast.AttitudeLoop(*gains, allocation, reference)
    for limit, moments in (
        # 2 e + 3 e 0.1 + 0.5 e / 0.1 = 7.3 e; then 2 e + 3 e 0.2; at no error the integral alone, and the slope back.
        (None, ([0, 0, 0], 2.3 * error * [1, 0, 0] + 7.3 * error * [0, 0, 1], 2.6 * error, [0.06, 0, 0.88])),
        # At the limit the integral about x stands still.
        (np.array([0.05, 1, 9]), ([0, 0, 0], [0.05, 0, -1.46], [0.05, 0, -0.52], [0.0, 0, 0.88])),
    ):
        command = fast.commanding(replace(loop, limit_n_m=limit), 1, 0.1)
        for j, (angles, moment) in enumerate(zip((0.0 * error, -error, -error, 0.0 * error), moments, strict=True)):
            np.testing.assert_allclose(command(j, *read_as(angles[None]))[0] ** 2 - 100.0, moment, atol=1e-9)


def test_anti_windup_shortens_the_overshoot():
    """A roll step that saturates the moment: with the integral held the overshoot is smaller."""
    from rotorid.vehicle.control import AttitudeReference

    vehicle = thesis_vehicle()

    @dataclass
    class Saturated:
        """The same saturation, but unknown to the controller."""

        inner: Callable

        def rotor_command(self, time_s, euler_rad):
            u = wrench_matrix(vehicle) @ (self.inner(round(time_s / 0.002), *read_as(euler_rad)).T ** 2)
            u[1:] = np.clip(u[1:], -0.02, 0.02)
            return np.sqrt(np.maximum((allocation_matrix(vehicle) @ u).T, 0))

    step = AttitudeReference("step", 6.4, lambda t: np.array([0.8, 0.0, 0.0]))
    peak = {}
    for name, limit in (("wound", None), ("held", (0.02, 0.02, 0.02))):
        pid = AttitudePid(vehicle, step, limit_n_m=limit)
        if limit is None:
            pid = Saturated(fast.commanding(pid.attitude_loop(0.002 * np.arange(2001)), 1, 0.002))
        peak[name] = simulate(vehicle, pid, 4.0, 0.002).euler_rad[0, :, 0].max()
    assert peak["held"] < peak["wound"] - 0.05


def test_thesis_attitude_control_follows_its_reference():
    """Eq. 4.28 with the gains of table 4.2: roll and pitch within 1.5 degrees after the first second."""
    reference = training_reference()
    trace = simulate(thesis_vehicle(), AttitudePid(thesis_vehicle(), reference), 5.0, 0.002)
    wanted = np.array([reference.euler_rad(t) for t in trace.time_s])
    late = trace.time_s > 2.0
    error = np.degrees(np.abs(trace.euler_rad[0] - wanted)[late].max(axis=0))
    assert (error < [5.0, 5.0, 2.0]).all(), error


def test_noise_and_disturbance_have_their_stated_size_and_seed():
    vehicle = thesis_vehicle()
    hold = Commands(np.array([0.0]), np.full((1, 4), 1073.0))
    noise = WhiteNoise(angular_velocity_rad_s=0.02, specific_force_m_s2=0.15, rotor_speed_relative=0.01)
    quiet = simulate(vehicle, hold, 2.0, 0.001)
    run = recording(quiet, vehicle, "hover", noise, np.random.default_rng(1))
    assert np.std(run.column("angular_velocity_x_rad_s")) == pytest.approx(0.02, rel=0.06)
    assert np.std(run.column("rotor_speed_2_rad_s")) == pytest.approx(10.73, rel=0.06)
    again = recording(quiet, vehicle, "hover", noise, np.random.default_rng(1))
    np.testing.assert_array_equal(run.table.to_numpy(), again.table.to_numpy())
    push = Disturbance(force_n=0.1, moment_n_m=0.001, correlation_s=0.05)
    shaken = simulate(vehicle, hold, 20.0, 0.005, disturbance=push, rng=np.random.default_rng(2))
    assert np.std(shaken.specific_force[0, :, 0]) == pytest.approx(0.1 / 0.652, rel=0.15)
    with pytest.raises(ValueError, match="needs a random generator"):
        simulate(vehicle, hold, 0.1, disturbance=push)


def test_sensor_effects_reach_the_readings_only():
    vehicle = thesis_vehicle()
    hold = Commands(np.array([0.0]), np.full((1, 4), 1073.0))
    bias = next(f for f in catalogue()["gyro_error"].forms(vehicle) if f.name == "bias")
    trace = simulate(vehicle, hold, 0.1)
    run = recording(trace, vehicle, "biased", effects=[(bias, [0.1, 0.2, 0.3])])
    np.testing.assert_allclose(run.column("angular_velocity_z_rad_s"), 0.3)
    np.testing.assert_allclose(trace.angular_velocity, 0)


def test_a_runaway_is_one_clear_sentence():
    # A derivative of the wrong sign with gains a million times too large.
    pid = AttitudePid(thesis_vehicle(), training_reference(), ((-1e9,) * 3, (0.0,) * 3, (0.0,) * 3))
    with pytest.raises(ValueError, match="ran away"), np.errstate(all="ignore"):
        simulate(thesis_vehicle(), pid, 5.0, 0.01)


def test_angular_acceleration_is_equation_4_19():
    vehicle = thesis_vehicle(inertia_kg_m2=dict(xx=2.489e-3, yy=2.5743e-3, zz=4.6838e-3))
    p, q, r = 1.0, 2.0, 3.0
    start, push = np.array([[p, q, r, 1.0, *[0.0] * 13]]), np.array([[[0.0, 0.0, 0.0, 0.01, 0.02, 0.03]]])
    flown = fast.fly(body_of(vehicle), fast.kernels_of([], vehicle), start, 0, 1.0, np.zeros((1, 4)), pushes=push)
    found = flown.accelerations[0, 0, :3]
    by_hand = [
        -0.8475 * q * r + 0.01 / 2.489e-3,
        0.8526 * p * r + 0.02 / 2.5743e-3,
        -0.0182 * p * q + 0.03 / 4.6838e-3,
    ]
    np.testing.assert_allclose(found, by_hand, atol=3e-4)


def test_effects_of_the_vehicle_file_are_flown():
    """Lag and drag stated in the file: the same flight as with both given by hand, under commands and under PID."""
    from rotorid.vehicle.improved import simulate_as_stated

    drag = catalogue()["rotor_drag"].forms(thesis_vehicle())[0]
    parameters = {p.symbol: 1e-5 for p in drag.parameters}
    entries = [
        dict(id="motor_lag", form="up and down", parameters={"tau_up": 0.05, "tau_down": 0.03}),
        dict(id="rotor_drag", form=drag.name, parameters=parameters),
    ]
    stated = thesis_vehicle(effects=entries)
    start = Start(velocity_m_s=np.array([[3.0, 0, 0]]))
    pid = AttitudePid(thesis_vehicle(), training_reference())
    effects = [(drag, list(parameters.values()))]
    by_hand = simulate(thesis_vehicle(), pid, 0.5, 0.002, start, Motors(0.05, 0.03), effects)
    found = simulate_as_stated(stated, pid, 0.5, 0.002, start=start)
    np.testing.assert_array_equal(found.velocity, by_hand.velocity)
    assert abs(found.velocity[0, -1, 0] - 3.0) > 0.05
    commands = Commands(0.002 * np.arange(250), wiggle(250, 0.002))
    known = simulate_as_stated(stated, commands, 0.5, 0.002, start=start)
    lagged = simulate(thesis_vehicle(), commands, 0.5, 0.002, start, Motors(0.05, 0.03), effects)
    # The series is lagged a sample at a time and held, the simulator's motors move within the step.
    np.testing.assert_allclose(known.rotor_speed[0, 50:], lagged.rotor_speed[0, 50:], rtol=3e-3)


@pytest.mark.parametrize("mass_kg", [0.1, 1.0])
def test_a_slung_load_swings_in_the_simulator(mass_kg):
    """The pendulum hangs still in hover and both fall by its weight: m_p g / (0.652 + m_p), also if it is heavier."""
    vehicle = thesis_vehicle()
    slung = next(f for f in catalogue()["payload"].forms(vehicle) if f.name == "slung")
    hold = Commands(np.array([0.0]), np.full((1, 4), np.sqrt(0.652 * 9.81 / (4 * CF))))
    trace = simulate(vehicle, hold, 0.5, 0.005, effects=[(slung, [mass_kg, 0.0, 0.5, 0.05])])
    assert trace.velocity[0, -1, 2] == pytest.approx(mass_kg * 9.81 / (0.652 + mass_kg) * 0.5, rel=1e-3)


def test_a_controller_flies_the_same_twice():
    """What a controller remembers of a flight stays in that flight, also where it holds another controller."""
    vehicle = thesis_vehicle()
    sine = Multisine(1.0, np.array([1.0, 2.0, 3.0]), 0.01 * np.eye(3), np.zeros((3, 3)))
    hold = ExcitedHold(vehicle, sine, (300.0, 1900.0))
    first, second = (simulate(vehicle, hold, 0.5, 0.002).angular_velocity for _ in range(2))
    np.testing.assert_array_equal(first, second)
    assert np.abs(first).max() > 0.1
