"""Sentences to people: the name that was probably meant, faults that a pydantic model finds, values in one line.

No wording of the validator's own reaches a user.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

if TYPE_CHECKING:
    from pydantic import BaseModel, ValidationError

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


_EXACT = {
    "greater_than": "a number greater than {gt:g}",
    "greater_than_equal": "a number of {ge:g} or more",
    "less_than": "a number less than {lt:g}",
    "less_than_equal": "a number of at most {le:g}",
    "literal_error": "{expected}",
    "enum": "{expected}",
    "finite_number": "a finite number",
    "int_from_float": "a whole number",
    "string_too_short": "text of at least {min_length} character",
    "string_pattern_mismatch": "a name of small letters, digits and underscores",
    "too_short": "at least {min_length} entries",
    "too_long": "at most {max_length} entries",
}
_BY_START = (
    ("float", "a number"),
    ("int", "a whole number"),
    ("string", "text"),
    ("bool", "true or false"),
    ("dict", "keys with values"),
    ("model", "keys with values"),
    ("mapping", "keys with values"),
    ("tuple", "a list"),
    ("list", "a list"),
)
_BRANCHES = ("float", "tuple[float, ...]", "constrained-float", "int", "str", "constrained-int")
"""Parts of a pydantic location that name a kind of value, not a key."""
LONGEST = 80
"""Characters of a value that is quoted."""


def explain(error: ValidationError, model: type[BaseModel]) -> str:
    """The first fault of a pydantic error as one clause: key, found, expected, the nearest name."""
    return explained(error, model)[0]


def explained(error: ValidationError, model: type[BaseModel]) -> list[str]:
    """Every fault of a pydantic error as a clause.

    A misspelled key is also a missing one: it comes first, as its name says more. A list that is too short only because
    what is in it is wrong is passed over.
    """
    entries = error.errors()
    faults = [
        entry
        for entry in entries
        if entry["type"] != "too_short"
        or not any(e is not entry and e["loc"][: len(entry["loc"])] == entry["loc"] for e in entries)
    ]
    return [_clause(entry, model) for entry in sorted(faults, key=lambda e: e["type"] != "extra_forbidden")]


def _clause(entry: Mapping[str, Any], model: type[BaseModel]) -> str:
    most_keys = 8  # Keys that are listed where none is like the one given.
    location, kind = entry["loc"], entry["type"]
    key = printable(".".join(str(part) for part in location if part not in _BRANCHES))
    if kind == "extra_forbidden":
        known = sorted(_keys_at(model, location))
        near = hint(str(location[-1]), known) or f"; known here are {listed(known, most_keys)}"
        return f"{key}: no such key is known{near}"
    if kind == "missing":
        return f"{key}: is missing"
    if kind == "value_error":
        return ": ".join(x for x in (key, printable(entry["ctx"]["error"])) if x)
    wanted = _expected(entry)
    clause = f"{key}: found {_found(entry)}, expected {wanted}"
    if "number" in wanted and isinstance(entry.get("input"), str):
        with suppress(ValueError):
            float(entry["input"])
            clause += " (without quotes, and where it has an exponent with a point and a sign: 1.0e-3)"
    return clause


def _keys_at(model: type[BaseModel], location: tuple[str | int, ...]) -> list[str]:
    """Keys that `model` knows where a location of a pydantic error lies."""
    for part in location[:-1]:
        if isinstance(part, str) and part in model.model_fields:
            model = next(_models_in(model.model_fields[part].annotation), model)
    return list(model.model_fields)


def _models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    """The models inside a type such as `dict[str, Channel]`."""
    if hasattr(annotation, "model_fields"):
        yield annotation
    for inner in get_args(annotation):
        yield from _models_in(inner)


def _expected(entry: Mapping[str, Any]) -> str:
    """What an entry of `ValidationError.errors()` would have accepted."""
    kind, context = entry["type"], entry.get("ctx") or {}
    if kind == "too_short" and context["min_length"] == 1:
        return "at least one entry"
    if kind in _EXACT:
        return _EXACT[kind].format(**context)
    return next((text for start, text in _BY_START if kind.startswith(start)), "another value")


def _found(entry: Mapping[str, Any]) -> str:
    """The value that was refused, short and in one line."""
    text = printable(_as_in_yaml(entry.get("input")))
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


def _as_in_yaml(value: Any) -> str:
    """A value as Python writes it, but true and false, which people write in small letters."""
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(_as_in_yaml(part) for part in value)}]"
    return str(value).lower() if isinstance(value, bool) else repr(value)


def printable(text: object) -> str:
    """A text in one line: line breaks and control characters written as escapes."""
    return "".join(x if x.isprintable() else x.encode("unicode_escape", "backslashreplace").decode() for x in str(text))
