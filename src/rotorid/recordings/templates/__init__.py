"""Vehicles to start from: files of believed values with the source of each, shipped with the package."""

from __future__ import annotations

from difflib import get_close_matches
from functools import cache
from importlib.resources import files

from rotorid.errors import InputError
from rotorid.io.text.files import parse_yaml
from rotorid.recordings.files import vehicle_of
from rotorid.recordings.vehicle import Vehicle


@cache
def names() -> tuple[str, ...]:
    """Names of the template vehicles, sorted."""
    return tuple(sorted(p.name.removesuffix(".yaml") for p in files(__name__).iterdir() if p.name.endswith(".yaml")))


def text(name: str) -> str:
    """The file of a template vehicle with its comments; InputError names the nearest name where there is none."""
    if name not in names():
        near = get_close_matches(name, names(), 1)
        meant = f"; did you mean {near[0]}?" if near else ""
        raise InputError(f"no template vehicle is called {name!r}{meant} There are: {', '.join(names())}")
    return files(__name__).joinpath(f"{name}.yaml").read_text(encoding="utf-8")


def read(name: str) -> Vehicle:
    """A template vehicle; InputError as `text`."""
    return vehicle_of(parse_yaml(text(name), f"{name}.yaml", compiled=True), f"{name}.yaml")
