"""Betaflight's blackbox logs: read byte by byte, and what the fields of a session mean by its own header.

Each session has lines of text (`H name:value`) that say how its frames are packed. Key frames (I) stand alone; a frame
between them (P) holds differences from a prediction. A frame is whole where the next one begins with a known letter.
After damage nothing is taken until the next key frame, because the frames between count from the damaged one.

Betaflight's body axes are forward-left-up (a positive pitch rate lowers the nose, a positive yaw rate turns left, and
the accelerometer reads +1 g along z at rest): half a turn about x makes them forward-right-down. Units by the log's own
header: `gyro_scale` (deg/s) and `blackbox_high_resolution` (tenths of it), `acc_1G`, `motorOutput` (range of the
motors' commands) and `features` (3D), `motor_poles`; `eRPM` in hundreds of electrical turns a minute; voltage and
current by the version. Blackbox logs hold no velocity; an attitude only since `imuQuaternion` is logged.

Sources: Betaflight `src/main/blackbox/` (`blackbox.c`, `blackbox_encoding.c`, `blackbox_fielddefs.h`),
`src/main/drivers/dshot.c`, `src/main/flight/mixer_init.c`, Blackbox Explorer `flightlog_fields_presenter.js`.
"""

from __future__ import annotations

import csv
import io
import re
import struct
from array import array
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.recordings import columns as c
from rotorid.recordings.importers.contract import Imported, Importer
from rotorid.recordings.importers.faults import ImportFault, airborne, flights, moving_on, report_gaps
from rotorid.recordings.importers.known import Known
from rotorid.recordings.importers.mapping import G, half_turn_about_x, quaternion_to_frd_ned

_FIRST_LINE = b"H Product:Blackbox"
_HEADER_LINE = re.compile(rb"H ([^:\n]{1,80}):([^\n]*)\n")
_FRAMES = b"IPGHSE"
_END_OF_LOG = b"End of log"
_LONGEST_FRAME = _MOST_FIELDS = 256
_LARGEST_STEP = 5000
_LARGEST_STEP_US = 10_000_000
"""A main frame that leaps farther ahead in iterations or time than this, or back, is damaged."""
_TURN = 1 << 32
"""Numbers have 32 bits: a clock in microseconds begins anew after 71.6 minutes."""
_OTHER_NAMES = {"gyroADC": ("gyroData", "gyroUnfilt"), "accSmooth": ("accADC",), "eRPM": ("eRPM(/100)",)}
"""To a field its names in other releases, and what holds the same before a filter."""
_FEWER_MOTORS = {1: "a fixed wing", 2: "a bicopter or a fixed wing", 3: "a tricopter, whose tail rotor a servo tilts"}
"""What Betaflight's mixers make of fewer motors than four."""


def _read(path: Path) -> Imported:
    """Every flight of every session in a blackbox file.

    InputError where the file is of another firmware, cannot be read, or holds no flight.
    """
    data = Path(path).read_bytes()
    found = [_exported(data, path)] if data.startswith(b'"Product"') else sessions(data)
    runs: dict[str, pd.DataFrame] = {}
    faults: list[ImportFault] = []
    reasons: list[str] = []
    for number, session in enumerate(found, 1):
        name = path.name.split(".")[0] + (f"_{number}" if len(found) > 1 else "")
        try:
            if isinstance(session, InputError):
                raise session
            flown, more = _flights(session, name, path)
        except InputError as error:
            reasons.append(str(error).removeprefix(f"{path}: "))
            faults.append(ImportFault("no_flight", c.TIME, f"session {number}: {reasons[-1]}", "left out", 0))
            continue
        runs |= flown
        faults += more
    if not runs:
        raise InputError(f"{path}: {reasons[-1] if reasons else 'holds no log'}")
    axes = "body forward-left-up, turned by half a turn about x into FRD"
    return Imported(runs, faults, axes, Known("betaflight"), speed_unit="rpm", settings=_stated_parameters(path))


