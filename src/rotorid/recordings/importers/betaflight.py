"""What the fields of blackbox logs of Betaflight, iNAV and EmuFlight mean by the header of their session.

Betaflight's body axes are forward-left-up (a positive pitch rate lowers the nose, a positive yaw rate turns left, and
the accelerometer reads +1 g along z at rest): half a turn about x makes them forward-right-down. Units by the log's own
header: `gyro_scale` (deg/s) and `blackbox_high_resolution` (tenths of it), `acc_1G`, `motorOutput` (range of the
motors' commands) and `features` (3D), `motor_poles`; `eRPM` in hundreds of electrical turns a minute; voltage and
current by the version. Its logs hold no velocity; an attitude only since `imuQuaternion` is logged.

EmuFlight's logs are Betaflight's, with the battery's voltage in the unit of its `vbatcellvoltage`. iNAV's have the
same body axes, rates in deg/s, motors in µs, an attitude (tenths of a degree; a positive pitch lowers the nose), and
position and velocity (cm, cm/s; north, east, up).

Sources: Betaflight, iNAV and EmuFlight `src/main/blackbox/blackbox.c`, Betaflight `src/main/drivers/dshot.c` and
`src/main/flight/mixer_init.c`, iNAV `src/main/flight/imu.c`, Blackbox Explorer `flightlog_fields_presenter.js`.
"""

from __future__ import annotations

import csv
import io
import re
import struct
from array import array
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.recordings import columns as c
from rotorid.recordings.importers.blackbox import HEADER_LINE, BlackboxSession, sessions
from rotorid.recordings.importers.contract import Imported, Importer
from rotorid.recordings.importers.faults import ImportFault, airborne, flights, moving_on, report_gaps
from rotorid.recordings.importers.known import Known
from rotorid.recordings.importers.mapping import G, continuous, from_angles, half_turn_about_x, quaternion_to_frd_ned

