"""Header-less CSV of a Vicon room with a PX4 vehicle (A. Appius, ground-effect flights).

25 columns: time, position (m, Vicon, z up), velocity, roll, pitch, yaw (deg), body rates (rad/s), four rotor
speeds (rpm), four voltages, four currents. The axes follow from the data: the lateral accelerations are
−g·pitch along x and +g·roll along y, so attitude and rates are forward-right-down over x north, y east, and
only the height is turned over. Rotors in PX4's order. Each group of columns is held at its own slower rate.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.recordings import columns as c
from rotorid.recordings.importers.faults import (
    ImportFault,
    blank_held,
    cut,
    drop_repeated_times,
    fault_where,
    report_gaps,
    true_stretches,
)
from rotorid.recordings.importers.mapping import quaternion_from_euler_frd
from rotorid.recordings.importers.units import RPM

_COUNT = 25
_GROUND_MARGIN_M = 0.015
"""Height above the resting height from which the vehicle counts as in the air."""


def _read_matrix(path: Path) -> tuple[np.ndarray, list[ImportFault]]:
    """The numbers of a header-less CSV, shape (n, 25); the last row may be cut off."""
    try:
        lines = Path(path).read_text(encoding="utf-8-sig").splitlines()
    except FileNotFoundError:
        raise InputError(f"{path}: file is missing") from None
    rows, faults = [], []
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        cells = line.rstrip(",").split(",")
        last = number == len(lines)
        values = []
        for column, cell in enumerate(cells, start=1):
            try:
                values.append(float(cell))
            except ValueError:
                if not last:
                    where = f"{path}, line {number}, column {column}"
                    raise InputError(f"{where}: expected a number, found {cell!r}") from None
                values = []
                break
        if len(values) != _COUNT:
            if not last:
                raise InputError(f"{path}, line {number}: expected {_COUNT} columns, found {len(values)}")
            faults.append(ImportFault("cut_off", "", f"last line has {len(cells)} of {_COUNT} columns", "left out", 1))
            continue
        rows.append(values)
    if len(rows) < 2:
        raise InputError(f"{path}: expected at least two rows of {_COUNT} numbers")
    return np.array(rows), faults


def convert(matrix: np.ndarray) -> tuple[pd.DataFrame, list[ImportFault]]:
    """Contract columns of the flown part of a log, clock from zero at its start."""
    time, position, velocity = matrix[:, 0], matrix[:, 1:4], matrix[:, 4:7]
    roll, pitch, yaw = np.radians(matrix[:, 7:10]).T
    columns = {c.TIME: time}
    columns |= dict(zip(c.POSITION, (position * [1, 1, -1]).T, strict=True))
    columns |= dict(zip(c.VELOCITY, (velocity * [1, 1, -1]).T, strict=True))
    columns[c.HEIGHT] = position[:, 2]
    quaternion = quaternion_from_euler_frd(roll, pitch, yaw)
    columns |= dict(zip(c.QUATERNION, quaternion.T, strict=True))
    columns |= dict(zip(c.ANGULAR_VELOCITY, matrix[:, 10:13].T, strict=True))
    columns |= dict(zip(c.rotor_columns("rotor_speed", 4), (matrix[:, 13:17] * RPM).T, strict=True))
    columns[c.BATTERY_VOLTAGE] = matrix[:, 17:21].mean(axis=1)
    columns[c.BATTERY_CURRENT] = matrix[:, 21:25].sum(axis=1)
    table = pd.DataFrame(columns)
    unlocked = table[list(c.POSITION)].isna().any(axis=1)
    table.loc[unlocked, [*c.POSITION, *c.VELOCITY, c.HEIGHT]] = np.nan
    faults = fault_where(unlocked, "no_lock", ", ".join(c.POSITION), "motion capture not locked (nan)", "made empty")
    rotors = list(c.rotor_columns("rotor_speed", 4))
    unpowered = (table[c.BATTERY_VOLTAGE] == 0) & (table[rotors].abs().sum(axis=1) == 0)
    faults += fault_where(unpowered, "no_telemetry", c.BATTERY_VOLTAGE, "speed controllers report 0 V", "made empty")
    table.loc[unpowered, [c.BATTERY_VOLTAGE, c.BATTERY_CURRENT]] = np.nan
    table, repeated = drop_repeated_times(table)
    height = table[c.HEIGHT].to_numpy()
    resting = np.nanmedian(height[: max(10, int(np.argmax(table[rotors[0]].to_numpy() > 3000 * RPM)))])
    flying = (table[rotors].mean(axis=1) > 4000 * RPM).to_numpy() & (height > resting + _GROUND_MARGIN_M)
    stretches = true_stretches(flying, table[c.TIME].to_numpy(), 5.0)
    if not stretches:
        raise InputError("no stretch of 5 s in the air found (rotors above 4000 rpm and off the ground)")
    start, stop = max(stretches, key=lambda s: s[1] - s[0])
    before = len(table)
    table = cut(table, start + 1.0, stop)
    found = f"in the air from {start:.1f} to {stop:.1f} s"
    ground = ImportFault("on_ground", "", found, "rest, take-off and landing left out", before - len(table))
    faults += [*repeated, ground, *report_gaps(table)]
    groups = {
        "pose": [*c.POSITION, *c.VELOCITY, c.HEIGHT],
        "attitude": [*c.QUATERNION, *c.ANGULAR_VELOCITY],
        "rotor speed": rotors,
        "battery": [c.BATTERY_VOLTAGE, c.BATTERY_CURRENT],
    }
    table, held = blank_held(table, groups)
    return table, faults + held


def read_vicon_csv(path: Path) -> tuple[pd.DataFrame, list[ImportFault]]:
    """One flight in contract columns, and its faults."""
    matrix, faults = _read_matrix(path)
    try:
        table, more = convert(matrix)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return table, faults + more
