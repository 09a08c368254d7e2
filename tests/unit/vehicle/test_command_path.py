"""What lies between command and rotor speed, flown under a controller: the speeds that the whole series would give."""

import numpy as np
import pytest

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import SpeedForm
from rotorid.errors import InputError
from rotorid.recordings import Vehicle
from rotorid.vehicle.control import AttitudePid, AttitudeReference
from rotorid.vehicle.improved import command_path, flyable, simulate_as_stated, speeds_of_commands
from rotorid.vehicle.simulator import Commands, Start, Trace
from tests.unit.effects.flown import audit_vehicle, entry
from tests.unit.effects.test_catalogue_audit import speed_forms, speed_values
from tests.unit.vehicle.by_numpy import by_numpy

STEP_S, SECONDS = 0.004, 0.6
VOLTAGE = np.linspace(12.0, 10.5, round(SECONDS / STEP_S) + 1)
LIMITS = (0.0, 1500.0)

CHAIN = (
    {"id": "throttle_curve", "form": "affine", "parameters": {"a_0": 0.05, "a_1": 0.08}},
    {"id": "battery_sag", "form": "power of voltage", "parameters": {"p": 0.8}},
    {"id": "command_saturation", "form": "upper limit", "parameters": {"w_high": 0.76}},
    {"id": "delay", "form": "of the command", "parameters": {"T": 0.0137}},
    {"id": "motor_lag", "form": "on thrust", "parameters": {"tau": 0.03}},
)


def stated(*effects: dict) -> Vehicle:
    return audit_vehicle(rotor_speed_limits_rad_s=LIMITS, effects=effects)


def pilot(vehicle: Vehicle) -> AttitudePid:
    """An attitude loop whose commands go up and down by more than a tenth."""

    def wanted(t: float) -> np.ndarray:
        return 0.3 * np.sin(np.array([7.0, 9.0, 4.0]) * t + [0.0, 1.0, 2.0])

    j = np.diag(vehicle.inertia_kg_m2.matrix())
    gains = (tuple(60.0 * j), (0.0,) * 3, tuple(12.0 * j))
    return AttitudePid(vehicle, AttitudeReference("lively", 6.5, wanted), gains, 0.02)


def flown(vehicle: Vehicle, **settings) -> Trace:
    """Two vehicles under the pilot, high above the ground, one of them tilted at the start."""
    start = Start(
        *(np.zeros((2, 3)) + [[0.0, 0.0, -50.0]], np.zeros((2, 3)), np.array([[0, 0, 0], [0.2, -0.1, 0.4]])),
        np.zeros((2, 3)),
    )
    return simulate_as_stated(vehicle, pilot(vehicle), SECONDS, STEP_S, VOLTAGE, start=start, **settings)


def assert_as_the_series(vehicle: Vehicle, trace: Trace, rtol: float = 1e-6) -> None:
    for command, speed in zip(trace.rotor_command, trace.rotor_speed, strict=True):
        expected = speeds_of_commands(vehicle, command, trace.time_s, VOLTAGE)
        np.testing.assert_allclose(speed, np.clip(expected, *LIMITS), rtol=rtol)


@pytest.mark.parametrize(("effect", "form"), list(speed_forms()))
def test_a_closed_loop_turns_the_rotors_as_the_recorded_commands_would(effect, form: SpeedForm):
    vehicle = stated(entry(effect.id, form, speed_values(form)))
    trace = flown(vehicle)
    assert np.ptp(trace.rotor_command, axis=1).min() > 50.0
    assert np.abs(trace.rotor_speed - trace.rotor_command).max() > (0.1 if form.excited_by == "time" else 10.0)
    assert_as_the_series(vehicle, trace)


def test_all_stages_together_and_below_a_slung_load():
    """A memory flies in several rounds: each must begin its path anew."""
    slung = {"id": "payload", "form": "slung", "parameters": {"m_p": 0.1, "m_p z": 0.0, "L": 0.5, "ζ": 0.05}}
    for vehicle in (stated(*CHAIN), stated(*CHAIN, slung)):
        trace = flown(vehicle)
        assert (trace.rotor_speed - trace.rotor_command).std() > 20.0
        assert_as_the_series(vehicle, trace)


@pytest.mark.parametrize("form", ["one constant", "up and down", "on thrust"])
def test_a_lag_without_time_changes_nothing(form: str):
    speed_form = next(f for f in catalogue()["motor_lag"].speed_forms if f.name == form)
    trace = flown(stated(entry("motor_lag", speed_form, speed_form.neutral)))
    np.testing.assert_array_equal(trace.rotor_speed, trace.rotor_command)


