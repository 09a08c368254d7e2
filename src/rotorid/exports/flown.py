"""An exported vehicle flown in the tool it is for, beside ours, on the same rotor speeds."""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np

from rotorid.exports.forms import AT_ONCE_S, FLU, Exported
from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle.improved import simulate_as_stated
from rotorid.vehicle.simulator import Commands, Start

STEP_S = 0.001
START_M_S = 2.0
"""Speed forward and to the right at the start, so that drag shows."""


@dataclass(frozen=True)
class Difference:
    """How far two simulations part: largest distance and angle, beside how far ours flew and turned."""

    position_m: float
    angle_rad: float
    flown_m: float
    turned_rad: float

    @property
    def sentence(self) -> str:
        return (
            f"flown beside ours on the same commands: at most {self.position_m:.2g} m apart after "
            f"{self.flown_m:.2g} m of way and {self.angle_rad:.2g} rad after {self.turned_rad:.2g} rad of turning"
        )


def commands_of(vehicle: Vehicle, duration_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) and rotor speeds (n, k), rad/s, about hover that turn the vehicle about every axis in turn."""
    time = np.arange(int(duration_s / STEP_S) + 1) * STEP_S
    hover = np.sqrt(vehicle.mass_kg * vehicle.gravity_m_s2 / vehicle.thrust_coefficients_n_s2().sum())
    phase = 2 * np.pi * np.arange(vehicle.rotor_count) / vehicle.rotor_count
    swing = 0.004 * np.sin(2 * np.pi * 1.5 * time[:, None] + phase) + 0.02 * np.sin(2 * np.pi * 0.7 * time)[:, None]
    return time, hover * (1 + swing)


def ours(vehicle: Vehicle, duration_s: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position (n, 3), attitude (n, 4), scalar first, and rotor speeds (n, k), forward-left-up, as we fly it."""
    time, speeds = commands_of(vehicle, duration_s)
    start = Start(velocity_m_s=np.array([[START_M_S, START_M_S, 0.0]]), rotor_speed_rad_s=speeds[:1])
    flown = vehicle.model_copy(update={"effects": tuple(e for e in vehicle.effects if e["id"] != "motor_lag")})
    lag = next((e["parameters"] for e in vehicle.effects if e["id"] == "motor_lag"), None)
    if lag is not None and "tau" in lag:  # the lag as the tool has it, sample by sample
        keep, out = np.exp(-STEP_S / float(lag["tau"])), speeds.copy()
        for k in range(1, len(out)):
            out[k] = keep * out[k - 1] + (1 - keep) * speeds[k - 1]
        speeds = out
    trace = simulate_as_stated(flown, Commands(time, speeds), duration_s, STEP_S, start=start)
    quaternion = trace.quaternion[0] * np.array([1.0, *FLU])
    return trace.position[0] * FLU, quaternion, trace.rotor_speed[0]


def angle_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angle (n,), rad, between attitudes (n, 4); exact for small ones, where an arc cosine is not."""
    a, b = (q / np.linalg.norm(q, axis=1, keepdims=True) for q in (a, b))
    apart = np.minimum(np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1))
    return 4 * np.arcsin(np.clip(apart / 2, 0, 1))


def difference(there: tuple[np.ndarray, np.ndarray], here: tuple[np.ndarray, np.ndarray, np.ndarray]) -> Difference:
    """Largest differences of positions (n, 3) and attitudes (n, 4)."""
    return Difference(
        float(np.linalg.norm(there[0] - here[0], axis=1).max()),
        float(angle_between(there[1], here[1]).max()),
        float(np.linalg.norm(np.diff(here[0], axis=0), axis=1).sum()),
        float(angle_between(here[1], here[1][:1]).max()),
    )


def in_rotorpy(vehicle: Vehicle, exported: Exported, duration_s: float = 0.3) -> Difference:
    """Fly RotorPy's Multirotor with the exported parameters beside ours."""
    from rotorpy.vehicles.multirotor import Multirotor

    time, speeds = commands_of(vehicle, duration_s)
    state = {
        "x": np.zeros(3), "v": np.array([START_M_S, -START_M_S, 0.0]), "q": np.array([0.0, 0.0, 0.0, 1.0]),
        "w": np.zeros(3), "wind": np.zeros(3), "rotor_speeds": speeds[0],
    }  # fmt: skip
    tight = {"method": "RK45", "rtol": 1e-6, "atol": 1e-9}
    flyer = Multirotor(exported.parameters, state, control_abstraction="cmd_motor_speeds", integrator_kwargs=tight)
    at_once = exported.parameters["tau_m"] == AT_ONCE_S
    if at_once:  # the speed is set at every step and stays over it
        flyer.tau_m = 1e6
    position, attitude = [state["x"]], [np.array([1.0, 0, 0, 0])]
    for k in range(len(time) - 1):
        if at_once:
            state["rotor_speeds"] = speeds[k]
        state = flyer.step(state, {"cmd_motor_speeds": speeds[k]}, STEP_S)
        position.append(state["x"])
        attitude.append(np.asarray(state["q"])[[3, 0, 1, 2]])
    return difference((np.array(position), np.array(attitude)), ours(vehicle, duration_s))


def in_mujoco(vehicle: Vehicle, exported: Exported, duration_s: float = 0.3) -> Difference:
    """Fly the exported model in MuJoCo beside ours without the effects that the model cannot express."""
    import mujoco

    kept = tuple(e for e in vehicle.effects if e["id"] in ("com_offset", "inertia_products"))
    same = vehicle.model_copy(update={"effects": kept})
    model = mujoco.MjModel.from_xml_string(exported.text)
    data = mujoco.MjData(model)
    data.qpos[:] = [0, 0, 0, 1, 0, 0, 0]
    data.qvel[:3] = [START_M_S, -START_M_S, 0.0]
    time, speeds = commands_of(same, duration_s)
    position, attitude = [data.qpos[:3].copy()], [data.qpos[3:7].copy()]
    for k in range(len(time) - 1):
        data.ctrl[:] = same.thrust_coefficients_n_s2() * speeds[k] ** 2
        mujoco.mj_step(model, data)
        position.append(data.qpos[:3].copy())
        attitude.append(data.qpos[3:7].copy())
    return difference((np.array(position), np.array(attitude)), ours(same, duration_s))


def try_out(vehicle: Vehicle, to: str, exported: Exported) -> str:
    """What a flight beside ours showed, or why none was made."""
    flyers = {"rotorpy": ("rotorpy", in_rotorpy), "mjcf": ("mujoco", in_mujoco)}
    if to not in flyers:
        return ""
    package, fly = flyers[to]
    try:
        return fly(vehicle, exported).sentence
    except ImportError as error:
        if error.name != package and package not in sys.modules:
            return f"not flown there: {error}"
        return f"not flown there: {package} is not installed"
