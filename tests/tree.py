"""What a test may not read: anything that the workflow or a user leaves in the tree.

A test that reads `results/`, `cache/` or an own set under `raw/` passes or fails with what was run before it. So each
look at such a path in a test's process, also by `Path.exists` and also where nothing is there, ends the test.
"""

import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
OUTPUTS = ("results", "cache", ".snakemake")
ON_THE_PATH = os.path.join(".snakemake", "pip-deployments")
"""Where Snakemake, once it is imported, has packages looked for as well."""
RAW = "raw"


def tracked_in(folder: str) -> frozenset[str] | None:
    """Files that git tracks below a folder of the tree and the folders of these; None outside a clone."""
    command = ["git", "-C", str(ROOT), "ls-files", "-z", folder]
    try:
        listed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    except (OSError, subprocess.CalledProcessError):
        return None
    files = [name for name in listed.split("\0") if name]
    return frozenset([folder, *files, *(str(parent) for name in files for parent in Path(name).parents)]) or None


def for_packages() -> bool:
    """Whether packages are being listed: Snakemake looks for its plugins among all names where Python looks."""
    frame = sys._getframe()
    while frame is not None:
        if frame.f_globals.get("__name__") == "pkgutil":
            return True
        frame = frame.f_back
    return False


class Guard:
    """Watches how this process looks at the tree while a test module is imported or a test runs."""

    def __init__(self) -> None:
        self.on = False
        self.prefix = str(ROOT) + os.sep
        self.raw = tracked_in(RAW)

    def output(self, path: object, start: str | None = None) -> str | None:
        """The path from the root if it is no part of what git tracks, else None; `start` is where it is relative to."""
        if isinstance(path, bytes):
            path = os.fsdecode(path)
        elif isinstance(path, os.PathLike):
            path = os.fspath(path)
        if not isinstance(path, str) or "\0" in path:
            return None
        if not path.startswith(os.sep):
            path = os.path.join(start or os.getcwd(), path)
        if not path.startswith(self.prefix) and os.pardir not in path:
            return None
        path = os.path.normpath(path)
        if not path.startswith(self.prefix):
            return None
        inside = path[len(self.prefix) :]
        if (inside + os.sep).startswith(ON_THE_PATH + os.sep):
            return None
        first = inside.partition(os.sep)[0]
        if first in OUTPUTS or (first == RAW and self.raw is not None and inside not in self.raw):
            return inside
        return None

    def look(self, path: object, start: str | None = None) -> None:
        """End the test that looks at an output."""
        if self.on and (found := self.output(path, start)) and not for_packages():
            pytest.fail(
                f"{found} is looked at: a test reads what git tracks and its own temporary folder alone "
                f"(tests/tree.py), else it depends on what was run before it"
            )

    def hear(self, event: str, arguments: tuple) -> None:
        """Audit hook: files opened, folders listed, programs started on an output."""
        if event == "open":
            path, mode, _ = arguments
            # os.open comes without a mode and may be relative to an open folder, which is not told.
            if mode is not None or (isinstance(path, str) and path.startswith(os.sep)):
                self.look(path)
        elif event in ("os.listdir", "os.scandir"):
            self.look(os.getcwd() if arguments[0] is None else arguments[0])
        elif event == "subprocess.Popen":
            _, words, folder, _ = arguments
            start = os.path.abspath(folder) if folder else None
            for word in [words] if isinstance(words, str | bytes) else words:
                self.look(word, start)

    def over(self, function: Callable) -> Callable:
        """`os.stat` or `os.lstat`, which no audit event tells of, with a look before it."""

        def stat(path, *, dir_fd=None, **options):
            if dir_fd is None:
                self.look(path)
            return function(path, dir_fd=dir_fd, **options)

        return stat

    def stand(self) -> None:
        """Have every look pass by; nothing is ended before `watching`."""
        sys.addaudithook(self.hear)
        os.stat, os.lstat = self.over(os.stat), self.over(os.lstat)

    @contextmanager
    def watching(self, test: Path) -> Iterator[None]:
        """Watch what is done for a test; the tests of the small proof, run by themselves, read `results/`."""
        before, self.on = self.on, not test.is_relative_to(ROOT / "tests" / "results")
        try:
            yield
        finally:
            self.on = before


GUARD = Guard()
