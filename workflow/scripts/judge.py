"""Verdicts on concealed sets.

- Reads each set, knows nothing else, runs the mismatch stage on it.
- Writes one verdict a set, and the time that each took.
"""

import sys
from pathlib import Path

from rotorid import log
from rotorid.proof.judge import judge_folder


def main(sets: str, verdicts: str) -> None:
    """Judge every set below `sets`."""
    judge_folder(Path(sets), Path(verdicts), progress=report_progress)


def report_progress(text: str) -> None:
    """One line for the person who waits."""
    print(f"  {text}", file=sys.stderr, flush=True)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(sets=snakemake.input.sets, verdicts=snakemake.output.verdicts)
