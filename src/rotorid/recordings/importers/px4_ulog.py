"""PX4 flight logs (ULog) through pyulog.

PX4's frames are the contract's: body forward-right-down, world north-east-down, quaternion scalar first.
Each topic has its own clock; a run is laid out on the times of the fastest inertial topic and each other
value stands in the row nearest in time, so nothing is interpolated.

What PX4 marks as invalid is a missing sample: positions and velocities by `xy_valid`, `z_valid`, `v_xy_valid`,
`v_z_valid`, the height by `dist_bottom_valid`, a speed controller by `esc_online_flags`, a battery by `connected`,
a current of -1. Position, velocity and attitude are the flight controller's estimates; where it resets one of them, a
run ends. Parameters may change within a log; each throttle is read by those that held then.

Sources: PX4 `msg/`, `src/modules/control_allocator/module.yaml`, `src/lib/mixer_module`; the ULog file format.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from pyulog import ULog

from rotorid.errors import InputError
from rotorid.io.text.wording import printable
from rotorid.recordings import columns as c
from rotorid.recordings.importers.faults import (
    GOES_ON,
    ImportFault,
    airborne,
    drop_repeated_times,
    fault_where,
    further_motors,
    on_grid,
    one_sense,
    report_gaps,
    without_pauses,
)
from rotorid.recordings.importers.known import Parameters, Values
from rotorid.recordings.importers.mapping import PULSE_US, RPM, continuous

_FIRST_MOTOR = 101
"""Number of motor 1 among PX4's output functions."""
_MOST_MOTORS = 12
_ROTORS_OF_TYPE = {0: 0, 2: 4, 13: 6, 14: 8, 29: 12, 35: 10, 43: 0}
"""Rotors by MAV_TYPE of multirotors; 0 where the type states no number."""
OTHER_TYPES = {1: "a fixed wing", 3: "a coaxial helicopter", 4: "a helicopter", 7: "an airship", 10: "a rover"}
OTHER_TYPES |= {11: "a boat", 12: "a submarine", 15: "a tricopter, whose tail rotor a servo tilts"}
OTHER_TYPES |= {n: "a VTOL" for n in range(19, 26)}
OTHER_AIRFRAMES = {1: "a fixed wing", 2: "a VTOL", 3: "a VTOL", 4: "a VTOL", 5: "a rover", 6: "a rover", 13: "a rover"}
OTHER_AIRFRAMES |= {7: "a vehicle whose motors point in several directions", 8: "a multirotor with rotors that tilt"}
OTHER_AIRFRAMES |= {n: "a helicopter" for n in (10, 11, 12)} | {n: "a spacecraft" for n in (14, 15)}
"""CA_AIRFRAME of what is no multirotor of fixed rotors."""
_CHANGED = (
    (r"THR_MDL_FAC|CA_R_REV|PWM_(MAIN|AUX)_\w+", "throttle", "each value is read by what held then"),
    (r"CA_ROTOR\w+|CA_AIRFRAME|MAV_TYPE", "vehicle.yaml", "the value that held for most of the flight is taken"),
    (r"MPC_THR_HOVER|EKF2_BCOEF_[XY]|EKF2_MCOEF", "", "no column depends on it"),
)
"""Parameters on which a value depends, or that `rotorid parameters` states: names, column, what a change means."""
_PLAUSIBLE_PULSE_US = (500.0, 2500.0)
_AROUND_RESET_S = 0.2
RESETS = (
    ("vehicle_local_position", "xy_reset_counter", ("delta_xy[0]", "delta_xy[1]"), 0.02),
    ("vehicle_local_position", "z_reset_counter", ("delta_z",), 0.02),
    ("vehicle_local_position", "vxy_reset_counter", ("delta_vxy[0]", "delta_vxy[1]"), 0.02),
    ("vehicle_local_position", "vz_reset_counter", ("delta_vz",), 0.02),
    ("vehicle_local_position", "heading_reset_counter", ("delta_heading",), 0.01),
    ("vehicle_attitude", "quat_reset_counter", tuple(f"delta_q_reset[{i}]" for i in (1, 2, 3)), 0.005),
)
"""What the estimator sets anew at once: topic, counter, the fields that hold by how much, and how much of it (m, m/s,
rad; half of the angle) is within the noise of an estimate."""
_ARMED = 2

