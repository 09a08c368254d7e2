"""The experiments of table A.1 as one table of samples for the black box.

- Motor forces from throttle by the thrust tests; wrench less its reading at rest; two clocks aligned.
"""

from collections.abc import Sequence

import pandas as pd

from rotorid_acquire.io.logs import read_sessions
from rotorid_lab import log
from rotorid_lab.black_box import read_experiments, thrust_of_throttle


def main(quadrotor: Sequence[str], wrench: Sequence[str], thrust: str, experiments: str) -> None:
    """Write the samples (CSV); tables of logs come as (samples, recordings)."""
    curve = thrust_of_throttle(pd.read_csv(thrust))
    tables = [(pd.read_parquet(samples), read_sessions(recordings)) for samples, recordings in (quadrotor, wrench)]
    read_experiments(*tables, curve).to_csv(experiments, index=False, float_format="%.9g")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            quadrotor=snakemake.input.quadrotor,
            wrench=snakemake.input.wrench,
            thrust=snakemake.input.thrust,
            experiments=snakemake.output.experiments,
        )
