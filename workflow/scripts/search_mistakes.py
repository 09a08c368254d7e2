"""What the search for mistakes alone names of mistakes planted in a real flight.

- Reads one public flight, cuts it, plants one mistake after another and searches for mistakes.
- Writes one row a planted mistake: whether it was named, its size, and in which words.
"""

from pathlib import Path

import pandas as pd

from rotorid_lab import log
from rotorid_proof.plantings.judge import cut
from rotorid_proof.plantings.plan import parsed
from rotorid_proof.plantings.tables import mistake_rows


def main(recordings: str, flight: str, plantings: list[str], code: str, out: str) -> None:
    """Search plantings of these names in flight `flight`, cut from the public set `recordings`; rows into `out`."""
    rows = mistake_rows(cut(Path(recordings), flight), [parsed(name) for name in plantings], code)
    pd.DataFrame(rows).to_csv(out, index=False, float_format="%.6g")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            recordings=snakemake.input.recordings,
            flight=snakemake.wildcards.flight,
            plantings=snakemake.params.plantings,
            code=snakemake.params.code,
            out=snakemake.output.table,
        )
