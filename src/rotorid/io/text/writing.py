"""Files that are written whole or not at all, and numbers that are the same on every computer."""

from __future__ import annotations

import errno
import glob
import math
import os
import platform
import re
import shutil
import stat
import tempfile
import threading
import time
from collections.abc import Collection, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from rotorid.errors import InputError

try:
    import fcntl
except ImportError:  # pragma: no cover - depends on the platform
    fcntl = None

_PATIENCE_S = 20.0
"""How long a writer waits for another one of the same folder: names are taken in milliseconds, a report in seconds."""
_HOST = platform.node().replace(".", "_")
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
_held = threading.local()


@contextmanager
def only_writer(*folders: Path) -> Iterator[None]:
    """Keep every other process, and thread, that writes results out of these folders while the block runs.

    Whoever holds a folder may ask for it again. InputError where another holds one of them for longer than a writer
    takes. Where the file system has no locks (some network folders) there is none.
    """
    with ExitStack() as stack:
        # One order for all, so that two writers of the same folders do not wait for each other.
        for folder in sorted({Path(os.path.realpath(folder)) for folder in folders}):
            stack.enter_context(_locked(folder))
        yield


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    number = os.open(folder, os.O_RDONLY)
    try:
        state = os.fstat(number)
        own = (os.getpid(), state.st_dev, state.st_ino)
        held = _held.__dict__.setdefault("folders", set())
        if own in held or fcntl is None:
            yield
            return
        _wait_for(number, folder)
        held.add(own)
        try:
            yield
        finally:
            held.discard(own)
    finally:
        os.close(number)  # which gives the lock back


