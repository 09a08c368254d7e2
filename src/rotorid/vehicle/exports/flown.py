"""An exported vehicle flown in the tool it is for, next to ours with what the file expresses, on the same commands.

What a file cannot express is named by `rotorid.vehicle.exports.forms`; a flight here shows that what it does express
flies as it does with us. RotorPy and MuJoCo fly their file themselves. Gazebo and gym-pybullet-drones are no packages
that pip installs: their file is read and integrated by an engine that is one (Drake reads SDF, Bullet is
gym-pybullet-drones' own), and what their own code adds, the forces of the rotors, is written here by their published
equations from the file's numbers.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any
from xml.etree import ElementTree

import numpy as np

from rotorid.errors import InputError
from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle.exports.derivatives import MUJOCO_FILE, ROTORPY_FILE
from rotorid.vehicle.exports.forms import AT_ONCE_S, FLU, KNOWS, Exported, expressed, parts_of
from rotorid.vehicle.improved import simulate_as_stated
from rotorid.vehicle.mixer import hover_speed_rad_s
from rotorid.vehicle.simulator import Commands, Start

_STEP_S = 0.001
_START_M_S = 2.0
"""Speed forward and to the right at the start, so that drag shows."""


@dataclass(frozen=True)
class _FlightDifference:
    """How far two simulations part: largest distance and angle, next to how far ours flew and turned."""

    position_m: float
    angle_rad: float
    flown_m: float
    turned_rad: float
    where: str = ""

    @property
    def sentence(self) -> str:
        return (
            f"flown in {self.where} next to our own flight of what the file holds, without what it does not express, "
            f"on the same commands: at most {self.position_m:.2g} m apart after {self.flown_m:.2g} m of way and "
            f"{self.angle_rad:.2g} rad after {self.turned_rad:.2g} rad of turning"
        )


def commands_of(vehicle: Vehicle, duration_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Times (n,) and rotor speeds (n, k), rad/s, about hover and within the vehicle's limits that turn it about every
    axis in turn."""
    time = np.arange(int(duration_s / _STEP_S) + 1) * _STEP_S
    hover = hover_speed_rad_s(vehicle)
    phase = 2 * np.pi * np.arange(vehicle.rotor_count) / vehicle.rotor_count
    # Phases around the vehicle roll and pitch it; their torques cancel, so yaw has a swing of its own.
    swing = 0.004 * np.sin(2 * np.pi * 1.5 * time[:, None] + phase) + 0.02 * np.sin(2 * np.pi * 0.7 * time)[:, None]
    swing = swing + 0.02 * np.sin(2 * np.pi * 1.1 * time)[:, None] * vehicle.yaw_signs()
    return time, np.clip(hover * (1 + swing), *(vehicle.rotor_speed_limits_rad_s or (0.0, np.inf)))


def ours(vehicle: Vehicle, speeds: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position (n, 3), attitude (n, 4), scalar first, and rotor speeds (n, k), forward-left-up, as we fly it.

    `speeds` (n, k), rad/s, are those of the rotors, each held for a step.
    """
    start = Start(velocity_m_s=np.array([[_START_M_S, _START_M_S, 0.0]]), rotor_speed_rad_s=speeds[:1])
    time = _STEP_S * np.arange(len(speeds))
    trace = simulate_as_stated(vehicle, Commands(time, speeds), time[-1], _STEP_S, start=start)
    quaternion = trace.quaternion[0] * np.array([1.0, *FLU])
    return trace.position[0] * FLU, quaternion, trace.rotor_speed[0]


def lagging(speeds: np.ndarray, up_s: float, down_s: float) -> np.ndarray:
    """Speeds (n, k) that follow commands (n, k) with a first-order lag up and down; at once where it is 0."""
    if up_s == 0 or down_s == 0:
        return speeds
    out = speeds.copy()
    for k in range(1, len(out)):
        keep = np.exp(-_STEP_S / np.where(speeds[k - 1] > out[k - 1], up_s, down_s))
        out[k] = keep * out[k - 1] + (1 - keep) * speeds[k - 1]
    return out


def _angle_between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angle (n,), rad, between attitudes (n, 4); exact for small ones, where an arc cosine is not."""
    a, b = (q / np.linalg.norm(q, axis=1, keepdims=True) for q in (a, b))
    apart = np.minimum(np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1))
    return 4 * np.arcsin(np.clip(apart / 2, 0, 1))


