"""Simulators of autopilots: PX4's SIH and Gazebo with sensors and airframe, ArduPilot's copter, and their equations.

Four rotors in X shape in the order that PX4 and ArduPilot share: front right, rear left, front left, rear right.

Sources; written from them, no code of theirs is here:

- PX4-Autopilot, src/modules/simulation/simulator_sih ("simulation in hardware"): sih_params.c, and sih.cpp
  (read_motors, generate_force_and_torques, equations_of_motion) as of version 1.16;
- the x500 of PX4's Gazebo models (PX4-gazebo-models, models/x500_base/model.sdf: sensors and their noise) and its
  airframe (PX4-Autopilot, ROMFS/px4fmu_common/init.d-posix/airframes/4001_gz_x500);
- ardupilot, libraries/SITL/SIM_Frame.cpp (load_frame_params, init, calculate_forces), SIM_Frame.h (Model) and
  SIM_Motor.cpp (calculate_forces, calc_thrust); AP_Motors/AP_MotorsMatrix for the order.
"""

from __future__ import annotations

import json
import re
from dataclasses import replace
from xml.sax.saxutils import escape

import numpy as np
from scipy.optimize import brentq

from rotorid.errors import InputError
from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle.exports.derivatives import left_of_one_damping, own_damping
from rotorid.vehicle.exports.forms import (
    KNOWS,
    Exported,
    Parts,
    allocated,
    for_qgroundcontrol,
    in_corners,
    in_entries,
    named_in_one_line,
    not_expressed,
    parts_of,
    sdf,
)
from rotorid.vehicle.mixer import hover_speed_rad_s

_SENSES = (1, 1, -1, -1)
"""Signs of the yaw moments: front right and rear left turn counter-clockwise."""
_INERTIA_TIMES, _LEAST_DETERMINANT = 100.0, np.finfo(np.float32).eps
"""SIH inverts so many times the inertia, and its 3 by 3 inverse is zero where the determinant is not above this, single
precision's epsilon (sih.cpp, `init_variables`; matrix/SquareMatrix.hpp, `inv`)."""
FASTEST_RAD_S = 6 * np.pi
"""SIH holds each body rate within ±6π rad/s (simulator_sih, `Sih::equations_of_motion`)."""
_OF_THE_TOOL = (
    f"SIH holds each body rate within ±6π rad/s, ±{np.degrees(FASTEST_RAD_S):.0f} deg/s: no faster turn is simulated",
    "SIH_WIND_N and SIH_WIND_E say where the wind comes from: SIH_WIND_N = 3 blows towards the south",
)
"""What flies otherwise there than a file's reader expects; sentences of the file."""
_RICHEST = 2.0
"""Full speed over that of the hover, where the vehicle states no limit."""
ARDUPILOT_GRAVITY = 9.80665
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


def full_speed_rad_s(vehicle: Vehicle, parts: Parts) -> float:
    """The speed at which SIH_T_MAX is made."""
    return parts.limits_rad_s[1] if parts.limits_rad_s else _RICHEST * hover_speed_rad_s(vehicle)


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


def _in_x(vehicle: Vehicle, to: str, tool: str) -> tuple[Parts, list[int], float, list[str]]:
    """Parts, which of our rotors, from 0, are the tool's 1 to 4, the speed of full thrust, and what is left out.

    InputError where the rotors are not four in X shape, or turn the other way.
    """
    parts = parts_of(with_drag_of_hover(vehicle), KNOWS[to])
    order = in_corners(parts.places, ((1, 1), (-1, -1), (1, -1), (-1, 1)))
    if order is None or len(parts.places) != 4:
        raise InputError(f"{vehicle.name}: {tool} wants four rotors in X shape, found {len(parts.places)} rotors")
    if tuple(int(vehicle.yaw_signs()[i]) for i in order) != _SENSES:
        raise InputError(
            f"{vehicle.name}: {tool} wants front right and rear left counter-clockwise, seen from above, "
            "the others clockwise"
        )
    left = [*parts.left_out, *left_of_one_damping(vehicle)]
    if not parts.limits_rad_s:
        left.append(
            f"full thrust: rotor_speed_limits_rad_s is not stated, {_RICHEST:g} times the hover's speed is taken"
        )
    return parts, order, full_speed_rad_s(vehicle, parts), left


