"""Compiled flights and windows against numpy: the same numbers for every effect of the catalogue."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import Motion
from rotorid.effects.gust import window_form
from rotorid.effects.instant import Wrench, body_of, records
from rotorid.errors import InputError
from rotorid.vehicle.attitude import quaternion_from_euler, rotation_from_quaternion
from rotorid.vehicle.compiled import _invert
from rotorid.vehicle.control import AttitudePid, training_reference
from rotorid.vehicle.fast import _adds_wrench
from rotorid.vehicle.improved import simulate_as_stated
from rotorid.vehicle.simulator import Commands, Disturbance, Motors, Start, WhiteNoise, simulate
from rotorid.vehicle.windows import Inputs, States, simulate_windows
from rotorid_lab.batch import Batch
from rotorid_lab.inertias import ExcitedHold, Multisine
from tests.unit.effects.flown import audit_vehicle, commands, start, typical_values
from tests.unit.vehicle.by_numpy import by_numpy

VEHICLE = audit_vehicle()
INSTANT, _, ADDED = records(8)
WRENCHES = [
    (effect.id, form)
    for effect in catalogue().values()
    for form in effect.forms(VEHICLE)
    if _adds_wrench(form, VEHICLE, typical_values(effect.id, form)) and not form.memory
]
WRENCHES.append(("gust", window_form(0.1, 0.5, 3)))
NAMES = [f"{name}: {form.name}" for name, form in WRENCHES]
TRACE = ("position", "velocity", "quaternion", "angular_velocity", "angular_acceleration", "specific_force")


def motion_at_random(n: int = 40, seed: int = 3) -> Motion:
    rng = np.random.default_rng(seed)
    rotation = rotation_from_quaternion(quaternion_from_euler(rng.uniform(-1, 1, (n, 3))))
    velocity = rng.normal(0, 3, (n, 3))
    velocity[::4] = [0.3, -0.2, 4.0]  # a steep descent
    return Motion(
        time_s=np.linspace(0.0, 0.6, n),
        rotor_speed=rng.uniform(300, 1500, (n, 4)),
        rotor_acceleration=rng.normal(0, 3000, (n, 4)),
        angular_velocity=rng.normal(0, 3, (n, 3)),
        angular_acceleration=rng.normal(0, 30, (n, 3)),
        specific_force=rng.normal(0, 10, (n, 3)),
        accelerometer=rng.normal(0, 10, (n, 3)),
        rotation=rotation,
        velocity=velocity,
        wind=np.array([1.0, -2.0, 0.5]),
        height=rng.uniform(0.01, 0.6, n),
    )


def instants_of(motion: Motion, vehicle) -> np.ndarray:
    """The same instants as records that kernels read."""
    k, m = vehicle.rotor_count, np.zeros(motion.size, INSTANT)
    for name in ("time_s", "height", "angular_velocity", "angular_acceleration", "specific_force", "rotation"):
        m[name] = getattr(motion, name)
    m["air_velocity"], m["on_board"] = motion.air_velocity, 1.0
    m["rotor_speed"][:, :k], m["rotor_acceleration"][:, :k] = motion.rotor_speed, motion.rotor_acceleration
    m["rotor_speed_sum"] = motion.rotor_speed.sum(axis=1)
    m["thrust"][:, :k] = vehicle.thrust_coefficients_n_s2() * motion.rotor_speed**2
    turning = np.cross(motion.angular_velocity[:, None], vehicle.rotor_positions_m())
    m["hub_velocity"][:, :k] = motion.air_velocity[:, None] + turning
    return m


def test_every_form_that_moves_the_vehicle_has_a_kernel():
    assert [
        name for name, (_, form) in zip(NAMES, WRENCHES, strict=True) if not isinstance(form.contribution, Wrench)
    ] == []
    assert len(WRENCHES) > 45


@pytest.mark.parametrize("case", WRENCHES, ids=NAMES)
def test_a_kernel_adds_at_each_instant_what_it_adds_to_all_at_once(case):
    name, form = case
    motion, values = motion_at_random(), typical_values(name, form)
    expected, kernel = form.contribution(motion, VEHICLE, values), form.contribution.kernel
    hubs, body, instants = VEHICLE.rotor_positions_m(), body_of(VEHICLE)[0], instants_of(motion, VEHICLE)
    force, moment = np.zeros((motion.size, 3)), np.zeros((motion.size, 3))
    for n in range(motion.size):
        added = np.zeros(1, ADDED).view(np.recarray)
        kernel(_record(instants[n]), _record(body), form.contribution.values_of(values), added[0])
        pulls = added[0].hub_force[:4]
        force[n] = added[0].force + pulls.sum(axis=0)
        moment[n] = added[0].moment + np.cross(hubs, pulls).sum(axis=0)
    for found, wanted in ((force, expected.force), (moment, expected.moment)):
        wanted = np.zeros_like(found) if wanted is None else wanted
        np.testing.assert_allclose(found, wanted, rtol=1e-11, atol=1e-12 * max(np.abs(wanted).max(), 1e-3))
    assert np.abs(force).max() + np.abs(moment).max() > 0


def _record(row):
    return np.array([row]).view(np.recarray)[0]


def flights(effects, **how):
    """The same flight by compiled code and by numpy; a random generator in `how` begins anew for each."""
    settings = dict(step_s=0.004, start=start(), effects=effects) | how
    controller, seed = settings.pop("controller", commands()), settings.pop("seed", 0)

    def flown():
        return simulate(VEHICLE, controller, **settings, rng=np.random.default_rng(seed))

    fast = flown()
    with by_numpy(VEHICLE):
        return fast, flown()


def assert_same(fast, slow, tolerance=1e-9):
    for name in TRACE + ("rotor_speed", "rotor_command"):
        a, b = getattr(fast, name), getattr(slow, name)
        np.testing.assert_allclose(a, b, rtol=0, atol=tolerance * max(1.0, np.abs(b).max()), err_msg=name)


@pytest.mark.parametrize("case", WRENCHES, ids=NAMES)
def test_a_compiled_flight_with_an_effect_is_that_of_numpy(case):
    name, form = case
    effects = [(form, typical_values(name, form))]
    fast, slow = flights(effects, duration_s=0.2, motors=Motors(0.03))
    assert_same(fast, slow)
    plain = simulate(VEHICLE, commands(), 0.2, 0.004, start=start(), motors=Motors(0.03))
    assert (
        np.abs(fast.velocity - plain.velocity).max() + np.abs(fast.angular_velocity - plain.angular_velocity).max()
        > 1e-6
    )


def test_an_offset_moves_the_point_that_is_recorded_about_the_true_centre_of_mass():
    """The true centre accelerates by the thrust alone, a_0 + dΩ × r + Ω × (Ω × r) = F / m; a_0 is what is recorded."""
    offset = np.array([0.01, -0.006, 0.004])
    form = next(f for f in catalogue()["com_offset"].forms(VEHICLE) if f.name == "moment and lever arm, in space")
    flown = simulate(VEHICLE, commands(), 0.3, 0.004, start=start(), effects=[(form, offset)])
    turning, rate = flown.angular_acceleration, flown.angular_velocity
    of_centre = flown.specific_force + np.cross(turning, offset) + np.cross(rate, np.cross(rate, offset))
    thrust = (VEHICLE.thrust_coefficients_n_s2() * flown.rotor_speed**2).sum(axis=-1)
    np.testing.assert_allclose(of_centre[..., 2], -thrust / VEHICLE.mass_kg, rtol=1e-6)
    np.testing.assert_allclose(of_centre[..., :2], 0.0, atol=1e-6)
    assert np.abs(flown.specific_force[..., :2]).max() > 0.1


SEVERAL = ("rotor_drag", "frame_drag", "payload", "inertia_products", "ground_effect", "thrust_tilt", "vortex_ring")


def several():
    """The first form of several effects at once, two of them with accelerations that they change."""
    found = {name: next(form for n, form in WRENCHES if n == name) for name in SEVERAL}
    return [(form, typical_values(name, form)) for name, form in found.items()]


def several_stated(**changes):
    """A vehicle whose file states them."""
    entries = tuple(
        {
            "id": name,
            "form": form.name,
            "parameters": {p.symbol: float(x) for p, x in zip(form.parameters, v, strict=True)},
        }
        for name, (form, v) in zip(SEVERAL, several(), strict=True)
    )
    return audit_vehicle(effects=entries + changes.pop("more", ()), **changes)


@pytest.mark.parametrize("motors", [Motors(), Motors(0.03, 0.05, (300.0, 1500.0))], ids=["at once", "lag and limits"])
def test_all_together_with_wind_and_disturbance(motors):
    how = dict(motors=motors, wind_m_s=np.array([3.0, -1.0, 0.5]), disturbance=Disturbance(0.2, 1e-3, 0.05))
    assert_same(*flights(several(), duration_s=0.1, seed=2, **how))


@pytest.mark.parametrize("kind", ["pid", "limited pid", "trimmed pid", "excited"])
def test_a_controller_flies_compiled_as_it_is_called(kind):
    if kind == "excited":
        waves = Multisine(2.0, np.array([1.0, 2.0, 3.0]), np.eye(3) * [0.01, 0.01, 0.002], np.zeros((3, 3)))
        pilot = ExcitedHold(VEHICLE, waves, (400.0, 2000.0))
    else:
        gains = ((0.25, 0.25, 0.5), (0.3, 0.3, 0.1), (0.04, 0.04, 0.07))
        limit = (0.1, 0.1, 0.02) if kind == "limited pid" else None
        trim = (0.02, -0.03, 0.005) if kind == "trimmed pid" else (0.0, 0.0, 0.0)
        pilot = AttitudePid(VEHICLE, training_reference(6.4), gains, 0.02, limit, trim)
    begin = Start(
        euler_rad=np.array([[0.1, -0.2, 0.3], [0.0, 0.1, 0.0]]),
        position_m=np.array([[0, 0, -0.4], [0, 0, -9.0]]),
        velocity_m_s=np.ones((2, 3)),
        angular_velocity_rad_s=np.zeros((2, 3)),
    )
    # Smaller effects than elsewhere: a vehicle that tumbles makes any two roundings apart.
    held = [(form, 0.2 * np.asarray(values)) for form, values in several()]
    noise, motors = WhiteNoise(attitude_rad=0.01), Motors(0.03)
    fast, slow = flights(held, controller=pilot, duration_s=0.25, start=begin, motors=motors, noise=noise, seed=1)
    assert np.abs(slow.angular_velocity).max() < 10.0
    assert_same(fast, slow)


def test_a_controller_that_gives_commands_alone_is_called():
    class Still:
        def rotor_command(self, time_s, euler_rad):
            return np.full((len(euler_rad), 4), 900.0)

    trace = simulate(VEHICLE, Still(), 0.02, 0.004)
    np.testing.assert_array_equal(trace.rotor_command, 900.0)


def recorded(n=76, dt=0.004):
    """A flight as a recording."""
    trace = simulate(VEHICLE, Commands(dt * np.arange(n), commands_of(n, dt)), (n - 1) * dt, dt, START_HIGH)
    given = Inputs(trace.rotor_speed[0], wind=np.array([1.0, 2.0, 0.0]))
    return (
        trace.time_s,
        given,
        States(trace.angular_velocity[0], trace.quaternion[0], trace.velocity[0], trace.position[0]),
    )


def commands_of(n, dt):
    t = dt * np.arange(n)[:, None]
    return 1073.0 * (1 + 0.05 * np.sin(2 * np.pi * t * np.array([1.0, 1.3, 1.7, 2.1])))


START_HIGH = Start(position_m=np.array([[0.0, 0.0, -0.5]]), velocity_m_s=np.array([[3.0, 1.0, 0.0]]))


@pytest.mark.parametrize("known", ["all", "pushed", "no velocity", "rates alone"])
@pytest.mark.parametrize("step_s", [None, 0.004, 0.012])
def test_windows_are_those_of_numpy(known, step_s):
    time_s, inputs, states = recorded()
    effects = several()
    if known == "pushed":
        rng = np.random.default_rng(0)
        inputs = replace(
            inputs, force=rng.normal(0, 0.3, (len(time_s), 3)), moment=rng.normal(0, 1e-3, (len(time_s), 3))
        )
    if known == "no velocity":
        states, effects = replace(states, velocity=None, position=None), several()[2:4]
    if known == "rates alone":
        states, effects = States(states.angular_velocity), several()[2:4]
    assert_same_windows(VEHICLE, effects, time_s, inputs, states, step_s)


def assert_same_windows(vehicle, effects, time_s, inputs, states, step_s=None):
    how = dict(window_s=0.12, step_s=step_s)
    fast = simulate_windows(vehicle, effects, time_s, inputs, states, **how).predicted
    with by_numpy(vehicle):
        slow = simulate_windows(vehicle, effects, time_s, inputs, states, **how).predicted
    for name in ("angular_velocity", "quaternion", "velocity", "position"):
        a, b = getattr(fast, name), getattr(slow, name)
        assert (a is None) == (b is None)
        if a is not None:
            np.testing.assert_allclose(a, b, rtol=0, atol=1e-9 * max(1.0, np.abs(b).max()), err_msg=name)


def test_a_vehicle_of_ten_rotors_flies_as_by_numpy():
    """Ten rotors at two heights on five arms of the quadrotor's length; records have room for eight at first."""
    places = [(0.2 * np.cos(a), 0.2 * np.sin(a), z) for z in (-0.02, 0.02) for a in 2 * np.pi * np.arange(5) / 5]
    rotors = [dict(x_m=x, y_m=y, z_m=z, spin=("cw", "ccw")[n % 2]) for n, (x, y, z) in enumerate(places)]
    vehicle = audit_vehicle(rotors=rotors, thrust_coefficient_n_s2=0.4 * 1.3877e-6)
    drag = catalogue()["rotor_drag"].forms(vehicle)[0]
    speed = 1073.0 * (1 + 0.02 * np.sin(np.arange(60)[:, None] + np.arange(10)))
    how = dict(duration_s=0.2, step_s=0.004, start=START_HIGH, effects=[(drag, [3e-5])])
    fast = simulate(vehicle, Commands(0.004 * np.arange(60), speed), **how)
    with by_numpy(vehicle):
        assert_same(fast, simulate(vehicle, Commands(0.004 * np.arange(60), speed), **how))