_Topics = Mapping[str, Sequence[Mapping[str, np.ndarray]]]


@dataclass(frozen=True)
class Px4Log:
    """What is read of a log: instances of each topic in order, parameters, seconds lost, damage, bytes of a message in
    which the file ends."""

    topics: _Topics
    parameters: Parameters = Parameters({})
    lost_s: tuple[float, ...] = ()
    damaged: bool = False
    rest: int = 0


class _Subscriptions(dict):
    """pyulog's subscriptions by their number: one that is taken by another keeps what it has received."""

    def __setitem__(self, number: int, subscription) -> None:
        if number in self:
            super().__setitem__(-1 - len(self), self[number])
        super().__setitem__(number, subscription)


class _Reader(ULog):
    """pyulog's reader, which forgets what came before a topic is subscribed once more under the same number."""

    def _load_file(self, *arguments, **named) -> None:
        self._subscriptions = _Subscriptions()
        super()._load_file(*arguments, **named)


def open_log(path: Path) -> Px4Log:
    """Read a ULog file; InputError where it is none."""
    if not Path(path).is_file():
        raise InputError(f"{path}: file is missing")
    try:
        log = _Reader(str(path))
    except MemoryError:
        raise
    except Exception as error:
        raise InputError(f"{path}: not a ULog file that can be read ({printable(error)[:150]})") from None
    parts: dict[tuple[str, int], list[Mapping[str, np.ndarray]]] = {}
    for dataset in sorted(log.data_list, key=lambda d: d.multi_id):
        if "timestamp" in dataset.data:  # a damaged format may have lost it
            parts.setdefault((dataset.name, dataset.multi_id), []).append(dataset.data)
    topics: dict[str, list[Mapping[str, np.ndarray]]] = {}
    for (name, _), found in parts.items():
        topics.setdefault(name, []).append(_joined(found))
    changed = ((at, name, value) for at, name, value in log.changed_parameters if isinstance(value, int | float))
    return Px4Log(
        topics,
        Parameters.of(changed, log.initial_parameters),
        tuple(d.duration / 1000 for d in log.dropouts),
        log.file_corruption,
        0 if log.file_corruption else _cut_message(Path(path).read_bytes()),
    )


def _joined(parts: Sequence[Mapping[str, np.ndarray]]) -> Mapping[str, np.ndarray]:
    """One instance of a topic from those that it was subscribed as one after the other, in order of time."""
    if len(parts) == 1:
        return parts[0]
    fields = set.intersection(*(set(part) for part in parts))
    order = np.argsort(np.concatenate([part["timestamp"] for part in parts]), kind="stable")
    return {name: np.concatenate([part[name] for part in parts])[order] for name in fields}


def _cut_message(data: bytes) -> int:
    """Bytes of the message that a ULog file ends in; 0 where it ends between two."""
    at = 16
    while at + 3 <= len(data):
        stop = at + 3 + int.from_bytes(data[at : at + 2], "little")
        if stop > len(data):
            break
        at = stop
    return len(data) - at


def in_flight(log: Px4Log) -> Values:
    """The parameters as they held for most of the flight."""
    times = _clock(log.topics)
    if not log.parameters.changes or not len(times):
        return log.parameters.start
    flown = _flying(log, times)
    return log.parameters.mostly(times if flown is None or not flown.any() else times[flown])


def rotor_count(log: Px4Log) -> int:
    """Number of rotors by the log's parameters, else by the motors that it drives, else 4; InputError if it is no
    multirotor of fixed rotors."""
    values = in_flight(log)
    kind, airframe = int(values.get("MAV_TYPE", 2)), int(values.get("CA_AIRFRAME", 0))
    if kind not in _ROTORS_OF_TYPE or airframe in OTHER_AIRFRAMES:
        what, by = OTHER_TYPES.get(kind, "a vehicle that is not known here"), f"MAV_TYPE {kind}"
        if kind in _ROTORS_OF_TYPE:
            what, by = OTHER_AIRFRAMES[airframe], f"CA_AIRFRAME {airframe}"
        raise InputError(f"the log is of {what} ({by}); only multirotors can be imported")
    stated = int(values.get("CA_ROTOR_COUNT", 0)) or (_ROTORS_OF_TYPE[kind] if "MAV_TYPE" in values else 0)
    return stated or _driven_motors(log.topics) or 4


