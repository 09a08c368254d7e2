"""Prove `rotorid compare` on pairs of sets in which it is known what changed.

- Draws pairs of two simulators that share no code with the library, from the hash of a commit.
- Cuts drawn sets in halves, in which nothing changed.
- Plants changes in real flights, against the same flight untouched and against another flight of the vehicle.
- Compares real sets of which the authors say what changed.
- Writes the row of every pair as it comes, so that an interrupted proof goes on where it stopped.
"""

import sys
import warnings
from dataclasses import replace
from pathlib import Path

import pandas as pd

from rotorid.errors import InputError
from rotorid.report import log
from rotorid_proof.changes import pairs, score


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
    only: str = "",
    part: int = 0,
    parts: int = 1,
) -> None:
    """Write `table` (a row a pair) and `summary`; rows are kept in `so_far` as they come.

    A row of another `code` stays until its pair is compared anew. `only` takes pairs whose name begins so; `part` of
    `parts` takes every so many.
    """
    warnings.simplefilter("ignore")
    kept = Path(so_far)
    kept.parent.mkdir(parents=True, exist_ok=True)
    rows = pd.read_csv(kept, keep_default_na=False).to_dict("records") if kept.is_file() else []
    done = {r["pair"] for r in rows if str(r["judged_by"]) == code}
    chosen = pairs.pairs_of(seed, Path(recordings), Path(plantings), drawn_pairs, drawn_halves)
    known: dict = {}
    for pair in [p for p in chosen if p.name.startswith(only)][part::parts]:
        if pair.name in done:
            continue
        try:
            row = replace(pairs.compared(pair, known), judged_by=code)
        except (InputError, RuntimeError) as error:
            print(f"{pair.name}: {error}", file=sys.stderr, flush=True)
            continue
        rows = [r for r in rows if r["pair"] != row.pair] + score.table([row]).to_dict("records")
        pd.DataFrame(rows).to_csv(kept, index=False)
        print(f"{row.pair}: {row.changed or 'nothing'} -> {row.claims or 'nothing'}", file=sys.stderr, flush=True)
    found = pd.DataFrame(rows)
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
