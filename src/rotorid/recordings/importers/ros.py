"""ROS 1 bags, ROS 2 bags and MCAP files through rosbags: no ROS is needed.

By ROS's REP 103 the body is forward-left-up and the world has z up; half a turn about x makes them forward-right-down
and z down. Of each quantity the topic of a known type with the most messages is read:

| quantity | types |
| --- | --- |
| body rates, specific force | `sensor_msgs/Imu` |
| attitude | `nav_msgs/Odometry`, `geometry_msgs/PoseStamped`, `…/TransformStamped`, then `sensor_msgs/Imu` |
| position, velocity | `nav_msgs/Odometry` (twist in body axes), `geometry_msgs/PoseStamped`, `…/TransformStamped` |
| rotor speeds | `mav_msgs/Actuators` and `actuator_msgs/Actuators` (rad/s), `mavros_msgs/ESCStatus` (rpm) |
| throttles | `mavros_msgs/RCOut` (µs) |
| battery, height | `sensor_msgs/BatteryState`, `sensor_msgs/Range` |

The clock is the messages' own stamp where they have one, else the time at which they were recorded.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from rotorid.errors import InputError
from rotorid.io.text.wording import printable
from rotorid.recordings import columns as c
from rotorid.recordings.importers import in_the_air
from rotorid.recordings.importers.clean import report_gaps
from rotorid.recordings.importers.frames import half_turn_about_x, quaternion_to_frd_ned
from rotorid.recordings.importers.optional import needs
from rotorid.recordings.importers.report import Fault

RPM = 2 * np.pi / 60
PULSE_US = (1000.0, 2000.0)


def _xyz(v) -> list[float]:
    return [v.x, v.y, v.z]


def _wxyz(q) -> list[float]:
    return [q.w, q.x, q.y, q.z]


READERS: dict[str, Callable] = {
    "sensor_msgs/msg/Imu": lambda m: {
        "rates": _xyz(m.angular_velocity), "force": _xyz(m.linear_acceleration), "imu_attitude": _wxyz(m.orientation),
    },
    "nav_msgs/msg/Odometry": lambda m: {
        "attitude": _wxyz(m.pose.pose.orientation), "position": _xyz(m.pose.pose.position),
        "body_velocity": _xyz(m.twist.twist.linear),
    },
    "geometry_msgs/msg/PoseStamped": lambda m: {
        "attitude": _wxyz(m.pose.orientation), "position": _xyz(m.pose.position),
    },
    "geometry_msgs/msg/TransformStamped": lambda m: {
        "attitude": _wxyz(m.transform.rotation), "position": _xyz(m.transform.translation),
    },
    "mav_msgs/msg/Actuators": lambda m: {"speeds": list(m.angular_velocities)},
    "actuator_msgs/msg/Actuators": lambda m: {"speeds": list(m.velocity)},
    "mavros_msgs/msg/ESCStatus": lambda m: {"rpm": [e.rpm for e in m.esc_status]},
    "mavros_msgs/msg/RCOut": lambda m: {"pulses": list(m.channels)},
    "sensor_msgs/msg/BatteryState": lambda m: {"voltage": [m.voltage], "current": [-m.current]},
    "sensor_msgs/msg/Range": lambda m: {"range": [m.range]},
}  # fmt: skip
"""To the type of a message what it holds by quantity; several types may hold one."""


@dataclass(frozen=True)
class Series:
    """One quantity of one topic: instants (n,), s, and values (n, k)."""

    topic: str
    time_s: np.ndarray
    values: np.ndarray


def read_series(path: Path) -> tuple[dict[str, list[Series]], list[Fault]]:
    """Every known quantity of a bag by topic, those with the most messages first.

    InputError where it cannot be read or holds no known type.
    """
    highlevel = needs("rosbags.highlevel", "ros", path)
    typesys = needs("rosbags.typesys", "ros", path)
    found: dict[tuple[str, str], list[tuple[float, list[float]]]] = {}
    unknown: dict[str, str] = {}
    try:
        store = typesys.get_typestore(typesys.Stores.LATEST)
        with highlevel.AnyReader([path], default_typestore=store) as bag:
            known = [k for k in bag.connections if k.msgtype in READERS]
            unknown = {k.topic: k.msgtype for k in bag.connections if k.msgtype not in READERS}
            for connection, recorded_ns, raw in bag.messages(connections=known) if known else ():
                message = bag.deserialize(raw, connection.msgtype)
                stamp = getattr(getattr(message, "header", None), "stamp", None)
                time_s = recorded_ns * 1e-9
                if stamp is not None and stamp.sec > 0:
                    time_s = stamp.sec + stamp.nanosec * 1e-9
                for quantity, values in READERS[connection.msgtype](message).items():
                    found.setdefault((quantity, connection.topic), []).append((time_s, values))
    except MemoryError:
        raise
    except Exception as error:  # rosbags lets whatever a broken file raises through
        raise InputError(f"{path}: not a bag or MCAP file that can be read ({printable(error)[:150]})") from None
    if not found:
        listed = ", ".join(f"{t} ({k})" for t, k in sorted(unknown.items())[:8]) or "none"
        raise InputError(f"{path}: no topic of a type that is known; found {listed}")
    series: dict[str, list[Series]] = {}
    for (quantity, topic), rows in found.items():
        width = min(len(v) for _, v in rows)
        rows.sort(key=lambda row: row[0])
        time_s = np.array([t for t, _ in rows])
        values = np.array([v[:width] for _, v in rows], float)
        keep = in_the_air.increasing(time_s)
        if width and keep.sum() > 1:
            series.setdefault(quantity, []).append(Series(topic, time_s[keep], values[keep]))
    for offered in series.values():
        offered.sort(key=lambda s: -len(s.time_s))
    faults = [
        Fault("instances", quantity, f"{', '.join(s.topic for s in offered)} hold it", f"{offered[0].topic} taken", 0)
        for quantity, offered in series.items()
        if len(offered) > 1
    ]
    return series, faults


def convert(series: dict[str, list[Series]], faults: list[Fault], where: object) -> tuple[pd.DataFrame, np.ndarray]:
    """Contract columns and where it flies (mask of rows), of the first series of each quantity."""
    first = {quantity: offered[0] for quantity, offered in series.items()}
    if "attitude" not in first and "imu_attitude" in first:
        size = np.linalg.norm(first["imu_attitude"].values, axis=1)
        if np.all(np.abs(size - 1) < 0.01):  # all zero, or w alone, where the sensor has none
            first["attitude"] = first["imu_attitude"]
    clock = max((first[q] for q in ("rates", "attitude") if q in first), key=lambda s: len(s.time_s), default=None)
    if clock is None:
        raise InputError(f"{where}: neither sensor_msgs/Imu nor a pose to take the clock from")
    grid = clock.time_s
    parts: list[tuple] = []
    for quantity, names in (("rates", c.ANGULAR_VELOCITY), ("force", c.SPECIFIC_FORCE), ("position", c.POSITION)):
        if quantity in first:
            parts.append((names, first[quantity].time_s, half_turn_about_x(first[quantity].values)))
    if "attitude" in first:
        parts.append((c.QUATERNION, first["attitude"].time_s, quaternion_to_frd_ned(first["attitude"].values)))
    if "body_velocity" in first:
        own = next(s for s in series["attitude"] if s.topic == first["body_velocity"].topic)
        turn = Rotation.from_quat(own.values[:, [1, 2, 3, 0]])
        parts.append((c.VELOCITY, own.time_s, half_turn_about_x(turn.apply(first["body_velocity"].values))))
    turning = first.get("speeds") or first.get("rpm")
    if turning is not None:
        speeds = np.abs(turning.values) * (1.0 if "speeds" in first else RPM)
        parts.append((c.rotor_columns("rotor_speed", speeds.shape[1]), turning.time_s, speeds))
    if "pulses" in first:
        pulses = first["pulses"].values
        used = [i for i in range(pulses.shape[1]) if np.ptp(pulses[:, i]) > 0][:4]
        low, high = PULSE_US
        found = f"channels {', '.join(str(i + 1) for i in used)} of {first['pulses'].topic} move"
        faults.append(
            Fault("unit", "throttle", found, f"taken for motors in order, {low:g} to {high:g} µs", len(pulses))
        )
        throttle = np.clip((pulses[:, used] - low) / (high - low), 0, 1)
        parts.append((c.rotor_columns("throttle", len(used)), first["pulses"].time_s, throttle))
    for quantity, name in (("voltage", c.BATTERY_VOLTAGE), ("current", c.BATTERY_CURRENT), ("range", c.HEIGHT)):
        if quantity in first:
            parts.append(((name,), first[quantity].time_s, first[quantity].values))
    table = in_the_air.table_on(grid, parts)
    return table, in_the_air.airborne(table)[0]


def read_ros(path: Path) -> tuple[dict[str, pd.DataFrame], list[Fault], str]:
    """Every flight of a bag (file or folder) or MCAP file by name, in contract columns, what was found, and the unit
    in which rotor speeds are stated."""
    series, faults = read_series(path)
    table, flying = convert(series, faults, path)
    runs, cuts = in_the_air.flights(table, flying, (path.resolve() if path.is_dir() else path).name.split(".")[0], path)
    unit = "rpm" if "rpm" in series and "speeds" not in series else "rad/s"
    return runs, [*faults, *report_gaps(table), *cuts], unit
