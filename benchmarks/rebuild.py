"""What a rebuild costs: from nothing, and with nothing to do.

Run: python benchmarks/rebuild.py [--out benchmarks/rebuild.md] [--cores 2]

The committed state is cloned to a temporary folder with an environment of its own, so that nothing is done yet. Public
recordings are used where `ROTORID_PUBLIC_DATA` names them. Not part of `python -m benchmarks`: it takes ten minutes.
"""

from __future__ import annotations

import argparse
import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def timed(command: list[str], folder: Path) -> tuple[float, float]:
    """Processor time of a command and all that it starts, and wall time, s."""
    used, begin = resource.getrusage(resource.RUSAGE_CHILDREN), time.perf_counter()
    subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    now = resource.getrusage(resource.RUSAGE_CHILDREN)
    return now.ru_utime + now.ru_stime - used.ru_utime - used.ru_stime, time.perf_counter() - begin


def main(out: Path | None, cores: int) -> None:
    rows = []
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "rotorid"
        subprocess.run(["git", "clone", "--quiet", ROOT, folder], check=True)
        subprocess.run(["make", "environment"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
        snakemake = [str(folder / ".venv/bin/snakemake"), "--cores", str(cores)]
        for what in ("the report from raw logs", "the report with nothing to do"):
            rows.append((what, *timed(snakemake, folder)))
            print(*rows[-1], file=sys.stderr)
    code = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, check=True, capture_output=True, text=True)
    data = "with" if os.environ.get("ROTORID_PUBLIC_DATA") else "without"
    text = "\n".join(
        [
            "# Rebuild",
            "",
            f"`python benchmarks/rebuild.py`: Python {platform.python_version()}, {cores} cores, code of "
            f"{code.stdout.strip()}, {data} public recordings.",
            "",
            "| what | processor time, s | wall time, s |",
            "| --- | ---: | ---: |",
            *(f"| {what} | {used:.3g} | {wall:.3g} |" for what, used, wall in rows),
            "",
        ]
    )
    out.write_text(text) if out else print(text)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--cores", type=int, default=2)
    given = parser.parse_args()
    main(given.out, given.cores)