def _driven_motors(topics: _Topics) -> int:
    """Number of motors to which `actuator_motors` gives a value; the others are NaN throughout."""
    motors = _first(topics, "actuator_motors")
    given = [
        i for i, name in enumerate(_indexed("control", _MOST_MOTORS), 1) if np.isfinite(motors.get(name, [])).any()
    ]
    return max(given, default=0)


# Clocks -------------------------------------------------------------------------------------------


def _time(data: Mapping[str, np.ndarray], sampled: bool = True) -> np.ndarray:
    """Times of a topic, µs: of the sampling where the topic states them, else of the publication."""
    stamp = np.asarray(data["timestamp"]).astype(np.int64)
    taken = np.asarray(data.get("timestamp_sample", np.zeros(len(stamp)))).astype(np.int64)
    near = (taken > 0) & (np.abs(stamp - taken) < 1_000_000)
    return np.where(near, taken, stamp) if sampled else stamp


def _held(grid: np.ndarray, time: np.ndarray, values: np.ndarray, before: float) -> np.ndarray:
    """Values held until the next one; `before` in rows before the first."""
    index = np.searchsorted(time, grid, side="right") - 1
    return np.where(index >= 0, np.asarray(values, float)[np.maximum(index, 0)], before)


def _indexed(name: str, count: int) -> list[str]:
    return [f"{name}[{i}]" for i in range(count)]


def _stack(data: Mapping[str, np.ndarray], fields: Sequence[str]) -> np.ndarray | None:
    """Fields as columns (n, k), None where one is missing."""
    return np.column_stack([data[f] for f in fields]).astype(float) if set(fields) <= set(data) else None


def _first(topics: _Topics, name: str) -> Mapping[str, np.ndarray]:
    """The first instance of a topic that goes on as long as any other; empty where there is none."""
    counts = [len(data["timestamp"]) for data in topics.get(name, [])]
    chosen = next((k for k, count in enumerate(counts) if count >= GOES_ON * max(counts)), None)
    return {} if chosen is None else topics[name][chosen]


# Rotors -------------------------------------------------------------------------------------------


def _throttles(log: Px4Log, rotors: int) -> tuple[np.ndarray | None, np.ndarray, list[ImportFault]]:
    """Throttles (n, rotors) with their times, µs, from either generation of actuator topics."""
    names = ", ".join(c.rotor_columns("throttle", rotors))
    motors = _first(log.topics, "actuator_motors")
    values = _stack(motors, _indexed("control", rotors))
    if values is not None:
        times = _time(motors, sampled=False)
        faults = _more_rotors("actuator_motors", _driven_motors(log.topics), rotors)
        values, reversed_ = one_sense(values, c.rotor_columns("throttle", rotors), 1.0)
        for start, stop, stated in log.parameters.spans(_CHANGED[0][0]):
            inside, curve = (times >= start) & (times < stop), float(stated.get("THR_MDL_FAC", 0.0))
            if 0 < curve <= 1 and inside.any():  # PX4 turns the thrust asked for into the signal by this curve
                half = (1 - curve) / (2 * curve)
                values[inside] = np.sqrt(half**2 + values[inside] / curve) - half
                seen = f"THR_MDL_FAC is {curve:g}: actuator_motors holds thrusts"
                faults += fault_where(inside, "unit", names, seen, "turned into signals by PX4's own curve")
        return values, times, faults + reversed_
    instances = log.topics.get("actuator_outputs", [])
    if not instances:
        return _no_throttle("no_command", "", "neither actuator_motors nor actuator_outputs is logged")
    return _from_pulses(log, instances, rotors, names)


def _no_throttle(
    kind: str, names: str, found: str, samples: int = 0, before: Sequence[ImportFault] = ()
) -> tuple[None, np.ndarray, list[ImportFault]]:
    return None, np.zeros(0), [*before, ImportFault(kind, names, found, "no throttle columns", samples)]


