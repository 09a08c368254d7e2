"""PX4 flight logs (ULog) through pyulog, and what PX4's topics mean, for bags of `px4_msgs` as well.

PX4's frames are the contract's: body forward-right-down, world north-east-down, quaternion scalar first.
Each topic has its own clock; a run is laid out on the times of the fastest inertial topic and each other
value stands in the row nearest in time, so nothing is interpolated.

What PX4 marks as invalid is a missing sample: positions and velocities by `xy_valid`, `z_valid`, `v_xy_valid`,
`v_z_valid`, the height by `dist_bottom_valid`, a speed controller by `esc_online_flags`, a battery by `connected`,
a current of -1. A control that is NaN stops its motor. Position, velocity and attitude are the flight controller's
estimates; where it resets one of them, a run ends. Parameters may change within a log; each throttle is read by those
that held then.

Sources: PX4 `msg/`, `src/modules/control_allocator/module.yaml`, `src/lib/mixer_module`, `src/drivers/dshot`,
`src/drivers/pwm_out/module.yaml`, `src/drivers/uavcan/module.yaml`; the ULog file format.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
from pyulog import ULog

from rotorid.errors import InputError
from rotorid.io.text.files import check_file
from rotorid.io.text.wording import printable
from rotorid.recordings import columns as c
from rotorid.recordings.importers.contract import Imported, Importer
from rotorid.recordings.importers.faults import (
    GOES_ON,
    ImportFault,
    airborne,
    alive_s,
    cut_off,
    drop_repeated_times,
    fault_where,
    flights,
    further_motors,
    goes_on,
    held_on,
    jumps_at,
    one_sense,
    report_gaps,
    stops,
    table_on,
    within,
    without_pauses,
)
from rotorid.recordings.importers.known import Known, Parameters, Values
from rotorid.recordings.importers.mapping import PULSE_US, RPM, continuous
from rotorid.recordings.vehicle import Rotor

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
    (
        r"THR_MDL_FAC|CA_R_REV|DSHOT_CONFIG|(PWM_(MAIN|AUX|EXTRA)|PCA9685|UAVCAN_EC|SIM_GZ_EC|HIL_ACT)_\w+",
        "throttle",
        "each value is read by what held then",
    ),
    (r"CA_ROTOR\w+|CA_AIRFRAME|MAV_TYPE", "vehicle.yaml", "the value that held for most of the flight is taken"),
    (r"MPC_THR_HOVER|EKF2_BCOEF_[XY]|EKF2_MCOEF", "", "no column depends on it"),
)
"""Parameters on which a value depends, or that `rotorid parameters` states: names, column, what a change means."""
_ENDS = {
    **dict.fromkeys(("PWM_MAIN", "PWM_AUX", "PWM_EXTRA", "PCA9685"), PULSE_US),
    "UAVCAN_EC": (1.0, 8191.0),
    "SIM_GZ_EC": (0.0, 1000.0),
    "HIL_ACT": (0.0, 1.0),
}
"""To the drivers of outputs, as their parameters are called, no and full throttle where no parameter states them."""
JUMPED = "PX4's estimator jumped in position, velocity or attitude"
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

_Fields = Mapping[str, np.ndarray]
"""Fields of one instance of a topic, (n,) each, named as pyulog does: `q[0]`, `esc[1].esc_rpm`."""
_Topics = Mapping[str, Sequence[_Fields]]
_Parts = tuple[dict[tuple[str, ...], tuple[np.ndarray, np.ndarray]], list[ImportFault]]
"""To columns of the contract times, µs, and values (n, k), and what was found."""
_UNKNOWN = Parameters({})


@dataclass(frozen=True)
class Px4Log:
    """What is read of a log: instances of each topic in order, parameters, seconds lost, damage, bytes of a message in
    which the file ends."""

    topics: _Topics
    parameters: Parameters = _UNKNOWN
    lost_s: tuple[float, ...] = ()
    damaged: bool = False
    rest: int = 0
    stray: int = 0
    """Bytes in front of the header, which are no part of the log."""


class _Subscriptions(dict):
    """pyulog's subscriptions by their number: one that is taken by another keeps what it has received."""

    def __setitem__(self, number: int, subscription) -> None:
        if number in self:
            super().__setitem__(-1 - len(self), self[number])
        super().__setitem__(number, subscription)


_MAGIC = b"ULog\x01\x12\x35"
"""First bytes of a ULog file."""


