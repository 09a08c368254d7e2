r"""Crazyflie flights from decoded uSD logs (`crazyflie_usd`): columns, frames and the part in the air.

The firmware's frames: body forward-left-up, world z up (north-west-up), quaternion body to world. Rotors:
1 front right (ccw), 2 rear right (cw), 3 rear left (ccw), 4 front left (cw); the joint regression of the
recorded moments on the squared speeds confirms this order. Gyroscopes log degrees per second, accelerometers
multiples of 9.81 m/s², motors fractions of 65,536.

A state is read in each form that the firmware logs (`FORMS`), the first that is there. Roll, pitch and yaw are of its
old body frame, in which pitch is positive nose up and so the contract's; the same sign is on the compressed pitch rate.
Sources: crazyflie-firmware `stabilizer.c` (log groups, `compressState`), `stabilizer_types.h`, `kalman_core.c`,
`quatcompress.h`.

A CSV whose columns have the firmware's names (the client's, or one of cflib's) is read by the same names.

Crazyflie uSD-deck logs: binary files of timed events (firmware `usddeck`, format versions 1 and 2).

Layout, little-endian throughout::

    u8 0xBC | u16 version | u16 number of event types
    per event type: u16 id | name\0 | u16 number of variables | per variable: "name(type)\0"
    per event: u16 id | u32 time in ms (version 1) or u64 time in µs (version 2) | its variables packed
    u32 CRC-32 of everything before it

Types are the characters of Python's `struct`: f float, e half a float, B H I unsigned, b h i signed integers.
Source: bitcraze/crazyflie-firmware, `usddeck.c` and `tools/usdlog/cfusdlog.py` (the format, none of its code).
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from pathlib import Path
from zlib import crc32

import numpy as np
import pandas as pd
import scipy

from rotorid.errors import InputError
from rotorid.io.text.files import check_file
from rotorid.recordings import columns as c
from rotorid.recordings.importers.contract import Imported, Importer, text_of
from rotorid.recordings.importers.faults import (
    ImportFault,
    airborne,
    blank_held,
    cut,
    cut_off,
    drop_repeated_times,
    in_order,
    join_rows,
    report_gaps,
    stretches_of,
    true_stretches,
    without_wild,
)
from rotorid.recordings.importers.guessing import guess
from rotorid.recordings.importers.known import Known
from rotorid.recordings.importers.mapping import (
    RPM,
    UNITS,
    continuous,
    half_turn_about_x,
    quaternion_from_euler_frd,
    quaternion_to_frd_ned,
    read_columns,
)
from rotorid.recordings.tables import numbers

_MAGIC = 0xBC
_CHECKSUM = 4
"""Bytes of it at the end of a log."""
_CLOCK_TURN = 2.0**32
"""Milliseconds after which the clock of version 1 begins anew."""
_TIME, _EVENT = "time_s", "fixedFrequency"
TYPES = {"e": "<f2", "f": "<f4", "d": "<f8", "b": "i1", "B": "u1", "h": "<i2", "H": "<u2", "i": "<i4", "I": "<u4"}
TYPES |= {"q": "<i8", "Q": "<u8"}
_STANDARD_GRAVITY_M_S2 = 9.81
"""The firmware's g: accelerometer logs are in multiples of this."""
_ROTORS = range(1, 5)
_SPEEDS = list(c.rotor_columns("rotor_speed", 4))
THROTTLES = list(c.rotor_columns("throttle", 4))


def _decompressed(code: np.ndarray) -> np.ndarray:
    """Quaternions (n, 4), scalar first, of the firmware's 32 bits: which of x, y, z, w is the largest, and the other
    three with a sign and nine bits each."""
    code = np.asarray(code).ravel().astype(np.int64)
    largest = code >> 30
    xyzw, rest = np.zeros((len(code), 4)), code.copy()
    for k in (3, 2, 1, 0):
        held = largest != k
        size = (rest & 511) / 511 * np.sqrt(0.5)
        xyzw[:, k] = np.where(held, np.where(rest & 512, -size, size), 0.0)
        rest = np.where(held, rest >> 10, rest)
    xyzw[np.arange(len(code)), largest] = np.sqrt(np.clip(1 - (xyzw**2).sum(axis=1), 0, None))
    return xyzw[:, [3, 0, 1, 2]]