def _more_rotors(topic: str, driven: int, rotors: int) -> list[ImportFault]:
    """A fault where a topic has motors beyond the vehicle's."""
    if driven <= rotors:
        return []
    found = f"{topic} drives {driven} motors, the log's parameters state {rotors}"
    return [ImportFault("order", "", found, "the others are left out; check CA_ROTOR_COUNT and MAV_TYPE", 0)]


def _from_pulses(log: Px4Log, instances, rotors: int, names: str):
    """Throttles of `actuator_outputs`, pulse widths in µs."""
    flown = in_flight(log)
    port, outputs = _outputs_of_motors(flown, rotors)
    if outputs is None:
        found = f"no output of PWM_MAIN_FUNC* or PWM_AUX_FUNC* is motor {port}, and actuator_motors is not logged"
        return _no_throttle("no_command", "", found)
    faults = []
    stacks = [_stack(data, [f"output[{k}]" for k in outputs]) for data in instances]
    usable = [i for i, s in enumerate(stacks) if s is not None]
    if not usable:
        return _no_throttle("no_command", "", f"actuator_outputs holds fewer than {rotors} outputs")
    chosen = max(usable, key=lambda i: float(np.nanstd(stacks[i], axis=0).min()))
    if len(instances) > 1:
        found = f"{len(instances)} instances of actuator_outputs"
        faults.append(ImportFault("instances", names, found, f"instance {chosen}, whose outputs move, taken", 0))
    if not any("_FUNC" in name for name in flown):  # no output states what it is
        every = _stack(instances[chosen], [f for f in _indexed("output", 16) if f in instances[chosen]])
        faults += _more_rotors("actuator_outputs", rotors + len(further_motors(every, rotors)), rotors)
    times, pulses = _time(instances[chosen], sampled=False), stacks[chosen]
    turning = pulses[pulses > 0]
    if len(turning) and not (turning.min() >= _PLAUSIBLE_PULSE_US[0] and turning.max() <= _PLAUSIBLE_PULSE_US[1]):
        found = f"outputs from {turning.min():g} to {turning.max():g} are no pulse widths in µs"
        return _no_throttle("unit", names, found, len(pulses), faults)
    throttle = np.full(pulses.shape, np.nan)
    for start, stop, values in log.parameters.spans(_CHANGED[0][0]):
        inside = (times >= start) & (times < stop)
        low, high, stated = _pulse_range(values, port, outputs)
        throttle[inside] = (pulses[inside] - low) / (high - low)
        if not stated and inside.any():
            found = "no parameter states the pulse widths of no and full throttle"
            faults += fault_where(inside, "unit", names, found, f"taken as {low[0]:g} and {high[0]:g} µs")
    both = [i for i in range(rotors) if int(flown.get("CA_R_REV", 0)) >> i & 1]  # 0 in the middle of their range
    throttle[:, both], backwards = one_sense(
        2 * throttle[:, both] - 1, [c.rotor_columns("throttle", rotors)[i] for i in both], 1.0
    )
    outside = (throttle < -0.01) | (throttle > 1.01)
    found = f"{outside.any(axis=1).mean():.0%} of the rows lie outside the range (disarmed motors get less)"
    faults += fault_where(outside, "range", names, found, "cut off at 0 and 1")
    return np.clip(throttle, 0, 1), times, faults + backwards


def _outputs_of_motors(parameters: Values, rotors: int) -> tuple[str | int, list[int] | None]:
    """The port (`MAIN` or `AUX`) and the indices of its outputs that drive motors 1 to `rotors`; the first ones of
    `MAIN` where no function is stated, and the number of a motor that has no output where one is missing."""
    by_port, stated = {}, False
    for port in ("MAIN", "AUX"):
        named = rf"PWM_{port}_FUNC(\d+)"
        functions = {int(v): int(m[1]) for k, v in parameters.items() if (m := re.fullmatch(named, k))}
        by_port[port] = [functions.get(_FIRST_MOTOR + i) for i in range(rotors)]
        stated |= bool(functions)
    if not stated:
        return "MAIN", list(range(rotors))
    port, motors = min(by_port.items(), key=lambda item: item[1].count(None))
    return (motors.index(None) + 1, None) if None in motors else (port, [k - 1 for k in motors])