class _Reader(ULog):
    """pyulog's reader, which forgets what came before a topic is subscribed once more under the same number."""

    def _load_file(self, *arguments, **named) -> None:
        self._subscriptions = _Subscriptions()
        super()._load_file(*arguments, **named)


def _read_behind(data: bytes) -> _Reader:
    """A log that stands behind stray bytes: pyulog does not end on some damaged data that is no file of its own."""
    with TemporaryDirectory() as folder:
        alone = Path(folder) / "log.ulg"
        alone.write_bytes(data)
        return _Reader(str(alone))


def open_log(path: Path) -> Px4Log:
    """Read a ULog file; InputError where it is none."""
    most_stray = 4096  # Bytes among which the header is looked for, as by whoever recognises the file.
    check_file(path)
    data = path.read_bytes()
    stray = max(data.find(_MAGIC, 0, most_stray), 0)
    try:
        log = _Reader(str(path)) if not stray else _read_behind(data[stray:])
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
        0 if log.file_corruption else _cut_message(data[stray:]),
        stray,
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
    return log.parameters.mostly(times, _flying(log, times))


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
    return stated or driven_motors(_first(log.topics, "actuator_motors")[0]) or 4


def driven_motors(data: _Fields) -> int:
    """Number of motors to which `actuator_motors` or `esc_status` gives a value; the other controls are NaN
    throughout."""
    given = [i for i, name in enumerate(_indexed("control", _MOST_MOTORS), 1) if np.isfinite(data.get(name, [])).any()]
    given += [motor + 1 for motor in _slots_of_motors(data)]
    return max(given, default=int(np.max(data.get("esc_count", [0]), initial=0)))


# Clocks -------------------------------------------------------------------------------------------


def _time(data: Mapping[str, np.ndarray], sampled: bool = True) -> np.ndarray:
    """Times of a topic, µs: of the sampling where the topic states them, else of the publication."""
    stamp = np.asarray(data["timestamp"]).astype(np.int64)
    taken = np.asarray(data.get("timestamp_sample", np.zeros(len(stamp)))).astype(np.int64)
    near = (taken > 0) & (np.abs(stamp - taken) < 1_000_000)
    return np.where(near, taken, stamp) if sampled else stamp


def _indexed(name: str, count: int) -> list[str]:
    return [f"{name}[{i}]" for i in range(count)]


def _stack(data: Mapping[str, np.ndarray], fields: Sequence[str]) -> np.ndarray | None:
    """Fields as columns (n, k), None where one is missing."""
    return np.column_stack([data[f] for f in fields]).astype(float) if set(fields) <= set(data) else None


def _first(topics: _Topics, name: str) -> tuple[_Fields, list[ImportFault]]:
    """The first instance of a topic that goes on changing as long as any other, and a fault where that is not the first
    of all; empty where there is none."""
    instances = topics.get(name, [])
    if len(instances) < 2:
        return (instances[0] if instances else {}), []
    numbers = [np.column_stack([v for f, v in d.items() if not f.startswith("timestamp")]) for d in instances]
    alive = {k: alive_s(d["timestamp"] * 1e-6, own) for k, (d, own) in enumerate(zip(instances, numbers, strict=True))}
    if not any(alive.values()):
        alive = {k: float(len(values)) for k, values in enumerate(numbers)}
    taken, faults = goes_on(alive, name)
    return instances[taken], faults


# Rotors -------------------------------------------------------------------------------------------


def _throttles(log: Px4Log, rotors: int) -> _Parts:
    """Throttles from either generation of actuator topics."""
    motors, faults = _first(log.topics, "actuator_motors")
    if f"control[{rotors - 1}]" in motors:
        parts, more = of_motors(motors, rotors, log.parameters)
        return parts, faults + more
    instances = log.topics.get("actuator_outputs", [])
    if not instances:
        return _no_throttle("no_command", "", "neither actuator_motors nor actuator_outputs is logged")
    return _from_outputs(log, instances, rotors)


def of_motors(data: _Fields, rotors: int, parameters: Parameters = _UNKNOWN) -> _Parts:
    """Throttles of `actuator_motors`.

    NaN stops a motor, and all of them where PX4 is disarmed; one that never has a value is none.
    """
    names, times = c.rotor_columns("throttle", rotors), _time(data, sampled=False)
    values = _stack(data, _indexed("control", rotors))
    faults = _more_rotors("actuator_motors", driven_motors(data), rotors)
    values, stopped = stops(values, names, "NaN")
    values, reversed_ = one_sense(values, names, 1.0)
    for inside, stated in parameters.spans(_CHANGED[0][0], times):
        curve = float(stated.get("THR_MDL_FAC", 0.0))
        if 0 < curve <= 1:  # PX4 turns the thrust asked for into the signal by this curve
            half = (1 - curve) / (2 * curve)
            values[inside] = np.sqrt(half**2 + values[inside] / curve) - half
            seen = f"THR_MDL_FAC is {curve:g}: actuator_motors holds thrusts"
            faults += fault_where(inside, "unit", ", ".join(names), seen, "turned into signals by PX4's own curve")
    return {names: (times, values)}, faults + stopped + reversed_


