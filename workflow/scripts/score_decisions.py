"""Decisions scored on the evidence that is kept.

- Lets every decision speak on every set, then opens what is true of each.
- Writes one table of counts by plant, laboratory and family, and one line a set.
"""

from pathlib import Path

from rotorid_lab import log
from rotorid_proof.decisions.bench import write_tables


def main(folder: str, engine: str, out: str, cores: int) -> None:
    """Score what is kept in `folder` into the folder `out`; evidence of another code than `engine` is marked older."""
    write_tables(Path(folder), engine, Path(out), cores)
    log.progress((Path(out) / "decisions.md").read_text(encoding="utf-8"))


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            folder=snakemake.params.folder,
            engine=snakemake.params.engine,
            out=str(Path(snakemake.output.table).parent),
            cores=snakemake.threads,
        )
