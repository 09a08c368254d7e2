"""RCbenchmark thrust-stand exports (1520, 1580, 1585): one motor and propeller, steady points of rising throttle.

Files come as UTF-8 with a byte-order mark, UTF-8 without or latin-1, with LF, CR LF or bare CR line ends. The program
writes each quantity in the unit that its user has chosen and names it in the heading: "Thrust (kgf)".
"Motor Electrical Speed" holds mechanical revolutions (the program divided by the pole pairs already: it gives a
plausible thrust coefficient). The 1520 has no torque.
"""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.io.text.files import check_file
from rotorid.recordings import columns as c
from rotorid.recordings.importers.contract import Imported, Importer, text_of
from rotorid.recordings.importers.faults import ImportFault, drop_repeated_times, fault_where
from rotorid.recordings.importers.mapping import UNITS, bracketed, converted, unit_of
from rotorid.recordings.mended import lost_speed

HEADINGS: dict[str, tuple[str, str, str]] = {
    "Time": ("time", "time", "s"),
    "ESC signal": ("esc", "share", "us"),
    "Thrust": ("thrust", "force", "gf"),
    "Torque": ("torque", "torque", "N.m"),
    "Voltage": ("voltage", "voltage", "V"),
    "Current": ("current", "current", "A"),
    "Motor Electrical Speed": ("speed", "rotor", "rpm"),
    "Motor Optical Speed": ("optical", "rotor", "rpm"),
}
"""To a heading the column here, the kind of its unit, and the unit where the heading names none."""
_HEADING = re.compile(r"ESC signal ?[(,](.*[,;])?\s*\"?Motor (Electrical|Optical) Speed ?[(,\r\n]", re.DOTALL)
"""Headings of RCbenchmark's stands of one rotor; those of other stands are read by a mapping."""
_NOT_ALWAYS = ("torque", "speed", "optical")


def decode_text(data: bytes) -> tuple[str, list[ImportFault]]:
    """Text of an export whatever its encoding, with `\\n` line ends, and what had to be mended."""
    faults = []
    if data.startswith(b"\xef\xbb\xbf"):
        text = data.decode("utf-8-sig")
        faults.append(ImportFault("byte_order_mark", "", "file starts with a byte-order mark", "read as UTF-8"))
    else:
        try:
            text = data.decode("utf-8")
        except UnicodeDecodeError:
            text = data.decode("latin-1")
            faults.append(ImportFault("encoding", "", "file is not UTF-8", "read as latin-1"))
    if "\r" in text and "\n" not in text:
        faults.append(ImportFault("line_ends", "", "lines end with a bare carriage return", "read as line ends"))
    return text.replace("\r\n", "\n").replace("\r", "\n"), faults


def _read_table(text: str, where: str) -> tuple[pd.DataFrame, list[ImportFault]]:
    """Columns of an export in SI units by the names of `HEADINGS`, and what was found.

    `time` s, `esc` from 0 to 1, `thrust` N, `torque` N m, `voltage` V, `current` A, `speed` and `optical` rad/s.
    """
    esc_low_us, esc_high_us = 1000.0, 2000.0
    try:
        rows = [row for row in csv.reader(text.split("\n")) if any(cell.strip() for cell in row)]
    except csv.Error as error:
        raise InputError(f"{where}: cannot be read as a table ({error})") from None
    if len(rows) < 2:
        raise InputError(f"{where}: expected a heading and rows of numbers")
    places, faults = _places(rows[0], where)
    if len(rows) > 2 and len(rows[-1]) < len(rows[0]):
        found = f"line {len(rows)} is cut off after {len(rows[-1])} of {len(rows[0])} cells"
        faults.append(ImportFault("cut_off", c.TIME, found, "left out", 1))
        rows.pop()
    columns: dict[str, list[float]] = {name: [] for name in places}
    for line, row in enumerate(rows[1:], start=2):
        if len(row) != len(rows[0]):
            raise InputError(f"{where}, line {line}: has {len(row)} cells, the heading has {len(rows[0])}")
        for name, (place, _, _) in places.items():
            cell = row[place].strip()
            try:
                columns[name].append(float(cell) if cell else np.nan)
            except ValueError:
                heading = rows[0][place].strip()
                raise InputError(f"{where}, line {line}, column {heading}: expected a number, found {cell!r}") from None
    read = {name: converted(np.array(columns[name]), kind, unit) for name, (_, kind, unit) in places.items()}
    if places["esc"][2] == "us":
        read["esc"] = (read["esc"] - esc_low_us) / (esc_high_us - esc_low_us)
    return pd.DataFrame(read), faults


