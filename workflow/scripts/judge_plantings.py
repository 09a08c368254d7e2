"""Verdicts on real flights with something planted in them.

- Reads one public flight, cuts it, plants one set after another and runs the mismatch stage on each.
- Writes one verdict a set with the hash of the code that judged it.
"""

from pathlib import Path

from rotorid_lab import log
from rotorid_proof.plantings.judge import judge_plantings
from rotorid_proof.plantings.plan import parsed


def main(recordings: str, plantings: list[str], code: str, verdicts: str, memory: str) -> None:
    """Judge the plantings of these names, all in the public set in `recordings`, into the folder `verdicts`."""
    wanted = [parsed(name) for name in plantings]
    judge_plantings(Path(recordings), wanted, code, Path(verdicts), Path(memory), progress=log.progress)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            recordings=snakemake.input.recordings,
            plantings=snakemake.params.plantings,
            code=snakemake.params.code,
            verdicts=snakemake.output.verdicts,
            memory=snakemake.params.memory,
        )