def px4_sih(vehicle: Vehicle) -> Exported:
    """SIH's parameters as QGroundControl loads them.

    SIH has thrust SIH_T_MAX u and torque SIH_Q_MAX u of a signal u that follows with SIH_T_TAU; arms SIH_L_ROLL and
    SIH_L_PITCH; drag −SIH_KDV v and damping −SIH_KDW Ω. The file says what of the tool flies otherwise
    (`_OF_THE_TOOL`).
    """
    fastest_s = 0.005  # Shortest SIH_T_TAU that its Euler step of 4 ms stands.
    parts, order, full, left = _in_x(vehicle, "px4-sih", "PX4's SIH")
    places, thrust, torque = parts.places[order], parts.thrust[order], parts.torque[order]
    for words, values in (("roll", places[:, 1]), ("pitch", places[:, 0])):
        if np.ptp(np.abs(values)) > 1e-6:
            left.append(f"arms in {words} of each rotor: their mean is taken")
    if any(parts.drag):
        left.append("rotor drag: that of the hover's rotor speed is taken, and along z as along x and y")
    drag, j = _drag_n_s_m(vehicle, parts), parts.inertia
    if np.ptp(parts.damping) > 0:
        left.append("damping about each axis: its mean is taken")
    own, weights = own_damping(vehicle, turning=True)
    damping = max(float(np.mean(parts.damping) + np.average(own, weights=weights / np.diag(j) ** 2)), 0.0)
    up, down = parts.tau_s
    tau_s = max((up + down) / 2, fastest_s)
    if tau_s > (up + down) / 2:
        left.append(f"rotors that follow within {(up + down) / 2:g} s: SIH's steps stand {fastest_s:g} s")
    left.append("motor signals: in SIH thrust is proportional to them, so THR_MDL_FAC belongs to 0 there")
    if vehicle.gravity_m_s2 != 9.81:
        left.append(f"gravity of {vehicle.gravity_m_s2:g} m/s²: SIH has that of its latitude")
    if not np.linalg.det(_INERTIA_TIMES * j) > _LEAST_DETERMINANT:
        least = (_LEAST_DETERMINANT / _INERTIA_TIMES**3) ** (1 / 3)
        left.append(
            f"turning: the inertia is too small for SIH's inverse of it (about {least:.1g} kg m² on each axis are "
            "needed), which is then zero, and this vehicle cannot rotate there at all"
        )
    values = {
        "SIH_MASS": parts.mass_kg, **{f"SIH_I{name.upper()}": value for name, value in in_entries(j).items()},
        "SIH_T_MAX": thrust.mean() * full**2, "SIH_Q_MAX": torque.mean() * full**2,
        "SIH_L_ROLL": np.abs(places[:, 1]).mean(), "SIH_L_PITCH": np.abs(places[:, 0]).mean(),
        "SIH_KDV": drag, "SIH_KDW": damping, "SIH_T_TAU": tau_s, "THR_MDL_FAC": 0.0,
    }  # fmt: skip
    lines = [f"# {vehicle.name}, exported by rotorid for PX4's SIH", *not_expressed(left)]
    lines += [*(f"# {sentence}" for sentence in _OF_THE_TOOL), *for_qgroundcontrol({"SIH_VEHICLE_TYPE": 0, **values})]
    text = "\n".join(lines) + "\n"
    return Exported(text, "sih.params", tuple(left), parameters=values, rotor_order=tuple(order))


def _drag_n_s_m(vehicle: Vehicle, parts: Parts) -> float:
    """One linear drag of the vehicle: that of the rotors in hover, and X_u and the like on top; not below 0."""
    own, weights = own_damping(vehicle, turning=False)
    rotors = len(parts.places) * float(np.mean(parts.drag)) * hover_speed_rad_s(vehicle)
    return max(rotors + float(np.average(own, weights=weights)), 0.0)


def sih_values(text: str) -> dict[str, float]:
    """The parameters of a QGroundControl file."""
    rows = [line.split("\t") for line in text.splitlines() if line and line[0] != "#"]
    return {name: float(value) for _, _, name, value, _ in rows}


def sih_wrench(values: dict[str, float], signal: np.ndarray, velocity: np.ndarray, rates: np.ndarray):
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