def difference(
    there: tuple[np.ndarray, np.ndarray], here: tuple[np.ndarray, np.ndarray, np.ndarray], where: str
) -> _FlightDifference:
    """Largest differences of positions (n, 3) and attitudes (n, 4)."""
    return _FlightDifference(
        float(np.linalg.norm(there[0] - here[0], axis=1).max()),
        float(_angle_between(there[1], here[1]).max()),
        float(np.linalg.norm(np.diff(here[0], axis=0), axis=1).sum()),
        float(_angle_between(here[1], here[1][:1]).max()),
        where,
    )


def through_rotorpy(
    exported: Exported, state: dict[str, np.ndarray], speeds: np.ndarray, steps_s: Iterable[float], at_once: bool,
    **how: Any,
) -> dict[str, np.ndarray]:  # fmt: skip
    """Flight of RotorPy's Multirotor, or that of the file's companion, from a state on: x, v, q and w, (n + 1, ...).

    Each of the speeds (n, k), rad/s, is commanded for its step; `at_once` it is set as the rotors' own.
    """
    from rotorpy.vehicles.multirotor import Multirotor

    scope: dict[str, Any] = {"WithDerivatives": Multirotor}
    exec(exported.companions.get(ROTORPY_FILE, ""), scope)
    with read_by("RotorPy"):
        flyer = scope["WithDerivatives"](exported.parameters, state, control_abstraction="cmd_motor_speeds", **how)
    if at_once:  # the speed is set at every step and stays over it
        flyer.tau_m = 1e6
    kept = [state]
    for speed, step_s in zip(speeds, steps_s, strict=True):
        state = {**state, "rotor_speeds": speed} if at_once else state
        state = flyer.step(state, {"cmd_motor_speeds": speed}, step_s)
        kept.append(state)
    return {name: np.array([np.asarray(s[name]) for s in kept]) for name in ("x", "v", "q", "w")}


@contextmanager
def passive_forces(exported: Exported) -> Iterator[None]:
    """MuJoCo with the callback of the file's companion or none, and after it with that of before."""
    import mujoco

    scope: dict[str, Any] = {"passive": None}
    exec(exported.companions.get(MUJOCO_FILE, ""), scope)
    before = mujoco.get_mjcb_passive()
    mujoco.set_mjcb_passive(scope["passive"])
    try:
        yield
    finally:
        mujoco.set_mjcb_passive(before)


def in_rotorpy(vehicle: Vehicle, exported: Exported, duration_s: float = 0.3) -> _FlightDifference:
    """Fly RotorPy's Multirotor with the exported parameters and their companion next to ours."""
    same = expressed(vehicle, "rotorpy")
    time, speeds = commands_of(same, duration_s)
    tau_s = exported.parameters["tau_m"]
    state = {
        "x": np.zeros(3), "v": np.array([_START_M_S, -_START_M_S, 0.0]), "q": np.array([0.0, 0.0, 0.0, 1.0]),
        "w": np.zeros(3), "wind": np.zeros(3), "rotor_speeds": speeds[0],
    }  # fmt: skip
    tight, at_once = {"method": "RK45", "rtol": 1e-6, "atol": 1e-9}, tau_s == AT_ONCE_S
    steps_s = [_STEP_S] * (len(time) - 1)
    there = through_rotorpy(exported, state, speeds[:-1], steps_s, at_once, integrator_kwargs=tight)
    turning = speeds if at_once else lagging(speeds, tau_s, tau_s)
    return difference((there["x"], there["q"][:, [3, 0, 1, 2]]), ours(same, turning), "RotorPy")


def in_mujoco(vehicle: Vehicle, exported: Exported, duration_s: float = 0.3) -> _FlightDifference:
    """Fly the exported model and its companion in MuJoCo next to ours with what they hold."""
    import mujoco

    with read_by("MuJoCo"):
        model = mujoco.MjModel.from_xml_string(exported.text)
    data = mujoco.MjData(model)
    data.qpos[:] = [0, 0, 0, 1, 0, 0, 0]
    data.qvel[:3] = [_START_M_S, -_START_M_S, 0.0]
    same = expressed(vehicle, "mjcf")
    time, speeds = commands_of(same, duration_s)
    thrust = same.thrust_coefficients_n_s2() * speeds**2
    tau_s = float(model.actuator_dynprm[0, 0]) if model.na else 0.0
    data.act[:] = thrust[0, : model.na]
    position, attitude = [data.qpos[:3].copy()], [data.qpos[3:7].copy()]
    with passive_forces(exported):
        for k in range(len(time) - 1):
            data.ctrl[:] = thrust[k]
            mujoco.mj_step(model, data)
            position.append(data.qpos[:3].copy())
            attitude.append(data.qpos[3:7].copy())
    here = ours(same, np.sqrt(lagging(speeds**2, tau_s, tau_s)))
    return difference((np.array(position), np.array(attitude)), here, "MuJoCo")


