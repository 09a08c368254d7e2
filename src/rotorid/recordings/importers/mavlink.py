"""Telemetry logs of MAVLink (`.tlog`) from ArduPilot, as the tables that its own logs have.

A ground station writes each message that it hears behind eight bytes of its own clock, µs. What counts is the clock of
the vehicle, since it was started; messages that have none are placed by the ground station's. Damaged bytes are passed
over: of the messages that are read the checksum must fit. Telemetry comes a few times a second and with gaps.

Sources: MAVLink's serialization (checksum X.25, extra byte of each message) and its definitions `minimal.xml`,
`common.xml`, `ardupilotmega.xml`; ArduPilot `GCS_Common.cpp` (`RAW_IMU` in thousandths of g and of rad/s).
"""

from __future__ import annotations

import struct
from binascii import crc_hqx
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.recordings import columns as c
from rotorid.recordings.importers import ardupilot
from rotorid.recordings.importers.contract import Importer
from rotorid.recordings.importers.mapping import G

_FIRST, _SECOND = 0xFE, 0xFD
"""First byte of a message by the version of MAVLink."""
_STAMP, _CHECKSUM, _SIGNATURE = 8, 2, 13
_LONGEST_US = 7 * 86_400_000_000
"""What is stamped later than this behind the first message is none."""
_REVERSED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))
_ARDUPILOT = 3
_MULTIROTORS = (2, 13, 14, 29, 35)
"""`MAV_TYPE` of multirotors: of four, six, eight, twelve, ten rotors."""


@dataclass(frozen=True)
class _Message:
    """A message that is read: extra byte of its checksum, layout, and the vehicle's clock in it, s."""

    extra: int
    layout: struct.Struct
    unit_s: float | None = None


_HEARTBEAT, _STATUS, _PARAMETER, _SCALED_IMU, _RAW_IMU, _ATTITUDE, _POSITION, _OUTPUTS = 0, 1, 22, 26, 27, 30, 32, 36
_ESCS = {11030: 0, 11031: 4, 11032: 8}
"""To messages of speed controllers the number of their first."""
_KINDS = {
    _HEARTBEAT: _Message(50, struct.Struct("<I5B")),
    _STATUS: _Message(124, struct.Struct("<3I2Hh6Hb")),
    _PARAMETER: _Message(220, struct.Struct("<fHH16sB")),
    _SCALED_IMU: _Message(170, struct.Struct("<I9h"), 1e-3),
    _RAW_IMU: _Message(144, struct.Struct("<Q9h"), 1e-6),
    _ATTITUDE: _Message(39, struct.Struct("<I6f"), 1e-3),
    _POSITION: _Message(185, struct.Struct("<I6f"), 1e-3),
    _OUTPUTS: _Message(222, struct.Struct("<I8HB8H"), 1e-6),
    **dict(zip(_ESCS, (_Message(extra, struct.Struct("<20H4B")) for extra in (144, 133, 85)), strict=True)),
}


def _messages(data: bytes) -> Iterator[tuple[int, int, int, tuple]]:
    """Time of the ground station, µs, sender, number and values of each message that is read."""
    at, size = 0, len(data)
    first_us = int.from_bytes(data[:_STAMP], "big")
    while at + _STAMP + 10 <= size:
        start = at + _STAMP
        stamp_us = int.from_bytes(data[at:start], "big")
        if data[start] not in (_FIRST, _SECOND) or not 0 <= stamp_us - first_us < _LONGEST_US:
            at += 1
            continue
        body, sender, number, signed = start + 6, data[start + 3], data[start + 5], 0
        if data[start] == _SECOND:
            body, sender, signed = start + 10, data[start + 5], data[start + 2] & 1
            number = int.from_bytes(data[start + 7 : body], "little")
        last = body + data[start + 1]
        kind = _KINDS.get(number)
        if kind is not None:
            read = (data[start + 1 : last] + bytes([kind.extra])).translate(_REVERSED)
            if crc_hqx(read, 0xFFFF).to_bytes(2, "big").translate(_REVERSED) != data[last : last + _CHECKSUM]:
                at += 1
                continue
            values = kind.layout.unpack(data[body:last].ljust(kind.layout.size, b"\0")[: kind.layout.size])
            yield stamp_us, sender, number, values
        at = last + _CHECKSUM + _SIGNATURE * signed