def sih_inertia(values: dict[str, float]) -> np.ndarray:
    """The inertia (3, 3), kg m²."""
    xx, yy, zz, xy, xz, yz = (values[f"SIH_I{k}"] for k in ("XX", "YY", "ZZ", "XY", "XZ", "YZ"))
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def gazebo_airframe(vehicle: Vehicle) -> Exported:
    """The model with sensors, `model.config`, and the airframe script, the last two as companions."""
    autostart = 22000  # SYS_AUTOSTART: PX4 leaves 22000 to 22999 to airframes of one's own.
    vehicle = named_in_one_line(vehicle)
    model = sdf(vehicle)
    # A name that a shell and Gazebo take.
    name = re.sub(r"[^a-z0-9]+", "_", vehicle.name.lower()).strip("_") or "vehicle"
    text = model.text.replace("    </link>\n", f"{_sensors(vehicle)}    </link>\n", 1)
    text = re.sub(r"<model name=(\"[^\"]*\"|'[^']*')>", f'<model name="{name}">', text, count=1)
    companions = {"model.config": _description(vehicle, name), f"{autostart}_gz_{name}": _airframe(vehicle, name)}
    said = f"places of the files: model.sdf and model.config in a folder {name} on GZ_SIM_RESOURCE_PATH"
    return replace(model, text=text, left_out=(*model.left_out, said), companions=companions)


def _sensors(vehicle: Vehicle) -> str:
    """IMU, barometer, magnetometer and satellite receiver of the body's link."""
    # Noise of the sensors where the vehicle states none: that of the x500.
    gyroscope_rad_s = 8.7e-4
    accelerometer_m_s2 = (6.4e-3, 6.4e-3, 6.9e-3)
    gyro = vehicle.noise.angular_velocity_rad_s or gyroscope_rad_s
    stated = vehicle.noise.specific_force_m_s2
    accelerometer = (stated,) * 3 if stated else accelerometer_m_s2
    place = " ".join(f"{v:.9g}" for v in np.asarray(vehicle.accelerometer_position_m) * [1, -1, -1])

    def axes(values) -> str:
        return "".join(
            f'<{a}><noise type="gaussian"><mean>0</mean><stddev>{v:.6g}</stddev></noise></{a}>'
            for a, v in zip("xyz", values, strict=True)
        )

    return f"""      <sensor name="imu_sensor" type="imu">
        <pose>{place} 0 0 0</pose>
        <always_on>1</always_on><update_rate>250</update_rate>
        <imu>
          <angular_velocity>{axes((gyro,) * 3)}</angular_velocity>
          <linear_acceleration>{axes(accelerometer)}</linear_acceleration>
        </imu>
      </sensor>
      <sensor name="air_pressure_sensor" type="air_pressure">
        <always_on>1</always_on><update_rate>50</update_rate>
        <air_pressure>
          <pressure><noise type="gaussian"><mean>0</mean><stddev>3</stddev></noise></pressure>
        </air_pressure>
      </sensor>
      <sensor name="magnetometer_sensor" type="magnetometer">
        <always_on>1</always_on><update_rate>100</update_rate>
        <magnetometer>{axes((1e-4,) * 3)}</magnetometer>
      </sensor>
      <sensor name="navsat_sensor" type="navsat"><always_on>1</always_on><update_rate>30</update_rate></sensor>
"""


def _description(vehicle: Vehicle, name: str) -> str:
    """`model.config`."""
    return f"""<?xml version="1.0"?>
<model>
  <name>{name}</name>
  <version>1.0</version>
  <sdf version="1.9">model.sdf</sdf>
  <description>{escape(vehicle.name)}, identified by rotorid</description>
</model>
"""


