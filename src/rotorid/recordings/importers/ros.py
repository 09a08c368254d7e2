"""ROS 1 bags, ROS 2 bags and MCAP files through rosbags: no ROS is needed.

By ROS's REP 103 the body is forward-left-up and the world has z up; half a turn about x makes them forward-right-down
and z down. Of each quantity the topic of a known type that states most values is read, of several attitudes the one
that follows the body rates; a command is no measurement:

| quantity | types |
| --- | --- |
| body rates, specific force | `sensor_msgs/Imu` |
| attitude | poses (`_POSES`), then `sensor_msgs/Imu` |
| position, velocity | poses, `nav_msgs/Odometry` (twist in body axes), `TwistStamped` |
| rotor speeds, rad/s | `Actuators` of `mav_msgs` and `actuator_msgs`, `mav_msgs/MotorSpeed` |
| rotor speeds, rpm | `mavros_msgs/ESCStatus`, `mavros_msgs/ESCTelemetry` |
| commanded speeds | `mav_msgs/CommandMotorSpeed`, `Actuators` of a topic called a command next to another |
| throttles | `mavros_msgs/RCOut` (µs) |
| battery, height | `sensor_msgs/BatteryState`, `sensor_msgs/Range` |

Messages of `px4_msgs` mean what the topics of PX4's own logs mean (`px4_ulog`): with its axes, the motor that each
controller drives, what is invalid, stopped or not heard, resets and the land detector. `sensor_msgs/Imu` states nothing
of a quantity whose covariance begins with -1; neither does a quaternion of length zero, nor a topic that holds what an
unset message does throughout. What a bag holds and is not read is listed where a quantity is missing.

A topic has one clock: its messages' own stamps, unless all of them are zero or they jump; then the times of recording,
which the topic of the inertial sensor relates to its stamps. Stamps that are off from those by a constant are shifted.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pandas as pd
import scipy

from rotorid.errors import InputError
from rotorid.io.text.wording import printable
from rotorid.recordings import columns as c
from rotorid.recordings.files import is_bag
from rotorid.recordings.importers.bag_records import Records, Unpacking, needs, typestores
from rotorid.recordings.importers.contract import Imported, Importer
from rotorid.recordings.importers.faults import (
    GOES_ON,
    ImportFault,
    airborne,
    alive_s,
    cut_off,
    flights,
    further_motors,
    jumps_at,
    moving_on,
    one_sense,
    report_gaps,
    table_on,
)
from rotorid.recordings.importers.guessing import agreement as by
from rotorid.recordings.importers.guessing.agreement import CONFIRMED, is_clear
from rotorid.recordings.importers.mapping import PULSE_US, RPM, continuous, half_turn_about_x, quaternion_to_frd_ned
from rotorid.recordings.importers.px4_ulog import (
    JUMPED,
    TOPICS,
    driven_motors,
    flying_by,
    in_the_air,
    of_controllers,
    of_motors,
    resets_of,
)


def _xyz(v) -> list[float]:
    return [v.x, v.y, v.z]


def _wxyz(q) -> list[float]:
    return [q.w, q.x, q.y, q.z]


def _imu(m) -> dict[str, list[float]]:
    """Of an Imu message what it states: a covariance that begins with -1 is a quantity that it has not."""
    every = {
        "rates": (_xyz(m.angular_velocity), m.angular_velocity_covariance),
        "force": (_xyz(m.linear_acceleration), m.linear_acceleration_covariance),
        "imu_attitude": (_wxyz(m.orientation), m.orientation_covariance),
    }
    return {name: values for name, (values, covariance) in every.items() if covariance[0] != -1}


def _pose(pose) -> dict[str, list[float]]:
    return {"attitude": _wxyz(pose.orientation), "position": _xyz(pose.position)}


def _twist(m) -> dict[str, list[float]]:
    """A velocity in the axes that its frame names: those of the body, or of the world."""
    of_body = any(word in m.header.frame_id for word in ("base", "body", "fcu"))
    return {"body_velocity" if of_body else "velocity": _xyz(m.twist.linear)}


_NO_PULSE = 65535
"""In place of a pulse: the channel is not stated."""
_POSES: dict[str, Callable] = {
    "geometry_msgs/msg/PoseStamped": lambda m: _pose(m.pose),
    "geometry_msgs/msg/PoseWithCovarianceStamped": lambda m: _pose(m.pose.pose),
    "geometry_msgs/msg/TransformStamped": lambda m: {
        "attitude": _wxyz(m.transform.rotation), "position": _xyz(m.transform.translation),
    },
    "nav_msgs/msg/Odometry": lambda m: _pose(m.pose.pose) | {"body_velocity": _xyz(m.twist.twist.linear)},
}  # fmt: skip
_READERS: dict[str, Callable] = _POSES | {
    "sensor_msgs/msg/Imu": _imu,
    "geometry_msgs/msg/TwistStamped": _twist,
    "mav_msgs/msg/Actuators": lambda m: {"speeds": list(m.angular_velocities), "throttle": list(m.normalized)},
    "actuator_msgs/msg/Actuators": lambda m: {"speeds": list(m.velocity), "throttle": list(m.normalized)},
    "mav_msgs/msg/MotorSpeed": lambda m: {"speeds": list(m.motor_speed)},
    "mav_msgs/msg/CommandMotorSpeed": lambda m: {"commands": list(m.motor_speed)},
    "mavros_msgs/msg/ESCStatus": lambda m: {"rpm": [e.rpm for e in m.esc_status]},
    "mavros_msgs/msg/ESCTelemetry": lambda m: {"rpm": [e.rpm for e in m.esc_telemetry]},
    "mavros_msgs/msg/RCOut": lambda m: {"pulses": [np.nan if p == _NO_PULSE else p for p in m.channels]},
    "sensor_msgs/msg/BatteryState": lambda m: {
        "voltage": [m.voltage if m.voltage > 0 else np.nan], "current": [-m.current],
    },
    "sensor_msgs/msg/Range": lambda m: {"range": [m.range if m.min_range <= m.range <= m.max_range else np.nan]},
}  # fmt: skip
"""To the type of a message what it states by quantity; several types may hold one."""
_ROTORS_OF_PX4 = {"actuator_motors": ("throttle", of_motors, 1.0), "esc_status": ("rpm", of_controllers, 1 / RPM)}
"""To a topic of PX4 the quantity of its rotors, its reader, and what one of the reader's units is of the quantity."""
_OF_PX4 = {
    c.ANGULAR_VELOCITY: "rates", c.SPECIFIC_FORCE: "force", c.QUATERNION: "attitude", c.POSITION: "position",
    c.VELOCITY: "velocity", (c.HEIGHT,): "range", (c.BATTERY_VOLTAGE,): "voltage", (c.BATTERY_CURRENT,): "current",
}  # fmt: skip
"""Columns of PX4's other topics to the quantities here."""
_PX4_TOPICS = {*TOPICS, *_ROTORS_OF_PX4, "vehicle_land_detected", "vehicle_status"}
_SAID = ("reset", "flying")
"""What messages say by a flag (n, 1): that the estimate has jumped, and that the vehicle may fly."""
_WANTED = {
    "body rates": ("rates",), "specific force": ("force",), "attitude": ("attitude", "imu_attitude"),
    "velocity": ("velocity", "body_velocity"), "rotors": ("speeds", "rpm", "commands", "throttle", "pulses"),
}  # fmt: skip
"""What a verdict needs, to the quantities that give it."""
_UNSET = {"attitude": (1.0, 0.0, 0.0, 0.0), "imu_attitude": (1.0, 0.0, 0.0, 0.0)}
_UNSET |= dict.fromkeys(("rates", "force", "position", "velocity", "body_velocity"), (0.0, 0.0, 0.0))
"""What a message holds of a quantity that nobody has set."""
_COMMANDED = re.compile(r"command|cmd|setpoint|desired|target|reference", re.IGNORECASE)
_SAME_CLOCK_S = 1.0
"""Stamps further than this from those of the inertial sensor, or from one message to the next, are another clock."""
_LISTED = 8
_WEIGHT_M_S2 = (5.0, 20.0)
"""Median size of the readings of an accelerometer that feels what carries the vehicle."""


