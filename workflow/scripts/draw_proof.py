"""Figures of the proof.

- Confusion matrices of flights and of instruments, power against size, held-out error against the oracle's.
"""

import pandas as pd

from rotorid.report.plots import style
from rotorid_lab import log
from rotorid_proof import plots as proof


def main(
    confusion: str,
    power: str,
    cases: str,
    matrix: str,
    instruments: str,
    curves: str,
    oracle: str,
) -> None:
    """Draw four figures from three tables."""
    said = pd.read_csv(confusion)
    style.save(proof.confusion(said[said["kind"] == "flight"]), matrix)
    style.save(proof.confusion(said[said["kind"] != "flight"]), instruments)
    style.save(proof.power(pd.read_csv(power)), curves)
    style.save(proof.oracle(pd.read_csv(cases)), oracle)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            confusion=snakemake.input.confusion,
            power=snakemake.input.power,
            cases=snakemake.input.cases,
            matrix=snakemake.output.confusion,
            instruments=snakemake.output.instruments,
            curves=snakemake.output.power,
            oracle=snakemake.output.oracle,
        )
