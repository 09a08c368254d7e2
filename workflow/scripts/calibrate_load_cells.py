"""Calibrate the load cells from a table of weights and readings.

- A least-squares line for each cell (thesis eqs 2.10 to 2.13) with 95 % intervals.
- Next to it the coefficients that the thesis prints, and the difference.
- The printed weights of the combinations checked against the sum of their elements.
- Readings that do not match their loads, flagged and named; the lines with and without them.
- How far the two balances disagree, and what all cells say of the one weight that only one balance weighed.
"""

import json
import logging
from pathlib import Path

import pandas as pd

from rotorid_lab import loadcell, log
from rotorid_lab.loadcell import FLAG_LEVEL

TUBE = "Carbon Fiber Tube"
LOGGER = logging.getLogger("rotorid.calibration")


def main(weights: str, readings: str, printed: str, out: str) -> None:
    """Fit every cell in `readings` and write the JSON file `out`."""
    known_gf, cells = loadcell.read_calibration_table(readings)
    with_tube = pd.read_csv(readings)["elements"].str.contains(TUBE, regex=False).to_numpy(float)
    tube_error, tube_interval, _ = loadcell.shared_weight_error(known_gf, cells, with_tube)
    table = pd.read_csv(printed).set_index("coefficient")
    flagged = loadcell.flag_readings(loadcell.as_readings(known_gf, cells))
    fitted = []
    for cell, reading in cells.items():
        line = loadcell.fit_line(reading, known_gf)
        LOGGER.info("cell %d: a0 %.4f gf, a1 %.4f gf per 10 uV", cell, line.a0, line.a1)
        book = {name: float(table.loc[name, f"cell_{cell}"]) for name in ("a0", "a1")}
        fitted.append(
            {
                "cell": cell,
                "a0_gf": line.a0,
                "a0_interval_95": line.interval(0),
                "a0_printed_gf": book["a0"],
                "a1_gf_per_10uv": line.a1,
                "a1_interval_95": line.interval(1),
                "a1_printed_gf_per_10uv": book["a1"],
                "r": line.r,
                "residual_rms_gf": line.residual_rms,
                "residuals_gf": line.residuals,
            }
            | loadcell.flags_as_dict(flagged[flagged["cell"] == cell])
        )
    warnings = loadcell.flag_warnings(fitted, flagged)
    for sentence in warnings:
        LOGGER.warning("%s", sentence)
    result = {
        "combinations": len(known_gf),
        "largest_weight_gf": float(max(known_gf)),
        "largest_sum_error_gf": loadcell.check_weights(weights, readings),
        "largest_a0_difference_gf": max(abs(cell["a0_gf"] - cell["a0_printed_gf"]) for cell in fitted),
        "largest_a1_difference_gf_per_10uv": max(
            abs(cell["a1_gf_per_10uv"] - cell["a1_printed_gf_per_10uv"]) for cell in fitted
        ),
        "largest_one_minus_r": max(1 - cell["r"] for cell in fitted),
        "residual_rms_gf": [
            min(cell["residual_rms_gf"] for cell in fitted),
            max(cell["residual_rms_gf"] for cell in fitted),
        ],
        "balance_disagreement_share": loadcell.balance_disagreement(weights),
        "tube_error_gf": tube_error,
        "tube_error_interval_95": tube_interval,
        "tube_error_expected_gf": expected_tube_error(weights),
        "intercepts_off_zero": [
            cell["cell"] for cell in fitted if not cell["a0_interval_95"][0] <= 0 <= cell["a0_interval_95"][1]
        ],
        "printed_inside_intervals": all(
            cell[f"{name}_interval_95"][0] <= cell[key] <= cell[f"{name}_interval_95"][1]
            for cell in fitted
            for name, key in (("a0", "a0_printed_gf"), ("a1", "a1_printed_gf_per_10uv"))
        ),
        "flag_level": FLAG_LEVEL,
        "readings": len(flagged),
        "warnings": warnings,
        "cells": fitted,
    }
    Path(out).write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")


def expected_tube_error(weights: str) -> float:
    """Error of the tube's weight [gf] if the balance that weighed it is off as with the other elements.

    The others count with the mean of both balances, which lies half of the disagreement below the first.
    """
    tube_gf = pd.read_csv(weights).set_index("element").loc[TUBE, "ohaus_gf"]
    return -float(tube_gf) * loadcell.balance_disagreement(weights) / 2


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            weights=snakemake.input.weights,
            readings=snakemake.input.readings,
            printed=snakemake.input.printed,
            out=snakemake.output.coefficients,
        )