@dataclass(frozen=True)
class _TopicSeries:
    """One quantity of one topic: instants (n,), s, and values (n, k)."""

    topic: str
    time_s: np.ndarray
    values: np.ndarray

    @property
    def changes(self) -> int:
        """How often its values change: a topic that repeats what it has states no more for it."""
        return int((np.diff(self.values, axis=0) != 0).any(axis=1).sum())

    @property
    def alive_s(self) -> float:
        """For how long they go on changing, s."""
        return alive_s(self.time_s, self.values)


@dataclass
class _BagContent:
    """What a bag holds: (stamp, time of recording, values) of each quantity of a topic, the topics that are not read
    with their type and number of messages, and whether the file ends early. Stamps are 0 where there are none."""

    rows: dict[tuple[str, str], list[tuple[float, float, list[float]]]] = field(default_factory=dict)
    px4: dict[tuple[str, str], list[tuple[float, dict[str, float]]]] = field(default_factory=dict)
    """To a topic of `px4_msgs` and its name in PX4's logs the time of recording and the fields of each message."""
    unread: dict[str, tuple[str, int]] = field(default_factory=dict)
    foreign: dict[str, str] = field(default_factory=dict)
    cut: bool = False
    broken: int = 0
    """Messages that cannot be decoded."""
    lost_chunks: int = 0

    def add(self, topic: str, msgtype: str, recorded_ns: int, message) -> None:
        if (name := _px4_topic(msgtype)) in _PX4_TOPICS:
            self.px4.setdefault((topic, name), []).append((recorded_ns * 1e-9, dict(_fields(message))))
            return
        stamp = getattr(getattr(message, "header", None), "stamp", None)
        stamp_s = getattr(message, "timestamp", 0) * 1e-6 if stamp is None else stamp.sec + stamp.nanosec * 1e-9
        for quantity, values in _READERS[msgtype](message).items():
            self.rows.setdefault((quantity, topic), []).append((stamp_s, recorded_ns * 1e-9, values))

    def skip(self, topic: str, msgtype: str, messages: int) -> None:
        self.unread[topic] = msgtype, self.unread.get(topic, ("", 0))[1] + messages


