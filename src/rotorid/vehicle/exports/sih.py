"""PX4's own simulator, SIH ("simulation in hardware"): its parameters, and its equations to fly them.

Source: PX4-Autopilot, src/modules/simulation/simulator_sih: sih_params.c, and sih.cpp (read_motors,
generate_force_and_torques, equations_of_motion) as of version 1.16. Written from them; no code of theirs is here.

Four rotors in X shape in the order that PX4 and ArduPilot share: front right, rear left, front left, rear right.
"""

from __future__ import annotations

import numpy as np

from rotorid.errors import InputError
from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle.exports.derivatives import left_of_one_damping, own_damping
from rotorid.vehicle.exports.forms import KNOWS, Exported, Parts, parts_of
from rotorid.vehicle.mixer import hover_speed_rad_s

_CORNERS = ((1, 1), (-1, -1), (1, -1), (-1, 1))
"""Signs of the places (x forward, y right) in that order."""
SENSES = (1, 1, -1, -1)
"""Signs of the yaw moments: front right and rear left turn counter-clockwise."""
_FASTEST_S = 0.005
"""Shortest SIH_T_TAU that its Euler step of 4 ms stands."""
FASTEST_RAD_S = 6 * np.pi
"""SIH holds each body rate within ±6π rad/s (simulator_sih, `Sih::equations_of_motion`)."""
_OF_THE_TOOL = (
    f"SIH holds each body rate within ±6π rad/s, ±{np.degrees(FASTEST_RAD_S):.0f} deg/s: no faster turn is simulated",
    "SIH_WIND_N and SIH_WIND_E say where the wind comes from: SIH_WIND_N = 3 blows towards the south",
)
"""What flies otherwise there than a file's reader expects; sentences of the file."""
RICHEST = 2.0
"""Full speed over that of the hover, where the vehicle states no limit."""


def full_speed_rad_s(vehicle: Vehicle, parts: Parts) -> float:
    """The speed at which SIH_T_MAX is made."""
    return parts.limits_rad_s[1] if parts.limits_rad_s else RICHEST * hover_speed_rad_s(vehicle)


def with_drag_of_hover(vehicle: Vehicle) -> Vehicle:
    """The vehicle with its rotor drag, whatever its form, as one that has the same coefficient at the hover's speed."""
    total = vehicle.rotor_count * hover_speed_rad_s(vehicle)
    effects = []
    for entry in vehicle.effects:
        p = entry.get("parameters", {})
        if entry["id"] == "rotor_drag" and "k_d" not in p:
            k_d = p["d"] / total if "d" in p else (p["k_d_x"] + p["k_d_y"]) / 2
            entry = {"id": "rotor_drag", "form": "at the hubs", "parameters": {"k_d": float(k_d)}}
        effects.append(entry)
    return vehicle.model_copy(update={"effects": tuple(effects)})