def _places(headings: list[str], where: str) -> tuple[dict[str, tuple[int, str, str]], list[ImportFault]]:
    """To a column here its place in the file, its kind and its unit; InputError names a heading that is not there."""
    places, faults = {}, []
    for place, heading in enumerate(headings):
        title, text = bracketed(heading)
        known = next((start for start in HEADINGS if start.lower() == title.lower()), None)
        if known is None:
            continue
        name, kind, usual = HEADINGS[known]
        unit = unit_of(text, kind) if text else usual
        if not unit:
            raise InputError(
                f"{where}, line 1, column {heading.strip()}: no known unit of a {title.lower()}, expected one of "
                f"{', '.join(UNITS[kind])}"
            )
        if not text:
            faults.append(ImportFault("unit", "", f"the heading {title!r} names no unit", f"taken as {usual}"))
        places[name] = place, kind, unit
    for title, (name, _, _) in HEADINGS.items():
        if name not in (*places, *_NOT_ALWAYS):
            raise InputError(f"{where}, line 1: no column whose heading starts with {title!r}")
    if not {"speed", "optical"} & set(places):
        raise InputError(f"{where}, line 1: no column whose heading starts with 'Motor Electrical Speed'")
    return places, faults


def _convert(raw: pd.DataFrame) -> tuple[pd.DataFrame, list[ImportFault]]:
    """Contract columns of a stand with one rotor of what `_read_table` gives; measured values are kept as recorded.

    The thrust is a force along -z of the body, which the rotor passes on to the sensor. The torque is positive while
    the rotor turns; `logfile.signed_by_spin` gives it the sign of its rotor.
    """
    faults, kept = [], "kept as recorded"
    thrust_n = raw["thrust"].to_numpy()
    optical = raw["optical"].to_numpy() if "optical" in raw else np.zeros(len(raw))
    electrical = raw["speed"].to_numpy() if "speed" in raw else np.zeros(len(raw))
    speed = electrical if (electrical > 0).any() or not (optical > 0).any() else optical
    turning = speed > 0
    if turning.sum() >= 2 and np.corrcoef(speed[turning] ** 2, thrust_n[turning])[0, 1] < -0.5:
        found = "thrust falls as the rotor speed rises: the load cell's sign is flipped"
        faults.append(ImportFault("flipped_sign", "force_z_n", found, kept, len(raw)))
    silent = (speed == 0) & (np.abs(thrust_n) > 0) & (raw["esc"].to_numpy() > 0)
    found = f"speed 0 while the rotor gives thrust ({int(silent.sum())} rows)"
    faults += fault_where(silent, "speed_missing", "rotor_speed_1_rad_s", found, kept)
    slow = lost_speed(speed, np.abs(thrust_n))
    found = f"speed far too low for its thrust ({int(slow.sum())} rows): pulses lost"
    faults += fault_where(slow, "speed_lost", "rotor_speed_1_rad_s", found, kept)
    negative = (thrust_n < 0) & ~turning
    found = f"thrust {thrust_n[negative].min(initial=0.0):.4f} N with the rotor at rest"
    faults += fault_where(negative, "tare", "force_z_n", found, kept)
    if (electrical > 0).any():
        faults += fault_where(optical > 0, "second_sensor", "", "an optical speed is recorded too", "left out")
    table = pd.DataFrame(
        {
            c.TIME: raw["time"],
            "throttle_1": raw["esc"],
            "rotor_speed_1_rad_s": speed,
            "force_z_n": -thrust_n,
            c.BATTERY_VOLTAGE: raw["voltage"],
            c.BATTERY_CURRENT: raw["current"],
        }
    )
    if "torque" in raw and raw["torque"].notna().any():
        torque = raw["torque"].to_numpy()
        table[c.MOMENT[2]] = torque * (-1.0 if np.nansum(torque * speed) < 0 else 1.0)
    table, repeated = drop_repeated_times(table)
    return table, faults + repeated


def read_rcbenchmark(path: Path) -> tuple[pd.DataFrame, list[ImportFault]]:
    """One stand run in contract columns, and its faults."""
    check_file(path)
    text, faults = decode_text(path.read_bytes())
    raw, more = _read_table(text, str(path))
    table, converted_ = _convert(raw)
    return table, [*faults, *more, *converted_]


def _read(path: Path) -> Imported:
    table, faults = read_rcbenchmark(path)
    name = path.name.removesuffix(".gz").rsplit(".", 1)[0]
    return Imported({name: table}, faults, "thrust along -z of the body", kind="stand", unsigned_torque=True)


def _is_export(path: Path, head: bytes) -> bool:
    text = text_of(head)
    return "Thrust" in text and _HEADING.search(text) is not None


IMPORTER = Importer(
    "rcbenchmark",
    "RCbenchmark CSV (1520, 1580, 1585)",
    _read,
    "throttle, thrust, torque, speed, voltage, current, each in the unit that its heading names",
    recognises=_is_export,
    known_by="heading",
)
