"""Packages that only some logs need."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from rotorid.errors import InputError


def needs(module: str, extra: str, path: object) -> ModuleType:
    """The module, or an InputError that says how it is installed."""
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        if error.name and error.name.split(".")[0] != module.split(".")[0]:
            raise
        raise InputError(
            f"{path}: reading it needs {module.split('.')[0]}, which is not installed: pip install 'rotorid[{extra}]'"
        ) from None
