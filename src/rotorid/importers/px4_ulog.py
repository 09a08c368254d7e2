"""PX4 flight logs (ULog) through pyulog.

PX4's frames are the contract's: body forward-right-down, world north-east-down, quaternion scalar first.
Each topic has its own clock; a run is laid out on the times of the fastest inertial topic and each other
value stands in the row nearest in time, so nothing is interpolated.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from pyulog import ULog

from rotorid.errors import InputError
from rotorid.importers.clean import drop_repeated_times, report_gaps
from rotorid.importers.frames import continuous
from rotorid.importers.report import Fault
from rotorid.recordings import columns as c

RPM = 2 * np.pi / 60


@dataclass(frozen=True)
class Topic:
    """A ULog topic, its fields, the columns they become and a factor to the contract's unit."""

    name: str
    fields: tuple[str, ...]
    columns: tuple[str, ...]
    factor: float = 1.0


def _indexed(field: str, count: int) -> tuple[str, ...]:
    return tuple(f"{field}[{i}]" for i in range(count))


TOPICS = (
    Topic("sensor_combined", _indexed("accelerometer_m_s2", 3), c.SPECIFIC_FORCE),
    Topic("vehicle_acceleration", _indexed("xyz", 3), c.SPECIFIC_FORCE),
    Topic("sensor_combined", _indexed("gyro_rad", 3), c.ANGULAR_VELOCITY),
    Topic("vehicle_angular_velocity", _indexed("xyz", 3), c.ANGULAR_VELOCITY),
    Topic("vehicle_attitude", _indexed("q", 4), c.QUATERNION),
    Topic("vehicle_local_position", ("x", "y", "z"), c.POSITION),
    Topic("vehicle_local_position", ("vx", "vy", "vz"), c.VELOCITY),
    Topic("battery_status", ("voltage_v",), (c.BATTERY_VOLTAGE,)),
    Topic("battery_status", ("current_a",), (c.BATTERY_CURRENT,)),
)
DRIVES = ("actuator_motors", "actuator_outputs")


def _on_grid(grid: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values put into the row of the grid nearest in time; NaN elsewhere (the last one wins a shared row)."""
    edges = (grid[1:] + grid[:-1]) / 2
    inside = (time >= grid[0]) & (time <= grid[-1])
    result = np.full((len(grid), values.shape[1]), np.nan)
    result[np.searchsorted(edges, time[inside])] = values[inside]
    return result


def _rotor_topics(data: dict, rotors: int) -> list[Topic]:
    topics = []
    if "actuator_motors" in data:
        topics.append(Topic("actuator_motors", _indexed("control", rotors), c.rotor_columns("throttle", rotors)))
    elif "actuator_outputs" in data:
        topics.append(Topic("actuator_outputs", _indexed("output", rotors), c.rotor_columns("throttle", rotors)))
    if "esc_status" in data:
        fields = tuple(f"esc[{i}].esc_rpm" for i in range(rotors))
        topics.append(Topic("esc_status", fields, c.rotor_columns("rotor_speed", rotors), RPM))
    return topics


def convert(data: dict[str, dict[str, np.ndarray]], rotors: int) -> tuple[pd.DataFrame, list[Fault]]:
    """Contract columns of ULog topics given as {topic: {field: values}}, `timestamp` in µs."""
    inertial = [t for t in ("vehicle_angular_velocity", "sensor_combined", "vehicle_attitude") if t in data]
    if not inertial:
        raise InputError(
            "no topic vehicle_angular_velocity, sensor_combined or vehicle_attitude to take the clock from"
        )
    base = max(inertial, key=lambda name: len(data[name]["timestamp"]))
    grid, faults = drop_repeated_times(pd.DataFrame({c.TIME: data[base]["timestamp"] * 1e-6}))
    time = grid[c.TIME].to_numpy()
    columns = {c.TIME: time - time[0]}
    for topic in (*TOPICS, *_rotor_topics(data, rotors)):
        fields = data.get(topic.name, {})
        if not set(topic.fields) <= set(fields):
            continue
        values = np.column_stack([fields[f] for f in topic.fields]).astype(float) * topic.factor
        if topic.columns == c.QUATERNION:
            values = continuous(values)
        if topic.name == "actuator_outputs":
            values = (values - 1000.0) / 1000.0
        columns.update(zip(topic.columns, _on_grid(time, fields["timestamp"] * 1e-6, values).T, strict=True))
    if not any(t in data for t in DRIVES):
        faults.append(
            Fault(
                "no_command",
                "",
                "neither actuator_motors nor actuator_outputs is logged",
                "no throttle columns",
                0,
            )
        )
    table = pd.DataFrame(columns)
    return table, faults + report_gaps(table)


def read_px4_ulog(path: Path, rotors: int = 4) -> tuple[pd.DataFrame, list[Fault]]:
    """One PX4 log in contract columns, and its faults (dropouts of the logger among them)."""
    if not Path(path).is_file():
        raise InputError(f"{path}: file is missing")
    try:
        log = ULog(str(path))
    except Exception as error:
        raise InputError(f"{path}: not a ULog file that can be read ({error})") from None
    data = {d.name: d.data for d in log.data_list if d.multi_id == 0}
    try:
        table, faults = convert(data, rotors)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    if log.dropouts:
        lost = sum(d.duration for d in log.dropouts) / 1000
        faults.append(
            Fault(
                "dropout",
                c.TIME,
                f"the logger lost {len(log.dropouts)} stretches, {lost:.3g} s in all",
                "left as gaps",
                len(log.dropouts),
            )
        )
    return table, faults
