"""Steps by hand: the vehicle after them, and where an effect's coefficients act then."""

import numpy as np
import pytest

from rotorid.effects.catalogue import catalogue
from rotorid.effects.contract import Motion
from rotorid.plan.simulate import MASS_SHARE, masses, swaps
from rotorid.recordings import Vehicle

VEHICLE = Vehicle.model_validate(
    {
        "name": "quad",
        "kind": "flight",
        "mass_kg": 1.0,
        "inertia_kg_m2": {"xx": 0.01, "yy": 0.012, "zz": 0.02},
        "rotors": [
            {"x_m": x, "y_m": y, "spin": spin}
            for x, y, spin in ((0.1, 0.1, "ccw"), (0.1, -0.1, "cw"), (-0.1, -0.1, "ccw"), (-0.1, 0.1, "cw"))
        ],
        "thrust_coefficient_n_s2": 1e-6,
        "torque_coefficient_n_m_s2": 1e-8,
    }
)
HOVER = 1566.0


def motion(speeds) -> Motion:
    return Motion(time_s=np.zeros(1), rotor_speed=np.array([speeds], float))


def form(effect: str, name: str):
    return next(f for f in catalogue()[effect].forms(VEHICLE) if f.name == name)


def test_propellers_that_turn_the_same_way_are_swapped_and_both_pairs() -> None:
    assert [c.pairs for c in swaps(VEHICLE)] == [((0, 2),), ((1, 3),), ((0, 2), (1, 3))]


def test_the_moment_of_a_propeller_goes_with_it_and_its_torque_stays() -> None:
    change = swaps(VEHICLE)[0]
    one = form("unequal_rotors", "rotor 1")
    before = one.contribution(motion([HOVER] * 4), VEHICLE, [0.1])
    after = change.moved["unequal_rotors"](one).contribution(motion([HOVER] * 4), change.vehicle, [0.1])
    assert after.moment[0, :2] == pytest.approx(-before.moment[0, :2])
    assert after.moment[0, 2] == pytest.approx(before.moment[0, 2])
    assert after.force == pytest.approx(before.force)


def test_a_swapped_propeller_has_the_speed_of_its_new_place() -> None:
    change = swaps(VEHICLE)[0]
    one = form("unequal_rotors", "thrust of rotor 1")
    after = change.moved["unequal_rotors"](one).contribution(motion([100, 200, 300, 400]), change.vehicle, [1.0])
    assert -after.force[0, 2] == pytest.approx(1e-6 * 300**2)


def test_a_mass_moves_the_rotors_from_the_common_centre() -> None:
    front, _ = masses(VEHICLE)
    centre = MASS_SHARE / (1 + MASS_SHARE) * np.hypot(0.1, 0.1)
    assert front.vehicle.mass_kg == pytest.approx(1.05)
    assert [r.x_m for r in front.vehicle.rotors] == pytest.approx([0.1 - centre] * 2 + [-0.1 - centre] * 2)
    # Two bodies about their common centre: reduced mass times the square of their distance.
    assert front.vehicle.inertia_kg_m2.yy - 0.012 == pytest.approx(MASS_SHARE / (1 + MASS_SHARE) * 0.02)


def test_an_offset_of_the_vehicle_is_a_smaller_one_of_both_masses() -> None:
    front, _ = masses(VEHICLE)
    plane = form("com_offset", "moment")
    before = plane.contribution(motion([HOVER] * 4), VEHICLE, [0.001, 0.0])
    after = front.moved["com_offset"](plane).contribution(motion([HOVER] * 4), front.vehicle, [0.001, 0.0])
    assert after.moment == pytest.approx(before.moment / (1 + MASS_SHARE))