def _pulse_range(parameters: Values, port: str, outputs: Sequence[int]) -> tuple[np.ndarray, np.ndarray, bool]:
    """Pulse widths of no and full throttle by output, µs, and whether a parameter states them."""
    ends, stated = [], True
    for word, default in zip(("MIN", "MAX"), PULSE_US, strict=True):
        common = next((parameters[k] for k in (f"PWM_{port}_{word}", f"PWM_{word}") if parameters.get(k, 0) > 0), None)
        own = [parameters.get(f"PWM_{port}_{word}{k + 1}", -1) for k in outputs]
        stated &= common is not None or all(v > 0 for v in own)
        ends.append(np.array([v if v > 0 else (common or default) for v in own], float))
    reverse = [bool(int(parameters.get(f"PWM_{port}_REV", 0)) >> k & 1) for k in outputs]
    low, high = ends
    return np.where(reverse, high, low), np.where(reverse, low, high), stated


def _speeds(log: Px4Log, rotors: int) -> tuple[np.ndarray | None, np.ndarray, list[ImportFault]]:
    """Rotor speeds (n, rotors), rad/s, of `esc_status`, NaN where a controller is not heard."""
    instances = log.topics.get("esc_status", [])
    turning = [d for d in instances if any(np.any(v) for field, v in d.items() if field.endswith(".esc_rpm"))]
    if not instances:
        return None, np.zeros(0), []
    data = (turning or instances)[0]
    slots = [i for i in range(8) if f"esc[{i}].esc_rpm" in data]
    function = {i: int(np.median(data.get(f"esc[{i}].actuator_function", [0]))) for i in slots}
    by_function = {f - _FIRST_MOTOR: i for i, f in function.items() if f >= _FIRST_MOTOR}
    place = {r: by_function.get(r, r) if by_function else r for r in range(rotors)}
    if not set(place.values()) <= set(slots):
        found = f"esc_status holds {len(slots)} controllers for {rotors} rotors"
        return None, np.zeros(0), [ImportFault("speed_missing", "rotor_speed", found, "no rotor speeds", 0)]
    online = np.asarray(data.get("esc_online_flags", np.full(len(data["timestamp"]), -1))).astype(np.int64)
    values = np.column_stack([np.asarray(data[f"esc[{place[r]}].esc_rpm"], float) for r in range(rotors)]) * RPM
    values, faults = one_sense(values, c.rotor_columns("rotor_speed", rotors))
    if len(turning) > 1:
        found = f"{len(turning)} instances of esc_status hold speeds"
        faults.append(ImportFault("instances", "rotor_speed", found, "the first of them taken", 0))
    heard = np.column_stack([(online >> place[r]) & 1 for r in range(rotors)]).astype(bool)
    others = [i for i in slots if i not in place.values() and np.any(data[f"esc[{i}].esc_rpm"])]
    faults += _more_rotors("esc_status", rotors + len(others), rotors)
    if not np.nan_to_num(values).any():
        found = "every speed in esc_status is 0"
        return None, np.zeros(0), [ImportFault("speed_missing", "rotor_speed", found, "no rotor speeds", len(values))]
    found = f"a speed controller is offline in {(~heard).any(axis=1).sum()} messages"
    faults += fault_where(~heard, "speed_missing", "rotor_speed", found, "made empty cells")
    return np.where(heard, values, np.nan), _time(data, sampled=False), faults


# The rest -----------------------------------------------------------------------------------------


def _inertial(topics: _Topics) -> dict[str, tuple[tuple[str, ...], np.ndarray, np.ndarray]]:
    """Accelerometer and gyroscope: topic to (columns, time in µs, values), each from the topic with most samples."""
    combined = _first(topics, "sensor_combined")
    found = {}
    for columns, field, other in (
        (c.SPECIFIC_FORCE, "accelerometer_m_s2", "vehicle_acceleration"),
        (c.ANGULAR_VELOCITY, "gyro_rad", "vehicle_angular_velocity"),
    ):
        offered = {"sensor_combined": _stack(combined, _indexed(field, 3))}
        offered[other] = _stack(_first(topics, other), _indexed("xyz", 3))
        offered = {name: values for name, values in offered.items() if values is not None}
        if not offered:
            continue
        name = max(offered, key=lambda name: len(offered[name]))
        time, values = _time(_first(topics, name)), offered[name]
        if name == "sensor_combined" and columns == c.SPECIFIC_FORCE:
            late = np.asarray(combined.get("accelerometer_timestamp_relative", np.zeros(len(time)))).astype(np.int64)
            near = np.abs(late) < 1_000_000
            time, values = time + np.where(near, late, 0), np.where(near[:, None], values, np.nan)
        found[name, columns] = (columns, time, values)
    return found


