"""A vehicle's derivatives in other tools: as a companion in the tool's own step, as terms of its file, or named.

Bodies there are forward-left-up. Gazebo's linear damping: gz-sim, `src/systems/hydrodynamics` (`Configure`,
`buildDampingMatrix`). PX4's SIH and ArduPilot's frame have one drag and one damping of all axes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rotorid.recordings.vehicle import Derivative, Vehicle
from rotorid.vehicle.derivatives import CHANNELS, QUANTITIES, symbol_of, table_of

_OF_STATE = QUANTITIES[:7]
"""What every tool's step knows of the vehicle: 1, velocity through the air, body rates."""
_SIGNS = np.array([1.0, 1.0, -1.0, -1.0, 1.0, -1.0, -1.0, *[1.0] * 5])
"""Of QUANTITIES in forward-left-up axes; those of the channels are the second to seventh."""
_MOST_SHOWN = 6
ROTORPY_FILE, MUJOCO_FILE = "rotorpy_derivatives.py", "mujoco_derivatives.py"
_DAMPING = tuple(zip(CHANNELS, _OF_STATE[1:], strict=True))
"""X_u, Y_v, Z_w, L_p, M_q, N_r."""


def of_state(vehicle: Vehicle, constants: bool = True) -> tuple[Derivative, ...]:
    """Those by what a tool's step knows of the vehicle."""
    wanted = _OF_STATE if constants else _OF_STATE[1:]
    return tuple(d for d in vehicle.derivatives if d.quantity in wanted)


def expressed_by(vehicle: Vehicle, to: str) -> tuple[Derivative, ...]:
    """The derivatives as a form and its companion have them; those of SIH and ArduPilot are in terms of their own."""
    if to in ("rotorpy", "mjcf"):
        return vehicle.derivatives  # the companion knows the rotors, too
    if to == "sdf":
        return tuple(d.model_copy(update={"low": -np.inf, "high": np.inf}) for d in of_state(vehicle, constants=False))
    return ()


def _said_of(derivatives: Sequence[Derivative], vehicle: Vehicle) -> str:
    """Their name, with the largest by what they add within their range, over the weight and its moment on an arm."""
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    arm = np.linalg.norm(vehicle.rotor_positions_m(), axis=1).max() or 1.0

    def size(d: Derivative) -> float:
        reach = abs(d.value) * max(abs(d.low), abs(d.high))
        return reach / weight if d.channel.startswith("force") else reach / (weight * arm)

    shown = sorted(derivatives, key=size, reverse=True)[:_MOST_SHOWN]
    words = [f"{symbol_of(d.channel, d.quantity)} = {d.value:.3g}" for d in shown]
    words += [f"{len(derivatives) - len(shown)} smaller"] if len(derivatives) > len(shown) else []
    return f"derivatives ({', '.join(words)})"


def left_of(vehicle: Vehicle, taken: Sequence[Derivative], nearly: str = "") -> list[str]:
    """A sentence for the derivatives that are not `taken`, and one for those that are `nearly` so; none for none."""
    rest = [d for d in vehicle.derivatives if d not in taken]
    said = [f"{_said_of(taken, vehicle)}: {nearly}"] if taken and nearly else []
    return [*said, _said_of(rest, vehicle)] if rest else said