def _px4_topic(msgtype: str) -> str:
    """PX4's name of the topic of a message of `px4_msgs`, `vehicle_attitude` of `VehicleAttitude`; empty for others."""
    return re.sub(r"(?<!^)(?=[A-Z])", "_", msgtype.removeprefix("px4_msgs/msg/")).lower() * msgtype.startswith("px4_")


def _is_read(msgtype: str) -> bool:
    return msgtype in _READERS or _px4_topic(msgtype) in _PX4_TOPICS


def _fields(message, before: str = "") -> Iterator[tuple[str, float]]:
    """The numbers of a message by their names in PX4's logs: `q[0]`, `esc[1].esc_rpm`."""
    for name in message.__dataclass_fields__:
        value = getattr(message, name)
        listed = isinstance(value, list | tuple | np.ndarray)
        for k, own in enumerate(value if listed else [value]):
            label = f"{before}{name}[{k}]" if listed else f"{before}{name}"
            if hasattr(own, "__dataclass_fields__"):
                yield from _fields(own, f"{label}.")
            elif not isinstance(own, str):
                yield label, own


def _read_px4(found: _BagContent) -> list[ImportFault]:
    """Put what messages of `px4_msgs` state among the rows of a bag, and what was found in them."""
    faults = []
    for (topic, name), messages in found.px4.items():
        names = set.intersection(*(set(fields) for _, fields in messages)) - {"__msgtype__"}
        data = {n: np.array([fields[n] for _, fields in messages]) for n in names}
        if "timestamp" not in data:
            continue
        stamp = data["timestamp"].astype(np.int64)
        stated = {"reset": (stamp, resets_of(name, data)[:, None])}
        if (up := in_the_air(name, data)) is not None:
            stated["flying"] = stamp, up[:, None]
        if name in _ROTORS_OF_PX4:
            quantity, read, times = _ROTORS_OF_PX4[name]
            parts, more = read(data, driven_motors(data))
            for at, values in parts.values():
                stated[quantity] = at, values * times
        else:
            parts, more = TOPICS[name](data) if name in TOPICS else ({}, [])
            for columns, (at, values) in parts.items():
                turned = [1, 1, -1, -1] if columns == c.QUATERNION else [1, -1, -1] if len(columns) == 3 else 1
                stated[_OF_PX4[columns]] = at, values * turned
        faults += [replace(fault, found=f"{topic}: {fault.found}") for fault in more]
        for quantity, (at, values) in stated.items():
            rows = zip(at * 1e-6, (recorded for recorded, _ in messages), values.tolist(), strict=True)
            if quantity != "reset" or values.any():
                found.rows[quantity, topic] = list(rows)
    return faults


