"""Hover of vehicles with effects: by hand, and as the simulator flies what is asked for."""

import numpy as np
import pytest

from rotorid.recordings import Vehicle
from rotorid.vehicle.control import AttitudePid, AttitudeReference
from rotorid.vehicle.improved import command_path, hover, simulate_as_stated
from rotorid.vehicle.simulator import Start
from tests.unit.effects.flown import audit_vehicle

WEIGHT = 0.652 * 9.81


def stated(*effects: tuple[str, str, dict[str, float]]) -> Vehicle:
    entries = tuple({"id": i, "form": f, "parameters": p} for i, f, p in effects)
    return audit_vehicle(rotor_speed_limits_rad_s=(0.0, 2000.0), effects=entries)


def found(vehicle: Vehicle):
    return hover(vehicle, command_path(vehicle), 50.0)


def test_without_effects_it_is_the_weight():
    assert found(stated()).thrust_n == WEIGHT
    assert found(stated()).moments_n_m == (0.0, 0.0, 0.0)
    assert found(stated()).gain == pytest.approx(1.0)


def test_a_curve_and_a_payload_by_hand():
    # ω = 1.1 ω_c: the force is 1.21 times the one asked for.
    curved = found(stated(("throttle_curve", "affine", {"a_0": 0.0, "a_1": 0.1})))
    assert curved.thrust_n == pytest.approx(WEIGHT / 1.21) and curved.gain == pytest.approx(1.21)
    # 0.1 kg at 20 mm ahead: (m + m_p) g is wanted, and m_p g r nose down is balanced nose up.
    loaded = found(stated(("payload", "rigid", {"m_p": 0.1, "m_p x": 0.002, "m_p y": 0.0, "m_p z": 0.0})))
    assert loaded.thrust_n == pytest.approx(0.752 * 9.81)
    np.testing.assert_allclose(loaded.moments_n_m, [0.0, 0.002 * 9.81, 0.0], atol=1e-8)
    slung = found(stated(("payload", "slung", {"m_p": 0.1, "m_p z": 0.0, "L": 0.5, "ζ": 0.05})))
    assert slung.thrust_n == pytest.approx(0.752 * 9.81)


def test_a_vehicle_that_its_rotors_do_not_carry():
    weak = found(stated(("command_saturation", "upper limit", {"w_high": 0.4})))
    assert weak.supported == pytest.approx(4 * 1.3877e-6 * 800.0**2 / WEIGHT)


EFFECTS = (
    ("throttle_curve", "power of the throttle", {"n": 0.7}),
    ("motor_lag", "on thrust", {"tau": 0.03}),
    ("com_offset", "moment", {"r_x": 0.012, "r_y": -0.007}),
    ("unequal_rotors", "thrust of rotor 1", {"d_1": -0.08}),
)


def test_what_is_asked_for_holds_a_vehicle_level_at_its_height():
    vehicle = stated(*EFFECTS)
    asked = found(vehicle)
    j = np.diag(vehicle.inertia_kg_m2.matrix()) / asked.gain
    start = Start(position_m=np.array([[0.0, 0.0, -50.0]]))

    def flight(thrust_n: float, trim: tuple[float, float, float]):
        level = AttitudeReference("level", thrust_n, lambda t: np.zeros(3))
        pid = AttitudePid(vehicle, level, (tuple(50.0 * j), (0.0,) * 3, tuple(11.0 * j)), 0.02, None, trim)
        return simulate_as_stated(vehicle, pid, 2.0, 0.002, start=start)

    held = flight(asked.thrust_n, asked.moments_n_m)
    assert np.abs(held.euler_rad).max() < 1e-4
    assert np.abs(held.position[0] - held.position[0, 0]).max() < 1e-3
    assert np.abs(flight(WEIGHT, (0.0, 0.0, 0.0)).position[0] - held.position[0]).max() > 1.0
