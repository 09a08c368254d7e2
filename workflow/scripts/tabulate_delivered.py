"""What is delivered of every set, in one table.

- Reads the rows of each set or batch.
- Writes `delivered.csv`.
"""

from pathlib import Path

from rotorid_lab import log
from rotorid_proof.delivered import table


def main(files: list[str], out: str) -> None:
    """Join the rows of `files` (JSON) into the table `out` (CSV)."""
    table([Path(file) for file in files]).to_csv(out, index=False)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(files=[*snakemake.input.sets, *snakemake.input.concealed], out=snakemake.output.table)