def _wait_for(number: int, folder: Path) -> None:
    """Lock an open folder; InputError where another writer keeps it."""
    until = time.monotonic() + _PATIENCE_S
    while True:
        try:
            return fcntl.flock(number, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            if error.errno not in (errno.EWOULDBLOCK, errno.EAGAIN):
                return None
        if time.monotonic() > until:
            raise InputError(
                f"{folder}: another command is writing its results there; wait until it has ended, or choose another "
                "folder"
            )
        time.sleep(0.01)


@contextmanager
def all_or_none(*paths: Path, optional: Collection[Path] = ()) -> Iterator[tuple[Path, ...]]:
    """Places to write files at that take their names together when the block ends; on an exception none is left.

    They lie in hidden folders next to the files (whose own folders are made), so that each takes its name in one step,
    and bear the files' names. Nobody else can write there, so that none of them is a link to somebody's file. No system
    gives several names in one step, so the first file vouches for the others: it goes first and comes last. A process
    that is killed, or a computer that stops, leaves either all files of one writing or no first file; of two writers
    one comes after the other. What a killed process left behind half written is swept away by the next that writes the
    same files. One of the `optional` paths that the block writes nothing at is not there afterwards.

    OSError names the file that there was no room for.
    """
    with ExitStack() as stack:
        private: dict[Path, Path] = {}
        for path in paths:
            if path.parent not in private:
                private[path.parent] = stack.enter_context(staging(path))
            else:
                _sweep(path)
        parts = tuple(private[path.parent] / path.name for path in paths)
        try:
            yield parts
            written = [part.exists() or path not in optional for part, path in zip(parts, paths, strict=True)]
            for part, there in zip(parts, written, strict=True):
                if there:
                    _to_disk(part)
        except OSError as error:
            if error.errno in _FULL and (error.filename is None or Path(str(error.filename)) in parts):
                _, last = max((_changed_ns(part), number) for number, part in enumerate(parts))
                raise OSError(error.errno, error.strerror, str(paths[last])) from error
            raise
        with only_writer(*private):
            (first_part, first), *others = zip(parts, paths, strict=True)
            if others and first.exists():
                first.unlink(missing_ok=True)
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


def _changed_ns(path: Path) -> int:
    """When a file was last written to, ns; 0 where there is none."""
    try:
        return path.lstat().st_mtime_ns
    except OSError:
        return 0


def write_texts(texts: Mapping[Path, str]) -> None:
    """Write text files, all of them or none."""
    with all_or_none(*texts) as parts:
        for part, text in zip(parts, texts.values(), strict=True):
            part.write_text(text, encoding="utf-8")


def copy_together(source: Path, folder: Path, first: str, gone: Collection[str] = ()) -> None:
    """Copy the files of one folder into another, all of them or none; the file called `first` vouches for the others.

    Files called one of `gone` are not there afterwards where the source has none.
    """
    there = sorted(path.name for path in source.iterdir() if path.is_file())
    names = sorted({*there, *gone} - {first})
    paths = [folder / name for name in (first, *names)]
    with all_or_none(*paths, optional=[path for path in paths if path.name not in there]) as parts:
        for part in parts:
            if part.name in there:
                shutil.copyfile(source / part.name, part)


@contextmanager
def staging(path: Path) -> Iterator[Path]:
    """An empty folder next to `path`, to write files in that are to take their names later; gone when the block ends.

    Its name cannot be known before, and it is its owner's alone. What a process that was killed left there is swept
    away by the next that writes the same path. OSError names `path` where the disk is full.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    _sweep(path)
    try:
        part = Path(tempfile.mkdtemp(".part", f".{path.name}.{_HOST}-{os.getpid()}.", path.parent))
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
    try:
        yield part
    except OSError as error:
        if error.errno in _FULL and (error.filename is None or part in Path(str(error.filename)).parents):
            raise OSError(error.errno, error.strerror, str(path)) from error
        raise
    finally:
        shutil.rmtree(part, ignore_errors=True)


def take_name(part: Path, folder: Path) -> None:
    """Give a staged folder its name in one step, once all its files are on the disk; OSError where one is there."""
    for path in part.iterdir():
        _to_disk(path)
    os.chmod(part, 0o777 & ~_umask())
    _to_disk(part)
    os.rename(part, folder)
    _to_disk(folder.parent)


def _umask() -> int:
    """What new files and folders are not to allow."""
    mask = os.umask(0o077)
    os.umask(mask)
    return mask


def take_place(part: Path, path: Path) -> None:
    """Put a staged file in the place of `path` in one step, once its content is on the disk."""
    _to_disk(part)
    os.replace(part, path)
    _to_disk(path.parent)


def _sweep(path: Path) -> None:
    """Remove parts of a file or folder whose writer is gone: of this computer by its process, else after a day."""
    forgotten_s = 86400.0  # Age at which the part of a file written by another computer counts as left behind.
    named = re.compile(re.escape(f".{path.name}.") + r"(?P<host>[^.]*)-(?P<process>\d+)(\.\w+)?\.part")
    for part in path.parent.glob(f".{glob.escape(path.name)}.*.part"):
        writer = named.fullmatch(part.name)
        if writer is None:
            continue
        try:
            state = part.lstat()
            here = writer["host"] in (_HOST, "")
            gone = _dead(writer["process"]) if here else time.time() - state.st_mtime > forgotten_s
        except FileNotFoundError:
            continue
        if gone and stat.S_ISDIR(state.st_mode):
            shutil.rmtree(part, ignore_errors=True)
        elif gone:
            part.unlink(missing_ok=True)


def _dead(process: str) -> bool:
    """Whether no process of this number runs here."""
    try:
        os.kill(int(process), 0)
    except (ProcessLookupError, OverflowError):
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
    digits = 6  # Significant digits that verdicts and vehicles state.
    if isinstance(value, dict):
        return {key: rounded(v) for key, v in value.items()}
    if isinstance(value, (list, tuple)):
        return type(value)(rounded(v) for v in value)
    if isinstance(value, float) and math.isfinite(value):
        return float(f"{value:.{digits - 1}e}")
    return value