def _by_rosbags(path: Path) -> _BagContent:
    """A bag, MCAP file or folder of one that is whole and holds ROS alone."""
    highlevel = needs("rosbags.highlevel", path)
    typesys = needs("rosbags.typesys", path)
    found = _BagContent()
    with (
        Unpacking(path).in_rosbags(),
        highlevel.AnyReader([path], default_typestore=typesys.get_typestore(typesys.Stores.LATEST)) as bag,
    ):
        known = [k for k in bag.connections if _is_read(k.msgtype)]
        for k in bag.connections:
            if (encoding := getattr(k.ext, "serialization_format", "cdr")) != "cdr":
                found.foreign[k.topic] = encoding
            elif not _is_read(k.msgtype):
                found.skip(k.topic, k.msgtype, k.msgcount)
        for connection, recorded_ns, raw in bag.messages(connections=known) if known else ():
            found.add(connection.topic, connection.msgtype, recorded_ns, bag.deserialize(raw, connection.msgtype))
    return found


def _by_records(path: Path) -> _BagContent:
    """What can be read, record by record, of a file or folder that rosbags refuses."""
    files = [path] if path.is_file() else sorted(p for p in path.iterdir() if p.suffix in (".db3", ".mcap"))
    found = _BagContent()
    for file in files:
        records = Records(file)
        listed = list(records.messages())
        stores = typestores([k for k in records.channels.values() if k.of_ros], path)
        for channel, recorded_ns, raw in listed:
            if _is_read(channel.msgtype):
                store = stores[channel.encoding]
                read = store.deserialize_ros1 if channel.encoding == "ros1" else store.deserialize_cdr
                try:
                    message = read(raw, channel.msgtype)
                except Exception:  # rosbags lets whatever broken bytes raise through
                    found.broken += 1
                    continue
                found.add(channel.topic, channel.msgtype, recorded_ns, message)
            else:
                found.skip(channel.topic, channel.msgtype, 1)
        for k in records.channels.values():
            if not k.of_ros:
                found.foreign[k.topic] = k.encoding or k.schema or "unknown"
        found.cut |= records.cut
        found.lost_chunks += records.lost_chunks
    return found


def _found(path: Path) -> _BagContent:
    """InputError where nothing of a bag can be read."""
    needs("rosbags.highlevel", path)
    try:
        return _by_rosbags(path)
    except (MemoryError, InputError):
        raise
    except Exception as error:  # rosbags lets whatever a broken file raises through
        why = printable(error)[:150]
    try:
        found = _by_records(path)
    except (MemoryError, InputError):
        raise
    except Exception:
        found = _BagContent()
    if not (found.rows or found.px4 or found.unread or found.foreign):
        raise InputError(f"{path}: not a bag or MCAP file that can be read ({why})")
    return found