def test_a_load_as_heavy_as_the_vehicle_is_solved_for_where_repetition_would_not_settle():
    form = next(form for name, form in WRENCHES if name == "payload" and form.name == "rigid")
    heavy = simulate(VEHICLE, commands(), 0.1, 0.004, start(), effects=[(form, [0.9, 0.0, 0.0, 0.0])])
    thrust = (VEHICLE.thrust_coefficients_n_s2() * heavy.rotor_speed**2).sum(axis=2)
    np.testing.assert_allclose(heavy.specific_force[..., 2], -thrust / (0.652 + 0.9), rtol=1e-9)


def test_the_small_inverse_is_that_of_numpy():
    rng = np.random.default_rng(1)
    for _ in range(20):
        matrix = rng.normal(size=(6, 6))
        matrix[0, 0] = 0.0
        found = matrix.copy()
        _invert.py_func(found)
        np.testing.assert_allclose(found, np.linalg.inv(matrix), rtol=1e-8, atol=1e-10)


def test_a_batch_flies_each_set_as_it_flies_alone():
    lag = ({"id": "motor_lag", "form": "up and down", "parameters": {"tau_up": 0.03, "tau_down": 0.05}},)
    vehicle = several_stated(more=lag, rotor_speed_limits_rad_s=(0, 2500))
    n, dt = 3, 0.004
    mass, drag = np.array([0.6, 0.652, 0.7]), np.array([1e-5, 3e-5, 0.0])
    batch = Batch(vehicle, n, {"mass_kg": mass, "rotor_drag.k_d": drag})
    flown = batch.fly(batch.hover(), commands_of(100, dt), dt, wind_m_s=np.array([4.0, 0.0, 0.0]), every=5)
    assert flown.position.shape == (n, 21, 3)
    for i in range(n):
        entries = [dict(e, parameters=dict(e["parameters"])) for e in vehicle.effects]
        entries[0]["parameters"]["k_d"] = float(drag[i])
        one = vehicle.model_copy(update={"mass_kg": float(mass[i]), "effects": tuple(entries)})
        held = Commands(dt * np.arange(100), commands_of(100, dt))
        alone = simulate_as_stated(one, held, 100 * dt, dt, wind_m_s=np.array([4.0, 0.0, 0.0]))
        for name in TRACE:
            a, b = getattr(flown, name)[i], getattr(alone, name)[0, ::5]
            if name.endswith(("acceleration", "force")):
                a, b = a[:-1], b[:-1]  # at the end the batch holds its last command
            np.testing.assert_allclose(a, b, rtol=0, atol=1e-9 * max(1.0, np.abs(b).max()), err_msg=name)


def test_steps_of_a_batch_make_up_its_flight_and_threads_change_nothing():
    vehicle = several_stated()
    batch = Batch(vehicle, 40, {"mass_kg": np.linspace(0.5, 0.8, 40)})
    series = commands_of(20, 0.004)
    whole = batch.fly(batch.hover(), series, 0.004, threads=2)
    single = batch.fly(batch.hover(), series, 0.004, threads=1)
    np.testing.assert_array_equal(whole.states, single.states)
    states = batch.hover()
    for command in series:
        states = batch.step(states, np.tile(command, (40, 1)), 0.004)
    np.testing.assert_allclose(states, whole.end, rtol=0, atol=1e-9)


def test_a_batch_names_what_it_does_not_know():
    with pytest.raises(InputError, match="has no parameter 'rotor_drag.k'.*rotor_drag.k_d"):
        Batch(several_stated(), 2, {"rotor_drag.k": np.zeros(2)})
    with pytest.raises(InputError, match=r"mass_kg has shape \(3,\), expected \(2,\)"):
        Batch(several_stated(), 2, {"mass_kg": np.ones(3)})