def _no_throttle(kind: str, names: str, found: str, samples: int = 0, before: Sequence[ImportFault] = ()) -> _Parts:
    return {}, [*before, ImportFault(kind, names, found, "no throttle columns", samples)]


def _more_rotors(topic: str, driven: int, rotors: int) -> list[ImportFault]:
    """A fault where a topic has motors beyond the vehicle's."""
    if driven <= rotors:
        return []
    found = f"{topic} drives {driven} motors, the log's parameters state {rotors}"
    return [ImportFault("order", "", found, "the others are left out; check CA_ROTOR_COUNT and MAV_TYPE")]


def _from_outputs(log: Px4Log, instances: Sequence[_Fields], rotors: int) -> _Parts:
    """Throttles of `actuator_outputs` by the parameters that state what drives the motors, and in what unit."""
    # Share of the range by which outputs that turn may lie outside of it; farther, they are in another unit.
    plausible = 0.5
    flown, columns = in_flight(log), c.rotor_columns("throttle", rotors)
    names = ", ".join(columns)
    port, outputs = _outputs_of_motors(flown, rotors)
    if outputs is None:
        found = f"no output of PWM_MAIN_FUNC*, PWM_AUX_FUNC* or their like is motor {port}, and actuator_motors is not"
        return _no_throttle("no_command", "", f"{found} logged")
    faults = []
    stacks = [_stack(data, [f"output[{k}]" for k in outputs]) for data in instances]
    usable = [i for i, s in enumerate(stacks) if s is not None]
    if not usable:
        return _no_throttle("no_command", "", f"actuator_outputs holds fewer than {rotors} outputs")
    chosen = max(usable, key=lambda i: float(np.nanstd(stacks[i], axis=0).min()))
    if len(instances) > 1:
        found = f"{len(instances)} instances of actuator_outputs"
        faults.append(ImportFault("instances", names, found, f"instance {chosen}, whose outputs move, taken"))
    stated = [int(v) for k, v in flown.items() if re.fullmatch(rf"{port}_FUNC\d+", k)]
    for motor in (m for m in range(rotors) if stated.count(_FIRST_MOTOR + m) > 1):
        found = f"{stated.count(_FIRST_MOTOR + motor)} outputs of {port} are motor {motor + 1}"
        action = f"output {outputs[motor] + 1} taken"
        faults.append(ImportFault("instances", f"throttle_{motor + 1}", found, action))
    if not any("_FUNC" in name for name in flown):  # no output states what it is
        every = _stack(instances[chosen], [f for f in _indexed("output", 16) if f in instances[chosen]])
        faults += _more_rotors("actuator_outputs", rotors + len(further_motors(every, rotors)), rotors)
    times, given = _time(instances[chosen], sampled=False), stacks[chosen]
    throttle = np.full(given.shape, np.nan)
    for inside, values in log.parameters.spans(_CHANGED[0][0], times):
        low, high, by = _ends_of(values, port, outputs)
        share = (given[inside] - low) / (high - low)
        turning = given[inside] > 0
        if (np.abs(share[turning] - 0.5) > 0.5 + plausible).any():
            own = given[inside][turning]
            found = f"outputs from {own.min():g} to {own.max():g} are not {by or 'pulse widths in µs'}"
            return _no_throttle("unit", names, found, len(given), faults)
        throttle[inside] = share
        ends = f"{low[0]:g} and {high[0]:g}"
        if not by:
            found = "no parameter states the pulse widths of no and full throttle"
            faults += fault_where(inside, "unit", names, found, f"taken as {ends} µs")
        elif not by.startswith("pulses"):
            faults += fault_where(inside, "unit", names, f"the outputs are {by}", f"no and full throttle are {ends}")
    both = [i for i in range(rotors) if int(flown.get("CA_R_REV", 0)) >> i & 1]  # 0 in the middle of their range
    throttle[:, both], backwards = one_sense(2 * throttle[:, both] - 1, [columns[i] for i in both], 1.0)
    throttle, outside = within(throttle, columns)
    return {columns: (times, throttle)}, faults + backwards + outside


