"""Steady points of the rotor tests: 50 of thrust and 20 of torque (thesis 3.5.3), from tables of samples.

The reading at rest is taken off each test (the tare): before the motor starts, of a torque test also after.
Thrust comes from the tester alone. Torque comes from two instruments with their own clocks: the tester counts
revolutions, the wrench sensor feels the moment. The host's time shows which of its samples are of the motor's run; all
margins are in each device's own time, which also holds for an emulator that runs faster than life.

Tables are those of `rotorid.io.tables`: all samples of one instrument, and one row a recording.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.identify.stand.clocks import device_time
from rotorid.io.tables import by_recording

RPM = 2 * np.pi / 60
_MARGIN_S = 0.6
COLUMNS = (
    *("test", "throttle", "speed_rad_s", "speed_sd_rad_s"),
    *("value", "value_sd", "samples", "rest_samples", "voltage_v"),
)
"""`rest_samples`: of how many samples the mean would be as uncertain as the tare is."""


def _running(table: pd.DataFrame, name: str) -> pd.DataFrame:
    """First and last sample with the motor on."""
    on = table[table["throttle"] > 0]
    if len(on) == 0 or on["time_s"].iloc[-1] - on["time_s"].iloc[0] <= 2 * _MARGIN_S:
        raise InputError(f"{name}: the motor never ran for more than {2 * _MARGIN_S} s")
    return on.iloc[[0, -1]]


def thrust_points(samples: pd.DataFrame, recordings: pd.DataFrame) -> pd.DataFrame:
    """One row a thrust test, columns `COLUMNS` (`value` in N), by throttle.

    Raises InputError for a test whose motor never ran or that has no reading at rest.
    """
    tables = by_recording(samples[samples["quality"] == 0])
    rows = []
    for name in recordings["id"]:
        table = tables[name]
        start, stop = _running(table, name)["time_s"]
        steady = table[table["time_s"].between(start + _MARGIN_S, stop - _MARGIN_S / 3)]
        rest = table[table["time_s"] < start - 0.05]
        if len(rest) == 0:
            raise InputError(f"{name}: no sample before the motor started, so no tare")
        rows.append(_row(name, steady, steady["thrust_n"] - rest["thrust_n"].mean(), len(rest)))
    return _sorted(rows)


def torque_points(rotor: tuple[pd.DataFrame, pd.DataFrame], wrench: tuple[pd.DataFrame, pd.DataFrame]) -> pd.DataFrame:
    """One row a torque test, by throttle; `value` in N m, positive.

    `rotor` and `wrench` are (samples, recordings) of the tester and of the wrench sensor; recordings of one group are
    one test. Raises InputError for a tester's recording without the sensor's, and as `thrust_points`.
    """
    counted, felt = (by_recording(samples[samples["quality"] == 0]) for samples, _ in (rotor, wrench))
    sensors = {row.group: row for row in wrench[1].itertuples()}
    rows = []
    for drive in rotor[1].itertuples():
        if drive.group not in sensors:
            raise InputError(
                f"{drive.id}: a torque test without a recording of the wrench sensor (group {drive.group})"
            )
        read = sensors[drive.group]
        table, reading = counted[drive.id], felt[read.id]
        ends = _running(table, drive.id)
        start, stop = ends["time_s"]
        steady = table[table["time_s"].between(start + _MARGIN_S, stop - _MARGIN_S)]
        # Each recording's times count from its own beginning.
        seen = reading["host_time_s"] + (read.host_start_s - drive.host_start_s)
        start, stop = device_time(reading["time_s"], seen, ends["host_time_s"])
        when = reading["time_s"]
        loaded = reading.loc[when.between(start + _MARGIN_S, stop - _MARGIN_S), "moment_z_n_m"]
        before = reading.loc[when < start - 0.1, "moment_z_n_m"]
        after = reading.loc[when > stop + _MARGIN_S, "moment_z_n_m"]
        if len(loaded) == 0 or len(before) == 0 or len(after) == 0:
            raise InputError(f"{read.id}: no samples while the rotor ran, or none at rest before or after")
        # The run lies in the middle between both rests, so that a steady drift of the zero drops out.
        turned = loaded - (before.mean() + after.mean()) / 2
        # The sign of the mean, not of each sample: that would turn noise into torque.
        resting = 4 / (1 / len(before) + 1 / len(after))
        rows.append(_row(drive.group, steady, turned * np.sign(turned.mean()), resting))
    return _sorted(rows)


def _sorted(rows: list[dict]) -> pd.DataFrame:
    return pd.DataFrame(rows, columns=list(COLUMNS)).sort_values("throttle", ignore_index=True, kind="stable")


def _row(test: str, steady: pd.DataFrame, value: pd.Series, rest_samples: float) -> dict:
    speed = steady["speed_rpm"] * RPM
    return {
        "test": test,
        "throttle": float(steady["throttle"].mean()),
        "speed_rad_s": float(speed.mean()),
        "speed_sd_rad_s": float(speed.std()),
        "value": float(value.mean()),
        "value_sd": float(value.std()),
        "samples": int(len(value)),
        "rest_samples": float(rest_samples),
        "voltage_v": float(steady["battery_voltage_v"].mean()),
    }
