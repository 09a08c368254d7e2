"""Crazyflie on a scale (IMRCLab): CSV of PWM, battery, four rotor speeds and the thrust of the whole vehicle.

Two layouts: `pwm,vbat[V],rpm1..4,thrust[g]` with steady points in random order, and
`weight[g],pwm,vbat[V],rpm1..4,v[V],i[A],p[W]` as a sweep. Neither has a clock: rows are counted as seconds.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.recordings import columns as c
from rotorid.recordings.importers.report import Fault
from rotorid.recordings.tables import place, read_csv

GRAM_FORCE_N = 9.80665e-3
RPM = 2 * np.pi / 60
FULL_SCALE = 65536.0
SPEEDS = ("rpm1", "rpm2", "rpm3", "rpm4")


def read_imrc_bench(path: Path) -> tuple[pd.DataFrame, list[Fault]]:
    """One bench run in contract columns (kind stand, thrust along -z), and its faults."""
    raw = read_csv(Path(path))
    thrust = next((name for name in ("thrust[g]", "weight[g]") if name in raw), None)
    missing = [name for name in ("pwm", "vbat[V]", *SPEEDS) if name not in raw]
    if thrust is None or missing:
        raise InputError(f"{path}, line 1: expected the column {missing[0] if missing else 'thrust[g]'}")
    for name in ("pwm", "vbat[V]", *SPEEDS, thrust):
        if raw[name].isna().any():
            row = int(np.flatnonzero(raw[name].isna())[0])
            raise InputError(f"{path}, {place(path, row)}, column {name}: is empty, expected a number")
    columns = {c.TIME: np.arange(len(raw), dtype=float)}
    throttle = raw["pwm"].to_numpy(float) / FULL_SCALE
    columns |= {name: throttle for name in c.rotor_columns("throttle", 4)}
    for name, column in zip(SPEEDS, c.rotor_columns("rotor_speed", 4), strict=True):
        columns[column] = raw[name].to_numpy(float) * RPM
    columns["force_z_n"] = -raw[thrust].to_numpy(float) * GRAM_FORCE_N
    columns[c.BATTERY_VOLTAGE] = raw["vbat[V]"].to_numpy(float)
    if "i[A]" in raw:
        columns[c.BATTERY_CURRENT] = raw["i[A]"].to_numpy(float)
    table = pd.DataFrame(columns)
    faults = [Fault("no_clock", c.TIME, "rows have no time", "rows counted as seconds", len(table))]
    for column in c.rotor_columns("rotor_speed", 4):
        lost = (table[column] == 0) & (throttle > 0.3)
        if lost.any():
            found = f"speed reads 0 in {int(lost.sum())} rows while the motor is driven"
            faults.append(Fault("speed_dropout", column, found, "kept as recorded", int(lost.sum())))
    return table, faults
