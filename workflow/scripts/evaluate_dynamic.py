"""Dynamic tests: thrust over time on three platforms, three sets.

- Force along z by the thesis's equations or as the reference sensor gives it; raw, low-passed, without lag.
- Largest thrust, noise at rest, return to zero, and the levels that platforms agree in.
"""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid_acquire.io.logs import by_recording, read_sessions
from rotorid_lab import bench_tests as static
from rotorid_lab import log
from rotorid_lab.bench import CELLS, Geometry, cell_forces, forces, read_geometry

KINDS = ("", "_low_pass", "_zero_phase")


def main(
    bench: Sequence[str],
    jr3: Sequence[str],
    calibration: str,
    geometry: str,
    flights: str,
    figures: str,
    levels: str,
    summary: str,
) -> None:
    """Write the flights (Parquet), one row a flight (CSV), the levels held (CSV) and the platforms' ratios (JSON)."""
    cells = json.loads(Path(calibration).read_text(encoding="utf-8"))["cells"]
    coefficients = np.array([[cell["a0_gf"], cell["a1_gf_per_10uv"]] for cell in cells])
    distances = read_geometry(geometry)
    parts = []
    sets = static.sets_of(pd.concat([read_sessions(tables[1]) for tables in (bench, jr3)], ignore_index=True))
    for tables in (bench, jr3):
        prepared, sessions = pd.read_parquet(tables[0]), read_sessions(tables[1])
        force_z = {
            f"{name}{kind}": _force_z(table, kind, coefficients, distances)
            for name, table in by_recording(prepared).items()
            for kind in KINDS
        }
        parts.append(static.flights(force_z, prepared, sessions, sets))
    flown = pd.concat(parts, ignore_index=True)
    flown.to_parquet(flights, index=False)
    static.figures(flown).to_csv(figures, index=False, float_format="%.9g")
    held = static.agreement(flown)
    held.to_csv(levels, index=False, float_format="%.9g")
    found = {entry["platform"]: entry for entry in static.ratios(held)}
    Path(summary).write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


def _force_z(table: pd.DataFrame, kind: str, coefficients: np.ndarray, geometry: Geometry) -> np.ndarray:
    """F_z, N, shape (n,), of one kind of signal."""
    if CELLS[0] in table:
        volts = table[[name + kind for name in CELLS]].to_numpy()
        return forces(cell_forces(volts, coefficients), geometry)[:, 2]
    return table[f"force_z_n{kind}"].to_numpy()


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            bench=snakemake.input.bench,
            jr3=snakemake.input.jr3,
            calibration=snakemake.input.calibration,
            geometry=snakemake.input.geometry,
            flights=snakemake.output.flights,
            figures=snakemake.output.figures,
            levels=snakemake.output.levels,
            summary=snakemake.output.summary,
        )
