"""The verdict on one recording set.

- Reads the set, analyses it, runs the simulation forward with the believed, refitted and improved vehicle.
- Writes the verdict, the improved vehicle (read back and simulated to prove that it holds the model) and the page.
- Bad input, a full disk and the like end the job with one sentence; the three files are then as they were before.
"""

import sys
from pathlib import Path

from rotorid.recordings import read_set
from rotorid.report.deliver import deliver
from rotorid_lab import log


def main(folder: str, verdict: str, page: str, improved: str, off: list[str]) -> None:
    """Analyse the set in `folder`, without the rules named in `off`, and write the three files."""
    log.progress(deliver(read_set(Path(folder)), Path(verdict), Path(page), Path(improved), off).sentence)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        try:
            main(
                folder=snakemake.params.folder,
                verdict=snakemake.output.verdict,
                page=snakemake.output.page,
                improved=snakemake.output.improved,
                off=snakemake.params.off,
            )
        except OSError as error:
            what = f"{error.filename}: {error.strerror}" if error.filename else str(error)
            sys.exit(f"rotorid: {what}; nothing was written")
