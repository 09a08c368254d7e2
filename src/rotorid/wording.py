"""What a pydantic model expected, in plain words: no wording of the validator's own reaches a user."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

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
LONGEST = 80
"""Characters of a value that is quoted."""


def expected(entry: Mapping[str, Any]) -> str:
    """What an entry of `ValidationError.errors()` would have accepted."""
    kind, context = entry["type"], entry.get("ctx") or {}
    if kind == "too_short" and context["min_length"] == 1:
        return "at least one entry"
    if kind in _EXACT:
        return _EXACT[kind].format(**context)
    return next((text for start, text in _BY_START if kind.startswith(start)), "another value")


def found(entry: Mapping[str, Any]) -> str:
    """The value that was refused, short and in one line."""
    text = printable(repr(entry.get("input")))
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


def printable(text: object) -> str:
    """A text in one line: line breaks and control characters written as escapes."""
    return "".join(x if x.isprintable() else x.encode("unicode_escape", "backslashreplace").decode() for x in str(text))
