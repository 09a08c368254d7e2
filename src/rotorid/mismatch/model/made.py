"""What is made of a stretch of flight, made once and again only where something changed that it is made of.

Between two assemblies only a wind, the hang of a payload, the rotors' speeds, the accelerations that a model predicts
or a term's own values change. What was read of the motion while a column was made says whether any of it matters.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from rotorid.effects.contract import Motion

_FIELDS = frozenset(f.name for f in fields(Motion))
MOST_BYTES = 256e6
"""Of all that is kept; what was made first is forgotten first."""


class Watched(Motion):
    """A motion that notes which of its fields are read."""

    def __getattribute__(self, name: str) -> Any:
        own = object.__getattribute__(self, "__dict__")
        if name == "__dict__":
            own.get("read", set()).update(_FIELDS)
        elif name in _FIELDS:
            own.get("read", set()).add(name)
        return object.__getattribute__(self, name)


def watched(motion: Motion) -> tuple[Watched, set[str]]:
    """A motion whose reader is watched, and the names of the fields read so far."""
    out, read = object.__new__(Watched), {"time_s"}
    object.__getattribute__(out, "__dict__").update(motion.__dict__, read=read)
    return out, read


@dataclass(frozen=True)
class _Made:
    """Something made of a motion."""

    given: tuple
    """What else it was made of."""
    read: dict[str, Any]
    """Fields of the motion that were read."""
    made: Any
    size: int
    """Bytes."""

    def holds(self, given: tuple, motion: Motion) -> bool:
        """Whether the same would be made again."""
        return self.given == given and all(getattr(motion, name) is value for name, value in self.read.items())


@dataclass
class LastMade:
    """What was made last of each stretch of flight, under keys of those who made it."""

    kept: dict[tuple, _Made] = field(default_factory=dict)
    size: int = 0

    def made(self, key: tuple, given: tuple, motion: Motion, make: Callable[[Motion], Any]) -> Any:
        """What `make` makes of a motion and of what is `given`: remembered under a key, or made."""
        place = id(motion.time_s), *key
        if place in self.kept:
            known = self.kept.pop(place)
            if known.holds(given, motion):
                self.kept[place] = known
                return known.made
            self.size -= known.size
        seen, read = watched(motion)
        made = make(seen)
        new = _Made(given, {name: getattr(motion, name) for name in read}, made, _bytes_of(made))
        self.kept[place], self.size = new, self.size + new.size
        while self.size > MOST_BYTES:
            self.size -= self.kept.pop(next(iter(self.kept))).size
        return made


def _bytes_of(made: Any) -> int:
    """Bytes of the arrays in lists and mappings."""
    if isinstance(made, np.ndarray):
        return made.nbytes
    return sum(map(_bytes_of, made.values() if isinstance(made, dict) else made))
