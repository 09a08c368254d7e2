"""Tensile tests of printed PLA.

- Stress-strain curve of each specimen, modulus, strength, 0.2 % yield.
- Mean of each infill density with its interval, next to the thesis's table 2.5.
"""

import pandas as pd

from rotorid_acquire.io.logs import read_sessions
from rotorid_lab import loadcell, log


def main(samples: str, recordings: str, printed: str, specimens: str, infill: str, curves: str) -> None:
    """Write one row a specimen (CSV), one an infill density (CSV) and the curves (Parquet)."""
    table, stress = loadcell.specimens(pd.read_parquet(samples), read_sessions(recordings))
    table.to_csv(specimens, index=False, float_format="%.9g")
    loadcell.by_infill(table, pd.read_csv(printed)).to_csv(infill, index=False, float_format="%.9g")
    stress.to_parquet(curves, index=False)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            samples=snakemake.input.samples,
            recordings=snakemake.input.recordings,
            printed=snakemake.input.printed,
            specimens=snakemake.output.specimens,
            infill=snakemake.output.infill,
            curves=snakemake.output.curves,
        )