def _airframe(vehicle: Vehicle, name: str) -> str:
    """The airframe script: places, senses and torques of the rotors, the range of their speeds, the hover."""
    # Share of the highest speed below which the lowest counts as none: PX4's curve has no start above 0.
    low_start = 0.05
    parts = parts_of(vehicle, frozenset({"com_offset", "command_saturation"}))
    low, high = parts.limits_rad_s or (0.0, _RICHEST * hover_speed_rad_s(vehicle))
    lines = [
        "#!/bin/sh", "#", f"# @name Gazebo {name}", "#", "# @type Quadrotor", "#", "",
        ". ${R}etc/init.d/rc.mc_defaults", "",
        "PX4_SIMULATOR=${PX4_SIMULATOR:=gz}", "PX4_GZ_WORLD=${PX4_GZ_WORLD:=default}",
        f"PX4_SIM_MODEL=${{PX4_SIM_MODEL:={name}}}", "", "param set-default SIM_GZ_EN 1", "",
        "param set-default CA_AIRFRAME 0", f"param set-default CA_ROTOR_COUNT {vehicle.rotor_count}",
    ]  # fmt: skip
    lines += [f"param set-default {name} {value:.6g}" for name, value in allocated(parts, vehicle.yaw_signs())]
    for i in range(1, vehicle.rotor_count + 1):
        ends = {"FUNC": 100 + i, "MIN": round(low), "MAX": round(high)}
        lines += [f"param set-default SIM_GZ_EC_{end}{i} {value}" for end, value in ends.items()]
    share = vehicle.mass_kg * vehicle.gravity_m_s2 / float((parts.thrust * high**2).sum())
    squared = low < low_start * high
    # The signal at which speeds from the lowest to the highest make that share of the thrust.
    hover = share if squared else (float(np.sqrt(share)) - low / high) / (1 - low / high)
    lines += [
        "",
        "# Gazebo's rotor speed is proportional to the signal between its ends: thrust goes with the square.",
        f"param set-default THR_MDL_FAC {1.0 if squared else 0.0:g}",
        f"param set-default MPC_THR_HOVER {min(max(hover, 0.1), 0.8):.4g}",
    ]
    return "\n".join(lines) + "\n"


def ardupilot_json(vehicle: Vehicle) -> Exported:
    """The frame as JSON, motors in ArduPilot's X order."""
    parts, order, full, left = _in_x(vehicle, "ardupilot-json", "ArduPilot's frame X")
    places, thrust, torque = parts.places[order], parts.thrust[order], parts.torque[order]
    weight = parts.mass_kg * ARDUPILOT_GRAVITY
    share = weight / (len(order) * float(thrust.mean()) * full**2)
    expo = 1.0 - parts.curve
    at_hover = float(ardupilot_signal(share, expo))
    diagonal = 2 * float(np.linalg.norm(places[:, :2], axis=1).mean())
    area = len(order) * np.pi * (vehicle.rotor_radius_m or diagonal / 8) ** 2
    if vehicle.rotor_radius_m is None:
        left.append("rotor_radius_m is not stated: an eighth of the diagonal is taken for the disc's area")
    drag = _drag_n_s_m(vehicle, parts)
    momentum = drag / np.sqrt(DENSITY_KG_M3 * area * weight)
    if drag:
        left.append("linear drag: it goes with the root of the thrust there, and along z as well")
    bluff = 2 * float(np.mean(parts.frame[:2])) / DENSITY_KG_M3
    if bluff:
        left.append("drag of the frame: by component there, and the same along every axis")
    own, weights = own_damping(vehicle, turning=True)
    inertia = np.diag(parts.inertia)
    damping = float(np.mean(np.array(parts.damping) / inertia) + np.average(own / inertia, weights=weights))
    rate = float(_DAMPING_RAD_S / damping) if damping > 0 else 0.0
    if damping > 0:
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
        "moment_inertia": inertia.tolist(),
        "num_motors": 4.0,
    }
    for i, (place, sense, factor) in enumerate(zip(places, _SENSES, yaw, strict=True), 1):
        content[f"motor{i}_position"] = place.tolist()
        content[f"motor{i}_vector"] = [0.0, 0.0, -1.0]
        content[f"motor{i}_yaw"] = float(sense * factor)
    head = f"# {vehicle.name}, exported by rotorid: sim_vehicle.py -v ArduCopter -f X:frame.json"
    text = "\n".join([head, *not_expressed(left), json.dumps(content, indent=2)]) + "\n"
    return Exported(text, "frame.json", tuple(left), parameters=content, rotor_order=tuple(order))


def ardupilot_signal(share: float | np.ndarray, expo: float) -> float | np.ndarray:
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


def ardupilot_values(text: str) -> dict:
    """The frame of a file; ArduPilot passes over lines that begin with #."""
    return json.loads("\n".join(line for line in text.splitlines() if not line.startswith("#")))


def ardupilot_wrench(frame: dict, signal: np.ndarray, velocity: np.ndarray, rates: np.ndarray):
    """Force and moment (n, 3), body axes, N and N m, without the weight, of signals (n, 4) in the frame's order.

    `velocity` (n, 3) through the air and `rates` (n, 3) are in body axes.
    """
    weight = frame["mass"] * ARDUPILOT_GRAVITY
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
