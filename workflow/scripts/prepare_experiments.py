"""The 48 dynamics experiments as one table of samples for the black box.

- Motor forces from throttle by the thrust tests; wrench less its reading at rest; two clocks aligned.
- Without logs: stand-in samples from the white box.
"""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid import log
from rotorid.blackbox.experiments import generated_experiments, read_experiments, thrust_of_throttle
from rotorid.recordings import read_vehicle


def main(logs: Sequence[str], thrust: str, vehicle_file: str, seed: int, experiments: str) -> None:
    """Write the samples (CSV)."""
    curve = thrust_of_throttle(pd.read_csv(thrust))
    pairs = []
    for path in sorted(p for p in logs if "-quadrotor." in p):
        number = int(re.search(r"exp-(\d+)-", Path(path).name).group(1))
        pairs.append((number, path, path.replace("-quadrotor.", "-wrench.")))
    if pairs:
        table = read_experiments(pairs, curve)
    else:
        vehicle = read_vehicle(Path(vehicle_file))
        table = generated_experiments(vehicle, curve, 0.03, 3e-4, np.random.default_rng(seed))
    table.to_csv(experiments, index=False, float_format="%.9g")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            logs=list(snakemake.input.get("logs", [])),
            thrust=snakemake.input.thrust,
            vehicle_file=snakemake.input.vehicle,
            seed=snakemake.params.seed,
            experiments=snakemake.output.experiments,
        )
