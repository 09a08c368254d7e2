"""The catalogue: every module of this package that defines `EFFECT`; adding an effect is adding one file."""

from __future__ import annotations

import importlib
import pkgutil
from functools import cache

import rotorid.effects
from rotorid.effects.contract import Effect


@cache
def catalogue() -> dict[str, Effect]:
    """Every wrench and sensor effect by id, in alphabetical order."""
    found = {}
    for module in pkgutil.iter_modules(rotorid.effects.__path__):
        effect = getattr(importlib.import_module(f"rotorid.effects.{module.name}"), "EFFECT", None)
        if effect is not None:
            found[effect.id] = effect
    return dict(sorted(found.items()))


@cache
def before_the_rotors() -> tuple[str, ...]:
    """Ids of effects that act between command and rotor speed and nowhere else: without commands nothing shows them."""
    return tuple(e.id for e in catalogue().values() if e.speed_forms and e.reading_forms is None)
