"""What to do next about an effect that recordings leave open: its manoeuvre, and columns that are not recorded yet."""

from __future__ import annotations

from collections.abc import Callable

from rotorid.effects.contract import Effect
from rotorid.recordings import columns as c
from rotorid.recordings.run import RecordingSet

RECORDABLE: dict[str, tuple[str, Callable[[int], tuple[str, ...]]]] = {
    "position": ("the position", lambda rotors: c.POSITION),
    "rotor_speed": ("the rotor speeds", lambda rotors: c.rotor_columns("rotor_speed", rotors)),
    "temperature": ("the temperature", lambda rotors: (c.TEMPERATURE,)),
    "voltage": ("the battery's voltage", lambda rotors: (c.BATTERY_VOLTAGE,)),
}
"""What `Effect.separating_columns` may name: in words, and the columns of a run for a number of rotors."""


def advice(effect: Effect, recordings: RecordingSet | None = None) -> str:
    """What would distinguish an effect from its confusers, one clause; it asks for no column that every run has.

    Without recordings it asks for every column that helps.
    """
    wanted = [name for name in effect.separating_columns if recordings is None or not _recorded(name, recordings)]
    words = " and ".join(RECORDABLE[name][0] for name in wanted)
    return f"{effect.separating_manoeuvre}; record {words} as well" if words else effect.separating_manoeuvre


def _recorded(name: str, recordings: RecordingSet) -> bool:
    """Whether every run has the columns."""
    columns = RECORDABLE[name][1](recordings.vehicle.rotor_count)
    return all(run.has(*columns) for run in recordings.runs)