def test_a_lag_far_below_the_step_flies_and_starts_at_the_speed_given():
    vehicle = stated({"id": "motor_lag", "form": "one constant", "parameters": {"tau": 1e-4}})
    start = Start(rotor_speed_rad_s=np.full((1, 4), 900.0))
    trace = simulate_as_stated(vehicle, pilot(vehicle), SECONDS, STEP_S, start=start)
    assert trace.rotor_speed[0, 0] == pytest.approx(900.0)
    np.testing.assert_allclose(trace.rotor_speed[0, 2:], trace.rotor_command[0, 1:-1], rtol=1e-6)


def test_the_acceleration_of_the_rotors_reaches_the_effects():
    """The reaction of speeding rotors: Q = J_r dω/dt summed with the spins, against what the trace itself shows."""
    chain = (CHAIN[0], CHAIN[-1])
    reaction = {"id": "rotor_acceleration_torque", "form": "reaction", "parameters": {"J_r": 2e-5}}
    vehicle = stated(*chain, reaction)
    trace = flown(vehicle)
    plain = simulate_as_stated(stated(*chain), Commands(trace.time_s, trace.rotor_command[0]), SECONDS, STEP_S)
    backward = np.diff(trace.rotor_speed[0], axis=0) / STEP_S
    turning = trace.angular_acceleration[0, 1:, 2] - plain.angular_acceleration[0, 1:, 2]
    gyroscopic = _euler(vehicle, trace.angular_velocity[0, 1:]) - _euler(vehicle, plain.angular_velocity[0, 1:])
    expected = 2e-5 * backward @ vehicle.yaw_signs() / vehicle.inertia_kg_m2.zz
    assert np.abs(expected).max() > 1.0
    np.testing.assert_allclose(turning - gyroscopic, expected, atol=1e-6 * np.abs(expected).max())


def _euler(vehicle: Vehicle, rates: np.ndarray) -> np.ndarray:
    """Yaw acceleration, rad/s², of a body turning by itself."""
    j = vehicle.inertia_kg_m2
    return (j.xx - j.yy) / j.zz * rates[:, 0] * rates[:, 1]


def test_known_commands_stay_in_the_trace():
    vehicle = stated(*CHAIN)
    closed = flown(vehicle)
    again = simulate_as_stated(vehicle, Commands(closed.time_s, closed.rotor_command[0]), SECONDS, STEP_S, VOLTAGE)
    np.testing.assert_array_equal(again.rotor_command[0], closed.rotor_command[0])
    np.testing.assert_allclose(again.rotor_speed[0], closed.rotor_speed[0], rtol=1e-6)


def test_what_a_controller_cannot_fly_is_said():
    early = {"id": "delay", "form": "of the command", "parameters": {"T": -0.02}}
    near = {"id": "ground_effect", "form": "image rotor", "parameters": {"c": 1.0}}
    bare = replace_ground(stated(early, *CHAIN[:2], near))
    vehicle, said = flyable(bare)
    assert [e["id"] for e in vehicle.effects] == ["throttle_curve", "battery_sag", "ground_effect"]
    assert vehicle.ground_z_m == 0.0 and vehicle.rotor_speed_limits_rad_s[1] == pytest.approx(2 * 1073.3, rel=1e-3)
    assert ["-0.02 s is left out" in said[0], "full voltage" in said[1], "2147 rad/s" in said[2]] == [True] * 3
    assert "ground_z_m" in said[3] and len(said) == 4
    assert flyable(vehicle)[0] == vehicle
    with pytest.raises(InputError, match="needs rotor_speed_limits_rad_s"):
        command_path(bare)
    with pytest.raises(InputError, match="a stand does not fly"):
        flyable(bare.model_copy(update={"kind": "stand"}))


def replace_ground(vehicle: Vehicle) -> Vehicle:
    """The vehicle without what its effects refer to."""
    return vehicle.model_copy(update={"ground_z_m": None, "rotor_speed_limits_rad_s": None})


def test_a_path_flies_the_same_compiled_and_by_numpy():
    """With effects of the rotors' acceleration, of the time (a gust) and of the accelerations themselves."""
    gust = {"f_north_1": 1.0, "f_north_2": -0.6, "f_east_1": 0.4, "f_east_2": 0.8}
    effects = (
        {"id": "rotor_acceleration_torque", "form": "reaction", "parameters": {"J_r": 2e-5}},
        {"id": "gust", "form": "0.10 s to 0.50 s, 2 knots", "parameters": gust},
        {"id": "payload", "form": "rigid", "parameters": {"m_p": 0.05, "m_p x": 1e-4, "m_p y": 2e-4, "m_p z": 0.0}},
    )
    vehicle = stated(*CHAIN, *effects)
    fast = flown(vehicle)
    with by_numpy(vehicle):
        slow = flown(vehicle)
    for name in ("position", "angular_velocity", "specific_force", "rotor_speed", "rotor_command"):
        np.testing.assert_allclose(getattr(fast, name), getattr(slow, name), rtol=1e-6, atol=1e-7, err_msg=name)
    assert np.abs(fast.velocity - flown(stated(*CHAIN)).velocity).max() > 0.1