@contextmanager
def read_by(tool: str) -> Iterator[None]:
    """What a tool says of a file that it does not read, in one sentence."""
    try:
        yield
    except Exception as error:  # each tool has errors of its own
        raise InputError(f"{tool} does not read the exported vehicle: {' '.join(str(error).split())}") from error


def _gazebo_motors(text: str) -> list[dict[str, Any]]:
    """What each `MulticopterMotorModel` of an SDF file says by its tags, in the order of their numbers; SI units.

    `sense` is 1 for counter-clockwise seen from above, else −1.
    """
    names = ("timeConstantUp", "timeConstantDown", "motorConstant", "momentConstant", "rotorDragCoefficient")
    plugins = [p for p in ElementTree.fromstring(text).iter("plugin") if p.find("motorNumber") is not None]
    out = []
    for plugin in sorted(plugins, key=lambda p: int(p.findtext("motorNumber", "0"))):
        value = {e.tag: e.text or "" for e in plugin}
        sense = 1.0 if value["turningDirection"] == "ccw" else -1.0
        out.append({"link": value["linkName"], "sense": sense, **{name: float(value[name]) for name in names}})
    return out


def gazebo_damping_of(text: str) -> np.ndarray:
    """Linear terms (6, 6) of a model's Hydrodynamics by velocity and rates; SI, forward-left-up."""
    plugins = ElementTree.fromstring(text).iter("plugin")
    own = next(
        (p for p in plugins if p.get("name") == "gz::sim::systems::Hydrodynamics"), ElementTree.Element("plugin")
    )
    return np.array([[float(own.findtext(channel + quantity, "0")) for quantity in "UVWPQR"] for channel in "xyzkmn"])


