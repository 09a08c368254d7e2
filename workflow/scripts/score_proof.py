"""Verdicts against answers.

- Opens the sealed answers and scores every verdict and every peer's word on the same set.
- Writes the table of targets and what stands behind it.
"""

from pathlib import Path

from rotorid_lab import log
from rotorid_proof.write import write_tables


def main(verdicts: list[str], answers: list[str], peers: list[str], out: str, present: str) -> None:
    """Score what is in the folders and write the tables into `out`; `present` is the hash of the code that judges."""
    write_tables([Path(p) for p in verdicts], [Path(p) for p in answers], [Path(p) for p in peers], Path(out), present)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            verdicts=snakemake.input.verdicts,
            answers=snakemake.input.answers,
            peers=snakemake.input.get("peers", []),
            out=str(Path(snakemake.output.summary).parent),
            present=snakemake.params.judging,
        )