def _read_series(path: Path) -> tuple[dict[str, list[_TopicSeries]], list[ImportFault]]:
    """Every known quantity of a bag by topic, those that state most first.

    InputError where it cannot be read or holds no known type.
    """
    found = _found(path)
    by_px4 = _read_px4(found)
    at = [row[1] for rows in found.rows.values() for row in (rows[0], rows[-1])]
    lasts_s = max(max(at, default=0.0) - min(at, default=0.0), 1e-9)
    others = [
        f"{topic} ({kind}, {n / lasts_s:.3g} Hz)" if at else f"{topic} ({kind})"
        for topic, (kind, n) in sorted(found.unread.items())
        if n
    ]
    foreign = [f"{topic} ({encoding})" for topic, encoding in sorted(found.foreign.items())]
    if not found.rows:
        listed = ", ".join([*others, *foreign][:_LISTED]) or "none"
        raise InputError(f"{path}: no topic of a type that is known; found {listed}")
    gap = "left out; their time is a gap"
    lost, strange = f"{found.lost_chunks} chunks of messages", ", ".join(foreign[:_LISTED])
    broken = f"{found.broken} messages cannot be decoded"
    met = (
        (found.cut, cut_off("the file ends early, without its index")),
        (found.broken, ImportFault("damaged", "", broken, "left out", found.broken)),
        (found.lost_chunks, ImportFault("damaged", "", f"{lost} cannot be unpacked", gap, found.lost_chunks)),
        (foreign, ImportFault("unread", "", f"{strange} hold no messages of ROS", "left out")),
    )
    times, more = _times(found)
    faults = [*(fault for there, fault in met if there), *more, *by_px4]
    series: dict[str, list[_TopicSeries]] = {}
    for (quantity, topic), rows in found.rows.items():
        widths = [len(values) for *_, values in rows]
        width = max(set(widths), key=widths.count)
        odd = len(widths) - widths.count(width)
        if odd:
            seen = f"{odd} of {len(widths)} messages of {topic} do not hold {width} values as the others do"
            faults.append(ImportFault("shape", quantity, seen, "left out", odd))
        keep = np.array(widths) == width
        if not width:
            continue
        time_s = times[quantity, topic][keep]
        values = np.array([v for (*_, v) in rows if len(v) == width], float)
        if "attitude" in quantity:
            stated = np.linalg.norm(values, axis=1) > 0.5  # a quaternion of length zero is none
            time_s, values = time_s[stated], values[stated]
        if quantity in _SAID:
            series.setdefault(quantity, []).append(_TopicSeries(topic, time_s, values))
            continue
        if len(time_s) < 2:
            continue
        order = np.argsort(time_s, kind="stable")
        time_s, values = time_s[order], values[order]
        keep, odd_times = moving_on(time_s)
        faults += [replace(fault, column=topic) for fault in odd_times if fault.kind == "apart"]
        own = _TopicSeries(topic, time_s[keep], values[keep])
        if quantity in _UNSET and (own.values == _UNSET[quantity]).all():
            seen = f"{quantity.replace('_', ' ')} of {topic} was never set ({_UNSET[quantity][0]:g}, 0, … throughout)"
            faults.append(ImportFault("stuck", quantity, seen, "states nothing, left out", len(values)))
        elif keep.sum() > 1:
            series.setdefault(quantity, []).append(own)
    faults += _set_commands_apart(series)
    _rank(series, path)
    missing = [name for name, quantities in _WANTED.items() if not set(quantities) & set(series)]
    if missing and others:
        more = f" and {len(others) - _LISTED} more" if len(others) > _LISTED else ""
        seen = (
            f"no topic of a type that is read states {', '.join(missing)}; not read are {', '.join(others[:_LISTED])}"
        )
        faults.append(ImportFault("unread", "", seen + more, "export what is missing as a CSV"))
    for quantity, offered in series.items():
        if len(offered) > 1 and quantity not in _SAID:
            seen = f"{', '.join(s.topic for s in offered)} hold it"
            faults.append(ImportFault("instances", quantity, seen, f"{offered[0].topic} taken"))
    return series, faults


def _set_commands_apart(series: dict[str, list[_TopicSeries]]) -> list[ImportFault]:
    """Leave out the motion of topics that are called commands, each with a fault; speeds of such a topic are commands,
    where another topic has speeds."""
    faults = []
    for quantity, offered in list(series.items()):
        asked = [s for s in offered if _COMMANDED.search(s.topic)]
        others = [s for s in offered if s not in asked]
        if quantity in ("attitude", "position", "velocity", "body_velocity") and asked:
            seen = f"{', '.join(s.topic for s in asked)}: a command by the name"
            faults.append(ImportFault("command", quantity, seen, "no measurement, left out", len(asked[0].values)))
        elif quantity == "speeds" and asked and others:
            series["commands"] = [*series.get("commands", []), *asked]
        else:
            continue
        series[quantity] = others
    for quantity in [q for q, offered in series.items() if not offered]:
        del series[quantity]
    return faults


