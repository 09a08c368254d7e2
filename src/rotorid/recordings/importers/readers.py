"""Other people's readers at work: with a limit on their memory, and without what they print.

Packed logs can be made to unpack to anything. Where the system can (Linux), the process gets a limit while a log is
read, so that a bomb ends as one sentence and not with the machine. What is wrong with a log is said once, by the
importer; the readers print a line for each byte that they stumble over.
"""

from __future__ import annotations

import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path

from rotorid.errors import InputError
from rotorid.io.text.bounds import LEAST_MEMORY, MEMORY_TIMES_FILE


@contextmanager
def limited(path: Path) -> Iterator[None]:
    """Inside, memory beyond the limit for this file is an InputError; nothing is limited where the system cannot."""
    try:
        import resource
    except ImportError:  # pragma: no cover - depends on the platform
        yield
        return
    taken = _taken_bytes()
    size = path.stat().st_size if path.is_file() else sum(p.stat().st_size for p in path.rglob("*") if p.is_file())
    more = max(LEAST_MEMORY, MEMORY_TIMES_FILE * size)
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    if taken is None or (soft != resource.RLIM_INFINITY and soft <= taken + more):
        yield
        return
    resource.setrlimit(resource.RLIMIT_DATA, (taken + more, hard))
    try:
        yield
    except MemoryError:
        raise InputError(
            f"{path}: reading it takes more than {more / 1e6:.0f} MB of memory, far more than a log of its size does"
        ) from None
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))


@contextmanager
def silent() -> Iterator[None]:
    """Inside, nothing reaches the screen, not even from compiled code."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = [os.dup(number) for number in (1, 2)]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for number in (1, 2):
            os.dup2(nowhere, number)
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            yield
    finally:
        for number, own in zip((1, 2), kept, strict=True):
            os.dup2(own, number)
            os.close(own)
        os.close(nowhere)


def _taken_bytes() -> int | None:
    """Bytes that count against the limit already; None where the system does not say."""
    try:
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    except OSError:
        return None
    return next((int(line.split()[1]) * 1024 for line in lines if line.startswith("VmData:")), None)
