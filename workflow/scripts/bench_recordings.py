"""Static tests of one platform as a recording set of kind bench.

- Reconstructed force beside the load that was put on, all axes of the platform.
"""

import json
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid import log
from rotorid.bench.reconstruct import read_geometry
from rotorid.bench.recordings import bench_force, bench_set
from rotorid.io.tables import read_sessions
from rotorid.recordings import write_set


def main(
    prepared: str, recordings: str, platform: str, calibration: str, geometry: str, noise_n: float, folder: str
) -> None:
    """Write the set of `platform` to `folder`."""
    sessions = read_sessions(recordings)
    sessions = sessions[sessions["platform"] == platform].reset_index(drop=True)
    cells = json.loads(Path(calibration).read_text(encoding="utf-8"))["cells"]
    coefficients = np.array([[cell["a0_gf"], cell["a1_gf_per_10uv"]] for cell in cells])
    force_of = bench_force(coefficients, read_geometry(geometry))
    made = bench_set(Path(folder).name, pd.read_parquet(prepared), sessions, force_of, noise_n)
    write_set(made, Path(folder).parent)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            prepared=snakemake.input.prepared,
            recordings=snakemake.input.recordings,
            platform=snakemake.params.platform,
            calibration=snakemake.input.calibration,
            geometry=snakemake.input.geometry,
            noise_n=snakemake.params.noise_n,
            folder=snakemake.output.folder,
        )
