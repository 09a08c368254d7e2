"""RCbenchmark 1520 thrust-stand exports: one motor and propeller, steady points of rising throttle.

Files come as UTF-8 with a byte-order mark, UTF-8 without or latin-1, with LF, CR LF or bare CR line ends.
"Motor Electrical Speed" holds mechanical revolutions per minute in these files (upstream divided by the pole
pairs already: it gives a plausible thrust coefficient). There is no torque.
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.recordings import columns as c
from rotorid.recordings.importers.clean import drop_repeated_times
from rotorid.recordings.importers.report import Fault
from rotorid.recordings.lost_speeds import lost_speed

GRAM_FORCE_N = 9.80665e-3
RPM = 2 * np.pi / 60
ESC_LOW_US, ESC_HIGH_US = 1000.0, 2000.0
HEADINGS = {
    "Time": "time",
    "ESC signal": "esc",
    "Thrust": "thrust",
    "Voltage": "voltage",
    "Current": "current",
    "Motor Electrical Speed": "rpm",
    "Motor Optical Speed": "optical",
}


def decode_text(data: bytes) -> tuple[str, list[Fault]]:
    """Text of an export whatever its encoding, with `\\n` line ends, and what had to be mended."""
    faults = []
    if data.startswith(b"\xef\xbb\xbf"):
        text = data.decode("utf-8-sig")
        faults.append(Fault("byte_order_mark", "", "file starts with a byte-order mark", "read as UTF-8", 0))
    else:
        try:
            text = data.decode("utf-8")
        except UnicodeDecodeError:
            text = data.decode("latin-1")
            faults.append(Fault("encoding", "", "file is not UTF-8", "read as latin-1", 0))
    if "\r" in text and "\n" not in text:
        faults.append(Fault("line_ends", "", "lines end with a bare carriage return", "read as line ends", 0))
    return text.replace("\r\n", "\n").replace("\r", "\n"), faults


def read_table(text: str, where: str) -> pd.DataFrame:
    """Numeric columns `time, esc, thrust, voltage, current, rpm` (and `optical` where there) of an export."""
    try:
        rows = [row for row in csv.reader(text.split("\n")) if any(cell.strip() for cell in row)]
    except csv.Error as error:
        raise InputError(f"{where}: cannot be read as a table ({error})") from None
    if len(rows) < 2:
        raise InputError(f"{where}: expected a heading and rows of numbers")
    places = {}
    for place, heading in enumerate(rows[0]):
        for start, name in HEADINGS.items():
            if heading.strip().startswith(start):
                places[name] = place
    for start, name in HEADINGS.items():
        if name not in places and name != "optical":
            raise InputError(f"{where}, line 1: no column whose heading starts with {start!r}")
    columns: dict[str, list[float]] = {name: [] for name in places}
    for line, row in enumerate(rows[1:], start=2):
        if len(row) != len(rows[0]):
            last = line == len(rows) and len(row) < len(rows[0])
            why = " (the file is cut off: delete its last line)" if last else ""
            raise InputError(f"{where}, line {line}: has {len(row)} cells, the heading has {len(rows[0])}{why}")
        for name, place in places.items():
            cell = row[place].strip()
            try:
                columns[name].append(float(cell) if cell else np.nan)
            except ValueError:
                heading = rows[0][place].strip()
                raise InputError(f"{where}, line {line}, column {heading}: expected a number, found {cell!r}") from None
    return pd.DataFrame(columns)


def convert(raw: pd.DataFrame) -> tuple[pd.DataFrame, list[Fault]]:
    """Contract columns of a stand with one rotor; measured values are kept as they were recorded.

    The thrust is a force along -z of the body, which the rotor passes on to the sensor.
    """
    faults = []
    thrust_n = raw["thrust"].to_numpy() * GRAM_FORCE_N
    speed = raw["rpm"].to_numpy() * RPM
    turning = speed > 0
    if turning.sum() >= 2 and np.corrcoef(speed[turning] ** 2, thrust_n[turning])[0, 1] < -0.5:
        faults.append(
            Fault(
                "flipped_sign",
                "force_z_n",
                "thrust falls as the rotor speed rises: the load cell's sign is flipped",
                "kept as recorded",
                int(len(raw)),
            )
        )
    silent = (speed == 0) & (np.abs(thrust_n) > 0) & (raw["esc"].to_numpy() > ESC_LOW_US)
    if silent.any():
        faults.append(
            Fault(
                "speed_missing",
                "rotor_speed_1_rad_s",
                f"speed 0 while the rotor gives thrust ({int(silent.sum())} rows)",
                "kept as recorded",
                int(silent.sum()),
            )
        )
    slow = lost_speed(speed, np.abs(thrust_n))
    if slow.any():
        found = f"speed far too low for its thrust ({int(slow.sum())} rows): pulses lost"
        faults.append(Fault("speed_lost", "rotor_speed_1_rad_s", found, "kept as recorded", int(slow.sum())))
    negative = (thrust_n < 0) & ~turning
    if negative.any():
        faults.append(
            Fault(
                "tare",
                "force_z_n",
                f"thrust {thrust_n[negative].min():.4f} N with the rotor at rest",
                "kept as recorded",
                int(negative.sum()),
            )
        )
    if "optical" in raw and (raw["optical"] > 0).any():
        faults.append(
            Fault(
                "second_sensor",
                "",
                "an optical speed is recorded too",
                "left out",
                int((raw["optical"] > 0).sum()),
            )
        )
    table = pd.DataFrame(
        {
            c.TIME: raw["time"],
            "throttle_1": (raw["esc"] - ESC_LOW_US) / (ESC_HIGH_US - ESC_LOW_US),
            "rotor_speed_1_rad_s": speed,
            "force_z_n": -thrust_n,
            c.BATTERY_VOLTAGE: raw["voltage"],
            c.BATTERY_CURRENT: raw["current"],
        }
    )
    table, repeated = drop_repeated_times(table)
    return table, faults + repeated


def read_rcbenchmark(path: Path) -> tuple[pd.DataFrame, list[Fault]]:
    """One stand run in contract columns, and its faults."""
    try:
        data = Path(path).read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: file is missing") from None
    text, faults = decode_text(data)
    table, more = convert(read_table(text, str(path)))
    return table, faults + more
