"""What the columns of a table are, proposed from their names and confirmed or refused by their numbers.

Each guess has its evidence. Names propose. Numbers decide what names leave open and refuse what they contradict: a
gyroscope integrates to the attitude, an accelerometer turned by the attitude to the velocity, a velocity to the
position; an accelerometer reads 9.8 m/s² in hover, a quaternion has length 1. What neither settles is left open as `?`.
"""

from __future__ import annotations

from dataclasses import dataclass

import pandas as pd

from rotorid.errors import InputError
from rotorid.recordings.importers.guessing.attitude import guess_attitude_and_rates
from rotorid.recordings.importers.guessing.draft import Draft
from rotorid.recordings.importers.guessing.force import axes_that_matter, guess_frames, guess_specific_force
from rotorid.recordings.importers.guessing.rotors import guess_rotors, guess_stand
from rotorid.recordings.importers.guessing.scalars import guess_scalar, guess_time
from rotorid.recordings.importers.guessing.travel import guess_height, guess_position, guess_velocity
from rotorid.recordings.importers.mapping import Mapping
from rotorid.recordings.tables import numbers


@dataclass(frozen=True)
class Guess:
    """A mapping that is proposed, why (by channel, `body` and `world`), and what only a person can answer."""

    mapping: Mapping
    evidence: dict[str, str]
    open: dict[str, str]
    """To a channel, `body` or `world` the question."""
    left_out: tuple[str, ...] = ()
    """Columns that hold something else than numbers, a sentence each."""


def guess(table: pd.DataFrame) -> Guess:
    """A mapping proposed for a table of any columns; those with a cell that is no number take no part."""
    layout = table.attrs.get("layout")
    table, left_out = _of_numbers(table)
    if layout and layout.above:
        first = layout.above[0][:150]
        left_out.insert(0, f"left out: {len(layout.above)} lines above the heading, the first of them: {first}")
    draft = Draft(table)
    guess_time(draft)
    for name in ("battery_voltage", "battery_current", "temperature"):
        guess_scalar(draft, name)
    guess_attitude_and_rates(draft)
    guess_specific_force(draft)
    body, draft.world = guess_frames(draft)
    guess_velocity(draft)
    guess_position(draft)
    body, world = axes_that_matter(draft, body, draft.world)
    guess_height(draft)
    for name in ("rotor_command", "rotor_speed", "throttle"):
        guess_rotors(draft, name)
    guess_stand(draft)
    mapping = Mapping(body=body, world=world, channels=draft.channels, keep=tuple(draft.free()))
    return Guess(mapping, draft.evidence, draft.open, tuple(left_out))


def _of_numbers(table: pd.DataFrame) -> tuple[pd.DataFrame, list[str]]:
    """The columns that hold numbers alone, and a sentence for each other one."""
    kept, left_out = {}, []
    for name in table.columns:
        try:
            kept[name] = numbers(table[[name]], "left out")[name]
        except InputError as error:
            left_out.append(str(error))
    return pd.DataFrame(kept), left_out
