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
