"""Other methods on concealed sets.

- Gives each the residual, the columns and the training runs that our own search works on.
- Writes what each says of each set, in the words of a verdict.
"""

from pathlib import Path

from rotorid_lab import log
from rotorid_proof.peers.asking import ask_folder


def main(sets: str, peers: str) -> None:
    """Ask every peer about every set below `sets`."""
    ask_folder(Path(sets), Path(peers), progress=log.progress)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(sets=snakemake.input.sets, peers=snakemake.output.peers)