def _local_position(data: Mapping[str, np.ndarray]) -> tuple[dict[tuple[str, ...], np.ndarray], list[ImportFault]]:
    """Position, velocity and height of `vehicle_local_position`, NaN where PX4 calls them invalid."""
    count = len(data["timestamp"])
    values: dict[tuple[str, ...], np.ndarray] = {}
    faults = []
    for names, fields, flags in (
        (c.POSITION, ("x", "y", "z"), ("xy_valid", "xy_valid", "z_valid")),
        (c.VELOCITY, ("vx", "vy", "vz"), ("v_xy_valid", "v_xy_valid", "v_z_valid")),
        ((c.HEIGHT,), ("dist_bottom",), ("dist_bottom_valid",)),
    ):
        raw = _stack(data, fields)
        if raw is None:
            continue
        known = np.column_stack([np.asarray(data.get(f, np.ones(count))).astype(bool) for f in flags])
        if names == (c.HEIGHT,) and "dist_bottom_sensor_bitfield" in data:
            # Without a range finder or optical flow PX4 states a height over a ground that it only assumes.
            known &= np.asarray(data["dist_bottom_sensor_bitfield"]).astype(bool)[:, None]
        bad = ", ".join(n for n, column in zip(names, known.T, strict=True) if not column.all())
        found = f"PX4 calls it invalid in {(~known).any(axis=1).mean():.0%} of the messages"
        faults += fault_where(~known, "invalid", bad, found, "made empty cells")
        values[names] = np.where(known, raw, np.nan)
    return values, faults


def _batteries(topics: _Topics) -> tuple[list[tuple[tuple[str, ...], np.ndarray, np.ndarray]], list[ImportFault]]:
    """Voltage and current of every battery; those after the first under names of their own."""
    out, faults, number = [], [], 0
    for data in topics.get("battery_status", []):
        if "voltage_v" not in data or ("connected" in data and not np.any(data["connected"])):
            continue
        number += 1
        voltage = np.asarray(data["voltage_v"], float)
        voltage = np.where(voltage > 0, voltage, np.nan)
        current = np.asarray(data.get("current_a", np.full(len(voltage), -1.0)), float)
        unknown = current < 0
        names = (c.BATTERY_VOLTAGE, c.BATTERY_CURRENT)
        if number > 1:
            names = (f"battery_{number}_voltage_v", f"battery_{number}_current_a")
            found = f"battery {number} is logged, too, at {np.nanmedian(voltage):.4g} V"
            faults.append(ImportFault("instances", names[0], found, "kept under a name of its own", len(voltage)))
        time = _time(data)
        out.append(((names[0],), time, voltage[:, None]))
        if unknown.all():
            faults.append(ImportFault("not_measured", names[1], "-1 A throughout: not measured", "column left out", 0))
        else:
            out.append(((names[1],), time, np.where(unknown, np.nan, current)[:, None]))
    return out, faults


def _resets(topics: _Topics) -> np.ndarray:
    """Times, µs, at which the estimator of PX4 jumped in position, velocity, heading or attitude."""
    jumps = [np.zeros(0, np.int64)]
    for topic, counter, fields, small in RESETS:
        data = _first(topics, topic)
        if counter in data:
            jumped = np.diff(np.asarray(data[counter]).astype(int)) != 0
            by = _stack(data, fields)
            if by is not None:
                jumped &= ~(np.linalg.norm(by[1:], axis=1) < small)
            jumps.append(_time(data)[1:][jumped])
    return np.unique(np.concatenate(jumps))