def _table_in_flu(derivatives: Sequence[Derivative]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Derivatives as a matrix (6, 12) of forward-left-up axes, and the ends (12,) of each range."""
    matrix, held = table_of(tuple(derivatives))
    ends = np.sort(held * _SIGNS[:, None], axis=1)
    return _SIGNS[1:7, None] * matrix * _SIGNS, ends[:, 0], ends[:, 1]


def _number(value: float) -> str:
    return f"{value:.9g}" if np.isfinite(value) else "np.inf" if value > 0 else "-np.inf"


def _table(vehicle: Vehicle) -> str:
    """The Python lines that both companions share."""
    matrix, low, high = _table_in_flu(vehicle.derivatives)
    rows = [
        f"    [{', '.join(map(_number, row + 0.0))}],  # {channel}"
        for channel, row in zip(CHANNELS, matrix, strict=True)
    ]
    places = vehicle.rotor_positions_m()[:, :2]
    lift, arm = vehicle.thrust_coefficients_n_s2(), np.linalg.norm(places, axis=1).max() or 1.0
    named = {
        "LOW": low,
        "HIGH": high,
        "ALONG": places[:, 0] / arm,
        "ACROSS": places[:, 1] / arm,
        "SPIN": vehicle.yaw_signs(),
    }
    values = [f"{name} = np.array([{', '.join(map(_number, own))}])" for name, own in named.items()]
    hover = vehicle.mass_kg * vehicle.gravity_m_s2 / lift.sum()
    return "\n".join(["MATRIX = np.array([", *rows, "])", *values, f"HOVER = {hover:.9g}", _ADDED])


_ADDED = '''

def added(velocity, rates, squares):
    """Force and moment (6,) at a velocity through the air, body rates and squares of the rotors' speeds, rad2/s2."""
    of_hover = squares / HOVER
    parts = [np.mean(x * of_hover) for x in (1.0, ACROSS, ALONG, SPIN)]
    rotors = [parts[0] - 1.0, *parts[1:], np.mean(np.sqrt(of_hover))]
    return MATRIX @ np.clip(np.concatenate([[1.0], velocity, rates, rotors]), LOW, HIGH)'''
_SAID = """Force, N, and moment, N m, are MATRIX @ x, each of x held between LOW and HIGH. x is 1, velocity through the
air, m/s, body rates, rad/s, and of the rotors, over the hover's: thrust less one; its parts about the roll and pitch
axes; its part by spin; mean speed. Body axes forward-left-up; ALONG and ACROSS are places of the rotors forward and
right, over the longest arm."""


def rotorpy_companion(vehicle: Vehicle) -> str:
    """A subclass of RotorPy's Multirotor that adds them."""
    return f'''# {vehicle.name}, exported by rotorid.
"""Derivatives for RotorPy: fly `WithDerivatives(quad_params, ...)` in place of `Multirotor(quad_params, ...)`.

{_SAID}
"""

import numpy as np
from rotorpy.vehicles.multirotor import Multirotor

{_table(vehicle)}


class WithDerivatives(Multirotor):
    def compute_body_wrench(self, body_rates, rotor_speeds, body_airspeed_vector):
        force, moment = super().compute_body_wrench(body_rates, rotor_speeds, body_airspeed_vector)
        more = added(body_airspeed_vector, body_rates, np.square(rotor_speeds))
        return force + more[:3], moment + more[3:]
'''


def mujoco_companion(vehicle: Vehicle) -> str:
    """MuJoCo's callback for passive forces that adds them."""
    return f'''# {vehicle.name}, exported by rotorid.
"""Derivatives for MuJoCo: `mujoco.set_mjcb_passive(passive)` once, and every step adds them.

{_SAID}
MuJoCo has one such callback for all models; None takes it off; MJX calls none.
"""

import mujoco
import numpy as np

{_table(vehicle)}


THRUST = np.array([{", ".join(map(_number, vehicle.thrust_coefficients_n_s2()))}])
"""Of each rotor, over the square of its speed, N s2/rad2."""


def passive(model, data):
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, "vehicle")
    if body < 0:  # another model
        return
    # Of a free joint: velocity and force in world axes, rates and moment in those of the body.
    first, rotation = model.body_dofadr[body], data.xmat[body].reshape(3, 3)
    move, turn = slice(first, first + 3), slice(first + 3, first + 6)
    thrust = data.act if model.na else data.ctrl
    more = added(rotation.T @ (data.qvel[move] - model.opt.wind), data.qvel[turn], np.maximum(thrust, 0.0) / THRUST)
    data.qfrc_passive[move] += rotation @ more[:3]
    data.qfrc_passive[turn] += more[3:]
'''


def gazebo_damping(vehicle: Vehicle) -> str:
    """Gazebo's Hydrodynamics system with the linear terms of the body's link, xU to nR; empty without any."""
    matrix = _table_in_flu(of_state(vehicle, constants=False))[0][:, 1:]
    terms = [
        f"      <{channel}{quantity}>{matrix[i, j]:.9g}</{channel}{quantity}>"
        for i, channel in enumerate("xyzkmn")
        for j, quantity in enumerate("UVWPQR")
        if matrix[i, j]
    ]
    if not terms:
        return ""
    nl = "\n"
    return f"""
    <plugin filename="gz-sim-hydrodynamics-system" name="gz::sim::systems::Hydrodynamics">
      <link_name>base_link</link_name>
      <disable_added_mass>true</disable_added_mass>
      <disable_coriolis>true</disable_coriolis>
{nl.join(terms)}
    </plugin>"""


def left_of_gazebo(vehicle: Vehicle) -> list[str]:
    """What Gazebo's linear terms leave."""
    near = "taken as linear terms of Gazebo's Hydrodynamics, which are not held beyond the flown range and know no wind"
    return left_of(vehicle, of_state(vehicle, constants=False), near)


def own_damping(vehicle: Vehicle, turning: bool) -> tuple[np.ndarray, np.ndarray]:
    """−X_u, −Y_v, −Z_w, N s/m, or (`turning`) −L_p, −M_q, −N_r, N m s/rad, (3,), and each one's weight in a mean.

    The weights are the squares of the largest speed or rate flown: one force for all axes is then off the least.
    """
    matrix, held = table_of(vehicle.derivatives)
    at = np.arange(3) + 3 * turning
    reach = np.abs(held[at + 1]).max(axis=1)
    reach[~np.isfinite(reach)] = 0.0  # by which there is no derivative
    return -matrix[at, at + 1], reach**2 if reach.any() else np.ones(3)


def left_of_one_damping(vehicle: Vehicle) -> list[str]:
    """What one drag and one damping of all axes leave."""
    taken = [d for d in vehicle.derivatives if (d.channel, d.quantity) in _DAMPING]
    near = "taken as one drag and one damping of all axes, means by the squares of what was flown, without its range"
    return left_of(vehicle, taken, near)
