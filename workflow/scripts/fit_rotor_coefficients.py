"""Thrust coefficients of the 5-inch propellers from the stand runs.

- Each motor: through the origin and with an offset of each run, with 95 % intervals.
- Each propeller: random-effects mean over motors, outlying motors, exponent of the speed, rest readings.
- Where the recordings are not there, the result says so.
"""

import json
from collections.abc import Sequence
from pathlib import Path

import pandas as pd

from rotorid.recordings import read_set
from rotorid.recordings.importers.faults import read_report
from rotorid_lab import log
from rotorid_lab.rotor import PROPELLER_COLUMNS, summarise_propeller


def main(
    sets: Sequence[str],
    speed_noise_relative: float,
    outlying_above: float,
    summary: str,
    motors: str,
    points: str,
) -> None:
    """Fit every propeller in `sets`; write the summary (JSON), the motors' table and the points (CSV)."""
    reports = [read_report(Path(folder)) for folder in sets]
    result = {
        "available": all(report["available"] for report in reports),
        "reason": next((r["reason"] for r in reports if not r["available"]), ""),
        "speed_noise_relative": speed_noise_relative,
        "outlying_above": outlying_above,
        "propellers": {},
    }
    rows, scattered = [], []
    if result["available"]:
        for folder in sets:
            found, more, cloud = summarise_propeller(read_set(folder), speed_noise_relative, outlying_above)
            result["propellers"][Path(folder).name.removeprefix("strawson-")] = found
            rows += more
            scattered += cloud
    Path(summary).write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    pd.DataFrame(rows, columns=PROPELLER_COLUMNS).to_csv(motors, index=False)
    cloud_columns = ["propeller", "run", "speed_rad_s", "thrust_n", "used"]
    pd.DataFrame(scattered, columns=cloud_columns).to_csv(points, index=False)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            sets=snakemake.input.sets,
            speed_noise_relative=snakemake.params.speed_noise_relative,
            outlying_above=snakemake.params.outlying_above,
            summary=snakemake.output.summary,
            motors=snakemake.output.motors,
            points=snakemake.output.points,
        )
