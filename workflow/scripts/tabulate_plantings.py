"""Tables of the plantings.

- Scores every verdict on a planted set against the verdict on its flight untouched.
- Keeps rows of plantings that were judged before and are not asked for now.
- Writes one row a planted cause, shares with their intervals, and what was new or lost with which cause.
"""

import json
from pathlib import Path

from rotorid_lab import log
from rotorid_proof.plantings.write import write_tables


def main(flights, recordings, untouched, verdicts, kept, judge, out) -> None:
    """Tables into the folder `out`; `judge` is the hash of the code that judges now."""
    before = {name: json.loads(Path(path).read_text()) for name, path in zip(flights, untouched, strict=True)}
    folders = dict(zip(flights, map(Path, recordings), strict=True))
    write_tables(folders, before, [Path(v) for v in verdicts], [Path(k) for k in kept], judge, Path(out))


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            flights=snakemake.params.flights,
            recordings=snakemake.input.recordings,
            untouched=snakemake.input.untouched,
            verdicts=snakemake.input.verdicts,
            kept=snakemake.input.get("kept", []),
            judge=snakemake.params.judge,
            out=str(Path(snakemake.output.table).parent),
        )