def _rank(series: dict[str, list[_TopicSeries]], path: Path) -> None:
    """Sort the topics of each quantity, the one that is read first.

    Inertial sensors that feel the thrust along z before others (those of cameras); attitudes by how far they follow the
    body rates (other bodies do not); position and velocity of the attitude's topic first; else by what they state.
    Topics of the inertial sensor's own vehicle before those of another, what stands still or ends early last.
    InputError where no inertial sensor feels the thrust along z.
    """
    for offered in series.values():
        most = max((s.alive_s for s in offered), default=0.0)
        offered.sort(key=lambda s, most=most: (s.alive_s < GOES_ON * most, -s.changes))
    along = {s.topic: np.median(s.values, axis=0) for s in series.get("force", [])}
    size = {topic: np.linalg.norm(felt) for topic, felt in along.items()}
    turned = {t for t in along if _WEIGHT_M_S2[0] < size[t] < _WEIGHT_M_S2[1] and along[t][2] < 0.7 * size[t]}
    if turned and turned == set(along):
        topic, felt = next(iter(along.items()))
        axis = int(np.argmax(np.abs(felt)))
        raise InputError(
            f"{path}: {topic} reads {felt[axis]:.3g} m/s² along {'xyz'[axis]} in the median, expected 9.8 along z (REP "
            "103: forward-left-up): its axes or its sign are others; export it as a CSV and state its axes in a mapping"
        )
    for quantity in ("force", "rates", "imu_attitude"):
        series.get(quantity, []).sort(key=lambda s: s.topic in turned)
    attitudes = series.get("attitude", [])
    if len(attitudes) > 1 and "rates" in series:
        rates = series["rates"][0]
        instants = by.steps_of(rates.time_s)
        moved = by.integrated(instants, rates.time_s, rates.values)
        follows = {
            s.topic: by.compare(by.turned(instants, s.time_s, continuous(s.values)), moved).correlation
            for s in attitudes
        }
        attitudes.sort(key=lambda s: -round(follows[s.topic], 1))
    for quantity in ("position", "body_velocity"):
        series.get(quantity, []).sort(key=lambda s: not attitudes or s.topic != attitudes[0].topic)
    if "rates" in series:
        own = _vehicle_of(series["rates"][0].topic)
        for quantity in ("speeds", "rpm", "commands", "throttle", "pulses", "voltage", "current", "range"):
            series.get(quantity, []).sort(key=lambda s: _vehicle_of(s.topic) != own)


def _vehicle_of(topic: str) -> str:
    """The namespace in which a topic of several vehicles stands: `/drone_1` of `/drone_1/imu/data`."""
    return topic.strip("/").split("/")[0]


def _times(found: _BagContent) -> tuple[dict[tuple[str, str], np.ndarray], list[ImportFault]]:
    """Times of the rows of each quantity of a topic, s, on the clock of the inertial sensor's stamps.

    A topic whose stamps are all zero, jump, or run at another rate has those at which its messages were recorded.
    """
    steady_s = 0.2  # Spread of the difference of two clocks up to which it is a constant.
    stamps = {key: np.array([row[0] for row in rows]) for key, rows in found.rows.items()}
    recorded = {key: np.array([row[1] for row in rows]) for key, rows in found.rows.items()}
    sound = set()
    for key, own in stamps.items():
        order = np.argsort(recorded[key], kind="stable")
        steps, waited = np.diff(own[order]), np.diff(recorded[key][order])
        # Stamps that jump go back, or run on by far more than the time between two recordings.
        jump = np.any(steps < -_SAME_CLOCK_S) or np.any(steps > _SAME_CLOCK_S + 10 * waited)
        if own.any() and not jump:
            sound.add(key)
    first = next((q for q in ("rates", "imu_attitude", "attitude") if any(k[0] == q for k in stamps)), None)
    base = max((k for k in stamps if k[0] == first), key=lambda k: len(stamps[k]), default=None)

    def placed(key: tuple[str, str]) -> np.ndarray:
        """Times of recording on the base's clock."""
        if base not in sound:
            return recorded[key]
        at, index = np.unique(recorded[base], return_index=True)
        to = stamps[base][index]
        inside = np.interp(recorded[key], at, to)
        return inside + np.minimum(recorded[key] - at[0], 0) + np.maximum(recorded[key] - at[-1], 0)

    times, faults = {}, {}
    for key, own in stamps.items():
        on_base = placed(key)
        off = np.median(own - on_base)
        if key not in sound:
            times[key], seen = on_base, "its stamps jump" if own.any() else ""
            action = "the times at which its messages were recorded hold"
        elif abs(off) < _SAME_CLOCK_S:
            times[key], seen = own, ""
        else:
            seen = f"its stamps are {off:.4g} s from those of {base[1]}"
            steady = np.ptp(np.quantile(own - on_base, [0.05, 0.95])) < steady_s
            times[key] = own - off if steady else on_base
            action = "shifted by that" if steady else "the times at which its messages were recorded hold"
        if seen:
            faults[key[1]] = ImportFault("two_clocks", c.TIME, f"{key[1]}: {seen}", action, len(own))
    return times, list(faults.values())


