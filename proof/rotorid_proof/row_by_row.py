"""Slow tables of the proof, a row at a time: what is done stays done, and recordings are read as users' files are."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import pandas as pd

from rotorid.errors import InputError
from rotorid.recordings import RecordingSet, read_set


def as_read(recording, write_set: Callable, name: str) -> RecordingSet:
    """A simulator's recording as a user's files would hand it over."""
    with tempfile.TemporaryDirectory() as folder:
        write_set(recording, Path(folder) / name)
        return read_set(Path(folder) / name)


def rows_of(
    cases: Sequence, row_of: Callable, table: Callable[[list], pd.DataFrame], kept: Path, code: str, key: str = "case"
) -> pd.DataFrame:
    """A row of every case, by `row_of(case)`, each written to `kept` as it comes.

    Parameters
    ----------
    cases
        Each with a `name`, which its row has in the column `key`.
    row_of
        Makes the row, a dataclass with `judged_by`.
    table
        Makes a table of rows.
    kept
        CSV file. A row of another `code` stays in it until its case is judged anew.
    code
        Hash of the code that judges.

    A case that cannot be judged, or that its simulator loses, is named on the standard error stream and has no row.
    """
    kept.parent.mkdir(parents=True, exist_ok=True)
    rows = pd.read_csv(kept, keep_default_na=False).to_dict("records") if kept.is_file() else []
    done = {r[key] for r in rows if str(r["judged_by"]) == code}
    for case in cases:
        if case.name in done:
            continue
        try:
            row = replace(row_of(case), judged_by=code)
        except (InputError, RuntimeError) as error:
            print(f"{case.name}: {error}", file=sys.stderr, flush=True)
            continue
        rows = [r for r in rows if r[key] != case.name] + table([row]).to_dict("records")
        pd.DataFrame(rows).to_csv(kept, index=False)
        print(rows[-1], file=sys.stderr, flush=True)
    return pd.DataFrame(rows)
