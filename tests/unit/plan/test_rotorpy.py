"""Plans flown by another simulator, RotorPy, through its own controller, from the polynomials handed over."""

import numpy as np
import pandas as pd
import pytest

from rotorid.plan import write
from rotorid.plan.candidates import Limits, candidates, joined, smaller
from rotorid.plan.plan import Plan, yaw_acceleration
from rotorid.plan.simulate import CompetingModel, fly
from rotorid.recordings import Vehicle

STEP_S = 0.01
LIMITS = Limits(x_m=(-5, 5), y_m=(-5, 5), height_m=(1, 5), speed_m_s=4, climb_m_s=2, tilt_deg=30)
PLANS = (("drift", "pass 90 at 1"), ("shake sideways to 1 Hz", "climb at 1"), ("waves 0", "face"))
"""Manoeuvres flown."""
SIZE = 0.5
"""Of the limits: the position loop makes motions near 1 Hz larger than they are asked for."""


def flat(table: pd.DataFrame, t: float) -> dict:
    """RotorPy's flat outputs (z up) at an instant, from the pieces as a Crazyflie evaluates them."""
    starts = (table["duration"].cumsum() - table["duration"]).to_numpy()
    row = max(int(np.searchsorted(starts, t, side="right")) - 1, 0)
    now = t - starts[row]
    values = {}
    for axis in ("x", "y", "z", "yaw"):
        polynomial = np.polynomial.Polynomial([table[f"{axis}^{p}"].iloc[row] for p in range(8)])
        values[axis] = [polynomial.deriv(order)(now) if order else polynomial(now) for order in range(5)]
    names = ("x", "x_dot", "x_ddot", "x_dddot", "x_ddddot")
    out = {n: np.array([values[a][i] for a in "xyz"]) for i, n in enumerate(names)}
    return out | {"yaw": values["yaw"][0], "yaw_dot": values["yaw"][1]}


def hummingbird(parameters: dict) -> Vehicle:
    """RotorPy's vehicle in the contract's axes."""
    rotors = [
        {"x_m": float(p[0]), "y_m": -float(p[1]), "z_m": -float(p[2]), "spin": "cw" if d > 0 else "ccw"}
        for p, d in zip(parameters["rotor_pos"].values(), parameters["rotor_directions"], strict=True)
    ]
    return Vehicle.model_validate(
        {
            "name": "hummingbird", "kind": "flight", "mass_kg": parameters["mass"],
            "inertia_kg_m2": {"xx": parameters["Ixx"], "yy": parameters["Iyy"], "zz": parameters["Izz"]},
            "rotors": rotors, "thrust_coefficient_n_s2": parameters["k_eta"],
            "torque_coefficient_n_m_s2": parameters["k_m"], "ground_z_m": 0.0,
        }
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("names", PLANS, ids=" and ".join)
def test_rotorpy_flies_a_plan_within_the_limits(names: tuple[str, ...]) -> None:
    from rotorpy.controllers.quadrotor_control import SE3Control
    from rotorpy.vehicles.hummingbird_params import quad_params
    from rotorpy.vehicles.multirotor import Multirotor

    vehicle, controller = hummingbird(quad_params), SE3Control(quad_params)
    bandwidth = float(np.sqrt(controller.kp_att))
    position = float(np.sqrt(controller.kp_pos[0]))
    options = {p.name: p for p in candidates(smaller(LIMITS, SIZE), SIZE * yaw_acceleration(vehicle))}
    pieces = tuple(options[n] for n in names)
    reference = joined(pieces, 0.004)
    expected = fly(CompetingModel(vehicle), reference, bandwidth, LIMITS.middle_m, position)
    table, _ = write.crazyflie(Plan("chosen", pieces, reference, expected, (), (), "set", LIMITS))

    first = flat(table, 0.0)
    hover = np.sqrt(quad_params["mass"] * 9.81 / 4 / quad_params["k_eta"])
    state = {
        "x": first["x"], "v": np.zeros(3), "q": np.array([0.0, 0.0, 0.0, 1.0]), "w": np.zeros(3), "wind": np.zeros(3),
        "rotor_speeds": np.full(4, hover),
    }  # fmt: skip
    plant = Multirotor(quad_params, state, control_abstraction="cmd_motor_speeds", aero=True)
    times = np.arange(0.0, reference.duration_s, STEP_S)
    flown, asked = [], []
    for t in times:
        state = plant.step(state, controller.update(t, state, flat(table, t)), STEP_S)
        flown.append([*state["x"], *state["v"], 1 - 2 * (state["q"][0] ** 2 + state["q"][1] ** 2)])
        asked.append(flat(table, t + STEP_S)["x"])
    flown, asked = np.array(flown), np.array(asked)
    tilt = np.degrees(np.arccos(np.clip(flown[:, 6], -1, 1)))
    speed = np.linalg.norm(flown[:, 3:5], axis=1)
    off = np.linalg.norm(flown[:, :3] - asked, axis=1)
    # What was predicted of the flight came out in another simulator under another controller.
    assert off.max() < 0.5
    assert speed.max() == pytest.approx(expected.speed_m_s, rel=0.15)
    assert tilt.max() < LIMITS.tilt_deg + 8
    assert flown[:, 2].min() > LIMITS.height_m[0] - 0.3 and flown[:, 2].max() < LIMITS.height_m[1]
    assert np.abs(flown[:, 0]).max() < LIMITS.x_m[1] and np.abs(flown[:, 1]).max() < LIMITS.y_m[1]
