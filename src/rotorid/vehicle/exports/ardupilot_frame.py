"""ArduPilot's simulated copter: a frame as JSON (`sim_vehicle.py -f X:frame.json`), and its equations to fly it.

Source: ardupilot, libraries/SITL/SIM_Frame.cpp (load_frame_params, init, calculate_forces), SIM_Frame.h (Model) and
SIM_Motor.cpp (calculate_forces, calc_thrust); AP_Motors/AP_MotorsMatrix for the order. Written from them; no code of
theirs is here.
"""

from __future__ import annotations

import json

import numpy as np
from scipy.optimize import brentq

from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle.exports.derivatives import left_of_one_damping, own_damping
from rotorid.vehicle.exports.forms import KNOWS, Exported, parts_of
from rotorid.vehicle.exports.px4 import RICHEST, SENSES, full_speed_rad_s, order_in_x, with_drag_of_hover
from rotorid.vehicle.mixer import hover_speed_rad_s

GRAVITY = 9.80665
"""ArduPilot's."""
DENSITY_KG_M3 = 1.225
"""At `refAlt` 0, where the reference flight is put."""
_REFERENCE_M_S = 10.0
_VOLTAGE_V = 16.8
"""Of a battery that never sags: the frame's thrust is by voltage over `maxVoltage`."""
_DAMPING_RAD_S = np.radians(400.0)
"""ArduPilot's damping is this over `refRotRate`, 1/s."""
_YAW_PER_THRUST = 0.05
"""A motor's yaw torque is its yaw factor times this, `diagonal_size`, thrust, and the signal once more."""


def ardupilot_json(vehicle: Vehicle) -> Exported:
    """The frame as JSON, motors in ArduPilot's X order."""
    parts = parts_of(with_drag_of_hover(vehicle), KNOWS["ardupilot-json"])
    order = order_in_x(parts.places, vehicle.yaw_signs(), vehicle.name, "ArduPilot's frame X")
    places, thrust, torque = parts.places[order], parts.thrust[order], parts.torque[order]
    left = [*parts.left_out, *left_of_one_damping(vehicle)]
    if not parts.limits_rad_s:
        left.append(
            f"full thrust: rotor_speed_limits_rad_s is not stated, {RICHEST:g} times the hover's speed is taken"
        )
    weight = parts.mass_kg * GRAVITY
    share = weight / (len(order) * float(thrust.mean()) * full_speed_rad_s(vehicle, parts) ** 2)
    expo = 1.0 - parts.curve
    at_hover = float(signal(share, expo))
    diagonal = 2 * float(np.linalg.norm(places[:, :2], axis=1).mean())
    area = len(order) * np.pi * (vehicle.rotor_radius_m or diagonal / 8) ** 2
    if vehicle.rotor_radius_m is None:
        left.append("rotor_radius_m is not stated: an eighth of the diagonal is taken for the disc's area")
    drag = len(order) * float(np.mean(parts.drag)) * hover_speed_rad_s(vehicle)
    # X_u and the like come on top, as the drag of the hover's thrust.
    own, weights = own_damping(vehicle, turning=False)
    drag = max(drag + float(np.average(own, weights=weights)), 0.0)
    momentum = drag / np.sqrt(DENSITY_KG_M3 * area * weight)
    if drag:
        left.append("linear drag: it goes with the root of the thrust there, and along z as well")
    bluff = 2 * float(np.mean(parts.frame[:2])) / DENSITY_KG_M3
    if bluff:
        left.append("drag of the frame: by component there, and the same along every axis")
    rate = 0.0
    own, weights = own_damping(vehicle, turning=True)
    inertia = np.diag(parts.inertia)
    damping = float(np.mean(np.array(parts.damping) / inertia) + np.average(own / inertia, weights=weights))
    if damping > 0:
        rate = float(_DAMPING_RAD_S / damping)
        left.append("damping about each axis: one rate for all is taken")
    if not any(entry["id"] == "motor_lag" for entry in vehicle.effects):
        left.append("motor lag: it has none but a limit of the signal's slope")
    left += [
        "battery: one that never sags",
        "torque: it goes with thrust times signal there, and is right at the hover",
        "thrust lost by the inflow of a climb: by momentum theory of the disc's area",
        "gyroscopic moment Ω × J Ω: it has none",
    ]
    wake = np.sqrt(2 * weight / (DENSITY_KG_M3 * area))
    yaw = torque / thrust / (_YAW_PER_THRUST * diagonal * at_hover)
    content = {
        "mass": parts.mass_kg,
        "diagonal_size": diagonal,
        "refSpd": _REFERENCE_M_S,
        "refAngle": _reference_angle_deg(weight, momentum, bluff, area),
        "refVoltage": _VOLTAGE_V,
        "refCurrent": float(wake * weight / 2 / _VOLTAGE_V),
        "refAlt": 0.0,
        "refTempC": 15.0,
        "refBatRes": 0.0,
        "maxVoltage": _VOLTAGE_V,
        "battCapacityAh": 0.0,
        "propExpo": expo,
        "refRotRate": rate,
        "hoverThrOut": share,
        "pwmMin": 1000.0,
        "pwmMax": 2000.0,
        "spin_min": 0.0,
        "spin_max": 1.0,
        "slew_max": 0.0,
        "disc_area": float(area),
        "mdrag_coef": float(momentum),
        "moment_inertia": np.diag(parts.inertia).tolist(),
        "num_motors": 4.0,
    }
    for i, (place, sense, factor) in enumerate(zip(places, SENSES, yaw, strict=True), 1):
        content[f"motor{i}_position"] = place.tolist()
        content[f"motor{i}_vector"] = [0.0, 0.0, -1.0]
        content[f"motor{i}_yaw"] = float(sense * factor)
    comments = [f"# {vehicle.name}, exported by rotorid: sim_vehicle.py -v ArduCopter -f X:frame.json"]
    comments += [f"# Not expressed: {sentence}" for sentence in left]
    text = "\n".join(comments) + "\n" + json.dumps(content, indent=2) + "\n"
    return Exported(text, "frame.json", tuple(left), parameters=content, rotor_order=tuple(order))