_FIRST_LINE = b"H Product:Blackbox"
_OTHER_NAMES = {"gyroADC": ("gyroData", "gyroUnfilt"), "accSmooth": ("accADC",), "eRPM": ("eRPM(/100)",)}
"""To a field its names in other releases, and what holds the same before a filter."""
_FEWER_MOTORS = {1: "a fixed wing", 2: "a bicopter or a fixed wing", 3: "a tricopter, whose tail rotor a servo tilts"}
"""What Betaflight's mixers make of fewer motors than four."""
_COUNTS: dict[str, dict[str, tuple[tuple[tuple[int, int], int], ...]]] = {
    "betaflight": {"vbatLatest": (((4, 0), 100), ((3, 1), 10)), "amperageLatest": (((3, 1), 100),)},
    "inav": {"vbatLatest": (((2, 0), 100),), "amperageLatest": (((2, 0), 100),)},
    "emuflight": {"amperageLatest": (((0, 0), 100),)},
}
"""To a firmware since which version so many counts of a field are 1 V or 1 A; Betaflight's before that counts steps of
the converter."""


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
            faults.append(ImportFault("no_flight", c.TIME, f"session {number}: {reasons[-1]}", "left out"))
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
    if "rotorflight" in firmware.lower():
        raise InputError(
            f"{path}: a blackbox log of a helicopter ({firmware}), whose main rotor's blades are turned to steer; only "
            "multirotors of fixed rotors can be imported"
        )
    if _firmware(headers) is None:
        raise InputError(
            f"{path}: a blackbox log of {firmware or 'an unknown firmware'}; only the axes and units of Betaflight, "
            "iNAV and EmuFlight are known, turn it into CSV (blackbox_decode), then `rotorid import FILE.csv`"
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
    firmware = _firmware(headers)
    if firmware == "inav":
        raw = raw.rename(columns={"vbat": "vbatLatest", "amperage": "amperageLatest"})
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
        faults.append(ImportFault("missing", ", ".join(c.SPECIFIC_FORCE), found, "no specific force"))
    attitude = fields("imuQuaternion", 3)
    if attitude is not None:
        xyz = attitude / quaternion_scale
        w = np.sqrt(np.clip(1 - np.sum(xyz**2, axis=1), 0, None))
        table[list(c.QUATERNION)] = quaternion_to_frd_ned(np.column_stack([w, xyz]))
    if firmware == "inav":
        table = table.assign(**_navigation(raw))
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
            faults.append(ImportFault("unit", "rotor_speed", found, f"taken as {default_poles}"))
        speeds = np.where(np.isnan(throttle), np.nan, turns * 100 / (poles / 2) * 2 * np.pi / 60)
        for column, own in zip(c.rotor_columns("rotor_speed", turns.shape[1]), speeds.T, strict=True):
            if np.nanmax(own, initial=0.0) > 0:
                table[column] = own
            else:
                found = "its eRPM is not logged, or 0 throughout"
                faults.append(ImportFault("speed_missing", column, found, "column left out"))
    battery, more = _battery(raw, headers)
    faults += more
    table = table.assign(**battery)
    faults += report_gaps(table)
    runs, cuts = flights(table, airborne(table)[0], name, where)
    return runs, [*faults, *cuts]


def _firmware(headers: Mapping[str, str]) -> str | None:
    """The firmware that wrote a log, of those whose axes and units are known."""
    stated = headers.get("Firmware revision", headers.get("Firmware type", "")).lower()
    return next((name for name in _COUNTS if name in stated), None)


def _navigation(raw: pd.DataFrame) -> dict[str, np.ndarray]:
    """Attitude, position and velocity as iNAV's estimator has them, in contract columns; NaN where it does not trust
    them by `navFlags` (1: height, 4: place)."""
    out: dict[str, np.ndarray] = {}
    if {f"attitude[{k}]" for k in range(3)} <= set(raw):
        angles = np.radians(raw[[f"attitude[{k}]" for k in range(3)]].to_numpy(float) / 10)
        xyzw = from_angles(angles * [1, -1, 1], "euler").as_quat()  # a positive pitch lowers the nose
        out |= dict(zip(c.QUATERNION, continuous(xyzw[:, [3, 0, 1, 2]]).T, strict=True))
    for field, names in (("navPos", c.POSITION), ("navVel", c.VELOCITY)):
        for k, bit, unit_m in ((0, 4, 0.01), (1, 4, 0.01), (2, 1, -0.01)):
            if {f"{field}[{k}]", "navFlags"} <= set(raw) and (trusted := (raw["navFlags"].astype(int) & bit) > 0).any():
                out[names[k]] = np.where(trusted, raw[f"{field}[{k}]"] * unit_m, np.nan)
    return out


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
            faults.append(ImportFault("unknown_name", base, found, "left out"))
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
        faults.append(ImportFault("unit", "throttle", found, f"no and full throttle taken as {low:g} and {high:g}"))
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
    converter_step_mv = 3300 / 4095
    version, firmware = _version(headers), _firmware(headers)
    found, faults = {}, []
    for field, column in (("vbatLatest", c.BATTERY_VOLTAGE), ("amperageLatest", c.BATTERY_CURRENT)):
        if field not in raw or not raw[field].max() > 0:
            continue
        values = raw[field].to_numpy(float)
        values = np.where(values > 0, values, np.nan) if field == "vbatLatest" else values
        counts = next((n for first, n in _COUNTS.get(firmware, {}).get(field, ()) if version >= first), None)
        if firmware == "emuflight" and field == "vbatLatest":  # in the unit of the voltages of a cell
            counts = {2: 10, 3: 100}.get(len(headers.get("vbatcellvoltage", "").rpartition(",")[2].strip()))
        raw_counts = firmware == "betaflight" and version
        offset, per_ampere = _pair(headers, "currentMeter") or _pair(headers, "currentSensor") or (0.0, 0.0)
        if counts is not None:
            found[column] = values / counts
        elif raw_counts and field == "vbatLatest" and (scale := _number(headers, "vbatscale", 0)) > 0:
            found[column] = values * converter_step_mv * scale * 1e-4  # the divider in tenths, mV
        elif raw_counts and field == "amperageLatest" and per_ampere > 0:
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
    for line in (_EXPORTED_LINE if head.startswith(b'"') else HEADER_LINE).finditer(head):
        name, value = (part.decode("utf-8", "replace").strip() for part in line.groups())
        if name == "Product" and out:  # that of the next session
            break
        if not _NO_SETTING.fullmatch(name):
            out.setdefault(name, value)
    return out


IMPORTER = Importer(
    "betaflight",
    "blackbox of Betaflight, iNAV and EmuFlight, and its export by Blackbox Explorer",
    _read,
    "every session, a broken-off one too: gyroscope, accelerometer, motors, `eRPM`, battery, by the units of the "
    "header; iNAV's attitude, position and velocity where it trusts them",
    starts=(_FIRST_LINE, b'"Product","Blackbox'),
    inside=(_FIRST_LINE,),
    template="five-inch",
)
