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


def main(folder: str, target: str, off: list[str]) -> None:
    """Analyse the set in `folder`, without the rules named in `off`, and write the files into `target`."""
    log.progress(deliver(read_set(Path(folder)), Path(target), off).sentence)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        try:
            target = Path(snakemake.output.verdict).parent
            main(folder=snakemake.params.folder, target=str(target), off=snakemake.params.off)
        except OSError as error:
            what = f"{error.filename}: {error.strerror}" if error.filename else str(error)
            sys.exit(f"rotorid: {what}; nothing was written")
