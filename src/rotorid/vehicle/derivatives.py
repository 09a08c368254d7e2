"""Stability and control derivatives of a vehicle file as a force and a moment that every flight adds.

What named physics leaves of a channel c is, about the hover, r_c = c_0 + Σ_k c_k x_k: c_0 is the channel's `constant`,
x_k are the quantities below, each held at the edge of the range in which it was flown. The linear part of a vehicle's
response has been stated so for eighty years (Klein and Morelli, Aircraft System Identification, 2nd ed., ch. 3): X_u,
Y_v, L_p, … A derivative predicts within its range and names no cause.
"""

from __future__ import annotations

import numpy as np
from numba.extending import register_jitable

from rotorid.effects.contract import Form, Motion, Parameter
from rotorid.effects.instant import Constants, Instants, Wrench
from rotorid.recordings.vehicle import Derivative, Vehicle, unit_of

CHANNELS = ("force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z")
CONTROLS = ("thrust", "thrust_roll", "thrust_pitch", "thrust_yaw", "speed")
QUANTITIES = ("constant", "u", "v", "w", "p", "q", "r", *CONTROLS)
"""Of the state: 1, velocity through the air, m/s, and body rates, rad/s, body axes. Of the rotors, over the hover's:
thrust less one; its parts about the roll and pitch axes, over the longest arm; its part by spin; mean speed."""
_SIZE = len(QUANTITIES)
_NEEDS = {**dict.fromkeys("uvw", "velocity"), **dict.fromkeys("pqr", "angular_velocity")}


def symbol_of(channel: str, quantity: str) -> str:
    """Its symbol in flight mechanics: X_u, Z_w, L_p, …; X_0 of a constant."""
    letter = "XYZLMN"[CHANNELS.index(channel)]
    return f"{letter}_{'0' if quantity == 'constant' else quantity}"


def quantities(motion: Motion, vehicle: Vehicle) -> np.ndarray:
    """The quantities at every instant, (n, 12) in the order of QUANTITIES; NaN where the motion does not have one."""
    m, v, out = Instants(motion, vehicle), Constants(vehicle), np.full((motion.size, _SIZE), np.nan)
    for k, name in enumerate(QUANTITIES):
        if name == "constant" or getattr(motion, _NEEDS.get(name, "rotor_speed")) is not None:
            out[:, k] = _quantity(m, v, k)
    return out


def about_hover_of(x: np.ndarray, vehicle: Vehicle, other: Vehicle) -> np.ndarray:
    """Quantities (n, 12) of a vehicle as they are of another one that hovers at another speed."""
    ratio = _hover_square(vehicle) / _hover_square(other)
    out = x.copy()
    out[:, 7] = (x[:, 7] + 1.0) * ratio - 1.0
    out[:, 8:11] *= ratio
    out[:, 11] *= np.sqrt(ratio)
    return out


def own_controls(vehicle: Vehicle) -> dict[str, tuple[str, float]]:
    """Of each channel that rotors make the control quantity that asks for it, and what a unit of it makes, N or N m."""
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    arm = float(np.linalg.norm(vehicle.rotor_positions_m()[:, :2], axis=1).max()) or 1.0  # of a single central rotor
    torque = float(vehicle.torque_coefficients_n_m_s2().mean() / vehicle.thrust_coefficients_n_s2().mean())
    return {
        "force_z": ("thrust", -weight),
        "moment_x": ("thrust_roll", -weight * arm),
        "moment_y": ("thrust_pitch", weight * arm),
        "moment_z": ("thrust_yaw", weight * torque),
    }


def _hover_square(vehicle: Vehicle) -> float:
    """Mean square of the rotor speeds in hover, rad2/s2."""
    return vehicle.mass_kg * vehicle.gravity_m_s2 / float(vehicle.thrust_coefficients_n_s2().sum())


def table_of(derivatives: tuple[Derivative, ...]) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives as a matrix (6, 12) and the range (12, 2) in which each quantity is not held."""
    matrix, held = np.zeros((len(CHANNELS), _SIZE)), np.tile([-np.inf, np.inf], (_SIZE, 1))
    for d in derivatives:
        k = QUANTITIES.index(d.quantity)
        matrix[CHANNELS.index(d.channel), k] = d.value
        held[k] = d.low, d.high
    return matrix, held


def wrench(x: np.ndarray, matrix: np.ndarray, held: np.ndarray) -> np.ndarray:
    """Force, N, and moment, N m, (n, 6), of quantities (n, 12)."""
    used = matrix.any(axis=0)
    return np.clip(x[:, used], *held[used].T) @ matrix[:, used].T


@register_jitable
def _quantity(m, v, k):
    """The k-th of QUANTITIES at the instant of a kernel."""
    if k == 0:
        return 1.0
    if k < 4:
        return m.air_velocity[k - 1]
    if k < 7:
        return m.angular_velocity[k - 4]
    lift = 0.0
    for i in range(v.rotors):
        lift += v.thrust_coefficient[i]
    hover, x = v.mass * v.gravity / lift, 0.0
    for i in range(v.rotors):
        square = m.rotor_speed[i] * m.rotor_speed[i] / hover
        if k == 7:
            x += square - 1.0
        elif k == 8:
            x += square * v.hub[i, 1] / v.reach
        elif k == 9:
            x += square * v.hub[i, 0] / v.reach
        elif k == 10:
            x += square * v.yaw_sign[i]
        else:
            x += m.rotor_speed[i] / np.sqrt(hover)
    return x / v.rotors


def _linear(m, v, p, w):
    """Adds to force and moment by a matrix (6, 12) and ranges (12, 2) in a row, as `wrench`."""
    for k in range(12):
        used = False
        for j in range(6):
            used = used or p[12 * j + k] != 0.0
        if not used:
            continue
        x = np.minimum(np.maximum(_quantity(m, v, k), p[72 + 2 * k]), p[73 + 2 * k])
        for j in range(3):
            if p[12 * j + k] != 0.0:
                w.force[j] += p[12 * j + k] * x
            if p[12 * (3 + j) + k] != 0.0:
                w.moment[j] += p[12 * (3 + j) + k] * x


def derivative_form(vehicle: Vehicle) -> tuple[Form, np.ndarray] | None:
    """The vehicle's derivatives as a form with its values; None where its file states none."""
    if not vehicle.derivatives:
        return None
    matrix, held = table_of(vehicle.derivatives)
    used = [q for q, column in zip(QUANTITIES, matrix.T, strict=True) if column.any()]
    needs = dict.fromkeys(_NEEDS.get(q, "rotor_speed") for q in used if q != "constant")
    parameters = [Parameter(symbol_of(c, q), unit_of(c, q)) for c in CHANNELS for q in QUANTITIES]
    parameters += [Parameter(f"{end} of {q}", "") for q in QUANTITIES for end in ("low", "high")]
    form = Form("derivatives", "r_c = c_0 + Σ_k c_k x_k", tuple(parameters), Wrench(_linear), tuple(needs))
    return form, np.concatenate([matrix.ravel(), held.ravel()])
