"""Steady points of the rotor tests: 50 of thrust and 20 of torque (thesis 3.5.3), from raw logs.

The reading at rest is taken off each test (the tare): before the motor starts, of a torque test also after.
Thrust comes from the tester alone. Torque comes from two instruments with their own clocks: the tester counts
revolutions, the wrench sensor feels the moment; both are averaged over the same stretch of the host's time, with
a margin larger than the clocks' difference.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.io.logs import Log, read_log

RPM = 2 * np.pi / 60
MARGIN_S = 0.6
COLUMNS = ("test", "throttle", "speed_rad_s", "speed_sd_rad_s", "value", "value_sd", "samples", "voltage_v")


def _good(log: Log) -> pd.DataFrame:
    return log.table[log.table["quality"] == 0]


def _running(table: pd.DataFrame, name: str) -> tuple[float, float]:
    """Host times between which the motor runs steadily, s."""
    on = table.loc[table["throttle"] > 0, "host_time_s"]
    if len(on) == 0 or on.iloc[-1] - on.iloc[0] <= 2 * MARGIN_S:
        raise InputError(f"{name}: the motor never ran for more than {2 * MARGIN_S} s")
    return float(on.iloc[0]), float(on.iloc[-1])


def thrust_points(paths: Iterable[str | Path]) -> pd.DataFrame:
    """One row a thrust test, columns `COLUMNS` (`value` in N)."""
    rows = []
    for path in paths:
        table = _good(read_log(path))
        start, stop = _running(table, str(path))
        steady = table[table["host_time_s"].between(start + MARGIN_S, stop - MARGIN_S / 3)]
        rest = table[table["host_time_s"] < start - 0.05]
        if len(rest) == 0:
            raise InputError(f"{path}: no sample before the motor started, so no tare")
        rows.append(_row(path, steady, steady["thrust_n"] - rest["thrust_n"].mean()))
    return pd.DataFrame(rows, columns=list(COLUMNS)).sort_values("throttle", ignore_index=True)


def torque_points(pairs: Iterable[tuple[str | Path, str | Path]]) -> pd.DataFrame:
    """One row a torque test, from (tester, wrench) logs; `value` in N m, positive."""
    rows = []
    for rotor_path, wrench_path in pairs:
        rotor, wrench = _good(read_log(rotor_path)), _good(read_log(wrench_path))
        start, stop = _running(rotor, str(rotor_path))
        steady = rotor[rotor["host_time_s"].between(start + MARGIN_S, stop - MARGIN_S)]
        loaded = wrench[wrench["host_time_s"].between(start + MARGIN_S, stop - MARGIN_S)]["moment_z_n_m"]
        before = wrench[wrench["host_time_s"] < start - 0.1]["moment_z_n_m"]
        after = wrench[wrench["host_time_s"] > stop + MARGIN_S]["moment_z_n_m"]
        if len(loaded) == 0 or len(before) == 0 or len(after) == 0:
            raise InputError(f"{wrench_path}: no samples while the rotor ran, or none at rest before or after")
        # The run lies in the middle between both rests, so that a steady drift of the zero drops out.
        turned = loaded - (before.mean() + after.mean()) / 2
        # The sign of the mean, not of each sample: that would turn noise into torque.
        rows.append(_row(rotor_path, steady, turned * np.sign(turned.mean())))
    return pd.DataFrame(rows, columns=list(COLUMNS)).sort_values("throttle", ignore_index=True)


def _row(path, steady: pd.DataFrame, value: pd.Series) -> dict:
    speed = steady["speed_rpm"] * RPM
    return {
        "test": Path(path).name.split(".")[0].removesuffix("-rotor"),
        "throttle": float(steady["throttle"].mean()),
        "speed_rad_s": float(speed.mean()),
        "speed_sd_rad_s": float(speed.std()),
        "value": float(value.mean()),
        "value_sd": float(value.std()),
        "samples": int(len(value)),
        "voltage_v": float(steady["battery_voltage_v"].mean()),
    }


def generated_points(
    coefficient: float, largest_speed_rad_s: float, tests: int, noise: float, rng: np.random.Generator
) -> pd.DataFrame:
    """Stand-in points where no logs are at hand: `coefficient` ω² with noise, up to the thesis's largest
    speed.

    Throttle 1, 2, … percent as in the thesis, speed growing with throttle to the power 0.669 (so that 0.5 and
    0.4 give the speeds of appendix A.1).
    """
    throttle = np.arange(1, tests + 1) / 100 * (50 / tests if tests == 50 else 2)
    speed = largest_speed_rad_s * (throttle / throttle[-1]) ** 0.669
    value = coefficient * speed**2 + rng.normal(0, noise, tests)
    table = pd.DataFrame({"throttle": throttle, "speed_rad_s": speed, "value": value})
    table["test"] = [f"generated-{i:02d}" for i in range(1, tests + 1)]
    table["speed_sd_rad_s"], table["value_sd"], table["samples"] = 1.0, noise, 1
    table["voltage_v"] = np.nan
    return table[list(COLUMNS)]
