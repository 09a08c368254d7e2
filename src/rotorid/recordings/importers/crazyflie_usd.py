"""Crazyflie uSD-deck logs: binary files of timed events (firmware `usddeck`, format versions 1 and 2).

Layout, little-endian throughout::

    u8 0xBC | u16 version | u16 number of event types
    per event type: u16 id | name\\0 | u16 number of variables | per variable: "name(type)\\0"
    per event: u16 id | u32 time in ms (version 1) or u64 time in µs (version 2) | its variables packed
    u32 CRC-32 of everything before it

Types are the characters of Python's `struct`: f float, e half a float, B H I unsigned, b h i signed integers.
Source: bitcraze/crazyflie-firmware, `usddeck.c` and `tools/usdlog/cfusdlog.py` (the format, none of its code).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path
from zlib import crc32

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.recordings.importers.report import Fault

MAGIC = 0xBC
CHECKSUM = 4
"""Bytes of it at the end of a log."""
TIME = "time_s"
TYPES = {"e": "<f2", "f": "<f4", "d": "<f8", "b": "i1", "B": "u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4"}
TYPES |= {"q": "<i8", "Q": "<u8"}


@dataclass(frozen=True)
class EventType:
    """One kind of record in a log: its name and the names and numpy types of its variables."""

    name: str
    variables: tuple[str, ...]
    dtype: np.dtype


def _text(data: bytes, start: int, where: str) -> tuple[str, int]:
    end = data.find(b"\0", start)
    if end < 0:
        raise InputError(f"{where}, byte {start}: header is cut off inside a name")
    return data[start:end].decode("latin-1"), end + 1


def _event_types(data: bytes, where: str) -> tuple[dict[int, EventType], int, int]:
    """Event types by id, format version and the offset of the first event."""
    if len(data) < 9 or data[0] != MAGIC:
        found = f"0x{data[0]:02X}" if data else "an empty file"
        raise InputError(f"{where}: expected a Crazyflie uSD log starting with 0xBC, found {found}")
    version, count = struct.unpack_from("<HH", data, 1)
    if version not in (1, 2):
        raise InputError(f"{where}: expected format version 1 or 2, found {version}")
    clock = "<u8" if version == 2 else "<u4"
    types, offset = {}, 5
    try:
        for _ in range(count):
            (identifier,) = struct.unpack_from("<H", data, offset)
            name, offset = _text(data, offset + 2, where)
            (variables,) = struct.unpack_from("<H", data, offset)
            offset += 2
            fields = [("__id", "<u2"), ("__clock", clock)]
            for _ in range(variables):
                label, offset = _text(data, offset, where)
                variable, _, letter = label.removesuffix(")").rpartition("(")
                if letter not in TYPES or not variable:
                    raise InputError(f"{where}: variable {label!r} has a type that is not known")
                fields.append((variable, TYPES[letter]))
            types[identifier] = EventType(name, tuple(f for f, _ in fields[2:]), np.dtype(fields))
    except struct.error:
        raise InputError(f"{where}: header is cut off after {offset} bytes") from None
    return types, version, offset


def decode_usd_log(data: bytes, where: str = "log") -> tuple[dict[str, pd.DataFrame], list[Fault]]:
    """Tables of a uSD log by event name, each with `time_s` (device clock) first, in file order.

    A wrong checksum, an unknown event or a cut-off tail is reported as a Fault and everything before it
    is kept; a file that is no uSD log raises InputError.
    """
    types, version, offset = _event_types(data, where)
    whole = crc32(data[:-CHECKSUM]) == struct.unpack("<I", data[-CHECKSUM:])[0]
    end = len(data) - CHECKSUM * whole  # of a log that is cut off the last bytes are no checksum
    offsets: dict[int, list[int]] = {identifier: [] for identifier in types}
    unknown, inside = None, None
    while offset + 2 <= end:
        identifier = data[offset] | data[offset + 1] << 8
        kind = types.get(identifier)
        if kind is None:
            unknown = identifier
            break
        if offset + kind.dtype.itemsize > end:
            inside = kind
            break
        offsets[identifier].append(offset)
        offset += kind.dtype.itemsize
    faults = _faults_of_end(data, offset, whole, unknown, inside)
    raw = np.frombuffer(data, np.uint8)
    scale = 1e-6 if version == 2 else 1e-3
    tables = {}
    for identifier, kind in types.items():
        starts = np.asarray(offsets[identifier], int)
        rows = raw[starts[:, None] + np.arange(kind.dtype.itemsize)].copy().view(kind.dtype)[:, 0]
        columns = {TIME: rows["__clock"].astype(float) * scale}
        columns |= {name: rows[name].astype(float) for name in kind.variables}
        tables[kind.name] = pd.DataFrame(columns)
    return tables, faults


def _faults_of_end(data: bytes, offset: int, whole: bool, unknown: int | None, inside: EventType | None) -> list[Fault]:
    """What is wrong with a log whose events end at an offset: with an event that is not known, or inside one."""
    rest, faults = len(data) - offset, []
    checked = rest == CHECKSUM  # exactly a checksum follows, right or wrong
    if rest <= CHECKSUM:
        unknown = None  # bytes of a checksum are no event
    if unknown is not None:
        found = f"event id {unknown} at byte {offset} is not in the header"
        faults.append(Fault("unknown_event", "", found, f"{rest - CHECKSUM} bytes after it left out", 1))
    if not whole and (checked or unknown is not None):
        stored = struct.unpack("<I", data[-CHECKSUM:])[0]
        found = f"CRC-32 is {crc32(data[:-CHECKSUM]):08x}, file says {stored:08x}"
        faults.insert(0, Fault("checksum", "", found, "kept; bytes may be damaged", 1))
    elif inside is not None or not (whole or unknown is not None):
        found = f"the file ends inside an event ({inside.name})" if inside else "the file ends without its checksum"
        faults.append(Fault("cut_off", "", found, "what came before is kept; the log stopped before its end", 1))
    return faults


def read_usd_log(path: Path) -> tuple[dict[str, pd.DataFrame], list[Fault]]:
    """Read a uSD log file; see `decode_usd_log`."""
    try:
        data = Path(path).read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: file is missing") from None
    return decode_usd_log(data, str(path))
