"""Betaflight blackbox logs through orangebox.

Betaflight's body axes are forward-left-up (a positive pitch rate lowers the nose, a positive yaw rate turns left, and
the accelerometer reads +1 g along z at rest): half a turn about x makes them forward-right-down. Units by the log's own
header: `gyro_scale` (deg/s), `acc_1G`, `motorOutput` (range of the motors' commands), `motor_poles`; `eRPM` in hundreds
of electrical turns a minute; voltage and current in hundredths since version 4.0. Blackbox logs hold no velocity; an
attitude only since `imuQuaternion` is logged.

Sources: Betaflight `src/main/blackbox/blackbox.c`, Blackbox Explorer `js/flightlog.js` and
`flightlog_fields_presenter.js`.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.io.text.wording import printable
from rotorid.recordings import columns as c
from rotorid.recordings.importers import in_the_air
from rotorid.recordings.importers.clean import report_gaps
from rotorid.recordings.importers.frames import half_turn_about_x, quaternion_to_frd_ned
from rotorid.recordings.importers.optional import needs
from rotorid.recordings.importers.report import Fault

GRAVITY_M_S2 = 9.80665
DEFAULT_POLES = 14
QUATERNION_SCALE = 32767.0
"""`imuQuaternion` holds x, y and z of the unit quaternion times this; w is what is missing to length 1."""
FIRST_IN_HUNDREDTHS = (4, 0)
"""Version since which voltage and current are logged in hundredths of a volt and an ampere."""


def read_betaflight(path: Path) -> tuple[dict[str, pd.DataFrame], list[Fault]]:
    """Every flight of every log in a blackbox file by name, in contract columns, and what was found.

    InputError where the file is of another firmware, cannot be read, or holds no flight.
    """
    orangebox = needs("orangebox", "betaflight", path)
    try:
        first = orangebox.Parser.load(str(path), 1)
        count = first.reader.log_count
        logs = [first, *(orangebox.Parser.load(str(path), number) for number in range(2, count + 1))]
    except MemoryError:
        raise
    except Exception as error:  # orangebox has errors of its own and lets others through
        raise InputError(f"{path}: not a blackbox log that can be read ({printable(error)[:150]})") from None
    runs: dict[str, pd.DataFrame] = {}
    faults: list[Fault] = []
    reason = InputError(f"{path}: holds no log")
    for number, log in enumerate(logs, 1):
        name = path.name.split(".")[0] + (f"_{number}" if len(logs) > 1 else "")
        try:
            found, more = _flights(log, name, path)
        except InputError as error:
            reason = error
            continue
        runs |= found
        faults += more
    if not runs:
        raise reason
    return runs, faults


def _flights(log, name: str, path: Path) -> tuple[dict[str, pd.DataFrame], list[Fault]]:
    headers = log.headers
    firmware = f"{headers.get('Firmware revision', headers.get('Firmware type', ''))}"
    if "betaflight" not in firmware.lower():
        raise InputError(
            f"{path}: a blackbox log of {firmware or 'an unknown firmware'}; only Betaflight's axes and units are "
            "known, turn it into CSV (blackbox_decode), then `rotorid import FILE.csv`"
        )
    try:
        rows = [frame.data for frame in log.frames()]
    except MemoryError:
        raise
    except Exception as error:  # a damaged frame may be anything to orangebox
        raise InputError(f"{path}: not a blackbox log that can be read ({printable(error)[:150]})") from None
    if len(rows) < 2:
        raise InputError(f"{path}: holds {len(rows)} samples")
    # Flags are words or nothing; every sensor is decoded to numbers.
    raw = pd.DataFrame(rows, columns=log.field_names[: len(rows[0])]).select_dtypes("number")
    return convert(raw, headers, name, path)


def convert(
    raw: pd.DataFrame, headers: Mapping[str, object], name: str, where: object
) -> tuple[dict[str, pd.DataFrame], list[Fault]]:
    """Flights in contract columns of the main frames of one log (`time` in µs) and its header."""
    if "time" not in raw:
        raise InputError(f"{where}: the log has no field time")
    faults: list[Fault] = []
    time = raw["time"].to_numpy(float) * 1e-6
    keep = np.isfinite(time) & in_the_air.increasing(np.nan_to_num(time, nan=-np.inf))
    if not keep.all():
        found = f"{int((~keep).sum())} frames do not move the clock on"
        faults.append(Fault("repeated_time", c.TIME, found, "left out", int((~keep).sum())))
    raw, time = raw[keep].reset_index(drop=True), time[keep]
    table = pd.DataFrame({c.TIME: time - time[0]})

    def fields(base: str, count: int) -> np.ndarray | None:
        names = [f"{base}[{i}]" for i in range(count)]
        return raw[names].to_numpy(float) if set(names) <= set(raw) else None

    gyro = fields("gyroADC", 3)
    if gyro is not None:
        scale = _float_of(headers.get("gyro_scale"), 1.0)
        table[list(c.ANGULAR_VELOCITY)] = half_turn_about_x(np.radians(gyro * scale))
    else:
        faults.append(Fault("missing", ", ".join(c.ANGULAR_VELOCITY), "gyroADC is not logged", "no body rates", 0))
    acceleration = fields("accSmooth", 3)
    one_g = float(headers.get("acc_1G", 0) or 0)
    if acceleration is not None and one_g > 0:
        table[list(c.SPECIFIC_FORCE)] = half_turn_about_x(acceleration / one_g * GRAVITY_M_S2)
    else:
        found = "accSmooth is not logged" if acceleration is None else "the header does not state acc_1G"
        faults.append(Fault("missing", ", ".join(c.SPECIFIC_FORCE), found, "no specific force", 0))
    attitude = fields("imuQuaternion", 3)
    if attitude is not None:
        xyz = attitude / QUATERNION_SCALE
        w = np.sqrt(np.clip(1 - np.sum(xyz**2, axis=1), 0, None))
        table[list(c.QUATERNION)] = quaternion_to_frd_ned(np.column_stack([w, xyz]))
    throttle, more = _throttles(raw, headers)
    faults += more
    if throttle is None:
        raise InputError(f"{where}: motor[0] to motor[3] are not logged, so that nothing shows when the vehicle flies")
    table[list(c.rotor_columns("throttle", throttle.shape[1]))] = throttle
    turns = fields("eRPM", throttle.shape[1])
    if turns is not None and np.nanmax(turns) > 0:
        poles = float(headers.get("motor_poles", DEFAULT_POLES) or DEFAULT_POLES)
        if "motor_poles" not in headers:
            found = "the header does not state motor_poles"
            faults.append(Fault("unit", "rotor_speed", found, f"taken as {DEFAULT_POLES}", 0))
        speeds = turns * 100 / (poles / 2) * 2 * np.pi / 60
        table[list(c.rotor_columns("rotor_speed", turns.shape[1]))] = speeds
    for field, column in (("vbatLatest", c.BATTERY_VOLTAGE), ("amperageLatest", c.BATTERY_CURRENT)):
        if field in raw and _version(headers) >= FIRST_IN_HUNDREDTHS and raw[field].max() > 0:
            table[column] = raw[field].to_numpy(float) / 100
    faults += report_gaps(table)
    runs, cuts = in_the_air.flights(table, in_the_air.airborne(table)[0], name, where)
    return runs, [*faults, *cuts]


def _throttles(raw: pd.DataFrame, headers: Mapping[str, object]) -> tuple[np.ndarray | None, list[Fault]]:
    """Commands of the motors as fractions (n, k), None where fewer than four are logged."""
    names = [n for i in range(8) if (n := f"motor[{i}]") in raw]
    if len(names) < 4:
        return None, []
    stated = headers.get("motorOutput")
    faults = []
    if isinstance(stated, list) and len(stated) == 2 and float(stated[1]) > float(stated[0]):
        low, high = map(float, stated)
    else:
        low, high = float(headers.get("minthrottle", 1000)), float(headers.get("maxthrottle", 2000))
        found = "the header does not state motorOutput"
        faults.append(Fault("unit", "throttle", found, f"no and full throttle taken as {low:g} and {high:g}", 0))
    return np.clip((raw[names].to_numpy(float) - low) / (high - low), 0, 1), faults


def _float_of(value: object, otherwise: float) -> float:
    """A number of a header: plain, or the bits of a 32-bit float in hexadecimal (`0x3f800000` is 1)."""
    if isinstance(value, str) and value.lower().startswith("0x"):
        return struct.unpack("<f", struct.pack("<I", int(value, 16)))[0]
    if isinstance(value, int) and value > 1_000_000:  # a reader that took the hexadecimal for a whole number
        return struct.unpack("<f", struct.pack("<I", value))[0]
    return float(value) if isinstance(value, int | float) else otherwise


def _version(headers: Mapping[str, object]) -> tuple[int, ...]:
    """Betaflight's version, `(4, 4)`; empty where the header does not state it."""
    words = str(headers.get("Firmware revision", "")).split()
    parts = words[1].split(".") if len(words) > 1 else []
    return tuple(int(p) for p in parts[:2] if p.isdigit())
