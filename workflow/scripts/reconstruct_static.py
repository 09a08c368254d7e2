"""Static tests: force of every recording by the thesis's equations and by the calibration matrix.

- Aluminium, PLA and the reference sensor along z; aluminium also along x, y and several axes at once.
- Uncertainty propagated from the calibration and the noise to each force.
- The matrix is calibrated on loads along one axis of half of the repeats; errors are of the other half.
"""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid_acquire.io.logs import read_sessions
from rotorid_lab import bench_tests as static
from rotorid_lab import log
from rotorid_lab.bench import CELLS, FORCES, force_matrix, line_of, read_geometry
from rotorid_lab.bench_tests import as_dict


def main(
    bench: Sequence[str],
    jr3: Sequence[str],
    combined: Sequence[str],
    calibration: str,
    geometry: str,
    matrix_largest_n: float,
    points: str,
    loads: str,
    series: str,
    comparison: str,
) -> None:
    """Write one row a recording (CSV), means by load (CSV), by series (CSV) and the two methods compared (JSON)."""
    cells = json.loads(Path(calibration).read_text(encoding="utf-8"))["cells"]
    lines, distances = [line_of(cell) for cell in cells], read_geometry(geometry)
    parts = []
    means = {platform: _means(bench, CELLS, platform) for platform in ("al", "pla")}
    several = _means(combined, CELLS, "al")
    for readings in (*means.values(), several):
        parts.append(static.points(readings, *static.by_equations(readings, lines, distances), "equations"))
    reference = _means(jr3, FORCES, "jr3")
    parts.append(static.points(reference, reference.values, np.sqrt(reference.variance), "sensor"))
    repeats = sorted(means["al"].sessions["repeat"].unique())
    fitted = static.matrix_of(means["al"], matrix_largest_n, set(repeats[::2]))
    held_out = static.only(means["al"], means["al"].sessions["repeat"].isin(repeats[1::2]).to_numpy())
    for readings in (held_out, several):
        parts.append(static.points(readings, *static.by_matrix(readings, fitted), "matrix"))
    table = pd.concat(parts, ignore_index=True)
    table.to_csv(points, index=False, float_format="%.9g")
    static.by_load(table).to_csv(loads, index=False, float_format="%.9g")
    alone = table[table["axis"].str.len() == 1]
    static.by_series(alone).to_csv(series, index=False, float_format="%.12g")
    found = {
        "matrix_largest_n": matrix_largest_n,
        "matrix": as_dict(fitted),
        "equations_matrix": force_matrix(distances).tolist(),
        "lateral_as_vertical": static.lateral_as_vertical(fitted, lines, distances),
        "methods": static.methods_compared(table),
    }
    Path(comparison).write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


def _means(tables: Sequence[str], channels: tuple[str, ...], platform: str) -> static.Means:
    """Mean readings of one platform from (prepared, recordings)."""
    prepared, sessions = pd.read_parquet(tables[0]), read_sessions(tables[1])
    return static.mean_readings(prepared, sessions[sessions["platform"] == platform], channels)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            bench=snakemake.input.bench,
            jr3=snakemake.input.jr3,
            combined=snakemake.input.combined,
            calibration=snakemake.input.calibration,
            geometry=snakemake.input.geometry,
            matrix_largest_n=snakemake.params.matrix_largest_n,
            points=snakemake.output.points,
            loads=snakemake.output.loads,
            series=snakemake.output.series,
            comparison=snakemake.output.comparison,
        )
