"""Prove a fleet's history on simulated vehicles of which it is known what changed and since which flight.

- Draws vehicles with ten flights each from the hash of a commit; half of them change from some flight on.
- Compares every later flight with the first three.
- Writes the row of every vehicle as it comes, so that an interrupted proof goes on where it stopped.
"""

import warnings
from pathlib import Path

from rotorid_lab import log
from rotorid_proof.changes import fleet
from rotorid_proof.row_by_row import rows_of


def main(table: str, so_far: str, seed: str, code: str = "", vehicles: int = 20) -> None:
    """Write `table` (a row a vehicle); rows are kept in `so_far` as they come."""
    warnings.simplefilter("ignore")
    found = rows_of(fleet.cases(seed, vehicles), fleet.row_of, fleet.table, Path(so_far), code, key="vehicle")
    found.to_csv(table, index=False)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            table=snakemake.output.table,
            so_far=snakemake.params.so_far,
            seed=snakemake.params.seed,
            code=str(snakemake.params.code),
        )
