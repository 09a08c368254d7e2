"""Raw logs to tidy tables.

- All samples with units in the column names and quality flags (Parquet).
- One row per recording: what was set, marks, what went wrong on the line (CSV).
"""

import logging
from collections.abc import Sequence

from rotorid_acquire.io.logs import read_tables
from rotorid_acquire.io.metadata_checksum import without_checksum
from rotorid_lab import log

LOGGER = logging.getLogger("rotorid.ingest")


def main(logs: Sequence[str], samples: str, recordings: str) -> None:
    """Read the raw logs among `logs` and write both tables."""
    table, sessions = read_tables(path for path in logs if not path.endswith(".yaml"))
    for row in sessions[~sessions["finished"]].itertuples():
        LOGGER.warning("%s did not come to its end and is left out of what follows", row.id)
    for row in sessions[sessions["faults"] != ""].itertuples():
        LOGGER.warning("%s: %s; %d samples missing", row.id, row.faults, row.missing)
    bare = sessions.loc[~sessions["metadata_checksum"], "id"]
    if len(bare):
        LOGGER.warning("%s", without_checksum(len(bare), bare.iloc[0]))
    LOGGER.info("%d recordings, %d samples, %d missing", len(sessions), len(table), sessions["missing"].sum())
    table.to_parquet(samples, index=False)
    sessions.to_csv(recordings, index=False)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            logs=list(snakemake.input.logs),
            samples=snakemake.output.samples,
            recordings=snakemake.output.recordings,
        )
