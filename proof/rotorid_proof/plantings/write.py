"""The plantings' tables as files."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from rotorid_proof.plantings import tables
from rotorid_proof.plantings.judge import cut
from rotorid_proof.plantings.plan import parsed

SIGNIFICANT = "%.6g"


def write_tables(
    folders: Mapping[str, Path],
    untouched: Mapping[str, Mapping[str, Any]],
    verdicts: Sequence[Path],
    kept: Sequence[Path],
    code: str,
    out: Path,
) -> pd.DataFrame:
    """Write plantings.csv, plantings_summary.csv and plantings_beside.csv into `out`; returns the first.

    Parameters
    ----------
    folders
        Flight to the folder of its imported public set.
    untouched
        Flight to the result on it untouched.
    verdicts
        Folders of results on planted sets.
    kept
        Tables of rows to keep, at most one.
    code
        Hash of the code that judges now.
    out
        Folder of the tables.
    """
    recordings = {name: cut(folder, name) for name, folder in folders.items()}
    rows = []
    for path in sorted(p for folder in verdicts for p in folder.glob("*.json")):
        result = json.loads(path.read_text(encoding="utf-8"))
        planting = parsed(result["planting"])
        before = untouched[planting.flight]["verdict"]
        rows += tables.rows_of(planting, recordings[planting.flight], result, before)
    new = pd.DataFrame(rows, columns=tables.COLUMNS)
    found = tables.kept_with(new, pd.read_csv(kept[0]) if kept else None)
    out.mkdir(parents=True, exist_ok=True)
    found.to_csv(out / "plantings.csv", index=False, float_format=SIGNIFICANT)
    tables.summary(found, code).to_csv(out / "plantings_summary.csv", index=False, float_format=SIGNIFICANT)
    tables.differing_names(found).to_csv(out / "plantings_beside.csv", index=False)
    return found
