"""Prove `rotorid compare` on pairs of sets in which it is known what changed.

- Draws pairs of two simulators that share no code with the library, from the hash of a commit.
- Cuts drawn sets in halves, in which nothing changed.
- Plants changes in real flights, against the same flight untouched and against another flight of the vehicle.
- Compares real sets of which the authors say what changed.
- Writes the row of every pair as it comes, so that an interrupted proof goes on where it stopped.
"""

import warnings
from functools import partial
from pathlib import Path

from rotorid_lab import log
from rotorid_proof.changes import pairs, score
from rotorid_proof.row_by_row import rows_of


def main(
    table: str,
    summary: str,
    so_far: str,
    recordings: str,
    plantings: str,
    seed: str,
    code: str = "",
    drawn_pairs: int = 100,
    drawn_halves: int = 100,
) -> None:
    """Write `table` (a row a pair) and `summary`; rows are kept in `so_far` as they come.

    Of each simulator `drawn_pairs` pairs and `drawn_halves` sets are drawn from `seed`, the hash of a commit.
    """
    warnings.simplefilter("ignore")
    chosen = pairs.pairs_of(seed, Path(recordings), Path(plantings), drawn_pairs, drawn_halves)
    found = rows_of(chosen, partial(pairs.compared, known={}), score.table, Path(so_far), code, key="pair")
    found.to_csv(table, index=False)
    score.summary(found).to_csv(summary, index=False)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            table=snakemake.output.table,
            summary=snakemake.output.summary,
            so_far=snakemake.params.so_far,
            recordings=snakemake.params.recordings,
            plantings=snakemake.input.plantings,
            seed=snakemake.params.seed,
            code=str(snakemake.params.code),
        )
