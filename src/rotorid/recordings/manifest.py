"""The list of a set's runs with their SHA-256, which `rotorid import` leaves in the set.

A set without such a list is what its files are. Where there is one, a run that is missing, changed or not listed is
said, so that half an import is not taken for a whole one.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path

from rotorid.errors import InputError
from rotorid.io.text.files import read_text
from rotorid.io.text.wording import printable
from rotorid.io.text.writing import all_or_none

FILE_NAME = "manifest.json"


def sha256(path: Path) -> str:
    """SHA-256 of a file, hexadecimal."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def write_manifest(folder: Path, paths: Iterable[Path]) -> None:
    """Write the list of a set's runs, whole or not at all; `paths` are their files."""
    runs = {path.name: sha256(path) for path in sorted(paths)}
    with all_or_none(folder / FILE_NAME) as (part,):
        part.write_text(json.dumps({"runs": runs}, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def listed_runs(folder: Path) -> Mapping[str, str] | None:
    """SHA-256 by the name of a run's file, None where the set has no list; InputError where it cannot be read."""
    path = folder / FILE_NAME
    if not path.exists() and not path.is_symlink():
        return None
    try:
        runs = json.loads(read_text(path))["runs"]
        if all(isinstance(digest, str) for digest in runs.values()):
            return runs
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
    raise InputError(f"{path}: is no list of runs{_renewed(folder)}")


def check_manifest(folder: Path, paths: Iterable[Path], ignored: Collection[str] = ()) -> None:
    """InputError where the set's runs are not those that its list holds; `ignored` files may be what they like."""
    listed = listed_runs(folder)
    if listed is None:
        return
    there = {path.name: path for path in paths if path.name not in ignored}
    faults = [f"run {name} is missing" for name in listed if name not in there and name not in ignored]
    faults += [f"run {name} is not listed" for name in there if name not in listed]
    faults += [f"run {name} was changed" for name in there if name in listed and sha256(there[name]) != listed[name]]
    if faults:
        more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
        raise InputError(
            f"{folder}: by {FILE_NAME}, {printable(faults[0])}{more}: an import that was stopped, or a change by hand"
            f"{_renewed(folder)}"
        )


def _renewed(folder: Path) -> str:
    """What to do about it, to end a sentence with."""
    return (
        f"; import again, or where the runs are as they should be, list them anew by `rotorid check {folder} --renew`"
    )
