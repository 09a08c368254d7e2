"""Figures of the proof.

- Targets met and missed, confusion matrices of flights and of instruments, power against size, held-out error against
  the oracle's.
"""

import pandas as pd

from rotorid.report import log
from rotorid.report.plots import style
from rotorid_proof import plots as proof


def main(
    summary: str,
    confusion: str,
    power: str,
    cases: str,
    targets: str,
    matrix: str,
    instruments: str,
    curves: str,
    oracle: str,
) -> None:
    """Draw five figures from four tables."""
    said = pd.read_csv(confusion)
    style.save(proof.targets(pd.read_csv(summary)), targets)
    style.save(proof.confusion(said[said["kind"] == "flight"]), matrix)
    style.save(proof.confusion(said[said["kind"] != "flight"]), instruments)
    style.save(proof.power(pd.read_csv(power)), curves)
    style.save(proof.oracle(pd.read_csv(cases)), oracle)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            summary=snakemake.input.summary,
            confusion=snakemake.input.confusion,
            power=snakemake.input.power,
            cases=snakemake.input.cases,
            targets=snakemake.output.targets,
            matrix=snakemake.output.confusion,
            instruments=snakemake.output.instruments,
            curves=snakemake.output.power,
            oracle=snakemake.output.oracle,
        )
