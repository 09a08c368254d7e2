"""What PX4 needs next to a Gazebo model to fly it: sensors, the model's description and the airframe script.

As the x500 of PX4's Gazebo models (PX4-gazebo-models, models/x500_base/model.sdf: sensors and their noise) and its
airframe (PX4-Autopilot, ROMFS/px4fmu_common/init.d-posix/airframes/4001_gz_x500).
"""

from __future__ import annotations

import re
from dataclasses import replace
from xml.sax.saxutils import escape

import numpy as np

from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle.exports.forms import Exported, parts_of, sdf
from rotorid.vehicle.exports.sih import RICHEST
from rotorid.vehicle.mixer import hover_speed_rad_s

_NUMBER = 22000
"""SYS_AUTOSTART: PX4 leaves 22000 to 22999 to airframes of one's own."""
_LOW_START = 0.05
"""Share of the highest speed below which the lowest counts as none: PX4's curve has no start above 0."""
_GYROSCOPE_RAD_S = 8.7e-4
_ACCELEROMETER_M_S2 = (6.4e-3, 6.4e-3, 6.9e-3)
"""Noise of the sensors where the vehicle states none: that of the x500."""


def gazebo_airframe(vehicle: Vehicle) -> Exported:
    """The model with sensors, `model.config`, and the airframe script, the last two as companions."""
    model = sdf(vehicle)
    name = _identifier(vehicle.name)
    text = model.text.replace("    </link>\n", f"{sensors(vehicle)}    </link>\n", 1)
    text = re.sub(r"<model name=(\"[^\"]*\"|'[^']*')>", f'<model name="{name}">', text, count=1)
    companions = {"model.config": description(vehicle, name), f"{_NUMBER}_gz_{name}": airframe(vehicle, name)}
    said = f"places of the files: model.sdf and model.config in a folder {name} on GZ_SIM_RESOURCE_PATH"
    return replace(model, text=text, left_out=(*model.left_out, said), companions=companions)


def _identifier(name: str) -> str:
    """A name that a shell and Gazebo take."""
    return re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_") or "vehicle"


def sensors(vehicle: Vehicle) -> str:
    """IMU, barometer, magnetometer and satellite receiver of the body's link."""
    gyro = vehicle.noise.angular_velocity_rad_s or _GYROSCOPE_RAD_S
    stated = vehicle.noise.specific_force_m_s2
    accelerometer = (stated,) * 3 if stated else _ACCELEROMETER_M_S2
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


def description(vehicle: Vehicle, name: str) -> str:
    """`model.config`."""
    return f"""<?xml version="1.0"?>
<model>
  <name>{name}</name>
  <version>1.0</version>
  <sdf version="1.9">model.sdf</sdf>
  <description>{escape(vehicle.name)}, identified by rotorid</description>
</model>
"""


def airframe(vehicle: Vehicle, name: str) -> str:
    """The airframe script: places, senses and torques of the rotors, the range of their speeds, the hover."""
    parts = parts_of(vehicle, frozenset({"com_offset", "command_saturation"}))
    low, high = parts.limits_rad_s or (0.0, RICHEST * hover_speed_rad_s(vehicle))
    lines = [
        "#!/bin/sh", "#", f"# @name Gazebo {name}", "#", "# @type Quadrotor", "#", "",
        ". ${R}etc/init.d/rc.mc_defaults", "",
        "PX4_SIMULATOR=${PX4_SIMULATOR:=gz}", "PX4_GZ_WORLD=${PX4_GZ_WORLD:=default}",
        f"PX4_SIM_MODEL=${{PX4_SIM_MODEL:={name}}}", "", "param set-default SIM_GZ_EN 1", "",
        "param set-default CA_AIRFRAME 0", f"param set-default CA_ROTOR_COUNT {vehicle.rotor_count}",
    ]  # fmt: skip
    strongest = parts.thrust.max()
    for i, (place, sign) in enumerate(zip(parts.places, vehicle.yaw_signs(), strict=True)):
        own = {
            "PX": place[0], "PY": place[1], "PZ": place[2], "KM": sign * parts.torque[i] / parts.thrust[i],
            "CT": 6.5 * parts.thrust[i] / strongest,
        }  # fmt: skip
        lines += [f"param set-default CA_ROTOR{i}_{key} {value:.6g}" for key, value in own.items()]
    for i in range(1, vehicle.rotor_count + 1):
        lines += [
            f"param set-default SIM_GZ_EC_FUNC{i} {100 + i}",
            f"param set-default SIM_GZ_EC_MIN{i} {round(low)}",
            f"param set-default SIM_GZ_EC_MAX{i} {round(high)}",
        ]
    share = vehicle.mass_kg * vehicle.gravity_m_s2 / float((parts.thrust * high**2).sum())
    squared = low < _LOW_START * high
    hover = share if squared else _signal(share, low / high)
    lines += [
        "",
        "# Gazebo's rotor speed is proportional to the signal between its ends: thrust goes with the square.",
        f"param set-default THR_MDL_FAC {1.0 if squared else 0.0:g}",
        f"param set-default MPC_THR_HOVER {min(max(hover, 0.1), 0.8):.4g}",
    ]
    return "\n".join(lines) + "\n"


def _signal(share: float, lowest: float) -> float:
    """The signal at which speeds from `lowest` to 1 make a share of the thrust."""
    return (float(np.sqrt(share)) - lowest) / (1 - lowest)
