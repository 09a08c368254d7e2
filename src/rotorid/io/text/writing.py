"""Files that are written whole or not at all, and numbers that are the same on every computer."""

from __future__ import annotations

import glob
import math
import os
import platform
import shutil
import time
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

_DIGITS = 6
"""Significant digits that verdicts and vehicles state."""
_FORGOTTEN_S = 86400.0
"""Age at which the part of a file written by another computer counts as left behind."""
_HOST = platform.node().replace(".", "_")


@contextmanager
def all_or_none(*paths: Path, optional: Collection[Path] = ()) -> Iterator[tuple[Path, ...]]:
    """Places to write files at that take their names together when the block ends; on an exception none is left.

    They lie in the files' own folders (which are made), so that each takes its name in one step. No system gives
    several names in one step, so the first file vouches for the others: it goes first and comes last. A process that
    is killed, or a computer that stops, leaves either all files of one writing or no first file. What such a process
    left behind half written is swept away by the next that writes the same files. One of the `optional` paths that the
    block writes nothing at is not there afterwards.
    """
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)
        _sweep(path)
    parts = tuple(path.with_name(f".{path.name}.{_HOST}-{os.getpid()}.part") for path in paths)
    try:
        yield parts
        written = [part.exists() or path not in optional for part, path in zip(parts, paths, strict=True)]
        for part, there in zip(parts, written, strict=True):
            if there:
                _to_disk(part)
        (first_part, first), *others = zip(parts, paths, strict=True)
        if others and first.exists():
            first.unlink()
            _to_disk(first.parent)
        for (part, path), there in zip(others, written[1:], strict=True):
            if there:
                os.replace(part, path)
            else:
                path.unlink(missing_ok=True)
        for folder in {path.parent for _, path in others}:
            _to_disk(folder)
        os.replace(first_part, first)
        _to_disk(first.parent)
    finally:
        for part in parts:
            part.unlink(missing_ok=True)


def write_texts(texts: Mapping[Path, str]) -> None:
    """Write text files, all of them or none."""
    with all_or_none(*texts) as parts:
        for part, text in zip(parts, texts.values(), strict=True):
            part.write_text(text, encoding="utf-8")


@contextmanager
def staging(path: Path) -> Iterator[Path]:
    """An empty folder next to `path`, to write files in that are to take their names later; gone when the block ends.

    What a process that was killed left there is swept away by the next that writes the same path.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    _sweep(path)
    part = path.with_name(f".{path.name}.{_HOST}-{os.getpid()}.part")
    part.mkdir()
    try:
        yield part
    finally:
        shutil.rmtree(part, ignore_errors=True)


def take_name(part: Path, folder: Path) -> None:
    """Give a staged folder its name in one step, once all its files are on the disk; OSError where one is there."""
    for path in part.iterdir():
        _to_disk(path)
    _to_disk(part)
    os.rename(part, folder)
    _to_disk(folder.parent)


def take_place(part: Path, path: Path) -> None:
    """Put a staged file in the place of `path` in one step, once its content is on the disk."""
    _to_disk(part)
    os.replace(part, path)
    _to_disk(path.parent)


def _sweep(path: Path) -> None:
    """Remove parts of a file or folder whose writer is gone: of this computer by its process, else after a day."""
    for part in path.parent.glob(f".{glob.escape(path.name)}.*.part"):
        host, _, process = part.name.removesuffix(".part").rpartition(".")[2].rpartition("-")
        try:
            gone = _dead(process) if host in (_HOST, "") else time.time() - part.stat().st_mtime > _FORGOTTEN_S
        except FileNotFoundError:
            continue
        if gone and part.is_dir():
            shutil.rmtree(part, ignore_errors=True)
        elif gone:
            part.unlink(missing_ok=True)


def _dead(process: str) -> bool:
    """Whether no process of this number runs here."""
    try:
        os.kill(int(process), 0)
    except (ProcessLookupError, ValueError):
        return True
    except PermissionError:
        return False
    return False


def _to_disk(path: Path) -> None:
    """Wait until a file's content, or a folder's names, are on the disk: a full disk may be reported only then."""
    number = os.open(path, os.O_RDONLY)
    try:
        os.fsync(number)
    finally:
        os.close(number)


def rounded(value: Any) -> Any:
    """Numbers to DIGITS significant digits, in lists, tuples and mappings as well; anything else as it is."""
    if isinstance(value, dict):
        return {key: rounded(v) for key, v in value.items()}
    if isinstance(value, (list, tuple)):
        return type(value)(rounded(v) for v in value)
    if isinstance(value, float) and math.isfinite(value):
        return float(f"{value:.{_DIGITS - 1}e}")
    return value
