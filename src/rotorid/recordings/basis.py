"""What a verdict on a set rests on: time in the air, share of the recordings on the ground, what was not recorded."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from rotorid.io.text.wording import listed
from rotorid.recordings import columns as c
from rotorid.recordings.run import RecordingSet, Run, stretches
from rotorid.recordings.vehicle import Vehicle

_IDLE_SHARE, _LARGEST_QUANTILE = 0.2, 0.98
"""Rotors idle below this share of nearly the largest thrust of their run, by the squares of their speeds."""
_GROUND_S = 1.0
"""Rotors that idle so long leave a vehicle on the ground: in the air it would have fallen five metres."""
_RESTING_G = 0.5
"""Specific force, over gravity, that the ground exerts on it at least; a vehicle that falls has next to none."""
_PAUSE_S, _PAUSE_STEPS = 5.0, 20
"""A stand's or bench's samples that are further apart than both are of two recordings, and nothing between them."""
_MOST_NAMES = 12


@dataclass(frozen=True)
class _Basis:
    """Time and columns of a set, as they are used."""

    recorded_s: float
    """Length of all runs, of a stand or bench without the pauses in them."""
    in_the_air_s: float | None
    """None for a stand or bench, and where no rotors are recorded."""
    ground_share: float | None
    """Of `recorded_s`, on the ground with rotors that idle or stand still."""
    missing: tuple[str, ...]
    """What the contract knows and no run, or not every run, has."""

    @property
    def sentence(self) -> str:
        """`The verdict rests on 62 s in the air; 8 % of the recordings are on the ground; not recorded: height.`"""
        if self.in_the_air_s is None:
            said = f"{self.recorded_s:.0f} s of recordings"
        else:
            share = 100 * (self.ground_share or 0.0)
            ground = f"{share:.0f} % of the recordings {'is' if share < 1.5 else 'are'} on the ground"
            said = f"{self.in_the_air_s:.0f} s in the air; {ground if share >= 0.5 else 'none of it is on the ground'}"
        lacks = f"not recorded: {listed(self.missing, _MOST_NAMES)}" if self.missing else "no column is missing"
        return f"The verdict rests on {said}; {lacks}."


def basis_of(recordings: RecordingSet) -> _Basis:
    """What a set offers to a verdict."""
    with_pauses = recordings.vehicle.kind == "flight"
    recorded = sum(float(np.ptp(run.time_s)) if with_pauses else _recorded_s(run.time_s) for run in recordings.runs)
    grounded = [on_the_ground_s(run, recordings.vehicle) for run in recordings.runs]
    known = recordings.vehicle.kind == "flight" and any(g is not None for g in grounded)
    ground = sum(g for g in grounded if g is not None)
    return _Basis(
        recorded,
        recorded - ground if known else None,
        ground / recorded if known and recorded > 0 else None,
        tuple(missing(recordings)),
    )


def _recorded_s(time_s: np.ndarray) -> float:
    """Length of a run, s, without its pauses; `time_s` has shape (n,)."""
    steps = np.diff(time_s)
    if not len(steps):
        return 0.0
    return float(steps[steps <= max(_PAUSE_S, _PAUSE_STEPS * np.median(steps))].sum())


def on_the_ground_s(run: Run, vehicle: Vehicle) -> float | None:
    """How long a run is on the ground, s; None where no rotors are recorded."""
    squares = _squares(run, vehicle)
    if squares is None:
        return None
    rows, thrust = squares
    time_s, force = run.time_s[rows], run.array(c.SPECIFIC_FORCE)[rows]
    idle = thrust < _IDLE_SHARE * np.quantile(thrust, _LARGEST_QUANTILE)
    total = 0.0
    for start, stop in stretches(idle):
        lasted = float(time_s[min(stop, len(time_s) - 1)] - time_s[start])
        felt = np.linalg.norm(force[start:stop], axis=1)
        felt = felt[np.isfinite(felt)]
        rests = not len(felt) or float(np.median(felt)) > _RESTING_G * vehicle.gravity_m_s2
        total += lasted if lasted >= _GROUND_S and rests else 0.0
    return total


def _squares(run: Run, vehicle: Vehicle) -> tuple[np.ndarray, np.ndarray] | None:
    """Rows in which all rotors are known, and the sum of the squares of their speeds or throttles there."""
    for kind in ("rotor_speed", "rotor_command", "throttle"):
        names = c.rotor_columns(kind, vehicle.rotor_count)
        if names and run.has(*names):
            values = run.array(names)
            rows = np.flatnonzero(np.isfinite(values).all(axis=1))
            return (rows, (values[rows] ** 2).sum(axis=1)) if len(rows) else None
    return None


def missing(recordings: RecordingSet) -> Iterator[str]:
    """Names of what the contract knows for this kind of set and no run has; with a count where some runs have it."""
    runs = recordings.runs
    for name, ways in _wanted(recordings).items():
        having = sum(any(run.has(*way) for way in ways) for run in runs)
        if having == 0:
            yield name
        elif having < len(runs):
            yield f"{name} in {len(runs) - having} of {len(runs)} runs"


def _wanted(recordings: RecordingSet) -> dict[str, list[tuple[str, ...]]]:
    """Name of each thing that may be recorded to the columns, any of which in full are it."""
    vehicle, runs = recordings.vehicle, recordings.runs

    def rotors(kind: str) -> tuple[str, ...]:
        return c.rotor_columns(kind, vehicle.rotor_count)

    def there(name: str) -> bool:
        return any(run.has(name) for run in runs)

    turning = {"rotor speeds": [rotors("rotor_speed")], "commands": [rotors("rotor_command"), rotors("throttle")]}
    voltage = {"battery voltage": [(c.BATTERY_VOLTAGE,)]}
    if vehicle.kind == "flight":
        heights = [(c.HEIGHT,)] if vehicle.ground_z_m is None else [(c.HEIGHT,), (c.POSITION[2],)]
        return turning | {
            "accelerometer": [c.SPECIFIC_FORCE],
            "body rates": [c.ANGULAR_VELOCITY],
            "attitude": [c.QUATERNION],
            "position and velocity": [c.POSITION, c.VELOCITY],
            "height above ground": heights,
        } | voltage  # fmt: skip
    if vehicle.kind == "stand":
        wrench = {}
        for group, names in (("force", c.FORCE), ("moment", c.MOMENT)):
            axes = [axis for axis, name in zip("xyz", names, strict=True) if not there(name)]
            along = f"{group} along {listed(axes)}" if 0 < len(axes) < 3 else f"{group}s"
            wrench[along] = [tuple(name for name in names if not axes or not there(name))]
        return wrench | turning | {"attitude of the mount": [c.MOUNT]} | voltage
    pairs = zip(c.FORCE, c.REFERENCE_FORCE, strict=True)
    return {name: [(name,)] for pair in pairs if any(map(there, pair)) for name in pair}
