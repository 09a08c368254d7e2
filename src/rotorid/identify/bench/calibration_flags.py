"""Names the readings of a calibration that do not match their loads, and says what the lines are without them.

Nothing is left out by this: the lines in use go through every reading, and whoever reads the result decides.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from rotorid.identify.bench import outliers
from rotorid.identify.bench.loadcell import fit_line
from rotorid.identify.bench.outliers import Outliers


def flag(readings: pd.DataFrame) -> pd.DataFrame:
    """The readings with what their cell's other readings say of them, in three more columns.

    Parameters
    ----------
    readings
        One row a reading of any number of cells: `id`, `cell`, `weight_gf`, `reading_10uv` (1e-5 V).

    Returns
    -------
    pd.DataFrame
        The same rows with `reading_says_gf` (load by the line through the unflagged readings), `studentised` (residual
        over its standard uncertainty; NaN where a cell has too few readings to test) and `flag` (what is wrong, empty
        where nothing is).
    """
    parts = []
    for _, part in readings.groupby("cell", sort=False):
        found = outliers.find(part["reading_10uv"], part["weight_gf"], len(readings))
        says = found.line.a0 + found.line.a1 * part["reading_10uv"].to_numpy()
        loads = part["weight_gf"].to_numpy(float)
        parts.append(
            part.assign(
                reading_says_gf=says,
                studentised=found.studentised,
                flag=[_reason(i, loads, says, found) if found.flagged[i] else "" for i in range(len(part))],
            )
        )
    return pd.concat(parts).loc[readings.index]


def _reason(i: int, loads: np.ndarray, says: np.ndarray, found: Outliers) -> str:
    """Which load was on instead, where one that is known explains the reading within the limit of the test."""
    within = abs((loads[i] - says[i]) / found.studentised[i]) * found.limit
    if abs(says[i] - found.line.a0) <= within:
        return "no load was on"
    nearest = loads[np.argmin(np.abs(loads - says[i]))]
    if abs(nearest - says[i]) <= within:
        return f"the load on it was the one of {nearest:g} gf"
    return "load and reading do not match"


def as_dict(part: pd.DataFrame) -> dict:
    """One cell's flagged readings and, where there are any, its line without them, for a JSON file.

    `part` has the cell's rows of the table that `flag` gives.
    """
    flagged = part[part["flag"] != ""]
    if flagged.empty:
        return {"flagged": [], "without_flagged": None}
    kept = part[part["flag"] == ""]
    line = fit_line(kept["reading_10uv"], kept["weight_gf"])
    columns = ["id", "weight_gf", "reading_says_gf", "studentised", "flag"]
    return {
        "flagged": flagged[columns].to_dict("records"),
        "without_flagged": {
            "a0_gf": line.a0,
            "a1_gf_per_10uv": line.a1,
            "a1_interval_95": line.interval(1),
            "r": line.r,
        },
    }


def warnings(cells: Sequence[Mapping], flagged: pd.DataFrame) -> list[str]:
    """Sentences on each flagged reading, on each line that has some, and on each cell that could not be tested.

    `cells` have `cell`, `a1_gf_per_10uv`, `r` and what `as_dict` gives; `flagged` is the table that `flag` gives.
    """
    sentences = []
    for cell in cells:
        name = f"cell {cell['cell']}"
        for reading in cell["flagged"]:
            sentences.append(
                f"{name}, {reading['id']}: {reading['weight_gf']:g} gf as noted, {reading['reading_says_gf']:.2f} gf "
                f"by its reading: {reading['flag']} (studentised residual {reading['studentised']:.0f})"
            )
        if without := cell["without_flagged"]:
            sentences.append(
                f"{name}: slope {cell['a1_gf_per_10uv']:.4f} gf per 1e-5 V and r {cell['r']:.6f} with the "
                f"flagged readings, {without['a1_gf_per_10uv']:.4f} and {without['r']:.6f} without; "
                "the line in use has them all"
            )
        part = flagged[flagged["cell"] == cell["cell"]]
        if part["studentised"].isna().all():
            sentences.append(f"{name}: {len(part)} readings are too few or too alike to find a wrong one by")
    return sentences


COLUMNS = "cell id weight_gf reading_says_gf studentised flag a1_with a1_without r_with r_without".split()


def as_table(cells: Sequence[Mapping]) -> pd.DataFrame:
    """The flagged readings of all cells, one row each, with slope and r of their cell with and without them."""
    rows = [
        {
            "cell": cell["cell"],
            **reading,
            "a1_with": cell["a1_gf_per_10uv"],
            "a1_without": cell["without_flagged"]["a1_gf_per_10uv"],
            "r_with": cell["r"],
            "r_without": cell["without_flagged"]["r"],
        }
        for cell in cells
        for reading in cell["flagged"]
    ]
    return pd.DataFrame(rows, columns=COLUMNS)