def _convert(
    series: dict[str, list[_TopicSeries]], faults: list[ImportFault], where: object
) -> tuple[pd.DataFrame, np.ndarray, np.ndarray]:
    """Contract columns of the first series of each quantity, where it flies, and where an estimate jumps (masks of
    rows)."""
    first = {quantity: offered[0] for quantity, offered in series.items()}
    if "attitude" not in first and "imu_attitude" in first:
        size = np.linalg.norm(first["imu_attitude"].values, axis=1)
        if np.all(np.abs(size - 1) < 0.01):
            first["attitude"] = first["imu_attitude"]
    clock = max((first[q] for q in ("rates", "attitude") if q in first), key=lambda s: len(s.time_s), default=None)
    if clock is None:
        raise InputError(f"{where}: neither sensor_msgs/Imu nor a pose to take the clock from")
    grid = clock.time_s
    parts: list[tuple] = []
    for quantity, names, turned in (
        ("rates", c.ANGULAR_VELOCITY, half_turn_about_x),
        ("force", c.SPECIFIC_FORCE, half_turn_about_x),
        ("position", c.POSITION, half_turn_about_x),
        ("attitude", c.QUATERNION, quaternion_to_frd_ned),
    ):
        if quantity in first:
            parts.append((names, first[quantity].time_s, turned(first[quantity].values)))
    parts += _velocity(series, faults)
    for quantity, kind, unit in (
        ("speeds", "rotor_speed", 1.0), ("rpm", "rotor_speed", RPM), ("commands", "rotor_command", 1.0)
    ):  # fmt: skip
        if quantity in first and not (quantity == "rpm" and "speeds" in first):
            names = c.rotor_columns(kind, first[quantity].values.shape[1])
            values, reversed_ = one_sense(first[quantity].values * unit, names)
            faults += reversed_
            parts.append((names, first[quantity].time_s, values))
    if "throttle" in first:
        used = np.isfinite(first["throttle"].values).any(axis=0)
        names = c.rotor_columns("throttle", int(np.flatnonzero(used).max(initial=-1)) + 1)
        values, reversed_ = one_sense(first["throttle"].values[:, : len(names)], names, 1.0)
        faults += reversed_
        parts.append((names, first["throttle"].time_s, values))
    elif "pulses" in first:
        parts.append(_of_pulses(first["pulses"], faults))
    for quantity, name in (("voltage", c.BATTERY_VOLTAGE), ("current", c.BATTERY_CURRENT), ("range", c.HEIGHT)):
        if quantity in first:
            values = first[quantity].values
            if quantity == "current" and np.nanmedian(values) < 0:  # discharging is negative by definition
                values = -values
            parts.append(((name,), first[quantity].time_s, values))
    table = table_on(grid, parts)
    # Of several vehicles in one bag what is said of this one.
    own = clock.topic.rsplit("/", 1)[0]
    said = {q: [s for s in series.get(q, []) if s.topic.rsplit("/", 1)[0] == own] or series.get(q, []) for q in _SAID}
    stated = flying_by([(s.time_s, s.values[:, 0]) for s in said["flying"]], grid, 1.0)
    flying, ground = airborne(table, stated)
    resets = [s.time_s[s.values[:, 0] > 0] - grid[0] for s in said["reset"]]
    jumps, reset = jumps_at(grid - grid[0], np.concatenate([np.zeros(0), *resets]), JUMPED)
    faults += ground + reset
    return table, flying, jumps


