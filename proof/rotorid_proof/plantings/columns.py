"""Columns of a recorded set that plantings change, and whether a set has them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd

from rotorid.recordings import RecordingSet, Run
from rotorid.recordings import columns as c
from rotorid.recordings.signal import kernels

SENSORS = {
    "gyroscope": c.ANGULAR_VELOCITY,
    "accelerometer": c.SPECIFIC_FORCE,
    "velocity": c.VELOCITY,
    "position": c.POSITION,
    "attitude": c.QUATERNION,
}
DRIVERS = {"rotors": "rotor_speed", "commands": "rotor_command", "throttle": "throttle"}
SLOW_HZ = 10.0
"""Rotor speeds read less often determine no moment: a vehicle's attitude is corrected several times a second."""
EVEN = 0.35
"""Largest departure of a clock's step from the median step, as a share of it, for columns that are moved in time."""


def names_of(recordings: RecordingSet, sensor: str) -> tuple[str, ...]:
    """Columns of a sensor, of the rotors' measured speeds, of commands or of throttles."""
    if sensor in DRIVERS:
        return c.rotor_columns(DRIVERS[sensor], recordings.vehicle.rotor_count)
    return SENSORS[sensor]


def has(recordings: RecordingSet, *sensors: str) -> bool:
    """Whether every run has every column of the sensors."""
    return all(run.has(*names_of(recordings, sensor)) for sensor in sensors for run in recordings.runs)


def dense(recordings: RecordingSet, sensor: str) -> bool:
    """Whether a sensor has a reading in nearly every sample of an evenly sampled table."""
    if not has(recordings, sensor):
        return False
    names = names_of(recordings, sensor)
    return all(
        np.isfinite(run.array(names)).all(axis=1).mean() > 0.95
        and np.quantile(np.abs(np.diff(run.time_s) / np.median(np.diff(run.time_s)) - 1.0), 0.98) < EVEN
        for run in recordings.runs
    )


def slow_rotors(recordings: RecordingSet) -> str:
    """Why what rotors do within a second is not known, empty where it is."""
    for driver in DRIVERS:
        if has(recordings, driver):
            names = names_of(recordings, driver)
            rate = min(np.isfinite(r.array(names)).all(axis=1).sum() / np.ptp(r.time_s) for r in recordings.runs)
            return f"rotor speeds are read {rate:.0f} times a second" if rate < SLOW_HZ else ""
    return ""


def command_of(recordings: RecordingSet) -> str | None:
    """What drives the rotors in the tables: `commands`, else `throttle`, else nothing."""
    return next((s for s in ("commands", "throttle") if has(recordings, s)), None)


def changed(
    recordings: RecordingSet, names: tuple[str, ...], change: Callable[[Run, np.ndarray], np.ndarray]
) -> RecordingSet:
    """The set with `change(run, values)`, values (n, m) to (n, m), in place of the named columns."""
    runs = []
    for run in recordings.runs:
        values = change(run, run.array(names).copy())
        new = pd.DataFrame(values, columns=list(names), index=run.table.index)
        runs.append(Run(run.name, run.table.assign(**{n: new[n] for n in names})))
    return replace(recordings, runs=tuple(runs))


def of_sensor(recordings: RecordingSet, sensor: str, change: Callable[[Run, np.ndarray], np.ndarray]) -> RecordingSet:
    """The set with one sensor's columns changed."""
    return changed(recordings, names_of(recordings, sensor), change)


def scaled(recordings: RecordingSet, sensor: str, factor: float | np.ndarray) -> RecordingSet:
    """The set with a sensor's columns times a factor, or each times its own."""
    return of_sensor(recordings, sensor, lambda run, values: values * factor)


def with_vehicle(recordings: RecordingSet, **update) -> RecordingSet:
    """The set with other values believed of its vehicle."""
    return replace(recordings, vehicle=recordings.vehicle.model_copy(update=update))


def signed(rng: np.random.Generator) -> float:
    """Plus or minus one."""
    return float(rng.choice([-1.0, 1.0]))


def direction(rng: np.random.Generator, dimensions: int) -> np.ndarray:
    """A random direction, shape (dimensions,), none of whose entries is next to nothing."""
    while True:
        vector = rng.normal(size=dimensions)
        vector /= np.linalg.norm(vector)
        if np.abs(vector).min() > 0.25:
            return vector


SMOOTH_CUTOFF_HZ = 40.0
"""Cutoff of the low-pass of `smooth`, where the recording's rate allows it."""


def smooth(run: Run, values: np.ndarray, slope: bool = False) -> np.ndarray:
    """Columns (n, m) low-passed, or the derivative of that (1/s); the ends, which the filter does not reach, held."""
    t = run.time_s
    rate_hz = 1.0 / float(np.median(np.diff(t)))
    cutoff = min(SMOOTH_CUTOFF_HZ, 0.2 * rate_hz)
    kernel = (kernels.derivative if slope else kernels.low_pass)(rate_hz, cutoff)
    half = kernels.half_length(rate_hz, cutoff)
    filled = np.stack([np.interp(t, t[good := np.isfinite(v)], v[good]) for v in values.T], axis=1)
    return np.pad(kernels.apply(kernel, filled), ((half, half), (0, 0)), mode="edge")