def _outputs_of_motors(parameters: Values, rotors: int) -> tuple[str | int, list[int] | None]:
    """The driver (of `_ENDS`) and the indices of its outputs that drive motors 1 to `rotors`; where no function is
    stated the first ones, of the bus where UAVCAN_ENABLE says so; the number of a motor that has no output where one is
    missing."""
    uavcan_with_motors = 3  # UAVCAN_ENABLE from which the bus drives motors.
    by_port, stated = {}, False
    for port in _ENDS:
        named = rf"{port}_FUNC(\d+)"
        stating = sorted((int(m[1]), int(v)) for k, v in parameters.items() if (m := re.fullmatch(named, k)))
        functions = {motor: number for number, motor in reversed(stating)}  # the first output of each
        by_port[port] = [functions.get(_FIRST_MOTOR + i) for i in range(rotors)]
        stated |= bool(functions)
    if not stated:
        on_bus = parameters.get("UAVCAN_ENABLE", 0) >= uavcan_with_motors
        return "UAVCAN_EC" if on_bus else "PWM_MAIN", list(range(rotors))
    port, motors = min(by_port.items(), key=lambda item: item[1].count(None))
    return (motors.index(None) + 1, None) if None in motors else (port, [k - 1 for k in motors])


def _ends_of(parameters: Values, port: str, outputs: Sequence[int]) -> tuple[np.ndarray, np.ndarray, str]:
    """Outputs of no and full throttle by motor, and in words what a parameter says that they are, empty where none
    does."""
    dshot = (1.0, 1999.0)  # No and full throttle of DShot (0 is disarmed), which PX4 logs less its 48 commands.
    dshot_timers = (-5, -4, -3, -2)  # Values of PWM_*_TIMn that are DShot of some speed; larger ones are pulses.
    timers = [int(v) for k, v in parameters.items() if re.fullmatch(rf"{port}_TIM\d+", k)]
    timer = next((t for t in timers if t in dshot_timers), None) if set(timers) <= set(dshot_timers) else None
    if port.startswith("PWM") and (parameters.get("DSHOT_CONFIG", 0) > 0 or timer is not None):
        name = f"{port}_TIMn {timer}" if timer is not None else f"DSHOT_CONFIG {parameters['DSHOT_CONFIG']:g}"
        low, high = (np.full(len(outputs), end) for end in dshot)
        return low, high, f"DShot by {name}"
    ends, stated = [], True
    for word, default in zip(("MIN", "MAX"), _ENDS[port], strict=True):
        common = next((parameters[k] for k in (f"{port}_{word}", f"PWM_{word}") if parameters.get(k, 0) > 0), None)
        own = [parameters.get(f"{port}_{word}{k + 1}", -1) for k in outputs]
        stated &= common is not None or all(v > 0 for v in own)
        ends.append(np.array([v if v > 0 else (common or default) for v in own], float))
    low, high = ends
    if not port.startswith(("PWM", "PCA9685")):
        return low, high, f"those of {port}_MINn and {port}_MAXn" if stated else f"those of {port}"
    reverse = [bool(int(parameters.get(f"{port}_REV", 0)) >> k & 1) for k in outputs]
    return np.where(reverse, high, low), np.where(reverse, low, high), f"pulses by {port}_*" if stated else ""


def _speeds(log: Px4Log, rotors: int) -> _Parts:
    """Rotor speeds, rad/s, of `esc_status`."""
    instances = log.topics.get("esc_status", [])
    turning = [d for d in instances if any(np.any(v) for field, v in d.items() if field.endswith(".esc_rpm"))]
    if not instances:
        return {}, []
    data, stuck = _first({"esc_status": turning or instances}, "esc_status")
    parts, faults = of_controllers(data, rotors)
    if parts and len(turning) > 1 and not stuck:
        found = f"{len(turning)} instances of esc_status hold speeds"
        faults.append(ImportFault("instances", "rotor_speed", found, "the first of them taken"))
    return parts, faults + stuck