def _of_old_angles(degrees: np.ndarray) -> np.ndarray:
    """Quaternions of roll, pitch and yaw (n, 3), deg: pitch is positive nose up, yaw counter-clockwise."""
    return quaternion_from_euler_frd(*np.radians(degrees * np.array([1.0, 1.0, -1.0])).T)


def _names(group: str, names: str) -> tuple[str, ...]:
    return tuple(f"{group}.{name}" for name in names.split())


FORMS: dict[tuple[str, ...], tuple[tuple[tuple[str, ...], Callable[[np.ndarray], np.ndarray]], ...]] = {
    c.POSITION: (
        (_names("stateEstimate", "x y z"), half_turn_about_x),
        (_names("stateEstimateZ", "x y z"), lambda v: half_turn_about_x(v / 1000)),
        (_names("kalman", "stateX stateY stateZ"), half_turn_about_x),
    ),
    c.VELOCITY: (
        (_names("stateEstimate", "vx vy vz"), half_turn_about_x),
        (_names("stateEstimateZ", "vx vy vz"), lambda v: half_turn_about_x(v / 1000)),
    ),
    c.QUATERNION: (
        (_names("stateEstimate", "qw qx qy qz"), quaternion_to_frd_ned),
        (_names("kalman", "q0 q1 q2 q3"), quaternion_to_frd_ned),
        (_names("stateEstimateZ", "quat"), lambda v: quaternion_to_frd_ned(_decompressed(v))),
        (_names("stateEstimate", "roll pitch yaw"), _of_old_angles),
        (_names("stabilizer", "roll pitch yaw"), _of_old_angles),
    ),
    c.ANGULAR_VELOCITY: (
        (_names("gyro", "x y z"), lambda v: half_turn_about_x(np.radians(v))),
        (_names("stateEstimateZ", "rateRoll ratePitch rateYaw"), lambda v: v / 1000 * np.array([1.0, 1.0, -1.0])),
    ),
    c.SPECIFIC_FORCE: ((_names("acc", "x y z"), lambda v: half_turn_about_x(v) * _STANDARD_GRAVITY_M_S2),),
}
"""Names of the firmware's variables, in the order in which they are preferred, and how they become the contract's."""
BODY_VELOCITY = _names("kalman", "statePX statePY statePZ")


def _is_log(path: Path, head: bytes) -> bool:
    """Whether a file's first bytes are those of a uSD log (its mark, a version, kinds of events and a name), or of a
    table with the firmware's names of its motors and of a state or sensor."""
    if len(head) >= 8 and head[0] == _MAGIC:
        version, count = struct.unpack_from("<HH", head, 1)
        name = head[7:].split(b"\0")[0]
        return 0 < version < 256 and 0 < count < 256 and name.isascii() and name.decode("latin-1").isprintable()
    heading = next(iter(text_of(head).splitlines()), "")
    names = {name.strip(' "') for name in re.split("[,;\t]", heading)}
    stated = any(set(own) <= names for forms in FORMS.values() for own, _ in forms)
    return stated and any({pattern.format(i) for i in _ROTORS} <= names for pattern in ("motor.m{}", "pwm.m{}_pwm"))


def _read_table(path: Path) -> tuple[dict[str, pd.DataFrame], list[ImportFault]]:
    """A table with the firmware's names as the one event of a log; InputError where its clock is not clear."""
    table = read_columns(path)
    found = guess(table)
    clock = found.mapping.channels["time"]
    if "time" in found.open:
        raise InputError(f"{path}: the clock: {found.open['time']}; call its column time_s, time_ms or time_us")
    (name,) = clock.columns
    known = [n for n in table if n == name or "." in n and pd.api.types.is_numeric_dtype(table[n])]
    raw, late = in_order(numbers(table[known], path), name)
    raw = join_rows(raw, name).rename(columns={name: _TIME})
    return {_EVENT: raw.assign(**{_TIME: raw[_TIME] * UNITS["time"][clock.unit]})}, late


