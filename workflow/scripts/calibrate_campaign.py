"""Calibrate the cells from the campaign's raw logs.

- Reading of each recording, line of each cell with intervals, linearity, repeatability, drift, creep.
- Readings that do not match their loads, flagged and named; the lines with and without them.
"""

import json
import logging
from pathlib import Path

import pandas as pd

from rotorid_acquire.io.logs import read_sessions
from rotorid_lab import bench as reconstruct
from rotorid_lab import loadcell, log
from rotorid_lab.loadcell import FLAG_LEVEL

LOGGER = logging.getLogger("rotorid.calibration")


def main(prepared: str, samples: str, recordings: str, readings: str, coefficients: str) -> None:
    """Write the readings (CSV) and each cell's calibration (JSON)."""
    sessions = read_sessions(recordings)
    table = loadcell.flag_readings(reconstruct.readings(pd.read_parquet(prepared), sessions))
    idle = reconstruct.idle_slopes(pd.read_parquet(samples), sessions)
    cells = [
        {"cell": int(cell)} | reconstruct.calibrate_cell(part, idle[int(cell)]) | loadcell.flags_as_dict(part)
        for cell, part in table.groupby("cell")
    ]
    warnings = loadcell.flag_warnings(cells, table)
    for sentence in warnings:
        LOGGER.warning("%s", sentence)
    table.to_csv(readings, index=False)
    result = {"flag_level": FLAG_LEVEL, "readings": len(table), "warnings": warnings, "cells": cells}
    Path(coefficients).write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            prepared=snakemake.input.prepared,
            samples=snakemake.input.samples,
            recordings=snakemake.input.recordings,
            readings=snakemake.output.readings,
            coefficients=snakemake.output.coefficients,
        )
