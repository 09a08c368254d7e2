"""Tables of markdown files, as benchmarks write them."""

from __future__ import annotations

import pandas as pd

from rotorid.errors import InputError


def first_table(text: str, columns: list[str], name: str) -> pd.DataFrame:
    """The first pipe table of a markdown text, its columns renamed in order; every cell is text.

    Parameters
    ----------
    text
        The whole file.
    columns
        As many names as the table has columns.
    name
        What the file is called in an error.

    Raises
    ------
    InputError
        No table, or another number of columns.
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