def attitude_without_pitch(
    specific_force_world_g: np.ndarray, roll_rad: np.ndarray, yaw_rad: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Attitude and specific force of a log that holds roll and yaw but no pitch (FLU, z up).

    Takes the pitch that leaves no specific force along body x, which is right as far as the thrust is along
    body z and air drag is small. Returns quaternions (n, 4), scalar first, and body specific force (n, 3) in
    g; its x component is zero by construction and so no measurement.
    """
    level = scipy.spatial.transform.Rotation.from_euler("Z", yaw_rad[:, None]).inv().apply(specific_force_world_g)
    pitch = np.arctan2(level[:, 0], level[:, 2])
    attitude = scipy.spatial.transform.Rotation.from_euler("ZYX", np.column_stack([yaw_rad, pitch, roll_rad]))
    return attitude.as_quat()[:, [3, 0, 1, 2]], attitude.inv().apply(specific_force_world_g)


def convert(log: pd.DataFrame) -> tuple[pd.DataFrame, list[ImportFault]]:
    """Contract columns of the table `fixedFrequency` of a uSD log, the whole log with its own clock."""
    full_scale = 65536.0
    columns: dict[str, np.ndarray] = {c.TIME: log["time_s"].to_numpy(float)}
    faults: list[ImportFault] = []

    def put(names, values):
        columns.update(zip(names, values.T, strict=True))

    for names, forms in FORMS.items():
        for own, turned in forms:
            if set(own) <= set(log.columns):
                put(names, turned(log[list(own)].to_numpy(float)))
                break
    if not set(c.VELOCITY) & set(columns) and set(BODY_VELOCITY) <= set(log.columns) and c.QUATERNION[0] in columns:
        xyzw = np.column_stack([columns[n] for n in c.QUATERNION])[:, [1, 2, 3, 0]]
        turn = scipy.spatial.transform.Rotation.from_quat(xyzw)
        put(c.VELOCITY, turn.apply(half_turn_about_x(log[list(BODY_VELOCITY)].to_numpy(float))))
    names = _names("stateEstimate", "ax ay az roll yaw")
    if c.QUATERNION[0] not in columns and set(names) <= set(log.columns):
        estimate, (roll, yaw) = log[list(names[:3])].to_numpy(float), np.radians(log[list(names[3:])].to_numpy(float)).T
        quaternion, force_g = attitude_without_pitch(estimate + [0, 0, 1], roll, yaw)
        put(c.QUATERNION, continuous(quaternion_to_frd_ned(quaternion)))
        if c.SPECIFIC_FORCE[0] not in columns:
            put(c.SPECIFIC_FORCE[1:], (half_turn_about_x(force_g) * _STANDARD_GRAVITY_M_S2)[:, 1:])
        done = "taken from the direction of the estimated acceleration; specific force along x left out"
        faults.append(ImportFault("no_pitch", ", ".join(c.QUATERNION), "pitch is not recorded", done, len(log)))
    output = [f"pwm.m{i}_pwm" for i in _ROTORS]
    request = [f"motor.m{i}" for i in _ROTORS]
    drive = output if set(output) <= set(log.columns) else request
    if set(drive) <= set(log.columns):
        put(THROTTLES, log[drive].to_numpy(float) / full_scale)
        if drive is output and set(request) <= set(log.columns):
            put([f"thrust_request_{i}" for i in _ROTORS], log[request].to_numpy(float) / full_scale)
    speeds = [f"rpm.m{i}" for i in _ROTORS]
    if set(speeds) <= set(log.columns):
        put(_SPEEDS, log[speeds].to_numpy(float) * RPM)
    for name, a_volt in (("pm.vbatMV", 1000), ("pm.vbat", 1)):
        if name in log and c.BATTERY_VOLTAGE not in columns:
            columns[c.BATTERY_VOLTAGE] = (log[name].where(log[name] > 0) / a_volt).to_numpy(float)
    table, repeated = drop_repeated_times(pd.DataFrame(columns))
    table, wild = without_wild(table)
    return table, faults + repeated + wild


def in_the_air(table: pd.DataFrame, shortest_s: float = 4.0) -> list[tuple[float, float]]:
    """Start and stop of every flight in a log: motors above 30 % and, where known, 0.1 m off the ground.

    The public recordings are cut so, with a second at each end, wherever a log begins or ends.
    """
    flying = table[THROTTLES].mean(axis=1).to_numpy() > 0.3
    if "position_z_m" in table:
        flying &= -table["position_z_m"].to_numpy() > 0.1
    time = table[c.TIME].to_numpy()
    return [(a + 1.0, b - 1.0) for a, b in true_stretches(flying, time, shortest_s)]


def _flown_stretches(table: pd.DataFrame) -> list[tuple[float, float]]:
    """Start and stop of every flight of a log by the detector of all importers, take-off and landing left out."""
    height = {c.HEIGHT: -table["position_z_m"]} if "position_z_m" in table else {}
    flying, _ = airborne(table.assign(**height))
    return stretches_of(table[c.TIME].to_numpy(float), flying)


def _sensor_faults(table: pd.DataFrame) -> list[ImportFault]:
    """Faults of rotor-speed sensors and a battery reading that never moves; values stay as recorded."""
    faults = []
    for name, throttle in zip(_SPEEDS, THROTTLES, strict=True):
        if name not in table:
            continue
        lost = (table[name] == 0) & (table[throttle] > 0.1)
        if lost.mean() > 0.001:
            found = f"speed reads 0 in {lost.mean():.1%} of the samples while the motor is driven"
            faults.append(ImportFault("speed_dropout", name, found, "kept as recorded", int(lost.sum())))
    if c.BATTERY_VOLTAGE in table and table[c.BATTERY_VOLTAGE].nunique() == 1:
        found = f"reads {table[c.BATTERY_VOLTAGE].iloc[0]:g} V throughout: not measured"
        faults.append(ImportFault("stuck", c.BATTERY_VOLTAGE, found, "column left out", len(table)))
    return faults


def flight_run(table: pd.DataFrame, start_s: float, stop_s: float) -> tuple[pd.DataFrame, list[ImportFault]]:
    """One flight of a converted log: cut, held samples emptied, sensor faults flagged."""
    run = cut(table, start_s, stop_s)
    if len(run) < 2:
        raise InputError(f"no samples from {start_s:g} to {stop_s:g} s")
    faults = _sensor_faults(run)
    if any(f.kind == "stuck" for f in faults):
        run = run.drop(columns=c.BATTERY_VOLTAGE)
    gaps = report_gaps(run)
    groups = {"state estimate": [*c.POSITION, *c.VELOCITY, *c.QUATERNION], "battery voltage": [c.BATTERY_VOLTAGE]}
    if c.ANGULAR_VELOCITY[0] not in run:  # roll and yaw then come with every sample
        groups["state estimate"] = [*c.POSITION, *c.VELOCITY]
    run, held = blank_held(run, groups)
    return run, faults + gaps + held


def flights(
    path: Path,
    prefix: str | None = None,
    stretches: list[tuple[float, float]] | None = None,
    detect: Callable[[pd.DataFrame], list[tuple[float, float]]] = _flown_stretches,
) -> tuple[dict[str, pd.DataFrame], list[ImportFault]]:
    """Every flight of a uSD log by name (`prefix`, default the file's), and the faults of log and flights.

    `stretches` (start and stop, s) in place of what `detect` finds to be in the air. InputError where the log holds no
    event `fixedFrequency` or the vehicle never flies.
    """
    path = Path(path)
    prefix = prefix or path.name.split(".")[0]
    with open(path, "rb") as file:
        binary = file.read(1) == bytes([_MAGIC])  # no text that can be read begins so
    tables, faults = read_usd_log(path) if binary else _read_table(path)
    if _EVENT not in tables:
        raise InputError(f"{path}: no event {_EVENT} in this log, found {', '.join(tables) or 'none'}")
    table, more = convert(tables[_EVENT])
    missing = [name for name in THROTTLES if name not in table]
    if missing and not stretches:
        raise InputError(f"{path}: motor.m1 to motor.m4 are not logged, so that nothing shows when the vehicle flies")
    stretches = stretches or detect(table)
    if not stretches:
        raise InputError(f"{path}: the vehicle never flies for 4 s in this log")
    runs: dict[str, pd.DataFrame] = {}
    faults = [*faults, *more]
    for number, (start, stop) in enumerate(stretches):
        run, found = flight_run(table, start, stop)
        label = prefix if len(stretches) == 1 else f"{prefix}_{number + 1}"
        kept = f"flight from {start:.2f} to {stop:.2f} s of the log"
        flown = ImportFault("cut", c.TIME, kept, "the rest left out")
        runs[label] = run
        faults += [f.in_run(label) for f in (flown, *found)]
    return runs, faults


def _text(data: bytes, start: int, where: str) -> tuple[str, int]:
    end = data.find(b"\0", start)
    if end < 0:
        raise InputError(f"{where}, byte {start}: header is cut off inside a name")
    return data[start:end].decode("latin-1"), end + 1


def _event_types(data: bytes, where: str) -> tuple[dict[int, tuple[str, np.dtype]], int, int]:
    """Kinds of events by id (name, and layout with `__id` and `__clock` first), format version, offset of the first."""
    if len(data) < 9 or data[0] != _MAGIC:
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
            types[identifier] = name, np.dtype(fields)
    except struct.error:
        raise InputError(f"{where}: header is cut off after {offset} bytes") from None
    return types, version, offset


def decode_usd_log(data: bytes, where: str = "log") -> tuple[dict[str, pd.DataFrame], list[ImportFault]]:
    """Tables of a uSD log by event name, each with `time_s` (device clock) first, in file order.

    A wrong checksum, an unknown event or a cut-off tail is reported as a Fault and everything before it
    is kept; a file that is no uSD log raises InputError.
    """
    types, version, offset = _event_types(data, where)
    whole = crc32(data[:-_CHECKSUM]) == struct.unpack("<I", data[-_CHECKSUM:])[0]
    end = len(data) - _CHECKSUM * whole  # of a log that is cut off the last bytes are no checksum
    offsets: dict[int, list[int]] = {identifier: [] for identifier in types}
    unknown, inside = None, ""
    while offset + 2 <= end:
        identifier = data[offset] | data[offset + 1] << 8
        if identifier not in types:
            unknown = identifier
            break
        name, layout = types[identifier]
        if offset + layout.itemsize > end:
            inside = name
            break
        offsets[identifier].append(offset)
        offset += layout.itemsize
    raw = np.frombuffer(data, np.uint8)
    scale = 1e-6 if version == 2 else 1e-3
    tables = {}
    for identifier, (name, layout) in types.items():
        starts = np.asarray(offsets[identifier], int)
        rows = raw[starts[:, None] + np.arange(layout.itemsize)].copy().view(layout)[:, 0]
        clock = rows["__clock"].astype(float)
        turns = np.cumsum(np.diff(clock, prepend=clock[:1]) < -0.5 * _CLOCK_TURN) if version == 1 else 0
        columns = {_TIME: (clock + _CLOCK_TURN * turns) * scale}
        tables[name] = pd.DataFrame(columns | {n: rows[n].astype(float) for n in layout.names[2:]})
    return tables, _faults_of_end(data, offset, whole, unknown, inside)


def _faults_of_end(data: bytes, offset: int, whole: bool, unknown: int | None, inside: str) -> list[ImportFault]:
    """What is wrong with a log whose events end at an offset: with an event that is not known, or inside one."""
    rest, faults = len(data) - offset, []
    checked = rest == _CHECKSUM  # exactly a checksum follows, right or wrong
    if rest <= _CHECKSUM:
        unknown = None  # bytes of a checksum are no event
    if unknown is not None:
        found = f"event id {unknown} at byte {offset} is not in the header"
        faults.append(ImportFault("unknown_event", "", found, f"{rest - _CHECKSUM} bytes after it left out", 1))
    if not whole and (checked or unknown is not None):
        stored = struct.unpack("<I", data[-_CHECKSUM:])[0]
        found = f"CRC-32 is {crc32(data[:-_CHECKSUM]):08x}, file says {stored:08x}"
        faults.insert(0, ImportFault("checksum", "", found, "kept; bytes may be damaged", 1))
    elif inside or not (whole or unknown is not None):
        found = f"the file ends inside an event ({inside})" if inside else "the file ends without its checksum"
        faults.append(cut_off(found, 1))
    return faults


def read_usd_log(path: Path) -> tuple[dict[str, pd.DataFrame], list[ImportFault]]:
    """Read a uSD log file; see `decode_usd_log`."""
    check_file(path)
    return decode_usd_log(path.read_bytes(), str(path))


def _read(path: Path) -> Imported:
    runs, faults = flights(path)
    axes = "body forward-left-up and world z up, turned by half a turn about x into FRD and NED"
    return Imported(runs, faults, axes, Known("crazyflie"), speed_unit="rpm")


IMPORTER = Importer(
    "crazyflie",
    "Crazyflie log (uSD, or CSV of its client)",
    _read,
    "`fixedFrequency`: gyroscope, accelerometer, estimate (quaternion, compressed, or roll, pitch, yaw), PWM, rpm; the "
    "part in the air",
    recognises=_is_log,
    known_by="first bytes, or names of the columns",
    template="crazyflie-2.1",
    by_mapping=True,
)
