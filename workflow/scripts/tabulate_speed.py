"""Tables of the chapter on speed, from what the benchmarks wrote.

- One table (CSV) of each benchmark, its columns by short names.
- The commit that each table was stored with (JSON).
"""

import json
from collections.abc import Mapping
from pathlib import Path

import pandas as pd

from rotorid.errors import InputError
from rotorid.report import log

COLUMNS = {
    "simulator": ["what", "seconds", "times"],
    "selection": ["hidden", "flights", "columns", "making", "pysindy", "search", "analysis", "found_by", "found"],
    "importing": ["log", "size_mb", "plain", "ours", "beyond", "outcome"],
    "mismatch": ["recording", "samples", "analysis_s", "per_second", "memory_mb", "found"],
    "rebuild": ["what", "processor_before", "processor", "wall_before", "wall"],
    "fleet": ["what", "amount"],
    "fem": ["what", "coarse", "full"],
}


def main(files: Mapping[str, str], stored: Mapping[str, str], out: Mapping[str, str]) -> None:
    """Write the table of each benchmark in `files` to the file of the same name in `out`; `stored` too."""
    tables = {
        name: first_table(Path(files[name]).read_text(), columns, files[name]) for name, columns in COLUMNS.items()
    }
    for column in ("found_by", "found"):
        tables["selection"][column] = tables["selection"][column].str.replace("_", " ")
    for name, table in tables.items():
        table.to_csv(out[name], index=False)
    Path(out["stored"]).write_text(json.dumps(dict(stored), indent=1) + "\n", encoding="utf-8")


def first_table(text: str, columns: list[str], name: str) -> pd.DataFrame:
    """The first pipe table of a markdown text, its columns renamed in order; every cell is text.

    `name` is what the file is called in an error. Raises InputError for no table, or another number of columns.
    """
    lines = [line.strip() for line in text.splitlines()]
    start = next((i for i, line in enumerate(lines) if line.startswith("|")), None)
    if start is None:
        raise InputError(f"{name}: no table in it (a line that begins with |)")
    rows = []
    for line in lines[start:]:
        if not line.startswith("|"):
            break
        rows.append([cell.strip() for cell in line.strip("|").split("|")])
    found = len(rows[0])
    if found != len(columns) or any(len(row) != found for row in rows):
        raise InputError(f"{name}: its table has {found} columns, expected {len(columns)} in each row")
    return pd.DataFrame(rows[2:], columns=columns)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            files=dict(snakemake.input.items()),
            stored=dict(snakemake.params.stored),
            out=dict(snakemake.output.items()),
        )