def of_controllers(data: _Fields, rotors: int) -> _Parts:
    """Rotor speeds, rad/s, of `esc_status`, each by the motor that its controller drives; NaN where a controller is not
    heard."""
    slots = _controllers(data)
    by_function = _slots_of_motors(data)
    place = {r: by_function.get(r, r) if by_function else r for r in range(rotors)}
    if not set(place.values()) <= set(slots):
        found = f"esc_status holds {len(slots)} controllers for {rotors} rotors"
        return {}, [ImportFault("speed_missing", "rotor_speed", found, "no rotor speeds")]
    names = c.rotor_columns("rotor_speed", rotors)
    online = np.asarray(data.get("esc_online_flags", np.full(len(data["timestamp"]), -1))).astype(np.int64)
    values = np.column_stack([np.asarray(data[f"esc[{place[r]}].esc_rpm"], float) for r in range(rotors)]) * RPM
    values, faults = one_sense(values, names)
    heard = np.column_stack([(online >> place[r]) & 1 for r in range(rotors)]).astype(bool)
    others = [i for i in slots if i not in place.values() and np.any(data[f"esc[{i}].esc_rpm"])]
    faults += _more_rotors("esc_status", rotors + len(others), rotors)
    if not np.nan_to_num(values).any():
        found = "every speed in esc_status is 0"
        return {}, [ImportFault("speed_missing", "rotor_speed", found, "no rotor speeds", len(values))]
    found = f"a speed controller is offline in {(~heard).any(axis=1).sum()} messages"
    faults += fault_where(~heard, "speed_missing", "rotor_speed", found, "made empty cells")
    return {names: (_time(data, sampled=False), np.where(heard, values, np.nan))}, faults


def _controllers(data: _Fields) -> list[int]:
    return [i for i in range(8) if f"esc[{i}].esc_rpm" in data]


def _slots_of_motors(data: _Fields) -> dict[int, int]:
    """To a motor (from 0) the place of its controller in `esc_status`, where the message states what each drives."""
    function = {i: int(np.median(data.get(f"esc[{i}].actuator_function", [0]))) for i in _controllers(data)}
    return {f - _FIRST_MOTOR: i for i, f in function.items() if f >= _FIRST_MOTOR}


# The rest -----------------------------------------------------------------------------------------


def _combined(data: _Fields) -> _Parts:
    time, relative = _time(data), np.asarray(data.get("accelerometer_timestamp_relative", 0)).astype(np.int64)
    near = np.broadcast_to(np.abs(relative) < 1_000_000, time.shape)
    found = {}
    if (rates := _stack(data, _indexed("gyro_rad", 3))) is not None:
        found[c.ANGULAR_VELOCITY] = time, rates
    if (force := _stack(data, _indexed("accelerometer_m_s2", 3))) is not None:
        found[c.SPECIFIC_FORCE] = time + np.where(near, relative, 0), np.where(near[:, None], force, np.nan)
    return found, []


def _columns(names: tuple[str, ...], fields: Sequence[str]) -> Callable[[_Fields], _Parts]:
    """A topic that holds one quantity."""

    def read(data: _Fields) -> _Parts:
        values = _stack(data, fields)
        return ({} if values is None else {names: (_time(data), values)}), []

    return read


def _local_position(data: _Fields) -> _Parts:
    """Position, velocity and height, NaN where PX4 calls them invalid."""
    count, values, faults = len(data["timestamp"]), {}, []
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
        values[names] = _time(data), np.where(known, raw, np.nan)
    return values, faults


def _odometry(data: _Fields) -> _Parts:
    """The estimate that PX4 sends to companions, as far as it is in its world axes."""
    values = {}
    for names, fields, frame, world in (
        (c.POSITION, _indexed("position", 3), "pose_frame", 1),
        (c.VELOCITY, _indexed("velocity", 3), "velocity_frame", 1),
        (c.QUATERNION, _indexed("q", 4), "pose_frame", 1),
    ):
        raw, frames = _stack(data, fields), data.get(frame)
        if raw is not None and frames is not None and (np.asarray(frames) == world).all():
            values[names] = _time(data), raw
    return values, []


def _battery(data: _Fields) -> _Parts:
    """Voltage and current of a battery, NaN where they are not measured; nothing of one that is not connected."""
    if "voltage_v" not in data or ("connected" in data and not np.any(data["connected"])):
        return {}, []
    time, voltage = _time(data), np.asarray(data["voltage_v"], float)
    current = np.asarray(data.get("current_a", np.full(len(voltage), -1.0)), float)
    values = {(c.BATTERY_VOLTAGE,): (time, np.where(voltage > 0, voltage, np.nan)[:, None])}
    if (current < 0).all():
        found = "-1 A throughout: not measured"
        return values, [ImportFault("not_measured", c.BATTERY_CURRENT, found, "column left out")]
    return values | {(c.BATTERY_CURRENT,): (time, np.where(current < 0, np.nan, current)[:, None])}, []


