"""The name that was probably meant, for columns and keys that nobody knows."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable
from pathlib import Path

_ALIKE = 0.7
"""Share of letters in common (difflib's ratio) from which one name is proposed for another."""


def plain(name: str) -> str:
    """A name without what people vary: case, separators, zeros before a number."""
    return re.sub(r"0+(?=\d)", "", re.sub(r"[^a-z0-9]", "", name.lower()))


def nearest(name: str, known: Iterable[str], alike: float = _ALIKE) -> str | None:
    """The known name that looks most like this one, None where none looks like it."""
    by_plain: dict[str, str] = {}
    for candidate in known:
        by_plain.setdefault(plain(candidate), candidate)
    found = difflib.get_close_matches(plain(name), by_plain, n=1, cutoff=alike)
    return by_plain[found[0]] if found else None


def listed(names: Iterable[str], most: int = 4) -> str:
    """`a, b and c`; of more than `most` names the first ones and how many more there are."""
    names = list(names)
    if len(names) > most:
        return f"{', '.join(names[: most - 1])} and {len(names) - most + 1} more"
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}" if names else "none"


def neighbour(path: Path) -> str:
    """`; did you mean flights?` by what lies next to a path that is missing, or nothing."""
    path = Path(path)
    try:
        there = sorted(p.name for p in path.parent.iterdir() if p.name.isprintable() and not p.name.startswith("."))
    except OSError:
        return ""
    found = nearest(path.name, there)
    return f"; did you mean {path.with_name(found)}?" if found else ""


def hint(name: str, known: Iterable[str]) -> str:
    """`; did you mean x?` or nothing, to end a sentence with."""
    found = nearest(name, known)
    return f"; did you mean {found}?" if found else ""
