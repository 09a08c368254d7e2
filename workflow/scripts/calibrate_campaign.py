"""Calibrate the cells from the campaign's raw logs.

- Reading of each recording, line of each cell with intervals, linearity, repeatability, drift, creep.
"""

import json
from pathlib import Path

import pandas as pd

from rotorid import log
from rotorid.bench import recalibrate
from rotorid.io.tables import read_sessions


def main(prepared: str, samples: str, recordings: str, readings: str, coefficients: str) -> None:
    """Write the readings (CSV) and each cell's calibration (JSON)."""
    sessions = read_sessions(recordings)
    table = recalibrate.readings(pd.read_parquet(prepared), sessions)
    idle = recalibrate.idle_slopes(pd.read_parquet(samples), sessions)
    cells = [
        recalibrate.as_dict(int(cell), recalibrate.calibrate_cell(part, idle[int(cell)]))
        for cell, part in table.groupby("cell")
    ]
    table.to_csv(readings, index=False)
    Path(coefficients).write_text(json.dumps({"cells": cells}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            prepared=snakemake.input.prepared,
            samples=snakemake.input.samples,
            recordings=snakemake.input.recordings,
            readings=snakemake.output.readings,
            coefficients=snakemake.output.coefficients,
        )
