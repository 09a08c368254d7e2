"""The verdict on a real flight with nothing planted in it, to which those on its plantings are compared.

- Reads one public flight, cuts it as its plantings are and runs the mismatch stage.
- Writes the verdict with the hash of the code that judged it.
"""

from pathlib import Path

from rotorid_lab import log
from rotorid_proof.plantings.judge import judge_untouched


def main(recordings: str, flight: str, code: str, out: str, memory: str) -> None:
    """Judge flight `flight` of the public set in `recordings` into the file `out`."""
    judge_untouched(Path(recordings), flight, code, Path(out), Path(memory))


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            recordings=snakemake.input.recordings,
            flight=snakemake.wildcards.flight,
            code=snakemake.params.code,
            out=snakemake.output.verdict,
            memory=snakemake.params.memory,
        )
