"""Bench readings made ready.

- Spikes out, rest reading off.
- The thesis's first-order low-pass, and a zero-phase one for work after the fact.
"""

from collections.abc import Mapping

import pandas as pd

from rotorid_acquire.io.logs import read_sessions
from rotorid_lab import log
from rotorid_lab.bench import Filter, prepare


def main(samples: str, recordings: str, settings: Mapping, prepared: str) -> None:
    """Write the prepared recordings (Parquet)."""
    prepare(pd.read_parquet(samples), read_sessions(recordings), Filter(**settings)).to_parquet(prepared, index=False)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            samples=snakemake.input.samples,
            recordings=snakemake.input.recordings,
            settings=snakemake.params.settings,
            prepared=snakemake.output.prepared,
        )