def _exported(data: bytes, path: Path) -> BlackboxSession:
    """The session in a table that Blackbox Explorer exports: its header, a line each, then frames as logged."""
    rows = csv.reader(io.StringIO(data.decode("utf-8", "replace")))
    headers: dict[str, str] = {}
    names: tuple[str, ...] = ()
    values, whole = array("d"), True
    try:
        for cells in rows:
            if not names and "time" in cells:
                names = tuple(name.strip() for name in cells)
            elif not names and len(cells) > 1:
                headers[cells[0]] = ",".join(cells[1:])
            elif names and cells:
                whole = len(cells) == len(names)
                values.extend(_cell(cell) for cell in cells[: len(cells) * whole])
    except csv.Error as error:
        raise InputError(f"{path}, line {rows.line_num}: cannot be read as a table ({error})") from None
    if not names:
        raise InputError(f"{path}: Blackbox Explorer's header is there, but no heading with a column time below it")
    if scale := _number(headers, "gyroScale", 0.0):  # the Explorer turns deg/s into rad/µs
        headers.setdefault("gyro_scale", f"{np.degrees(scale) * 1e6:.9f}")
    return BlackboxSession(headers, names, np.array(values).reshape(-1, len(names)), whole, 0)


def _cell(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return np.nan


def _flights(session: BlackboxSession, name: str, path: Path) -> tuple[dict[str, pd.DataFrame], list[ImportFault]]:
    headers = session.headers
    firmware = headers.get("Firmware revision", headers.get("Firmware type", ""))
    if "betaflight" not in firmware.lower():
        raise InputError(
            f"{path}: a blackbox log of {firmware or 'an unknown firmware'}; only Betaflight's axes and units are "
            "known, turn it into CSV (blackbox_decode), then `rotorid import FILE.csv`"
        )
    if len(session.values) < 2:
        raise InputError(f"{path}: holds {len(session.values)} samples")
    raw = pd.DataFrame(session.values, columns=session.names)
    faults = []
    if session.damaged:
        found = f"{session.damaged} frames are damaged or count from one that is"
        faults.append(ImportFault("damaged", c.TIME, found, "left out", session.damaged, name))
    if not session.whole:
        found = "the log breaks off without its end event (power lost, or a full memory)"
        lasts = (raw["time"].iloc[-1] - raw["time"].iloc[0]) * 1e-6
        faults.append(ImportFault("cut_off", c.TIME, found, f"{len(raw)} frames up to {lasts:.2f} s kept", 0, name))
    runs, more = convert(raw, headers, name, path)
    return runs, faults + more


def convert(
    raw: pd.DataFrame, headers: Mapping[str, str], name: str, where: object
) -> tuple[dict[str, pd.DataFrame], list[ImportFault]]:
    """Flights in contract columns of the main frames of one session (`time` in µs) and its header."""
    default_poles = 14
    # `imuQuaternion` holds x, y and z of the unit quaternion times this; w is what is missing to length 1.
    quaternion_scale = 32767.0
    if "time" not in raw:
        raise InputError(f"{where}: the log has no field time")
    raw, faults = _known_names(raw)
    time = raw["time"].to_numpy(float) * 1e-6
    keep, more = moving_on(time)
    faults += more
    raw, time = raw[keep].reset_index(drop=True), time[keep]
    table = pd.DataFrame({c.TIME: time - time[0]})

    def fields(base: str, count: int) -> np.ndarray | None:
        names = [f"{base}[{i}]" for i in range(count)]
        return raw[names].to_numpy(float) if set(names) <= set(raw) else None

    gyro = fields("gyroADC", 3)
    if gyro is not None:
        scale = _number(headers, "gyro_scale", _number(headers, "gyro.scale", 1.0))
        scale /= 10 if _number(headers, "blackbox_high_resolution", 0) > 0 else 1
        table[list(c.ANGULAR_VELOCITY)] = half_turn_about_x(np.radians(gyro * scale))
    else:
        missing = ", ".join(c.ANGULAR_VELOCITY)
        faults.append(ImportFault("missing", missing, "gyroADC is not logged", "no body rates"))
    acceleration = fields("accSmooth", 3)
    one_g = _number(headers, "acc_1G", 0)
    if acceleration is not None and one_g > 0:
        table[list(c.SPECIFIC_FORCE)] = half_turn_about_x(acceleration / one_g * G)
    else:
        found = "accSmooth is not logged" if acceleration is None else "the header does not state acc_1G"
        faults.append(ImportFault("missing", ", ".join(c.SPECIFIC_FORCE), found, "no specific force", 0))
    attitude = fields("imuQuaternion", 3)
    if attitude is not None:
        xyz = attitude / quaternion_scale
        w = np.sqrt(np.clip(1 - np.sum(xyz**2, axis=1), 0, None))
        table[list(c.QUATERNION)] = quaternion_to_frd_ned(np.column_stack([w, xyz]))
    motors = [n for i in range(8) if (n := f"motor[{i}]") in raw]
    if not motors:
        raise InputError(f"{where}: no motor[0], motor[1], … is logged, so that nothing shows when the vehicle flies")
    if len(motors) in _FEWER_MOTORS:
        what = _FEWER_MOTORS[len(motors)]
        raise InputError(
            f"{where}: the log is of {what} ({len(motors)} motors); only multirotors of fixed rotors can be imported"
        )
    throttle, more = throttles(raw[motors].to_numpy(float), headers)
    faults += more
    table[list(c.rotor_columns("throttle", throttle.shape[1]))] = throttle
    turns = np.column_stack([raw.get(f"eRPM[{i}]", np.zeros(len(raw))) for i in range(throttle.shape[1])])
    if np.nanmax(turns) > 0:
        poles = _number(headers, "motor_poles", 0)
        if not poles > 0:
            poles, found = default_poles, "the header does not state motor_poles"
            faults.append(ImportFault("unit", "rotor_speed", found, f"taken as {default_poles}", 0))
        speeds = np.where(np.isnan(throttle), np.nan, turns * 100 / (poles / 2) * 2 * np.pi / 60)
        for column, own in zip(c.rotor_columns("rotor_speed", turns.shape[1]), speeds.T, strict=True):
            if np.nanmax(own, initial=0.0) > 0:
                table[column] = own
            else:
                found = "its eRPM is not logged, or 0 throughout"
                faults.append(ImportFault("speed_missing", column, found, "column left out", 0))
    battery, more = _battery(raw, headers)
    faults += more
    table = table.assign(**battery)
    faults += report_gaps(table)
    runs, cuts = flights(table, airborne(table)[0], name, where)
    return runs, [*faults, *cuts]


def _known_names(raw: pd.DataFrame) -> tuple[pd.DataFrame, list[ImportFault]]:
    """The fields under the names of today's releases; what looks like one of them and is none is named."""
    names = {f"{other}[{i}]": f"{base}[{i}]" for base, others in _OTHER_NAMES.items() for other in others
             for i in range(8) if f"{base}[{i}]" not in raw}  # fmt: skip
    raw = raw.rename(columns=names)
    faults = []
    for base in ("gyroADC", "accSmooth", "eRPM", "motor", "vbatLatest", "amperageLatest"):
        core = re.sub(r"ADC|Smooth|Latest", "", base).lower()
        like = [n for n in raw if core in n.lower() and not re.search(r"unfilt|legacy", n.lower())]
        if like and not any(n.split("[")[0] == base for n in raw):
            found = f"{base} is not logged, but {', '.join(like)} looks like it under a name that is not known"
            faults.append(ImportFault("unknown_name", base, found, "left out", 0))
    return raw, faults


def throttles(motors: np.ndarray, headers: Mapping[str, str]) -> tuple[np.ndarray, list[ImportFault]]:
    """Commands of motors (n, k) as fractions of the range that the header states, and what was found.

    With 3D a motor also turns backwards; the contract has no fraction for that, so these are NaN.
    """
    feature_3d = 1 << 12
    dshot = (48.0, 2047.0)
    # With 3D, DShot's commands below this turn a motor backwards, from 48 on the faster the larger.
    dshot_forward = 1048.0
    # Betaflight's own dead band of 3D where motors have pulses in µs; the header does not hold what was set.
    deadband_3d = (1406.0, 1514.0)
    slowest_pulse_us = 900.0  # Commands of motors that turn below this are none of pulses in µs.
    faults = []
    low, high = _pair(headers, "motorOutput") or (0.0, 0.0)
    if not high > low:
        low, high = _number(headers, "minthrottle", 1000.0), _number(headers, "maxthrottle", 2000.0)
        turning = motors[motors > 0]
        if len(turning) and np.quantile(turning, 0.01) < slowest_pulse_us:
            low, high = dshot
        found = "the header does not state motorOutput"
        faults.append(ImportFault("unit", "throttle", found, f"no and full throttle taken as {low:g} and {high:g}", 0))
    backwards = np.zeros(motors.shape, bool)
    if int(_number(headers, "features", 0)) & feature_3d:
        if low < slowest_pulse_us:
            backwards, low = (motors > 0) & (motors < dshot_forward), dshot_forward + low - dshot[0]
        else:
            backwards, low = motors < deadband_3d[0], deadband_3d[1]
            found = "pulses in µs with 3D, whose dead band the header does not state"
            faults.append(ImportFault("unit", "throttle", found, f"no throttle taken as {low:g} µs, Betaflight's own"))
    share = np.clip((motors - low) / (high - low), 0, 1)
    if backwards.any():
        found = f"{int(backwards.any(axis=1).sum())} samples have a motor that turns backwards (3D)"
        faults.append(ImportFault("backwards", "throttle", found, "made empty cells", int(backwards.sum())))
    return np.where(backwards, np.nan, share), faults


def _battery(raw: pd.DataFrame, headers: Mapping[str, str]) -> tuple[dict[str, np.ndarray], list[ImportFault]]:
    """Voltage and current of the battery in contract columns, as far as they are logged and their unit is known."""
    # Since which version so many counts of a field are 1 V or 1 A; before that it counts steps of the converter.
    volts = (((4, 0), 100), ((3, 1), 10))
    amperes = (((3, 1), 100),)
    converter_step_mv = 3300 / 4095
    version = _version(headers)
    found, faults = {}, []
    for field, column, since in (
        ("vbatLatest", c.BATTERY_VOLTAGE, volts),
        ("amperageLatest", c.BATTERY_CURRENT, amperes),
    ):
        if field not in raw or not raw[field].max() > 0:
            continue
        values = raw[field].to_numpy(float)
        counts = next((n for first, n in since if version >= first), None)
        offset, per_ampere = _pair(headers, "currentMeter") or _pair(headers, "currentSensor") or (0.0, 0.0)
        if counts is not None:
            found[column] = values / counts
        elif version and field == "vbatLatest" and (scale := _number(headers, "vbatscale", 0)) > 0:
            found[column] = values * converter_step_mv * scale * 1e-4  # the divider in tenths, mV
        elif version and field == "amperageLatest" and per_ampere > 0:
            found[column] = (values * converter_step_mv - offset) * 10 / per_ampere
        else:
            why = "the header does not state the version or the scale that its unit depends on"
            faults.append(ImportFault("unit", column, f"{field}: {why}", "left out", len(raw)))
    return found, faults


def _number(headers: Mapping[str, str], name: str, otherwise: float) -> float:
    """A number of the header: plain, or the bits of a 32-bit float in hexadecimal (`0x3f800000` is 1)."""
    text = headers.get(name, "").strip()
    if re.fullmatch(r"0x[0-9a-fA-F]{1,8}", text):
        return struct.unpack("<f", struct.pack("<I", int(text, 16)))[0]
    return float(text) if re.fullmatch(r"[-+]?\d{1,15}(\.\d*)?(e[-+]?\d{1,2})?", text) else otherwise


def _pair(headers: Mapping[str, str], name: str) -> tuple[float, float] | None:
    """Two numbers of the header with a comma between; None where it does not state them."""
    parts = headers.get(name, "").split(",")
    numbers = [_number({name: p}, name, np.nan) for p in parts]
    return (numbers[0], numbers[1]) if len(numbers) == 2 and np.isfinite(numbers).all() else None


def _version(headers: Mapping[str, str]) -> tuple[int, ...]:
    """Betaflight's version, `(4, 4)`; empty where the header does not state it."""
    found = re.search(r"(\d{1,4})\.(\d{1,3})", headers.get("Firmware revision", ""))
    return (int(found[1]), int(found[2])) if found else ()


@dataclass(frozen=True)
class BlackboxSession:
    """One session of a blackbox file.

    `names` and `values` (n, k), whole numbers: the main frames in the order of the file, `time` in µs without the
    clock's new beginnings. `whole`: the event of the end is there. `damaged`: frames that could not be read, or count
    from such a one.
    """

    headers: Mapping[str, str]
    names: tuple[str, ...]
    values: np.ndarray
    whole: bool
    damaged: int


def sessions(data: bytes) -> list[BlackboxSession | InputError]:
    """Every session of a blackbox file in its order; for one whose header cannot be read the reason."""
    starts = [match.start() for match in re.finditer(re.escape(_FIRST_LINE), data)]
    found: list[BlackboxSession | InputError] = []
    for start, stop in zip(starts, [*starts[1:], len(data)], strict=True):
        try:
            found.append(_session(data[start:stop]))
        except InputError as error:
            found.append(error)
    return found


def _session(data: bytes) -> BlackboxSession:
    headers, at = _headers(data)
    frames = _Frames(headers, data)
    whole = frames.read(at)
    values = np.array(frames.values, dtype=np.int64).reshape(-1, len(frames.names))
    time = values[:, frames.time]
    values[:, frames.time] = time + _TURN * np.cumsum(np.diff(time, prepend=time[:1]) < -_TURN // 2)
    return BlackboxSession(headers, frames.names, values, whole, frames.damaged)


def _headers(data: bytes) -> tuple[dict[str, str], int]:
    """The lines of a header by name, and where the frames begin; what is no line is passed over."""
    headers: dict[str, str] = {}
    at = 0
    while at < len(data):
        if line := _HEADER_LINE.match(data, at):
            name, value = (part.decode("utf-8", "replace").strip() for part in line.groups())
            headers[name] = value
            at = line.end()
        elif data[at] in _FRAMES.replace(b"H", b""):
            break
        else:
            at += 1
    return headers, at


# Numbers ------------------------------------------------------------------------------------------


def _unsigned(data: bytes, at: int) -> tuple[int, int]:
    """A number of seven bits a byte, the lowest first, and where the next begins."""
    value = shift = 0
    while True:
        byte = data[at]
        at += 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value & _TURN - 1, at
        shift += 7
        if shift > 28:
            return 0, at


def _signed(data: bytes, at: int) -> tuple[int, int]:
    value, at = _unsigned(data, at)
    return value >> 1 ^ -(value & 1), at


_SIGNED = tuple(byte >> 1 ^ -(byte & 1) for byte in range(128))
_SIGNED_BYTES = bytes(value & 255 for value in _SIGNED) + bytes(128)


def _extended(value: int, bits: int) -> int:
    """The lowest bits of a number, of which the highest is the sign."""
    sign = 1 << bits - 1
    return (value & (sign << 1) - 1 ^ sign) - sign


def _many_signed(data: bytes, at: int, count: int) -> tuple[list[int], int]:
    """Signed numbers one behind the other; most have one byte, whose number is looked up."""
    part = data[at : at + count]
    if len(part) == count and part.isascii():  # one byte each
        return memoryview(part.translate(_SIGNED_BYTES)).cast("b").tolist(), at + count
    values = []
    for _ in range(count):
        byte = data[at]
        if byte < 128:
            at += 1
            values.append(_SIGNED[byte])
        else:
            value, at = _signed(data, at)
            values.append(value)
    return values, at


def _one(turned: Callable[[int], int]) -> Callable[[bytes, int, int], tuple[list[int], int]]:
    """One number, turned into what it stands for."""

    def read(data: bytes, at: int, count: int) -> tuple[list[int], int]:
        value, at = _unsigned(data, at)
        return [turned(value)], at

    return read


def _up_to_eight(data: bytes, at: int, count: int) -> tuple[list[int], int]:
    """A bit for each number that is not zero, then those."""
    if count == 1:
        return _many_signed(data, at, 1)
    given, values = data[at], []
    at += 1
    for k in range(count):
        value = 0
        if given >> k & 1:
            if (byte := data[at]) < 128:
                value, at = _SIGNED[byte], at + 1
            else:
                value, at = _signed(data, at)
        values.append(value)
    return values, at


def _four(data: bytes, at: int, count: int) -> tuple[list[int], int]:
    """Two bits for the width of each number (0, 4, 8, 16 bits), then these one behind the other."""
    widths = [(0, 4, 8, 16)[data[at] >> shift & 3] for shift in (0, 2, 4, 6)]
    size = -(-sum(widths) // 8)
    packed, left, values = int.from_bytes(data[at + 1 : at + 1 + size], "big"), 8 * size, []
    for width in widths:
        left -= width
        values.append(_extended(packed >> left, width) if width else 0)
    return values, at + 1 + size


def _three(layouts: tuple) -> Callable[[bytes, int, int], tuple[list[int], int]]:
    """Three numbers by the layout that the highest two bits choose: bytes, and shift and width of each number.

    The last choice gives each number whole bytes, from one to four, the lowest first.
    """

    def read(data: bytes, at: int, count: int) -> tuple[list[int], int]:
        lead = data[at]
        if lead >> 6 < 3:
            size, fields = layouts[lead >> 6]
            packed = int.from_bytes(data[at : at + size], "big")
            return [_extended(packed >> shift, width) for shift, width in fields], at + size
        values, at = [], at + 1
        for shift in (0, 2, 4):
            size = (lead >> shift & 3) + 1
            values.append(int.from_bytes(data[at : at + size], "little", signed=True))
            at += size
        return values, at

    return read


_ENCODINGS: dict[int, tuple[Callable, int]] = {
    0: (_many_signed, 1),
    1: (_one(lambda value: value), 1),
    3: (_one(lambda value: -_extended(value, 14)), 1),
    6: (_up_to_eight, 8),
    7: (_three(((1, ((4, 2), (2, 2), (0, 2))), (2, ((8, 4), (4, 4), (0, 4))), (3, ((16, 6), (8, 6), (0, 6))))), 3),
    8: (_four, 4),
    9: (lambda data, at, count: ([0], at), 1),
    10: (_three(((1, ((4, 2), (2, 2), (0, 2))), (2, ((9, 5), (4, 5), (0, 4))), (3, ((14, 8), (7, 7), (0, 7))))), 3),
}
"""To the number of an encoding its reader and how many fields it packs together (`_up_to_eight`: at most)."""
_EVENTS: dict[int, int] = {0: 1, 14: 2, 15: 1, 30: 2}
"""To an event how many unsigned numbers follow: beep, log resumed, disarmed, flight mode."""
_RESUMED, _ADJUSTED, _ENDED = 14, 13, 255


# Frames -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Predictions:
    """Which fields of a kind of frame are predicted how: by the frame before, the line through the two before, their
    mean, a value of the header, a count, or the first motor."""

    constant: tuple[int, ...]
    straight: tuple[int, ...]
    mean: tuple[int, ...]
    fixed: tuple[tuple[int, int], ...]
    counted: tuple[int, ...]
    as_read: tuple[int, ...]
    """By the first motor before it is predicted itself: fields in front of it."""
    motor: tuple[int, ...]
    all: tuple[int, ...]
    unknown: tuple[int, ...]

    @classmethod
    def of(cls, predictors: list[int], fixed: Mapping[int, int], motor: int) -> _Predictions:
        """By the numbers of the header; `motor` is the first motor's field."""

        def those(number: int) -> tuple[int, ...]:
            return tuple(k for k, predictor in enumerate(predictors) if predictor == number)

        return cls(
            constant=those(1),
            straight=those(2),
            mean=those(3),
            fixed=tuple((k, fixed[p]) for k, p in enumerate(predictors) if p in fixed),
            counted=those(6),
            as_read=tuple(k for k in those(5) if k < motor),
            motor=tuple(k for k in those(5) if k >= motor),
            all=tuple(k for k, predictor in enumerate(predictors) if predictor),
            unknown=tuple(p for p in predictors if p not in (0, 1, 2, 3, 5, 6, *fixed)),
        )


class _Frames:
    """Reads the frames of one session into `values`, a row of fields behind the other."""

    def __init__(self, headers: Mapping[str, str], data: bytes) -> None:
        self._data, self.values, self.damaged = data, array("q"), 0
        self.names = tuple(headers.get("Field I name", "").split(","))
        if not {"time", "loopIteration"} <= set(self.names):
            raise InputError("the header of the log is damaged: it does not name the fields loopIteration and time")
        if len(self.names) > _MOST_FIELDS:
            raise InputError(f"the header of the log is damaged: it names {len(self.names)} fields")
        self.time, self._iteration = self.names.index("time"), self.names.index("loopIteration")
        self._motor = self.names.index("motor[0]") if "motor[0]" in self.names else 0
        self._plans = {}
        for letter in _FRAMES.decode().replace("E", ""):
            encodings = _numbers_of(headers, f"Field {letter} encoding")
            if encodings or letter == "I":
                count = len(self.names) if letter in "IP" else len(encodings)
                self._plans[ord(letter)] = _plan(encodings, count, letter)
        self._predictors = {ord(k): _numbers_of(headers, f"Field {k} predictor") for k in "IP"}
        if any(len(self._predictors[k]) != len(self.names) for k in self._predictors if k in self._plans):
            raise InputError("the header of the log is damaged: its lists of fields have different lengths")
        first = {name: (_numbers_of(headers, name) or [default])[0]
                 for name, default in (("minthrottle", 1150), ("vbatref", 4095), ("motorOutput", 0))}  # fmt: skip
        self._fixed = {4: first["minthrottle"], 8: 1500, 9: first["vbatref"], 11: first["motorOutput"]}
        self._predictions = {k: _Predictions.of(own, self._fixed, self._motor) for k, own in self._predictors.items()}
        self._zero = [0] * len(self.names)
        self._key_every = max((_numbers_of(headers, "I interval") or [1])[0], 1)
        share = [int(n) for n in re.findall(r"\d+", headers.get("P interval", "1"))] or [1]
        self._of, self._every = (share[0], max(share[1], 1)) if len(share) > 1 else (1, max(share[0], 1))
        self._history: list[list[int]] = []
        self._last: tuple[int, int] | None = None
        """Iteration and time of the last main frame, or of the event that the log resumes."""

    def read(self, at: int) -> bool:
        """Read from a place on to the event of the end, or of the data; whether that event was there."""
        data, size, sound = self._data, len(self._data), False
        while at < size:
            letter, start = data[at], at
            if letter == ord("E"):
                if data.startswith(_END_OF_LOG, at + 2) and data[at + 1] == _ENDED:
                    return True
                after = self._event(at + 1)
            else:
                after = self._frame(letter, at + 1) if letter in self._plans else None
            if after is None or not self._begins(after) or after - start > _LONGEST_FRAME:
                # What is no frame is looked through byte by byte for the next one.
                self.damaged += sound or letter == ord("I")
                at, sound = start + 1, False
                continue
            if letter in b"IP":
                sound = self._take(letter, sound)
                self.damaged += not sound
            at = after
        return False

    def _begins(self, at: int) -> bool:
        return at == len(self._data) or (at < len(self._data) and self._data[at] in _FRAMES)

    def _frame(self, letter: int, at: int) -> int | None:
        """Where the frame that begins here ends, its numbers in `_now`; None where the data end in it."""
        self._now: list[int] = []
        try:
            for read, count in self._plans[letter]:
                values, at = read(self._data, at, count)
                self._now += values
        except IndexError:
            return None
        return at if at <= len(self._data) else None

    def _event(self, at: int) -> int | None:
        """Where an event ends; None where it is not known, or the data end in it."""
        data = self._data
        try:
            kind, at = data[at], at + 1
            if kind == _ADJUSTED:
                return at + 5 if data[at] & 128 else _signed(data, at + 1)[1]
            if kind not in _EVENTS:
                return None
            values = []
            for _ in range(_EVENTS[kind]):
                value, at = _unsigned(data, at)
                values.append(value)
        except IndexError:
            return None
        if kind == _RESUMED and self._begins(at):
            self._last = values[0], values[1]
        return at

    def _take(self, letter: int, sound: bool) -> bool:
        """Add the main frame just read; whether it, and what counts from it, can be relied on."""
        if letter == ord("P") and not sound:
            return False
        now = self._predicted(letter)
        at = now[self._iteration], now[self.time]
        follows = self._last is None or (
            0 <= at[0] - self._last[0] < _LARGEST_STEP and (at[1] - self._last[1]) % _TURN < _LARGEST_STEP_US
        )
        self._last = at  # a key frame after a true leap is not taken, the next one is
        if not follows:
            return False
        self._history = [now, now] if letter == ord("I") else [now, self._history[0]]
        self.values.extend(now)
        return True

    def _predicted(self, letter: int) -> list[int]:
        """The fields of a main frame: what was read and its predictions."""
        now, plan = self._now, self._predictions[letter]
        if plan.unknown:
            raise InputError(f"the header of the log is damaged: there is no predictor {plan.unknown[0]}")
        before, earlier = self._history if letter == ord("P") else (self._zero, self._zero)
        for k in plan.as_read:
            now[k] += now[self._motor]
        for k in plan.constant:
            now[k] += before[k]
        for k in plan.straight:
            now[k] += 2 * before[k] - earlier[k]
        for k in plan.mean:
            both = before[k] + earlier[k]
            now[k] += both + (both < 0) >> 1  # towards zero, as the firmware divides
        for k, value in plan.fixed:
            now[k] += value
        for k in plan.counted:
            now[k] = before[k] + 1 + self._left_out()
        for k in plan.motor:
            now[k] += now[self._motor]
        if max(now) >= _TURN // 2 or min(now) < -_TURN // 2:
            for k in plan.all:
                if not -_TURN // 2 <= now[k] < _TURN // 2:
                    now[k] = now[k] % _TURN if k == self.time else _extended(now[k], 32)
        now[self.time] %= _TURN
        return now

    def _left_out(self) -> int:
        """Iterations behind the last frame that the log leaves out by its rate."""
        following = self._history[0][self._iteration] + 1
        for count in range(self._key_every):
            if ((following + count) % self._key_every + self._of - 1) % self._every < self._of:
                return count
        return 0


def _plan(encodings: list[int], count: int, letter: str) -> list[tuple[Callable, int]]:
    """Readers of the fields of a kind of frame, each with the number of fields that it takes."""
    plan, k = [], 0
    while k < len(encodings):
        if encodings[k] not in _ENCODINGS:
            raise InputError(f"the header of the log is damaged: there is no encoding {encodings[k]}")
        read, takes = _ENCODINGS[encodings[k]]
        if encodings[k] == 6:
            takes = next((n for n in range(1, 8) if encodings[k + n : k + n + 1] != [6]), 8)
        while encodings[k] == 0 and encodings[k + takes : k + takes + 1] == [0]:
            takes += 1
        plan.append((read, takes))
        k += takes
    if k != count:
        raise InputError(f"the header of the log is damaged: the fields of frames {letter} are packed for {k} numbers")
    return plan


def _numbers_of(headers: Mapping[str, str], name: str) -> list[int]:
    """Whole numbers of a header's list; empty where it is not there or holds something else."""
    parts = headers.get(name, "").split(",")
    return [int(p) for p in parts] if all(re.fullmatch(r"-?\d{1,10}", p.strip()) for p in parts) else []


_EXPORTED_LINE = re.compile(rb'^"([^"\n]{1,80})","?([^"\n]*)"?\r?$', re.MULTILINE)
_LARGEST_HEADER = 65_536
_NO_SETTING = re.compile(
    r"Field .*|Product|Data version|[IP] interval|Log start.*|Craft name|Firmware.*|Board.*|P ratio"
)
"""Lines of a header that say how the log is laid out, or what flew: no settings."""


def _stated_parameters(path: Path) -> dict[str, str]:
    """The settings in the header of a blackbox's first session, or of its export, as text."""
    head = Path(path).read_bytes()[:_LARGEST_HEADER]
    out: dict[str, str] = {}
    for line in (_EXPORTED_LINE if head.startswith(b'"') else _HEADER_LINE).finditer(head):
        name, value = (part.decode("utf-8", "replace").strip() for part in line.groups())
        if name == "Product" and out:  # that of the next session
            break
        if not _NO_SETTING.fullmatch(name):
            out.setdefault(name, value)
    return out


IMPORTER = Importer(
    "betaflight",
    "Betaflight blackbox, and its export by Blackbox Explorer",
    _read,
    "every session, a broken-off one too: gyroscope, accelerometer, motors, `eRPM`, battery, by the header's units",
    starts=(_FIRST_LINE, b'"Product","Blackbox'),
    inside=(_FIRST_LINE,),
    template="five-inch",
)