def in_drake(vehicle: Vehicle, exported: Exported, duration_s: float = 0.3) -> _FlightDifference:
    """Fly the exported SDF model in Drake next to ours with what the model holds.

    Drake reads masses, inertias, places and joints. It has no motor model: thrust C_F ω² and drag −k ω v⊥ act on the
    rotor's link and the torque on the body, as in Gazebo's `MulticopterMotorModel::UpdateForcesAndMoments`, and the
    linear terms of its `Hydrodynamics` on the body.
    """
    from pydrake.common.value import Value
    from pydrake.math import RotationMatrix
    from pydrake.multibody.math import SpatialForce, SpatialVelocity
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import ExternallyAppliedSpatialForce, MultibodyPlant
    from pydrake.systems.analysis import Simulator
    from pydrake.systems.framework import DiagramBuilder, LeafSystem

    motors, damping = _gazebo_motors(exported.text), gazebo_damping_of(exported.text)
    same = expressed(vehicle, "sdf")
    time, speeds = commands_of(same, duration_s)
    turning = speeds.copy()
    for i, m in enumerate(motors):
        if m["timeConstantUp"] != AT_ONCE_S:
            turning[:, [i]] = lagging(speeds[:, [i]], m["timeConstantUp"], m["timeConstantDown"])
    builder = DiagramBuilder()
    plant = builder.AddSystem(MultibodyPlant(0.0))
    with read_by("Drake"):
        Parser(plant).AddModelsFromString(exported.text, "sdf")
    plant.mutable_gravity_field().set_gravity_vector([0, 0, -vehicle.gravity_m_s2])
    plant.Finalize()
    base = plant.GetBodyByName("base_link")
    links = [plant.GetBodyByName(m["link"]) for m in motors]
    inside = plant.CreateDefaultContext()

    class Rotors(LeafSystem):
        def __init__(self) -> None:
            super().__init__()
            self.DeclareVectorInputPort("state", plant.num_multibody_states())
            self.DeclareAbstractOutputPort("forces", lambda: Value[list[ExternallyAppliedSpatialForce]](), self.push)

        def push(self, context: Any, out: Any) -> None:
            plant.SetPositionsAndVelocities(inside, self.get_input_port().Eval(context))
            step = min(int(context.get_time() / _STEP_S + 1e-6), len(turning) - 1)
            turned = plant.EvalBodyPoseInWorld(inside, base).rotation().matrix()
            moving = plant.EvalBodySpatialVelocityInWorld(inside, base)
            state = np.concatenate([turned.T @ moving.translational(), turned.T @ moving.rotational()])
            added = damping @ state
            wrenches = [(base, turned @ added[3:], turned @ added[:3])]
            for m, link, speed in zip(motors, links, turning[step], strict=True):
                moving = plant.EvalBodySpatialVelocityInWorld(inside, link).translational()
                across = moving - (moving @ turned[:, 2]) * turned[:, 2]
                thrust = m["motorConstant"] * speed**2
                pull = thrust * turned[:, 2] - abs(speed) * m["rotorDragCoefficient"] * across
                wrenches.append((link, np.zeros(3), pull))
                torque = -m["sense"] * m["momentConstant"] * thrust * turned[:, 2]
                wrenches.append((base, torque, np.zeros(3)))
            forces = []
            for body, torque, force in wrenches:
                applied = ExternallyAppliedSpatialForce()
                applied.body_index, applied.p_BoBq_B = body.index(), np.zeros(3)
                applied.F_Bq_W = SpatialForce(torque, force)
                forces.append(applied)
            out.set_value(forces)

    rotors = builder.AddSystem(Rotors())
    builder.Connect(plant.get_state_output_port(), rotors.get_input_port())
    builder.Connect(rotors.get_output_port(), plant.get_applied_spatial_force_input_port())
    simulator = Simulator(builder.Build())
    simulator.get_mutable_integrator().set_fixed_step_mode(True)
    simulator.get_mutable_integrator().set_maximum_step_size(_STEP_S)
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    plant.SetFreeBodySpatialVelocity(context, base, SpatialVelocity([0, 0, 0], [_START_M_S, -_START_M_S, 0]))
    start = plant.EvalBodyPoseInWorld(context, base).translation()
    position, attitude = [], []
    for now in time:
        simulator.AdvanceTo(now)
        pose = plant.EvalBodyPoseInWorld(context, base)
        position.append(pose.translation() - start)
        attitude.append(RotationMatrix(pose.rotation()).ToQuaternion().wxyz())
    where = "Drake by the equations of Gazebo's motor model"
    return difference((np.array(position), np.array(attitude)), ours(same, turning), where)


_BULLET_DAMPING = 0.04
"""c of the deceleration c (1 + |v|) v, and the same for turning, that Bullet gives to a body by default."""


def in_pybullet(
    vehicle: Vehicle, exported: Exported, duration_s: float = 0.3, damping: float = _BULLET_DAMPING
) -> _FlightDifference:
    """Fly the exported URDF in Bullet next to ours with what it holds.

    Forces on the rotors' links, torque and drag on the link at the centre of mass, all from the file's `properties`, as
    in that tool's `BaseAviary._physics` and `_drag`.
    """
    from tempfile import TemporaryDirectory

    import pybullet
    from pybullet_utils.bullet_client import BulletClient

    same = expressed(vehicle, "gym-pybullet-drones")
    says = {k: float(v) for k, v in ElementTree.fromstring(exported.text)[0].attrib.items()}
    time, speeds = commands_of(same, duration_s)
    order = exported.rotor_order
    substeps = 10  # its integrator is of first order
    client = BulletClient(pybullet.DIRECT)
    try:
        client.setGravity(0, 0, -vehicle.gravity_m_s2)
        client.setTimeStep(_STEP_S / substeps)
        with TemporaryDirectory() as folder:
            path = f"{folder}/{exported.file_name}"
            with open(path, "w", encoding="utf-8") as file:
                file.write(exported.text)
            with read_by("Bullet"):
                body = client.loadURDF(path, flags=pybullet.URDF_USE_INERTIA_FROM_FILE)
        client.changeDynamics(body, -1, linearDamping=damping, angularDamping=damping)
        client.resetBaseVelocity(body, [_START_M_S, -_START_M_S, 0], [0, 0, 0])
        position, attitude = [np.zeros(3)], [np.array([1.0, 0, 0, 0])]
        for k in range(len(time) - 1):
            turns = speeds[k][list(order)] * 60 / (2 * np.pi)
            twist = says["km"] * turns**2 * (-1 if exported.mirrored else 1)
            for _ in range(substeps):
                for i in range(4):
                    client.applyExternalForce(body, i, [0, 0, says["kf"] * turns[i] ** 2], [0, 0, 0], client.LINK_FRAME)
                yaw = -twist[0] + twist[1] - twist[2] + twist[3]
                client.applyExternalTorque(body, 4, [0, 0, yaw], client.LINK_FRAME)
                _, turned = client.getBasePositionAndOrientation(body)
                rotation = np.reshape(client.getMatrixFromQuaternion(turned), (3, 3))
                velocity = rotation.T @ np.array(client.getBaseVelocity(body)[0])
                coefficients = np.array([says["drag_coeff_xy"], says["drag_coeff_xy"], says["drag_coeff_z"]])
                drag = -coefficients * (turns * 2 * np.pi / 60).sum() * velocity
                client.applyExternalForce(body, 4, drag.tolist(), [0, 0, 0], client.LINK_FRAME)
                client.stepSimulation()
            place, turned = client.getBasePositionAndOrientation(body)
            position.append(np.array(place))
            attitude.append(np.array(turned)[[3, 0, 1, 2]])
    finally:
        client.disconnect()
    where = "Bullet by the equations of gym-pybullet-drones"
    return difference((np.array(position), np.array(attitude)), ours(same, speeds), where)


