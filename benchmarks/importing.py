"""Import of logs compared with decoding alone: processor time.

Run: python benchmarks/importing.py [--out benchmarks/importing.md]

PX4 logs of the folder that ROTORID_PUBLIC_DATA names: pyulog alone (`ULog(path)`, every topic decoded) and our import,
which reads by pyulog as well and makes contract columns, faults and the airborne part. Raw logs of the campaign:
unpacking alone (gzip), and our reader, which checks every frame, finds gaps and makes a table.
"""

from __future__ import annotations

import argparse
import gzip
import os
import platform
import sys
import time
from importlib.metadata import version
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from pyulog import ULog

from rotorid.errors import InputError
from rotorid.recordings.importers.logfile import read_log as import_log
from rotorid_acquire.io.logs import read_log

ROOT = Path(__file__).resolve().parents[1]
REPEATS = 3


def main(out: Path | None) -> None:
    public = Path(os.environ.get("ROTORID_PUBLIC_DATA", "nowhere")) / "px4-ulog"
    rows = [px4(path) for path in sorted(public.glob("*.ulg"))]
    raw = sorted((ROOT / "raw/campaign").rglob("*.rlog.gz"), key=lambda p: (-p.stat().st_size, p.name))
    rows += [campaign(path) for path in raw[:3]]
    text = "\n".join(
        [
            "# Import of logs",
            "",
            f"`python benchmarks/importing.py`: Python {platform.python_version()}, pyulog {version('pyulog')}, pandas "
            f"{version('pandas')}; processor time of one core, the least of {REPEATS}.",
            "",
            "| log | MB | plain decoding, s | our import, s | beyond plain, s | what comes out |",
            "| --- | ---: | ---: | ---: | ---: | --- |",
            *rows,
            "",
            "Plain decoding is pyulog for PX4, unpacking alone for the raw logs of the campaign.",
            "",
        ]
    )
    print(text)
    if out:
        out.write_text(text, encoding="utf-8")


def px4(path: Path) -> str:
    """A line for a PX4 log."""

    def ours() -> str:
        try:
            tables = import_log(path, None).runs.values()
        except InputError as error:
            return f"refused: {str(error).removeprefix(f'{path}: ')}"
        return f"{sum(len(t) for t in tables)} samples in {len(tables)} runs"

    return line(path, lambda: ULog(str(path)), ours)


def campaign(path: Path) -> str:
    """A line for a raw log."""
    return line(path, lambda: gzip.decompress(path.read_bytes()), lambda: f"{len(read_log(path).table)} samples")


def line(path: Path, plain, ours) -> str:
    """A line of the table."""
    plain_s, _ = least(plain)
    ours_s, said = least(ours)
    size = path.stat().st_size / 1e6
    return f"| {path.name} | {size:.2f} | {plain_s:.3f} | {ours_s:.3f} | {ours_s - plain_s:.3f} | {said} |"


def least(function):
    """Least processor time of some runs in s, and what the function gives."""
    found = []
    for _ in range(REPEATS):
        begin = time.process_time()
        answer = function()
        found.append(time.process_time() - begin)
    return min(found), answer


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path)
    main(parser.parse_args().out)
