"""What faults of sensors and logging do to the columns of a recorded set."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from rotorid.effects.contract import Parameter, SetForm
from rotorid.recordings import columns as c
from rotorid.recordings.run import RecordingSet, Run
from rotorid.recordings.vehicle import Vehicle

VECTORS = {
    "accelerometer": c.SPECIFIC_FORCE,
    "gyroscope": c.ANGULAR_VELOCITY,
    "velocity": c.VELOCITY,
    "position": c.POSITION,
}
"""Sensors that read a vector, with their columns."""


def sensors(vehicle: Vehicle) -> dict[str, tuple[str, ...]]:
    """Every sensor with its columns."""
    return {
        **VECTORS,
        "attitude": c.QUATERNION,
        "rotor speeds": c.rotor_columns("rotor_speed", vehicle.rotor_count),
    }


def with_columns(recordings: RecordingSet, names: tuple[str, ...], change: Callable[[Run, np.ndarray], np.ndarray]):
    """The set with `change(run, values)` (values (n, m) to (n, m)) in place of the named columns where it has them."""
    runs = []
    for run in recordings.runs:
        if run.has(*names):
            table = run.table.copy()
            table[list(names)] = change(run, run.array(names).copy())
            run = Run(run.name, table)
        runs.append(run)
    return replace(recordings, runs=tuple(runs))


def late(run: Run, values: np.ndarray, late_s: np.ndarray | float) -> np.ndarray:
    """Columns (n, m) as a sensor writes them whose stamps are late by `late_s`: value at t is that of t - late."""
    when = run.time_s - late_s
    return np.stack([np.interp(when, run.time_s, column) for column in values.T], axis=1)


def late_sensors(
    vehicle: Vehicle,
    equation: str,
    parameters: tuple[Parameter, ...],
    example: tuple[float, ...],
    late_s: Callable[[np.ndarray, np.ndarray], np.ndarray | float],
) -> tuple[SetForm, ...]:
    """A form for each sensor whose lateness is `late_s(seconds since the run's start, values)`."""

    def one(sensor: str, names: tuple[str, ...]) -> SetForm:
        def apply(recordings, values):
            def change(run, columns):
                return late(run, columns, late_s(run.time_s - run.time_s[0], values))

            return with_columns(recordings, names, change)

        return SetForm(f"of the {sensor}", equation, parameters, apply, (0.0,) * len(parameters), example, names)

    return tuple(one(sensor, names) for sensor, names in sensors(vehicle).items())
