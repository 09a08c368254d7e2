"""Static tests of each platform as a recording set of kind bench.

- Reconstructed force next to the load that was put on, all axes of the platform.
"""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.recordings import write_set
from rotorid_acquire.io.logs import read_sessions
from rotorid_lab import log
from rotorid_lab.bench import bench_force, bench_set, read_geometry


def main(
    bench: Sequence[str],
    jr3: Sequence[str],
    calibration: str,
    geometry: str,
    noise_n: float,
    reference_noise_n: float,
    folders: dict[str, str],
) -> None:
    """Write the set of each platform (`al`, `pla`, `jr3`) to its folder; tables come as (prepared, recordings)."""
    cells = json.loads(Path(calibration).read_text(encoding="utf-8"))["cells"]
    coefficients = np.array([[cell["a0_gf"], cell["a1_gf_per_10uv"]] for cell in cells])
    force_of = bench_force(coefficients, read_geometry(geometry))
    tables = {
        name: (pd.read_parquet(pair[0]), read_sessions(pair[1])) for name, pair in (("bench", bench), ("jr3", jr3))
    }
    for platform, folder in folders.items():
        prepared, sessions = tables["jr3" if platform == "jr3" else "bench"]
        mine = sessions[sessions["platform"] == platform].reset_index(drop=True)
        noise = reference_noise_n if platform == "jr3" else noise_n
        write_set(bench_set(Path(folder).name, prepared, mine, force_of, noise), Path(folder).parent)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            bench=snakemake.input.bench,
            jr3=snakemake.input.jr3,
            calibration=snakemake.input.calibration,
            geometry=snakemake.input.geometry,
            noise_n=snakemake.params.noise_n,
            reference_noise_n=snakemake.params.reference_noise_n,
            folders=dict(snakemake.output.items()),
        )