TOPICS: Mapping[str, Callable[[_Fields], _Parts]] = {
    "sensor_combined": _combined,
    "vehicle_angular_velocity": _columns(c.ANGULAR_VELOCITY, _indexed("xyz", 3)),
    "vehicle_acceleration": _columns(c.SPECIFIC_FORCE, _indexed("xyz", 3)),
    "vehicle_attitude": _columns(c.QUATERNION, _indexed("q", 4)),
    "vehicle_local_position": _local_position,
    "vehicle_odometry": _odometry,
    "battery_status": _battery,
}
"""What a topic states of the vehicle.

Motors, controllers, flight and resets: `of_motors`, `of_controllers`, `in_the_air`, `resets_of`."""


def _inertial(topics: _Topics) -> _Parts:
    """Accelerometer and gyroscope, each of the fastest topic that goes on."""
    found, faults = {}, []
    for columns, other in (
        (c.SPECIFIC_FORCE, "vehicle_acceleration"), (c.ANGULAR_VELOCITY, "vehicle_angular_velocity")
    ):  # fmt: skip
        offered = []
        for name in ("sensor_combined", other):
            data, more = _first(topics, name)
            part = TOPICS[name](data)[0].get(columns) if data else None
            offered += [] if part is None else [(part, more)]
        if offered:
            alive = [alive_s(time * 1e-6, values) for (time, values), _ in offered]
            lasting = [o for o, own in zip(offered, alive, strict=True) if own >= GOES_ON * max(alive)]
            found[columns], more = max(lasting, key=lambda offer: len(offer[0][0]))
            faults += [fault for fault in more if fault not in faults]
    return found, faults


def _batteries(topics: _Topics) -> _Parts:
    """Voltage and current of every battery; those after the first under names of their own."""
    out, faults, number = {}, [], 0
    for data in topics.get("battery_status", []):
        parts, more = TOPICS["battery_status"](data)
        number += bool(parts)
        faults += more if number == 1 else []
        for (name,), (time, values) in parts.items():
            if number > 1:
                name = f"battery_{number}_{name.removeprefix('battery_')}"
                if name.endswith("_v"):
                    found = f"battery {number} is logged, too, at {np.nanmedian(values):.4g} V"
                    faults.append(ImportFault("instances", name, found, "kept under a name of its own", len(values)))
            out[name,] = time, values
    return out, faults


def resets_of(name: str, data: _Fields) -> np.ndarray:
    """Messages (n,) of a topic at which the estimator of PX4 has jumped in position, velocity, heading or attitude."""
    jumped = np.zeros(len(data["timestamp"]), bool)
    for topic, counter, fields, small in RESETS:
        if topic == name and counter in data:
            own = np.diff(np.asarray(data[counter]).astype(int)) != 0
            by = _stack(data, fields)
            jumped[1:] |= own if by is None else own & ~(np.linalg.norm(by[1:], axis=1) < small)
    return jumped


def _resets(topics: _Topics) -> np.ndarray:
    """Times, µs, of the resets."""
    jumps = [np.zeros(0, np.int64)]
    for name in dict.fromkeys(topic for topic, *_ in RESETS):
        data = _first(topics, name)[0]
        if data:
            jumps.append(_time(data)[resets_of(name, data)])
    return np.unique(np.concatenate(jumps))


def in_the_air(name: str, data: _Fields) -> np.ndarray | None:
    """Messages (n,) of the land detector or of the status by which the vehicle may fly; None where they say nothing."""
    armed = 2
    if name == "vehicle_land_detected" and "landed" in data:
        flags = [data[f] for f in ("landed", "maybe_landed", "ground_contact") if f in data]
        return ~np.any(np.asarray(flags).astype(bool), axis=0)
    if name == "vehicle_status" and "arming_state" in data:
        return np.asarray(data["arming_state"]) == armed
    return None


def _flying(log: Px4Log, grid: np.ndarray) -> np.ndarray | None:
    """Rows in which the vehicle is in the air by PX4's land detector, and armed; None where the log says neither."""
    said = []
    for name in ("vehicle_land_detected", "vehicle_status"):
        data = _first(log.topics, name)[0]
        if data and (up := in_the_air(name, data)) is not None:
            said.append((_time(data), up))
    return flying_by(said, grid, 1e-6)


