"""Faults of files that fill a pydantic model, in plain words: key, found, expected, the nearest name."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from rotorid.recordings.names import hint
from rotorid.wording import expected, found, printable

_BRANCHES = ("float", "tuple[float, ...]", "constrained-float", "int", "str", "constrained-int")
"""Parts of a pydantic location that name a kind of value, not a key."""


def explain(error: ValidationError, model: type[BaseModel]) -> str:
    """First fault of a pydantic error as one clause."""
    entries = error.errors()
    # A misspelled key is also a missing one: its name says more.
    first = next((e for e in entries if e["type"] == "extra_forbidden"), entries[0])
    location, kind = first["loc"], first["type"]
    key = printable(".".join(str(part) for part in location if part not in _BRANCHES))
    if kind == "extra_forbidden":
        return f"{key}: no such key is known{hint(str(location[-1]), keys_at(model, location))}"
    if kind == "missing":
        return f"{key}: is missing"
    if kind == "value_error":
        return ": ".join(x for x in (key, printable(first["ctx"]["error"])) if x)
    return f"{key}: found {found(first)}, expected {expected(first)}"


def keys_at(model: type[BaseModel], location: tuple[str | int, ...]) -> list[str]:
    """Keys that `model` knows where a location of a pydantic error lies."""
    for part in location[:-1]:
        if isinstance(part, str) and part in model.model_fields:
            model = next(_models_in(model.model_fields[part].annotation), model)
    return list(model.model_fields)


def _models_in(annotation: Any) -> Iterator[type[BaseModel]]:
    """The models inside a type such as `dict[str, Channel]`."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for inner in get_args(annotation):
        yield from _models_in(inner)