def px4_sih(vehicle: Vehicle) -> Exported:
    """SIH's parameters as QGroundControl loads them.

    SIH has thrust SIH_T_MAX u and torque SIH_Q_MAX u of a signal u that follows with SIH_T_TAU; arms SIH_L_ROLL and
    SIH_L_PITCH; drag −SIH_KDV v and damping −SIH_KDW Ω. The file says what of the tool flies otherwise
    (`_OF_THE_TOOL`).
    """
    parts = parts_of(with_drag_of_hover(vehicle), KNOWS["px4-sih"])
    order = order_in_x(parts.places, vehicle.yaw_signs(), vehicle.name, "PX4's SIH")
    places, thrust, torque = parts.places[order], parts.thrust[order], parts.torque[order]
    left = [*parts.left_out, *left_of_one_damping(vehicle)]
    full = full_speed_rad_s(vehicle, parts)
    if not parts.limits_rad_s:
        left.append(
            f"full thrust: rotor_speed_limits_rad_s is not stated, {RICHEST:g} times the hover's speed is taken"
        )
    for words, values in (("roll", places[:, 1]), ("pitch", places[:, 0])):
        if np.ptp(np.abs(values)) > 1e-6:
            left.append(f"arms in {words} of each rotor: their mean is taken")
    hover = hover_speed_rad_s(vehicle)
    drag = len(order) * float(np.mean(parts.drag)) * hover
    if drag:
        left.append("rotor drag: that of the hover's rotor speed is taken, and along z as along x and y")
    # X_u and the like come on top; SIH's drag and damping are not below 0.
    own, weights = own_damping(vehicle, turning=False)
    drag = max(drag + float(np.average(own, weights=weights)), 0.0)
    if np.ptp(parts.damping) > 0:
        left.append("damping about each axis: its mean is taken")
    j = parts.inertia
    own, weights = own_damping(vehicle, turning=True)
    damping = max(float(np.mean(parts.damping) + np.average(own, weights=weights / np.diag(j) ** 2)), 0.0)
    up, down = parts.tau_s
    tau_s = max((up + down) / 2, _FASTEST_S)
    if tau_s > (up + down) / 2:
        left.append(f"rotors that follow within {(up + down) / 2:g} s: SIH's steps stand {_FASTEST_S:g} s")
    left.append("motor signals: in SIH thrust is proportional to them, so THR_MDL_FAC belongs to 0 there")
    if vehicle.gravity_m_s2 != 9.81:
        left.append(f"gravity of {vehicle.gravity_m_s2:g} m/s²: SIH has that of its latitude")
    values = {
        "SIH_MASS": parts.mass_kg,
        "SIH_IXX": j[0, 0], "SIH_IYY": j[1, 1], "SIH_IZZ": j[2, 2],
        "SIH_IXY": j[0, 1], "SIH_IXZ": j[0, 2], "SIH_IYZ": j[1, 2],
        "SIH_T_MAX": thrust.mean() * full**2, "SIH_Q_MAX": torque.mean() * full**2,
        "SIH_L_ROLL": np.abs(places[:, 1]).mean(), "SIH_L_PITCH": np.abs(places[:, 0]).mean(),
        "SIH_KDV": drag, "SIH_KDW": damping, "SIH_T_TAU": tau_s, "THR_MDL_FAC": 0.0,
    }  # fmt: skip
    comments = [f"# {vehicle.name}, exported by rotorid for PX4's SIH", *(f"# Not expressed: {s}" for s in left)]
    comments += [f"# {sentence}" for sentence in _OF_THE_TOOL]
    rows = ["1\t1\tSIH_VEHICLE_TYPE\t0\t6", *(f"1\t1\t{name}\t{float(value):.9g}\t9" for name, value in values.items())]
    return Exported(
        "\n".join([*comments, *rows]) + "\n", "sih.params", tuple(left), parameters=values, rotor_order=tuple(order)
    )


def values_of(text: str) -> dict[str, float]:
    """The parameters of a QGroundControl file."""
    rows = [line.split("\t") for line in text.splitlines() if line and line[0] != "#"]
    return {name: float(value) for _, _, name, value, _ in rows}


def wrench(values: dict[str, float], signal: np.ndarray, velocity: np.ndarray, rates: np.ndarray):
    """Force and moment (n, 3), body axes, N and N m, without the weight, of signals (n, 4) in SIH's order.

    `velocity` (n, 3) through the air and `rates` (n, 3) are in body axes.
    """
    u = signal.T
    force = -values["SIH_KDV"] * velocity
    force[:, 2] -= values["SIH_T_MAX"] * u.sum(axis=0)
    moment = -values["SIH_KDW"] * rates
    moment[:, 0] += values["SIH_L_ROLL"] * values["SIH_T_MAX"] * (-u[0] + u[1] + u[2] - u[3])
    moment[:, 1] += values["SIH_L_PITCH"] * values["SIH_T_MAX"] * (u[0] - u[1] + u[2] - u[3])
    moment[:, 2] += values["SIH_Q_MAX"] * (u[0] + u[1] - u[2] - u[3])
    return force, moment


def inertia_of(values: dict[str, float]) -> np.ndarray:
    """The inertia (3, 3), kg m²."""
    xx, yy, zz, xy, xz, yz = (values[f"SIH_I{k}"] for k in ("XX", "YY", "ZZ", "XY", "XZ", "YZ"))
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def order_in_x(places: np.ndarray, yaw_signs: np.ndarray, name: str, tool: str) -> list[int]:
    """Which of our rotors, from 0, are the tool's 1 to 4.

    `places` (n, 3) and `yaw_signs` (n,) are those of the vehicle `name`. InputError where the rotors are not four in X
    shape, or turn the other way.
    """
    corners = {(int(np.sign(x)), int(np.sign(y))): i for i, (x, y, _) in enumerate(places)}
    if len(places) != 4 or set(corners) != set(_CORNERS):
        raise InputError(f"{name}: {tool} wants four rotors in X shape, found {len(places)} rotors")
    order = [corners[corner] for corner in _CORNERS]
    if tuple(int(yaw_signs[i]) for i in order) != SENSES:
        raise InputError(
            f"{name}: {tool} wants front right and rear left counter-clockwise, seen from above, the others clockwise"
        )
    return order