def flying_by(said: Sequence[tuple[np.ndarray, np.ndarray]], grid: np.ndarray, unit_s: float) -> np.ndarray | None:
    """Rows of a grid (n,) in which all of several say (times, and whether it may fly) that the vehicle flies."""
    if not said:
        return None
    up = np.all([held_on(grid, time, values) > 0.5 for time, values in said], axis=0)
    return without_pauses(up, (grid - grid[0]) * unit_s)


def _clock(topics: _Topics) -> np.ndarray:
    """Times, µs, of the inertial topic with most samples, or of the attitude; empty where there is none."""
    attitude = _first(topics, "vehicle_attitude")[0]
    clocks = [time for time, _ in _inertial(topics)[0].values()] + ([_time(attitude)] if attitude else [])
    return max(clocks, key=len, default=np.zeros(0, np.int64))


def convert(log: Px4Log, rotors: int) -> tuple[pd.DataFrame, list[ImportFault], np.ndarray, np.ndarray]:
    """Contract columns of a whole log, its faults, the rows (n,) in which it flies, and those (n,) in which the
    estimator is reset, so that no run may hold them; InputError where there is no clock."""
    inertial, faults = _inertial(log.topics)
    base = _clock(log.topics)
    if not len(base):
        raise InputError(
            "no topic vehicle_angular_velocity, sensor_combined or vehicle_attitude to take the clock from"
        )
    frame, repeated = drop_repeated_times(pd.DataFrame({c.TIME: (base - base[0]) * 1e-6}))
    grid = (frame[c.TIME].to_numpy() * 1e6).round().astype(np.int64) + base[0]
    faults, parts = repeated + faults, inertial
    for name in ("vehicle_attitude", "vehicle_local_position"):
        data, found = _first(log.topics, name)
        values, more = TOPICS[name](data) if data else ({}, [])
        faults, parts = faults + found + more, parts | values
    if c.QUATERNION in parts:
        time, values = parts[c.QUATERNION]
        parts[c.QUATERNION] = time, continuous(values)
    for values, found in (_batteries(log.topics), _throttles(log, rotors), _speeds(log, rotors)):
        faults, parts = faults + found, parts | values
    table = table_on(grid, ((names, *part) for names, part in parts.items()), 1e-6)
    flying, ground = airborne(table, _flying(log, grid))
    faults += ground
    times = (_resets(log.topics) - grid[0]) * 1e-6
    jumps, reset = jumps_at(table[c.TIME].to_numpy(), times, JUMPED)
    faults += reset
    faults += log.parameters.faults(_CHANGED, float(grid[0]), 1e-6)
    lost = f"the logger lost {len(log.lost_s)} stretches, {sum(log.lost_s):.3g} s in all"
    met = (
        (log.stray, ImportFault("damaged", "", f"{log.stray} bytes stand in front of the header", "left out")),
        (log.rest, cut_off(f"the file ends inside a message, after {log.rest} bytes of it")),
        (log.damaged, ImportFault("damaged", "", "the file is damaged", "what could be read is kept")),
        (log.lost_s, ImportFault("dropout", c.TIME, lost, "left as gaps", len(log.lost_s))),
    )
    faults += [fault for there, fault in met if there]
    return table, faults + report_gaps(table), flying & ~jumps, jumps


# Vehicle ------------------------------------------------------------------------------------------


def px4_vehicle(parameters: Mapping[str, float], rotors: int) -> tuple[Known, list[ImportFault]]:
    """Places, turning senses and torque ratio of PX4's control allocation (`CA_ROTOR*`), where a log holds them, and
    what it states of the rotors that a vehicle.yaml cannot hold.

    Places of ±1 m are what a generic airframe has until somebody sets them: they are directions, not distances.
    A positive `CA_ROTORi_KM` is a rotor that turns counter-clockwise seen from above.
    """
    faults = _untaken(parameters, rotors)
    keys = [[f"CA_ROTOR{i}_{k}" for k in ("PX", "PY", "PZ", "KM")] for i in range(rotors)]
    if not all(k in parameters for row in keys for k in row):
        return Known("px4"), faults
    values = [[float(parameters[k]) for k in row] for row in keys]
    if not any(abs(x) + abs(y) > 0 for x, y, _, _ in values):
        return Known("px4"), faults
    rotor = tuple(
        Rotor(x_m=round(x, 6), y_m=round(y, 6), z_m=round(z, 6), spin="ccw" if k > 0 else "cw") for x, y, z, k in values
    )
    ratio = sum(abs(k) for *_, k in values) / rotors
    where = "CA_ROTOR* of the log's parameters"
    if all(abs(v) in (0.0, 1.0) for x, y, *_ in values for v in (x, y)):
        return Known("px4", None, round(ratio, 6) or None, where, directions=rotor), faults
    return Known("px4", rotor, round(ratio, 6) or None, where), faults


