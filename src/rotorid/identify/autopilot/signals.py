"""Stretches of a flight on an even grid: signals of the motors, specific force, motion, voltage."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rotorid.errors import InputError
from rotorid.recordings import RecordingSet, Run
from rotorid.recordings import columns as c
from rotorid.recordings.own_rates import on_own_rates
from rotorid.vehicle.attitude import normalised, rotation_from_quaternion

_LEAST_STRETCH_S = 3.0
_GAP_PERIODS = 6.0
"""Where the accelerometer gives nothing for longer than so many of its periods, a stretch ends."""


@dataclass(frozen=True)
class Stretch:
    """One stretch without a hole; every series is on the grid of `dt_s`, body axes forward-right-down."""

    run: str
    dt_s: float
    time_s: np.ndarray
    specific_force: np.ndarray
    """(n, 3), m/s²."""
    throttle: np.ndarray | None
    """Signals of the motors, (n, k), 0 to 1."""
    voltage: np.ndarray | None
    """(n,), V."""
    attitude: np.ndarray | None
    """Rotation from body to world, (n, 3, 3)."""
    velocity: np.ndarray | None
    """World north-east-down, (n, 3), m/s."""


def stretches_of(recordings: RecordingSet) -> list[Stretch]:
    """The stretches of a set's runs that last at least `_LEAST_STRETCH_S`.

    InputError where the set is no flight, or none of its runs has an accelerometer.
    """
    if recordings.vehicle.kind != "flight":
        raise InputError(f"{recordings.name}: kind is {recordings.vehicle.kind}, expected flight")
    even = on_own_rates(recordings)
    if not any(run.has(*c.SPECIFIC_FORCE) for run in even.runs):
        raise InputError(
            f"{recordings.name}: parameters need an accelerometer, found no {c.SPECIFIC_FORCE[0]} … in any run"
        )
    found = [s for run in even.runs for s in _of_run(run, even.vehicle.rotor_count)]
    if not found:
        raise InputError(
            f"{recordings.name}: too little data: no stretch with accelerometer readings lasts {_LEAST_STRETCH_S:g} s"
        )
    return found


def _of_run(run: Run, rotors: int) -> list[Stretch]:
    if not run.has(*c.SPECIFIC_FORCE):
        return []
    force = run.array(c.SPECIFIC_FORCE)
    known = np.isfinite(force).all(axis=1)
    time_s, force = run.time_s[known], force[known]
    if len(time_s) < 2:
        return []
    dt = float(np.median(np.diff(time_s)))
    cuts = np.flatnonzero(np.diff(time_s) > _GAP_PERIODS * dt) + 1
    out = []
    for part in np.split(np.arange(len(time_s)), cuts):
        span = time_s[part[-1]] - time_s[part[0]]
        if span < _LEAST_STRETCH_S:
            continue
        grid = time_s[part[0]] + dt * np.arange(int(span / dt) + 1)
        quaternion = _on(grid, run, c.QUATERNION)
        out.append(
            Stretch(
                run.name,
                dt,
                grid,
                np.stack([np.interp(grid, time_s[part], force[part, j]) for j in range(3)], axis=1),
                _on(grid, run, c.rotor_columns("throttle", rotors)),
                None if (volts := _on(grid, run, (c.BATTERY_VOLTAGE,))) is None else volts[:, 0],
                None if quaternion is None else rotation_from_quaternion(normalised(quaternion)),
                _on(grid, run, c.VELOCITY),
            )
        )
    return out


def _on(grid: np.ndarray, run: Run, names: tuple[str, ...]) -> np.ndarray | None:
    """Columns of a run on a grid, (n, len(names)), by straight lines; None where one is not recorded."""
    if not names or not run.has(*names):
        return None
    out = np.empty((len(grid), len(names)))
    for j, name in enumerate(names):
        values = run.column(name)
        known = np.isfinite(values)
        if known.sum() < 4:
            return None
        out[:, j] = np.interp(grid, run.time_s[known], values[known])
    return out
