"""Verdicts on concealed sets.

- Reads each set, knows nothing else, runs the mismatch stage on it.
- Writes one verdict a set, the time that each took, and the hash of the code that judged it.
"""

from pathlib import Path

from rotorid_lab import log
from rotorid_proof.judge import judge_folder


def main(sets: str, verdicts: str, code: str) -> None:
    """Judge every set below `sets` by the code of this hash."""
    judge_folder(Path(sets), Path(verdicts), progress=log.progress, code=code)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(sets=snakemake.input.sets, verdicts=snakemake.output.verdicts, code=snakemake.params.code)
