"""Verdicts on many recording sets in one process: Python starts once, a set that fails costs only itself.

Each set is judged in a process of its own, branched off after everything is imported (which takes milliseconds), so
that neither a fault nor the memory of one reaches the next. A verdict is remembered by the content of its set and the
code that judged it: a batch that was broken off, or is cut anew because sets were added, judges nothing twice. A set
that could not be read, or whose process was killed, is not remembered: another day it may end otherwise.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import shutil
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Sequence
from pathlib import Path

from rotorid.errors import InputError
from rotorid.recordings import read_set
from rotorid.recordings.templates import read
from rotorid.report.deliver import deliver
from rotorid.vehicle.control.swings import swings

FILES = ("verdict.json", "report.html", "improved_vehicle.yaml", "ledger.json")
"""What a verdict consists of."""
FAILED = "failed.json"
"""What stands in its place where there is none: `reason`, and `fault` where it is none of the set's."""
_WORTH_A_START = 4
"""Sets to judge from which on it pays to load beforehand what every one of them would load by itself."""


def judge_sets(
    folders: Sequence[Path], code: str, out: Path, memory: Path, progress: Callable[[str], None] = lambda text: None
) -> None:
    """Judge sets: `out/<set>/` each, with the files of its verdict or `failed.json`.

    Parameters
    ----------
    folders
        Folders of the sets; their names must differ.
    code
        Hash of the code that judges.
    out
        Folder of the results.
    memory
        Folder that remembers verdicts by content and code.
    progress
        Called with one line a set.

    Raises
    ------
    OSError
        The disk is full, or the like: no fault of a set. What was judged before stays remembered.
    """
    out.mkdir(parents=True, exist_ok=True)
    places = {folder: memory / code / content_of(folder) for folder in folders}
    if sum(not known.is_dir() for known in places.values()) >= _WORTH_A_START:
        _load()
    for folder, known in places.items():
        start = time.monotonic()
        if known.is_dir():
            shutil.copytree(known, out / folder.name, dirs_exist_ok=True)
        else:
            _judge_apart(folder, known, out / folder.name)
        failed = " (failed)" if (out / folder.name / FAILED).is_file() else ""
        progress(f"{folder.name}: {time.monotonic() - start:.1f} s{failed}")


def content_of(folder: Path) -> str:
    """Sixteen hexadecimal digits that stand for a set: its name and every file in it."""
    whole = hashlib.sha256(folder.name.encode())
    for path in sorted(p for p in folder.iterdir() if p.is_file()):
        with open(path, "rb") as file:
            whole.update(f"\n{path.name} {hashlib.file_digest(file, 'sha256').hexdigest()}".encode())
    return whole.hexdigest()[:16]


def _load() -> None:
    """Judge a short flight made up for it, so that modules, compiled code and fonts are there in every branch.

    They are two fifths of what a short set costs.
    """
    made_up = swings(read("thesis"), "first", 3.0, 2, 1)
    with tempfile.TemporaryDirectory() as folder:
        deliver(made_up, *(Path(folder) / name for name in FILES[:3]))


def _judge_apart(folder: Path, known: Path, out: Path) -> None:
    """Judge a set in a process of its own; results appear as the folder `known`, whole or not at all, and in `out`."""
    part = known.with_name(f".{known.name}.{os.getpid()}.part")
    # Nobody else judges this set: what lies here was left by a process that was killed.
    for left in known.parent.glob(f".{known.name}.*.part"):
        shutil.rmtree(left, ignore_errors=True)
    part.mkdir(parents=True)
    try:
        context = multiprocessing.get_context("fork" if sys.platform == "linux" else "spawn")
        process = context.Process(target=_judge_one, args=(folder, part))
        process.start()
        process.join()
        if process.exitcode == _DISK:
            raise OSError(f"{folder.name}: {(part / FAILED).read_text(encoding='utf-8')}")
        if process.exitcode not in (0, _UNREADABLE):
            _write_failure(part, f"its process ended by signal or exit code {process.exitcode}", fault=True)
        shutil.copytree(part, out, dirs_exist_ok=True)
        if process.exitcode == 0 and not known.is_dir():
            os.replace(part, known)
    finally:
        shutil.rmtree(part, ignore_errors=True)


_DISK, _UNREADABLE = 74, 66
"""Exit codes of a process that could not write, and of one that could not read its set (sysexits.h)."""


def _judge_one(folder: Path, target: Path) -> None:
    """The files of a set's verdict, or why there are none, into `target`."""
    try:
        recordings = read_set(folder)
    except OSError as error:
        _write_failure(target, str(error), fault=False)
        sys.exit(_UNREADABLE)
    except InputError as error:
        _write_failure(target, str(error), fault=False)
        return
    try:
        deliver(recordings, *(target / name for name in FILES[:3]))
    except InputError as error:
        _write_failure(target, str(error), fault=False)
    except OSError as error:
        (target / FAILED).write_text(str(error), encoding="utf-8")
        sys.exit(_DISK)
    except Exception as error:  # any fault of the stage costs this set alone
        traceback.print_exc()
        _write_failure(target, f"{type(error).__name__}: {error}", fault=True)


def _write_failure(target: Path, reason: str, fault: bool) -> None:
    for name in FILES:
        (target / name).unlink(missing_ok=True)
    text = json.dumps({"reason": reason, "fault": fault}, indent=1, ensure_ascii=False) + "\n"
    (target / FAILED).write_text(text, encoding="utf-8")
