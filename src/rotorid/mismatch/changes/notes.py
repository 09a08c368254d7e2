"""What keeps two sets of flights from being compared fully: a larger residual, and flight that the first has not."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rotorid.mismatch.changes.joint import FARTHER, Joint
from rotorid.mismatch.changes.problem import NAMES
from rotorid.mismatch.changes.usual import left_by_all
from rotorid.mismatch.decision.words import (
    capital,
    channel_words,
    effect_words,
    listed,
    number,
    parameter_words,
    regime_words,
)
from rotorid.mismatch.plant.channel_errors import CHANNELS_OF_WRENCH
from rotorid.mismatch.plant.motion import Segment
from rotorid.mismatch.plant.rows import CHANNELS
from rotorid.mismatch.posterior.leftover import TINY

LARGER = 2.0
"""How many times the residual of the first set that of the second must be, in some force or moment, to be noted."""


def notes_of(joint: Joint, base: str, new: str) -> tuple[str, ...]:
    """Notes on a comparison, in sentences."""
    return (*residual_notes(joint, base, new), *regime_notes(joint.flown_by_base, joint.flown_by_new, base, new))


def command_notes(reference: Sequence[Segment], recorded: Sequence[Segment], base: str, new: str) -> tuple[str, ...]:
    """That one of two sets has no commands, so that the chain from command to rotor speed was not compared."""
    first, second = (any(s.command is not None for s in own) for own in (reference, recorded))
    if first == second:
        return ()
    without = new if first else base
    return (f"{without} has no commands: the motors' lag, delay, throttle curve and battery were not compared.",)


def residual_notes(joint: Joint, base: str, new: str) -> list[str]:
    """That more is left unexplained in the second set than in the first: something outside the catalogue changed."""
    per_block = [left_by_all(own) / own.blocks.sum() for own in (joint.base, joint.new)]
    ratio = np.sqrt(per_block[1] / joint.inertia**2 / np.maximum(per_block[0], TINY))
    larger = [
        (r, int(c)) for r, c in zip(ratio, joint.base.channels, strict=True) if r > LARGER and c < CHANNELS_OF_WRENCH
    ]
    if not larger:
        return []
    most = max(r for r, _ in larger)
    where = listed([f"the {channel_words(CHANNELS[c])}" for _, c in larger])
    return [
        f"What no known effect explains is up to {most:.1f} times as large in {new} as in {base} ({where}): something "
        f"differs there that is outside the catalogue, or noise and vibration are larger."
    ]


def regime_notes(first: Mapping[str, float], second: Mapping[str, float], base: str, new: str) -> list[str]:
    """In what the second set goes farther than the first; one sentence or none."""
    farther = []
    for name, far in first.items():
        if name in second and second[name] > FARTHER * far > 0:
            words, unit = regime_words(name)
            farther.append(f"{words} {number(second[name])} {unit} where {base} has {number(far)} {unit}")
    if not farther:
        return []
    return [
        f"{new} goes farther ({listed(farther)}). Airspeeds more than {FARTHER} times as high are not compared; other "
        "flight is by the forms of the effects."
    ]


def refused_notes(ids: Sequence[Sequence[str]]) -> list[str]:
    """That a name was not stated because it contradicts what differs; `ids` holds the class of each."""
    return [
        f"{capital(listed([effect_or_value(i) for i in own], 'or'))} would explain the motion, but would change trims, "
        "shares or thrust by other amounts than they differ by: not stated."
        for own in ids
    ]


def effect_or_value(name: str) -> str:
    """An effect, or a value by its contract name, in words."""
    return f"the {parameter_words(name)[0]}" if name in NAMES.values() else effect_words(name)
