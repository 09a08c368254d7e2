"""Prove what verdicts state of the path from command to thrust.

- Conceals the rotor speeds of real flights that recorded them, and compares what is stated with what they say.
- Draws gentle flights in gusts, of which commands alone are recorded, from the hash of a commit.
- Writes the rows of every set as they come, so that an interrupted proof goes on where it stopped.
"""

import warnings
from pathlib import Path

from rotorid_lab import log
from rotorid_proof import path


def main(
    speeds: str,
    speeds_summary: str,
    feedback: str,
    feedback_summary: str,
    so_far: str,
    recordings: str,
    folder: str,
    seed: str,
    each: int,
    code: str = "",
) -> None:
    """Write the two tables and their summaries; sets and rows are kept in the folder `so_far`."""
    warnings.simplefilter("ignore")
    kept = Path(so_far)
    sets = path.prepared(
        kept / "sets", lambda: path.public_sets(Path(recordings), Path(folder) if folder else None), code
    )
    found = path.kept_rows(sets, path.concealed_rows, kept / "concealed_speeds.csv", code)
    found.to_csv(speeds, index=False, float_format="%.5g")
    path.summary(found).to_csv(speeds_summary, index=False)
    names = [(name,) for name in path.feedback_names(seed, each)]
    drawn = path.kept_rows(names, path.feedback_rows, kept / "feedback.csv", code)
    drawn.to_csv(feedback, index=False, float_format="%.5g")
    path.feedback_summary(drawn).to_csv(feedback_summary, index=False)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            speeds=snakemake.output.speeds,
            speeds_summary=snakemake.output.speeds_summary,
            feedback=snakemake.output.feedback,
            feedback_summary=snakemake.output.feedback_summary,
            so_far=snakemake.params.so_far,
            recordings=snakemake.params.recordings,
            folder=snakemake.params.folder,
            seed=snakemake.params.seed,
            each=snakemake.params.each,
            code=str(snakemake.params.code),
        )
