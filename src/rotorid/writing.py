"""Files that are written whole or not at all, and numbers that are the same on every computer."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

DIGITS = 6
"""Significant digits that verdicts and vehicles state."""


@contextmanager
def all_or_none(*paths: Path) -> Iterator[tuple[Path, ...]]:
    """Places to write files at that take their names together when the block ends; on an exception none is left.

    They lie in the files' own folders (which are made), so that each takes its name in one step.
    """
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)
    parts = tuple(path.with_name(f".{path.name}.{os.getpid()}.part") for path in paths)
    try:
        yield parts
        for part in parts:
            _to_disk(part)
        for part, path in zip(parts, paths, strict=True):
            os.replace(part, path)
    finally:
        for part in parts:
            part.unlink(missing_ok=True)


def _to_disk(path: Path) -> None:
    """Wait until a file's content is on the disk: a full disk may tell only then."""
    with open(path, "rb") as file:
        os.fsync(file.fileno())


def rounded(value: Any) -> Any:
    """Numbers to DIGITS significant digits, in lists, tuples and mappings as well; anything else as it is."""
    if isinstance(value, dict):
        return {key: rounded(v) for key, v in value.items()}
    if isinstance(value, (list, tuple)):
        return type(value)(rounded(v) for v in value)
    if isinstance(value, float) and math.isfinite(value):
        return float(f"{value:.{DIGITS - 1}e}")
    return value