def in_crazyflow(vehicle: Vehicle, exported: Exported, duration_s: float = 2.0) -> _FlightDifference:
    """Integrate crazyflow's own dynamics with the numbers of the exported section next to ours with what it holds."""
    import tomllib

    from crazyflow.dynamics.first_principles import dynamics

    (section,) = tomllib.loads(exported.text).values()
    values = {name: np.asarray(value) for name, value in section.items() if name not in ("thrust_min", "thrust_max")}
    same = expressed(vehicle, "crazyflow")
    time, speeds = commands_of(same, duration_s)
    up, down = 1 / values["rotor_dyn_coef"][[0, 2]]
    turns = lagging(speeds, up, down) if parts_of(vehicle, KNOWS["crazyflow"]).tau_s[0] else speeds
    fixed = dict(values, gravity_vec=np.array([0.0, 0.0, -9.81]), J_inv=np.linalg.inv(values["J"]))

    def rates(state: np.ndarray, rpm: np.ndarray) -> np.ndarray:
        found = dynamics(state[:3], state[3:7], state[7:10], state[10:13], rpm, rpm, **fixed)
        return np.concatenate([np.asarray(part) for part in found[:4]])

    state = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, _START_M_S, -_START_M_S, 0.0, 0.0, 0.0, 0.0])
    states = [state]
    for rpm in turns[:-1] * 60 / (2 * np.pi):
        one = rates(state, rpm)
        two = rates(state + _STEP_S / 2 * one, rpm)
        three = rates(state + _STEP_S / 2 * two, rpm)
        four = rates(state + _STEP_S * three, rpm)
        state = state + _STEP_S / 6 * (one + 2 * two + 2 * three + four)
        state[3:7] /= np.linalg.norm(state[3:7])
        states.append(state)
    path = np.array(states)
    return difference((path[:, :3], path[:, [6, 3, 4, 5]]), ours(same, turns), "crazyflow's first-principles dynamics")


FLYERS: dict[str, tuple[str, Callable[[Vehicle, Exported], _FlightDifference]]] = {
    "rotorpy": ("rotorpy", in_rotorpy),
    "mjcf": ("mujoco", in_mujoco),
    "sdf": ("pydrake", in_drake),
    "gym-pybullet-drones": ("pybullet", in_pybullet),
    "crazyflow": ("crazyflow", in_crazyflow),
}
"""By form, the module that must be there, and the flight."""


def try_out(vehicle: Vehicle, to: str, exported: Exported) -> str:
    """What a flight next to ours showed, or why none was made; empty for a form that no tool flies.

    InputError where the tool does not read the file.
    """
    if to not in FLYERS:
        return ""
    package, fly = FLYERS[to]
    try:
        return fly(vehicle, exported).sentence
    except InputError:
        raise
    except ImportError as error:
        if error.name != package and package not in sys.modules:
            return f"not flown there: {error}"
        return f"not flown there: {package} is not installed"
    except Exception as error:  # whatever another tool ends with, the file that it has read is right
        return f"the trial flight there did not end: {' '.join(str(error).split())}"