def _velocity(series: dict[str, list[_TopicSeries]], faults: list[ImportFault]) -> list[tuple]:
    """The velocity in the axes of the world, by the attitude of its own topic, else of the first one.

    It is in the axes that its message states, unless only in the others it integrates to the position.
    """
    stated = "velocity" if "velocity" in series else "body_velocity"
    if stated not in series:
        return []
    velocity = series[stated][0]
    attitudes = [*series.get("attitude", []), *series.get("imu_attitude", [])]
    attitude, position = (
        next((s for s in offered if s.topic == velocity.topic), offered[0] if offered else None)
        for offered in (attitudes, series.get("position", []))
    )
    readings = {"velocity": velocity.values}
    if attitude is not None:
        nearest = np.searchsorted((attitude.time_s[1:] + attitude.time_s[:-1]) / 2, velocity.time_s)
        turn = scipy.spatial.transform.Rotation.from_quat(attitude.values[nearest][:, [1, 2, 3, 0]])
        readings["body_velocity"] = turn.apply(velocity.values)
    elif stated == "body_velocity":
        seen = f"the velocity of {velocity.topic} is in body axes, and no topic states an attitude"
        faults.append(ImportFault("no_attitude", ", ".join(c.VELOCITY), seen, "columns left out", len(velocity.time_s)))
        return []
    if position is not None and attitude is not None:
        instants = by.steps_of(velocity.time_s)
        moved = by.changes(instants, position.time_s, position.values)
        agreed = {k: by.compare(moved, by.integrated(instants, velocity.time_s, v)) for k, v in readings.items()}
        other = next(k for k in agreed if k != stated)
        if agreed[other].correlation > CONFIRMED and is_clear(agreed[other], agreed[stated]):
            axes = {"velocity": "world", "body_velocity": "body"}
            seen = (
                f"{velocity.topic} is in {axes[stated]} axes as stated, but only in {axes[other]} axes it integrates "
                f"to the position (correlation {agreed[other].correlation:.3f}, else {agreed[stated].correlation:.3f})"
            )
            faults.append(ImportFault("axes", "velocity", seen, f"taken in {axes[other]} axes", len(velocity.values)))
            stated = other
    return [(c.VELOCITY, velocity.time_s, half_turn_about_x(readings[stated]))]


def _of_pulses(outputs: _TopicSeries, faults: list[ImportFault]) -> tuple:
    """Throttles of an array of all outputs, which names no motors: the first four that move are motors, and each other
    whose signal follows from theirs."""
    mixed = 4  # Motors of a mixer whose signals say those of all others: it has four demands.
    steps = np.diff(pd.DataFrame(outputs.values).ffill().to_numpy(), axis=0)
    moving = np.flatnonzero((np.abs(np.nan_to_num(steps)) > 0).any(axis=0))
    pulses = outputs.values[:, moving]
    used = [*range(min(mixed, len(moving))), *further_motors(pulses, mixed)]
    low, high = PULSE_US
    seen = f"channels {', '.join(str(moving[k] + 1) for k in used)} of {outputs.topic} move"
    action = f"taken for motors in order, {low:g} to {high:g} µs"
    faults.append(ImportFault("unit", "throttle", seen, action, len(pulses)))
    others = [str(moving[k] + 1) for k in range(len(moving)) if k not in used]
    if others:
        seen = f"channels {', '.join(others)} of {outputs.topic} move, too, but not with the motors"
        faults.append(ImportFault("servo", "throttle", seen, "taken for no motors", len(pulses)))
    throttle = np.clip((pulses[:, used] - low) / (high - low), 0, 1)
    return c.rotor_columns("throttle", len(used)), outputs.time_s, throttle


def _read(path: Path) -> Imported:
    """Every flight of a bag (file or folder) or MCAP file."""
    series, faults = _read_series(path)
    table, flying, jumps = _convert(series, faults, path)
    name = (path.resolve() if path.is_dir() else path).name.split(".")[0]
    runs, cuts = flights(table, flying, name, path, jumps)
    unit = "rpm" if "rpm" in series and "speeds" not in series else "rad/s"
    axes = "REP 103: body forward-left-up, world z up, turned by half a turn about x into FRD and z down"
    return Imported(runs, [*faults, *report_gaps(table), *cuts], axes, speed_unit=unit)


IMPORTER = Importer(
    "ros",
    "ROS 1 or 2 bag, MCAP",
    _read,
    "`Imu`, `Odometry`, poses, twists, `Actuators`, `MotorSpeed`, `ESCStatus`, `ESCTelemetry`, `RCOut`, "
    "`BatteryState`, `Range`, PX4's own; whole messages of a file that ends early; `'rotorid[ros]'`",
    starts=(b"#ROSBAG V2.0", b"\x89MCAP0", b"SQLite format 3"),
    recognises=lambda path, head: path.is_dir() and is_bag(path),
    known_by="first bytes, or a folder with `metadata.yaml`",
    any_size=True,
)