def read_telemetry(path: Path) -> dict[str, pd.DataFrame]:
    """What a telemetry log of ArduPilot holds, in the tables of its own logs; InputError where it is none."""
    found = list(_messages(Path(path).read_bytes()))
    beats = [(sender, values[1], values[2]) for _, sender, number, values in found if number == _HEARTBEAT]
    vehicle = next(((sender, kind) for sender, kind, autopilot in beats if autopilot == _ARDUPILOT), None)
    if vehicle is None:
        raise InputError(
            f"{path}: a telemetry log of MAVLink without the heartbeat of an ArduPilot, whose telemetry alone is read; "
            "take the autopilot's own log (.ulg)"
        )
    if vehicle[1] not in _MULTIROTORS:
        raise InputError(
            f"{path}: the telemetry is of no multirotor (MAV_TYPE {vehicle[1]}); only these can be imported"
        )
    rows: dict[int, list[tuple]] = {number: [] for number in _KINDS}
    for time_us, sender, number, values in found:
        if sender == vehicle[0]:
            unit_s = _KINDS[number].unit_s
            rows[number].append((time_us * 1e-6, np.nan if unit_s is None else values[0] * unit_s, *values))
    if not rows[_ATTITUDE]:
        raise InputError(f"{path}: the telemetry holds no ATTITUDE, whose clock is needed")
    later_s = float(np.median([ground - own for ground, own, *_ in rows[_ATTITUDE]]))
    return {name: pd.DataFrame(table) for name, table in _tables(rows, later_s).items() if len(table[c.TIME])}


def _tables(rows: dict[int, list[tuple]], later_s: float) -> dict[str, dict[str, np.ndarray]]:
    """Tables of an ArduPilot's own logs; `later_s` is the ground station's clock less the vehicle's."""

    def of(number: int, first: int, count: int) -> tuple[dict[str, np.ndarray], np.ndarray]:
        values = np.array([row[:2] + row[2 + first : 2 + first + count] for row in rows[number]], float)
        values = values.reshape(-1, 2 + count)
        time_s = np.where(np.isnan(values[:, 1]), values[:, 0] - later_s, values[:, 1])
        order = np.argsort(time_s, kind="stable")
        return {c.TIME: time_s[order]}, values[order, 2:].T

    def named(number: int, first: int, names: str, scale: float = 1.0) -> dict[str, np.ndarray]:
        time, values = of(number, first, len(names.split()))
        return time | dict(zip(names.split(), values * scale, strict=True))

    inertial = _RAW_IMU if rows[_RAW_IMU] else _SCALED_IMU
    time, outputs = of(_OUTPUTS, 1, 17)
    pulses = np.where(np.delete(outputs, 8, axis=0) > 0, np.delete(outputs, 8, axis=0), np.nan)
    battery = named(_STATUS, 4, "Volt Curr")
    escs = [(number, first + k, 12 + k) for number, first in _ESCS.items() for k in range(4) if rows[number]]
    speeds = [named(number, place, "RPM") | {"Instance": np.array([float(n)])} for number, n, place in escs]
    stated = sorted((ground - later_s, values[3].split(b"\0")[0].decode("ascii", "replace"), values[0])
                    for ground, _, *values in rows[_PARAMETER])  # fmt: skip
    return {
        "GYR": named(_ATTITUDE, 4, "GyrX GyrY GyrZ"),
        "ACC": named(inertial, 1, "AccX AccY AccZ", G / 1000),
        "ATT": named(_ATTITUDE, 1, "Roll Pitch Yaw", np.degrees(1)),
        "XKF1": named(_POSITION, 1, "PN PE PD VN VE VD"),
        "RCOU": time | {f"C{k}": own for k, own in enumerate(pulses, 1) if np.isfinite(own).any()},
        "BAT": battery | {"Volt": battery["Volt"] / 1000, "Curr": np.maximum(battery["Curr"], 0) / 100},
        "ESC": {name: np.concatenate([np.broadcast_to(own[name], len(own[c.TIME])) for own in speeds] or [np.zeros(0)])
                for name in (c.TIME, "Instance", "RPM")},
        "PARM": dict(zip((c.TIME, "Name", "Value"), zip(*stated, strict=True), strict=True))
                if stated else {c.TIME: []},
    }  # fmt: skip


def _is_telemetry(path: Path, head: bytes) -> bool:
    """Whether a time in µs from 1998 to 2128, or a name of telemetry, stands before a message's first byte."""
    epoch = 9e14 < int.from_bytes(head[:8], "big") < 5e15
    return head[8:9] in (b"\xfe", b"\xfd") and (epoch or path.suffix.lower() in (".tlog", ".rlog"))


IMPORTER = Importer(
    "mavlink",
    "telemetry of ArduPilot by MAVLink (`.tlog`)",
    lambda path: ardupilot.read(path, read_telemetry(path)),
    "`ATTITUDE` with body rates, `RAW_IMU` or `SCALED_IMU`, `LOCAL_POSITION_NED`, `SERVO_OUTPUT_RAW` by the parameters "
    "that were sent, `ESC_TELEMETRY`, `SYS_STATUS`; it comes a few times a second: the log on board says more",
    recognises=_is_telemetry,
    known_by="a clock and a message's first byte",
)