def signal(share: float | np.ndarray, expo: float) -> float | np.ndarray:
    """The signals whose thrusts are shares of the full one: share = (1 − e) u + e u²."""
    return share if expo == 0 else (expo - 1 + np.sqrt((1 - expo) ** 2 + 4 * expo * share)) / (2 * expo)


def _momentum_n(weight: float, coefficient: float, area: float, tilt: float) -> float:
    """Horizontal drag of the rotors in the reference flight, N."""
    speed = _REFERENCE_M_S * np.cos(tilt)
    return float(np.cos(tilt) * coefficient * speed * np.sqrt(weight / np.cos(tilt) * DENSITY_KG_M3 * area))


def _reference_angle_deg(weight: float, momentum: float, bluff: float, area: float) -> float:
    """The tilt, degrees, that holds the reference speed against both drags; ArduPilot finds the frame's drag by it."""
    if momentum == 0 and bluff == 0:
        return 0.0
    frame = 0.5 * DENSITY_KG_M3 * bluff * _REFERENCE_M_S**2

    def unbalanced(tilt: float) -> float:
        return weight * np.tan(tilt) - _momentum_n(weight, momentum, area, tilt) - frame

    return float(np.degrees(brentq(unbalanced, 0.0, np.radians(89.0))))


def values_of(text: str) -> dict:
    """The frame of a file; ArduPilot passes over lines that begin with #."""
    return json.loads("\n".join(line for line in text.splitlines() if not line.startswith("#")))


def wrench(frame: dict, signal: np.ndarray, velocity: np.ndarray, rates: np.ndarray):
    """Force and moment (n, 3), body axes, N and N m, without the weight, of signals (n, 4) in the frame's order.

    `velocity` (n, 3) through the air and `rates` (n, 3) are in body axes.
    """
    weight = frame["mass"] * GRAVITY
    tilt = np.radians(frame["refAngle"])
    coefficient, area = frame["mdrag_coef"], frame["disc_area"]
    rotors_n = _momentum_n(weight, coefficient, area, tilt)
    left_n = weight * np.tan(tilt) - rotors_n
    bluff = 0.0
    if left_n < 0:
        coefficient *= weight * np.tan(tilt) / rotors_n
    else:
        bluff = left_n / (0.5 * DENSITY_KG_M3 * frame["refSpd"] ** 2)
    wake = 2 * frame["refCurrent"] * frame["refVoltage"] / weight
    effective = weight / (0.5 * DENSITY_KG_M3 * wake**2) / 4
    fastest = wake / np.sqrt(frame["hoverThrOut"])
    expo = frame["propExpo"]
    force, moment = np.zeros_like(velocity), np.zeros_like(velocity)
    for i in range(4):
        u, place = np.clip(signal[:, i], 0, 1), np.array(frame[f"motor{i + 1}_position"])
        at_hub = velocity + np.cross(rates, place)
        inflow = np.maximum(0.0, -at_hub[:, 2])
        outflow = fastest**2 * ((1 - expo) * u + expo * u**2)
        thrust = 0.5 * DENSITY_KG_M3 * effective * (outflow - inflow**2)
        factor = coefficient * np.sqrt(DENSITY_KG_M3 * area / 4) * np.sqrt(np.abs(thrust))
        own = -factor[:, None] * at_hub
        own[:, 2] -= thrust
        force += own
        moment += np.cross(place, own)
        moment[:, 2] += frame[f"motor{i + 1}_yaw"] * u * _YAW_PER_THRUST * frame["diagonal_size"] * thrust
    force -= 0.5 * DENSITY_KG_M3 * bluff * np.abs(velocity) * velocity
    if frame["refRotRate"] > 0:
        moment -= _DAMPING_RAD_S / frame["refRotRate"] * np.array(frame["moment_inertia"]) * rates
    return force, moment
