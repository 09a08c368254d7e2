"""The section of crazyflow's params.toml flies as ours does: by its published equations, and in crazyflow itself."""

import tomllib

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rotorid.recordings import Vehicle, templates
from rotorid.vehicle.exports import export_vehicle
from rotorid.vehicle.exports.flown import commands_of, in_crazyflow, ours
from rotorid.vehicle.exports.forms import expressed
from tests.unit.vehicle.test_exports import DRAG, OFFSET, PRODUCTS, six_rotors, with_effects

STEP_S = 0.001


def section_of(vehicle: Vehicle) -> dict:
    found = tomllib.loads(export_vehicle(vehicle, "crazyflow").text)
    assert list(found) == ["rotorid"]
    return {name: np.asarray(value) for name, value in found["rotorid"].items()}


def accelerations(p: dict, turn: Rotation, velocity: np.ndarray, rates: np.ndarray, rpm: np.ndarray) -> tuple:
    """By crazyflow's documentation, forward-left-up: of the centre in world axes, and of turning in body axes."""
    powers = np.stack([np.ones(4), rpm, rpm**2], axis=1)
    thrust, twist = (p["rpm2thrust"] * powers).sum(1), (p["rpm2torque"] * powers).sum(1)
    force = turn.apply([0.0, 0.0, thrust.sum()]) + turn.apply(p["drag_matrix"] @ turn.inv().apply(velocity))
    torque = np.array([1, 1, 0]) * (p["mixing_matrix"] @ (p["L"] * thrust)) + [0, 0, p["mixing_matrix"][2] @ twist]
    turning = np.linalg.solve(p["J"], torque - np.cross(rates, p["J"] @ rates))
    return force / p["mass"] - [0.0, 0.0, 9.81], turning


def flown_by_the_equations(p: dict, speeds: np.ndarray) -> np.ndarray:
    """Places (n, 3) from the state in which our flights begin."""
    place, velocity, rates, turn = np.zeros(3), np.array([2.0, -2.0, 0.0]), np.zeros(3), Rotation.identity()
    out, fine = [place], 10
    for rpm in speeds[:-1] * 60 / (2 * np.pi):
        for _ in range(fine):
            pull, turning = accelerations(p, turn, velocity, rates, rpm)
            middle = rates + 0.5 * STEP_S / fine * turning
            place = place + STEP_S / fine * (velocity + 0.5 * STEP_S / fine * pull)
            velocity, rates = velocity + STEP_S / fine * pull, rates + STEP_S / fine * turning
            turn = turn * Rotation.from_rotvec(STEP_S / fine * middle)
        out.append(place)
    return np.array(out)


@pytest.mark.parametrize(("drag", "most_m"), [((), 2e-5), ((DRAG,), 1e-3)])
def test_it_flies_by_its_equations_as_ours_does(drag: tuple, most_m: float) -> None:
    """The drag that it holds is that at the speed of hover: there they part by more."""
    vehicle = with_effects(OFFSET, PRODUCTS, *drag)
    speeds = commands_of(expressed(vehicle, "crazyflow"), 0.3)[1]
    here = ours(expressed(vehicle, "crazyflow"), speeds)[0]
    there = flown_by_the_equations(section_of(vehicle), speeds)
    apart = float(np.linalg.norm(there - here, axis=1).max())
    assert apart < most_m, apart
    # Without the offset of the centre of mass the paths part: the comparison could fail.
    plain = flown_by_the_equations(section_of(with_effects(PRODUCTS, *drag)), speeds)
    assert float(np.linalg.norm(plain - here, axis=1).max()) > 5 * apart


def test_each_rotor_has_its_own_curve_and_lags_go_along() -> None:
    coefficients = (1.0e-5, 1.1e-5, 1.2e-5, 1.3e-5)
    vehicle = with_effects(("motor_lag", "up and down", {"tau_up": 0.02, "tau_down": 0.05})).model_copy(
        update={"thrust_coefficient_n_s2": coefficients}
    )
    p = section_of(vehicle)
    rpm = 300 * 60 / (2 * np.pi)
    assert p["rpm2thrust"][:, 2] * rpm**2 == pytest.approx(np.array(coefficients) * 300**2)
    assert p["rotor_dyn_coef"].tolist() == pytest.approx([50.0, 0.0, 20.0, 0.0])


def test_what_it_leaves_out_is_named() -> None:
    exported = export_vehicle(with_effects(DRAG, ("ground_effect", "inverse square", {"c": 1.0})), "crazyflow")
    said = " ".join(exported.left_out)
    for words in ("ground_effect", "at its hub", "lag of the rotors of 0 s", "list of drones"):
        assert words in said, words
    assert all(f"# Not expressed: {sentence}" in exported.text for sentence in exported.left_out)
    with pytest.raises(ValueError, match="crazyflow knows four rotors, found 6"):
        export_vehicle(six_rotors(), "crazyflow")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["thesis", "x500"])
def test_crazyflow_flies_it_within_a_millimetre_over_two_seconds(name: str) -> None:
    pytest.importorskip("crazyflow", reason="crazyflow is not installed: the section was not flown there")
    vehicle = templates.read(name)
    found = in_crazyflow(vehicle, export_vehicle(vehicle, "crazyflow"), 2.0)
    assert found.position_m < 1e-3 and found.flown_m > 2