def _untaken(parameters: Mapping[str, float], rotors: int) -> list[ImportFault]:
    """A fault for each thing that control allocation states of the rotors and a vehicle.yaml has no place for."""
    alike = 0.01  # Relative difference of a coefficient up to which rotors are alike.
    tilted_deg = 1.0  # Angle between a rotor's axis and body z from which on it is tilted.

    def stated(name: str, default: float) -> list[float]:
        return [float(parameters.get(f"CA_ROTOR{i}_{name}", default)) for i in range(rotors)]

    def fault(kind: str, which: list[int], found: str, action: str) -> list[ImportFault]:
        if not which:
            return []
        who = f"rotor{'s' * (len(which) > 1)} {', '.join(map(str, which))}"
        return [ImportFault(kind, "vehicle.yaml", found.format(who), action)]

    axes = np.column_stack([stated("AX", 0.0), stated("AY", 0.0), stated("AZ", -1.0)])
    size = np.linalg.norm(axes, axis=1)  # PX4 makes each axis a unit vector
    lean = np.degrees(np.arccos(np.clip(-axes[:, 2] / np.where(size > 0, size, 1.0), -1, 1)))
    tilted = [i for i in range(rotors) if lean[i] > tilted_deg]
    degrees = ", ".join(f"{lean[i]:.3g}" for i in tilted)
    found = f"{{}} tilted against body z by {degrees} degrees (CA_ROTOR*_AX, _AY, _AZ)"
    faults = fault("tilted_rotor", [i + 1 for i in tilted], found, "its thrust is taken along -z")
    places = list(zip(*(stated(name, 0.0) for name in ("PX", "PY", "PZ")), strict=True))
    pairs = [f"{i + 1} and {k + 1}" for k in range(rotors) for i in range(k) if places[i] == places[k] != (0, 0, 0)]
    if pairs and 2 * len(pairs) <= rotors:
        found = f"rotors {', '.join(pairs)} are on one spot (CA_ROTOR*_PZ states no distance along z)"
        faults.append(ImportFault("coaxial", "vehicle.yaml", found, "taken so: write z_m of each by what you measure"))
    by_servo = [i + 1 for i, servo in enumerate(stated("TILT", 0.0)) if servo > 0]
    faults += fault("tilted_rotor", by_servo, "a servo tilts {} (CA_ROTOR*_TILT)", "its thrust is taken along -z")
    if parameters.get("CA_SV_CS_COUNT", 0) > 0 or parameters.get("CA_SV_TL_COUNT", 0) > 0:
        found = "the vehicle has servos (CA_SV_CS_COUNT, CA_SV_TL_COUNT)"
        faults.append(ImportFault("servo", "vehicle.yaml", found, "what they move is not taken"))
    for name, default, action in (
        ("KM", 0.05, "their mean size is taken for the ratio of torque to thrust"),
        ("CT", 6.5, "one thrust coefficient is taken for all"),
    ):
        size = np.abs(stated(name, default))
        usual = float(np.median(size))
        other = [i + 1 for i in range(rotors) if abs(size[i] - usual) > alike * usual]
        faults += fault("unequal_rotors", other, f"CA_ROTOR*_{name} of {{}} is not that of the others", action)
    return faults


def _read(path: Path) -> Imported:
    """Every flight of a ULog file."""
    log = open_log(path)
    try:
        rotors = rotor_count(log)
        table, found, flying, jumps = convert(log, rotors)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    settings = {name: value for name, value in in_flight(log).items() if isinstance(value, int | float)}
    known, faults = px4_vehicle(settings, rotors)
    runs, cuts = flights(table, flying, path.stem, path, jumps)
    axes = "PX4's: body forward-right-down, world north-east-down, as the contract's"
    return Imported(runs, (*found, *faults, *cuts), axes, known, speed_unit="rpm", settings=settings)


IMPORTER = Importer(
    "px4",
    "PX4 ULog",
    _read,
    "inertial sensors, attitude, position and velocity where valid, throttles of either generation of actuator topics "
    "with their ranges, `esc_status`, batteries, range finder; rotor positions, directions of rotation and torque "
    "ratio from `CA_ROTOR*`; the part in the air",
    starts=(_MAGIC,),
    inside=(_MAGIC,),
    template="x500",
)
