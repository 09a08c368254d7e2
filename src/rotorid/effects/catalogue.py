"""The catalogue: every module of this package that defines `EFFECT`, and every entry point `rotorid.effects` of
packages that are installed. Adding an effect is adding one file, here or in a package of one's own.
"""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache
from importlib.metadata import entry_points
from typing import Literal

import rotorid.effects
from rotorid.effects.contract import Effect
from rotorid.errors import InputError

_GROUP = "rotorid.effects"


@cache
def catalogue() -> dict[str, Effect]:
    """Every wrench and sensor effect by id, in alphabetical order.

    Raises InputError where a package's entry point is no effect, or has the id of another one.
    """
    found = {}
    for module in pkgutil.iter_modules(rotorid.effects.__path__):
        effect = getattr(importlib.import_module(f"rotorid.effects.{module.name}"), "EFFECT", None)
        if effect is not None:
            found[effect.id] = effect
    for point in entry_points(group=_GROUP):
        effect = point.load()
        if not isinstance(effect, Effect):
            raise InputError(f"entry point {point.value} of {_GROUP}: expected an Effect, not {type(effect).__name__}")
        if effect.id in found:
            raise InputError(
                f"entry point {point.value} of {_GROUP}: an effect {effect.id} is in the catalogue already"
            )
        found[effect.id] = effect
    return dict(sorted(found.items()))


@cache
def ids_of(trait: str, value: object = True) -> frozenset[str]:
    """Ids of the effects that declare a trait (a field of `Effect`) with this value."""
    return frozenset(e.id for e in catalogue().values() if getattr(e, trait) == value)


@cache
def ids_of_stage(stage: int) -> frozenset[str]:
    """Ids of the effects with a speed form of a stage (`CURVE` to `LAG`)."""
    return frozenset(e.id for e in catalogue().values() if any(f.stage == stage for f in e.speed_forms))


def moving_air(how: Literal["all the time", "in windows"]) -> Effect:
    """The effect of air that moves over the ground all the time, or in windows."""
    return next(e for e in catalogue().values() if e.air_moves == how)


@cache
def before_the_rotors() -> tuple[str, ...]:
    """Ids of effects that act between command and rotor speed and nowhere else: without commands nothing shows them."""
    return tuple(e.id for e in catalogue().values() if e.speed_forms and e.reading_forms is None)