def _flying(log: Px4Log, grid: np.ndarray) -> np.ndarray | None:
    """Rows in which the vehicle is in the air by PX4's land detector, and armed; None where the log says neither."""
    land, status = _first(log.topics, "vehicle_land_detected"), _first(log.topics, "vehicle_status")
    if "landed" not in land and "arming_state" not in status:
        return None
    up = np.ones(len(grid), bool)
    if "landed" in land:
        time = _time(land)
        for name in ("landed", "maybe_landed", "ground_contact"):
            if name in land:
                up &= _held(grid, time, land[name], 1.0) < 0.5
    if "arming_state" in status:
        up &= _held(grid, _time(status), status["arming_state"], 0.0) == _ARMED
    return without_pauses(up, (grid - grid[0]) * 1e-6)


def _clock(topics: _Topics) -> np.ndarray:
    """Times, µs, of the inertial topic with most samples, or of the attitude; empty where there is none."""
    attitude = _first(topics, "vehicle_attitude")
    clocks = [time for _, time, _ in _inertial(topics).values()] + ([_time(attitude)] if attitude else [])
    return max(clocks, key=len, default=np.zeros(0, np.int64))


def convert(log: Px4Log, rotors: int) -> tuple[pd.DataFrame, list[ImportFault], np.ndarray, np.ndarray]:
    """Contract columns of a whole log, its faults, the rows (n,) in which it flies, and those (n,) in which the
    estimator is reset, so that no run may hold them; InputError where there is no clock."""
    inertial = _inertial(log.topics)
    attitude = _first(log.topics, "vehicle_attitude")
    base = _clock(log.topics)
    if not len(base):
        raise InputError(
            "no topic vehicle_angular_velocity, sensor_combined or vehicle_attitude to take the clock from"
        )
    frame, faults = drop_repeated_times(pd.DataFrame({c.TIME: (base - base[0]) * 1e-6}))
    grid = (frame[c.TIME].to_numpy() * 1e6).round().astype(np.int64) + base[0]
    columns: dict[str, np.ndarray] = {c.TIME: (grid - grid[0]) * 1e-6}

    def put(names: Sequence[str], time: np.ndarray, values: np.ndarray) -> None:
        columns.update(zip(names, on_grid(grid, time, values).T, strict=True))

    for names, time, values in inertial.values():
        put(names, time, values)
    quaternion = _stack(attitude, _indexed("q", 4)) if attitude else None
    if quaternion is not None:
        put(c.QUATERNION, _time(attitude), continuous(quaternion))
    place = _first(log.topics, "vehicle_local_position")
    if place:
        values, found = _local_position(place)
        faults += found
        for names, block in values.items():
            put(names, _time(place), block)
    batteries, found = _batteries(log.topics)
    faults += found
    for names, time, values in batteries:
        put(names, time, values)
    for kind, reader in (("throttle", _throttles), ("rotor_speed", _speeds)):
        values, time, found = reader(log, rotors)
        faults += found
        if values is not None:
            put(c.rotor_columns(kind, rotors), time, values)
    table = pd.DataFrame({k: v for k, v in columns.items() if k == c.TIME or np.isfinite(v).any()})
    flying, ground = airborne(table, _flying(log, grid))
    faults += ground
    jumps = np.zeros(len(grid), bool)
    for reset in _resets(log.topics):
        jumps |= np.abs(grid - reset) * 1e-6 <= _AROUND_RESET_S
    if jumps.any():
        times = int(np.count_nonzero(np.diff(jumps.astype(int), prepend=0) > 0))
        found = f"PX4's estimator jumped {times} times in position, velocity or attitude"
        faults.append(ImportFault("estimator_reset", "", found, "a run ends at each jump in the air", times))
    faults += log.parameters.faults(_CHANGED, float(grid[0]), 1e-6)
    if log.rest:
        found = f"the file ends inside a message, after {log.rest} bytes of it"
        faults.append(ImportFault("cut_off", "", found, "what came before is kept; the log stopped before its end", 0))
    if log.damaged:
        faults.append(ImportFault("damaged", "", "the file is damaged", "what could be read is kept", 0))
    if log.lost_s:
        found = f"the logger lost {len(log.lost_s)} stretches, {sum(log.lost_s):.3g} s in all"
        faults.append(ImportFault("dropout", c.TIME, found, "left as gaps", len(log.lost_s)))
    return table, faults + report_gaps(table), flying & ~jumps, jumps
