"""The columns of a run on one even grid, nothing derived and nothing dropped but voltages that no battery has."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from rotorid.mismatch.decide.findings import Finding
from rotorid.mismatch.evidence.motion import (
    LONGEST_BRIDGED_SAMPLES,
    continuous,
    fresh_samples,
    own_rate_hz,
    rotation_matrices,
)
from rotorid.recordings import RecordingSet, Run, Vehicle
from rotorid.recordings import columns as c

COMMANDED = ("commands", "throttle")
"""Sensors that are what was asked of the rotors, not what was measured."""
P_LIMIT = 1e-9
"""p-value below which the readings of a sensor show a mistake by themselves."""


def sensor_columns(vehicle: Vehicle) -> dict[str, tuple[str, ...]]:
    """Sensor to its columns. One sensor is one clock."""
    count = vehicle.rotor_count
    driven = {
        "rotors": c.rotor_columns("rotor_speed", count),
        "commands": c.rotor_columns("rotor_command", count),
        "throttle": c.rotor_columns("throttle", count),
    }
    if vehicle.kind != "flight":
        return {**driven, "force": c.FORCE, "moment": c.MOMENT}
    return {
        **driven,
        "gyroscope": c.ANGULAR_VELOCITY,
        "accelerometer": c.SPECIFIC_FORCE,
        "attitude": c.QUATERNION,
        "velocity": c.VELOCITY,
        "position": c.POSITION,
    }


SENSOR_WORDS = {
    "rotors": "the rotor speeds",
    "commands": "the commands",
    "throttle": "the throttle",
    "gyroscope": "the gyroscope",
    "accelerometer": "the accelerometer",
    "attitude": "the attitude",
    "velocity": "the velocity",
    "position": "the position",
}


def channel_of(column: str, vehicle: Vehicle) -> str:
    """The verdict's channel in which a column's samples are compared; the column itself where none is."""
    sensor = next((s for s, names in sensor_columns(vehicle).items() if column in names), None)
    if sensor == "rotors":
        return column.removesuffix("_rad_s")
    if sensor in ("force", "moment"):
        return column.removesuffix("_n_m").removesuffix("_n")
    if sensor == "accelerometer":
        return "force_" + "xyz"[c.SPECIFIC_FORCE.index(column)]
    if sensor == "gyroscope":
        return "angular_velocity"
    return sensor if sensor in ("attitude", "velocity", "position") else column


@dataclass(frozen=True)
class Signals:
    """Sensors of one run on an even grid; a sensor that the run lacks is not in `values`."""

    run: str
    rate_hz: float
    time_s: np.ndarray
    values: dict[str, np.ndarray]
    """Sensor to (n, m), SI units, NaN where missing."""
    own_rate_hz: dict[str, float]

    def rotation(self) -> np.ndarray:
        """Body-to-world rotations of the recorded attitude, (n, 3, 3)."""
        q = self.values["attitude"]
        return rotation_matrices(q / np.linalg.norm(q, axis=1, keepdims=True))


def on_grid(time_s: np.ndarray, values: np.ndarray, grid_s: np.ndarray) -> np.ndarray:
    """Fresh samples of (n, m) values interpolated onto a grid (cubic), NaN in long holes and outside."""
    keep = fresh_samples(values)
    t, v = time_s[keep], values[keep]
    if len(t) < 8:
        return np.full((len(grid_s), values.shape[1]), np.nan)
    if len(t) == len(grid_s) and np.allclose(t, grid_s, atol=1e-6, rtol=0):
        return v.astype(float)
    out = CubicSpline(t, v, axis=0, extrapolate=False)(grid_s)
    gap = np.diff(t)
    for k in np.flatnonzero(gap > LONGEST_BRIDGED_SAMPLES * float(np.median(gap))):
        out[(grid_s > t[k]) & (grid_s < t[k + 1])] = np.nan
    return out


def _read_signals(run: Run, vehicle: Vehicle) -> Signals:
    """Every sensor of a run on the run's own median period."""
    t = run.time_s
    rate = 1.0 / float(np.median(np.diff(t)))
    grid = t[0] + np.arange(int(np.floor((t[-1] - t[0]) * rate + 1e-6)) + 1) / rate
    values, own = {}, {}
    for key, names in sensor_columns(vehicle).items():
        if names and run.has(*names):
            raw = run.array(names)
            if key == "attitude":
                with np.errstate(invalid="ignore", divide="ignore"):
                    raw = continuous(raw / np.linalg.norm(raw, axis=1, keepdims=True))
            values[key] = on_grid(t, raw, grid)
            own[key] = own_rate_hz(t, raw)
    return Signals(run.name, rate, grid, values, own)


@dataclass(frozen=True)
class ReadSet(RecordingSet):
    """A recording set that reads its signals once; a changed copy (`replace`) reads its own."""

    @cached_property
    def signals(self) -> list[Signals]:
        """Signals of every run."""
        return [_read_signals(run, self.vehicle) for run in self.runs]


def replace_columns(recordings: RecordingSet, change) -> RecordingSet:
    """The set with every run's table passed through `change(run) -> dict of columns or None`."""
    return replace(recordings, runs=tuple(run.holding(change(run) or {}) for run in recordings.runs))


def replace_sensor(recordings: RecordingSet, sensor: str, change: Callable[[np.ndarray], np.ndarray]) -> RecordingSet:
    """The set with a sensor's readings (n, m) passed through `change` in every run that has all of them."""
    names = sensor_columns(recordings.vehicle)[sensor]

    def changed(run: Run):
        return dict(zip(names, change(run.array(names)).T, strict=True)) if run.has(*names) else None

    return replace_columns(recordings, changed)


def established(id: str, sentence: str, p_value: float, channels: Iterable[str], **more) -> Finding:
    """What the recordings show by themselves to be a mistake in them."""
    return Finding(id, "established", sentence=sentence, p_value=p_value, channels=tuple(channels), **more)


@dataclass(frozen=True)
class Corrected:
    """A set as corrected so far, and what was found."""

    recordings: ReadSet
    findings: tuple[Finding, ...] = ()
    notes: tuple[str, ...] = ()

    def then(self, step: Callable[[ReadSet], Corrected]) -> Corrected:
        """The same after a further step, which looks at the set as corrected so far."""
        found = step(self.recordings)
        return Corrected(found.recordings, self.findings + found.findings, self.notes + found.notes)


def connected(recordings: RecordingSet) -> Corrected:
    """The set without voltages that no battery has, and a note for every run whose voltmeter read mostly such."""
    least_v = 0.5  # No battery that turns a rotor has less.
    notes = []

    def change(run: Run):
        if not run.has(c.BATTERY_VOLTAGE):
            return {}
        voltage = run.table[c.BATTERY_VOLTAGE]
        dead = voltage < least_v
        if not dead.any():
            return {}
        mostly = dead.sum() > voltage.notna().sum() / 2
        if mostly:
            notes.append(f"{c.BATTERY_VOLTAGE} of {run.name} reads below {least_v} V: taken as not connected.")
        return {c.BATTERY_VOLTAGE: np.nan if mostly else voltage.mask(dead)}

    return Corrected(replace_columns(recordings, change), notes=tuple(notes))
