"""Verdicts on a batch of recording sets, one process, each set by itself.

- Judges each set as `rotorid verdict` does; what was judged before by the same code is taken from memory.
- Writes a folder a set: the files of its verdict, or `failed.json` with the reason. A set that fails costs only itself.
- A full disk and the like end the job; what was judged until then stays remembered.
"""

import sys
from pathlib import Path

from rotorid.report.fleet import judge_sets
from rotorid_lab import log


def main(folders: list[str], code: str, verdicts: str, memory: str) -> None:
    """Judge the sets in `folders` into the folder `verdicts`."""
    judge_sets([Path(f) for f in folders], code, Path(verdicts), Path(memory), progress=log.progress)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        try:
            main(
                folders=snakemake.params.folders,
                code=snakemake.params.code,
                verdicts=snakemake.output.verdicts,
                memory=snakemake.params.memory,
            )
        except OSError as error:
            sys.exit(f"rotorid: {error}; what was judged so far is remembered")
