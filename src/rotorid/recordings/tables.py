"""Tables of runs, CSV (plain or gzipped) and Parquet, read strictly: the place of what is not a number is reported."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.io.text.files import (
    LARGEST_FILE,
    LEAST_UNPACKED,
    LONGEST_JUMP_S,
    MOST_GRID,
    MOST_HOLES,
    MOST_UNPACKED,
    check_file,
)
from rotorid.io.text.wording import printable
from rotorid.recordings import columns as c
from rotorid.recordings.csv_text import check_heading, check_size, look_through, opened, with_point

_MISSING = frozenset(("", "nan", "na", "n/a", "null", "none", "<na>", "#n/a", "-nan"))
"""What stands for a missing sample, in small letters."""
_JUMP_STEPS = 10.0
"""A step of the clock longer than so many usual ones is a jump; a slow clock has long steps throughout."""


class UnusableRun(InputError):
    """A run that is a table and cannot be used: a set can do without it."""


def read_csv(path: Path) -> pd.DataFrame:
    """The table of a CSV file, plain or gzipped, as numbers, not yet checked for its clock."""
    return numbers(read_cells(path), path)


def read_parquet(path: Path) -> pd.DataFrame:
    """The table of a Parquet file as numbers, not yet checked for its clock."""
    return numbers(read_parquet_cells(path), path)


def read_cells(path: Path, foreign: bool = False) -> pd.DataFrame:
    """The cells of a CSV file, plain or gzipped: numbers where a column holds nothing else.

    `foreign` as in `csv_text.look_through`; the table's `attrs` then hold the `layout` that was found.
    """
    layout = look_through(path, foreign)
    try:
        with opened(path) as file:
            for _ in range(layout.heading_line - 1):
                file.readline()
            how = {"skipinitialspace": True, "index_col": False, "low_memory": False}
            table = pd.read_csv(file, sep=layout.separator, decimal=layout.decimal, **how)
    except (pd.errors.ParserError, pd.errors.EmptyDataError, OverflowError) as error:
        raise InputError(f"{path}: cannot be read as a table ({printable(error)})") from None
    check_size(*table.shape, path)
    table = table.iloc[: len(table) - layout.cut_off]
    table.columns = layout.names
    if layout.decimal == ",":  # a column with another cell among its numbers is text as a whole
        for name in table.columns[[not pd.api.types.is_numeric_dtype(kind) for kind in table.dtypes]]:
            table[name] = table[name].map(with_point, na_action="ignore")
    if foreign:
        table.attrs["layout"] = layout
    return table


NO_PARQUET = "Parquet files need pyarrow, which is not installed: pip install 'rotorid[parquet]'"


def parquet_is_here() -> bool:
    """Whether Parquet files can be read and written: pyarrow is large, and a verdict on CSV does without it."""
    return find_spec("pyarrow") is not None


def write_table(table: pd.DataFrame, path: Path) -> None:
    """Write a run by the suffix of its file, one of .csv, .csv.gz and .parquet; the same bytes every time."""
    if path.name.endswith(".parquet"):
        if not parquet_is_here():
            raise InputError(f"{path}: {NO_PARQUET}")
        table.to_parquet(path, index=False)
    else:
        compression = {"method": "gzip", "mtime": 0} if path.name.endswith(".gz") else None
        table.to_csv(path, index=False, compression=compression)


def read_parquet_cells(path: Path) -> pd.DataFrame:
    """The cells of a Parquet file: numbers, or what else a column holds."""
    size = check_file(path)
    if not parquet_is_here():
        raise InputError(f"{path}: {NO_PARQUET}")
    import pyarrow.parquet as parquet

    try:
        with parquet.ParquetFile(path) as file:
            _check_parquet(file, size, path)
        # Text stays one copy of each word and a number a row: written out, 1 MB can stand for thousands of millions.
        words = [f.name for f in file.schema_arrow if str(f.type) in ("string", "large_string", "binary")]
        with parquet.ParquetFile(path, read_dictionary=words) as file:
            table = file.read().to_pandas(ignore_metadata=True)
    except InputError:
        raise
    except Exception as error:  # pyarrow has errors of its own for each way in which a file can be broken
        raise InputError(f"{path}: cannot be read as a table ({printable(str(error)[:150])})") from None
    return table.drop(columns=[n for n in table.columns if n.startswith("__index_level_")])


def _check_parquet(file, size: int, path: Path) -> None:
    """InputError where what a Parquet file says of itself is no table of numbers, or one too large."""
    import pyarrow as pa

    check_heading([str(name) for name in file.schema_arrow.names], path)
    check_size(file.metadata.num_rows, max(file.metadata.num_columns, 1), path)
    for field in file.schema_arrow:
        if pa.types.is_nested(field.type):
            raise InputError(f"{path}, row 1, column {field.name}: expected a number, found {field.type}")
    groups = [file.metadata.row_group(k) for k in range(file.metadata.num_row_groups)]
    unpacked = sum(group.total_byte_size for group in groups)
    most = min(LARGEST_FILE, max(LEAST_UNPACKED, MOST_UNPACKED * size))
    widths = [field.type.byte_width for field in file.schema_arrow if pa.types.is_fixed_size_binary(field.type)]
    if max(unpacked, sum(widths) * file.metadata.num_rows) > most:
        raise InputError(f"{path}: unpacks to more than {most / 1e6:.0f} MB, far more than a log does")


def check_table(table: pd.DataFrame, where: str) -> pd.DataFrame:
    """The table as floats with a usable `time_s`; InputError says what is wrong and where."""
    if c.TIME not in table.columns:
        near = next((f"; is {printable(n)} meant?" for n in table.columns if _like_time(str(n))), "")
        raise InputError(f"{where}: column {c.TIME} is missing{near}")
    check_size(*table.shape, where)
    table = table.astype(float)
    time = table[c.TIME].to_numpy()
    if len(time) < 2:
        raise UnusableRun(f"{where}: too little data: expected at least two samples, found {len(time)}")
    if not np.isfinite(time).all():
        row = int(np.flatnonzero(~np.isfinite(time))[0])
        found = "is empty" if np.isnan(time[row]) else f"is {time[row]}, expected a time in seconds"
        raise InputError(f"{where}, {place(where, row)}: {c.TIME} {found}")
    with np.errstate(over="ignore"):
        steps = np.diff(time)
    if (steps <= 0).any():
        row = int(np.flatnonzero(steps <= 0)[0]) + 1
        raise InputError(
            f"{where}, {place(where, row)}: {c.TIME} must increase strictly, "
            f"found {time[row]:.9g} after {time[row - 1]:.9g}"
        )
    if jumped := clock_jump(time, where):
        raise UnusableRun(jumped)
    return table


def clock_jump(time_s: np.ndarray, where: str) -> str | None:
    """A sentence where a clock jumps, forward or back, so far that no even grid can hold the run; else None.

    `time_s` has shape (n,), seconds; `where` is the file that the sample's place is named in.
    """
    with np.errstate(over="ignore"):
        steps = np.abs(np.diff(time_s))
    if not len(steps):
        return None
    usual, row = float(np.median(steps)), int(np.argmax(steps))
    long = steps[row] > max(LONGEST_JUMP_S, _JUMP_STEPS * usual)
    if not long and steps.sum() <= usual * max(MOST_GRID, MOST_HOLES * len(steps)):
        return None
    return (
        f"{where}, {place(where, row + 1)}: {c.TIME} jumps by {time_s[row + 1] - time_s[row]:.6g} s where its usual "
        f"step is {usual:.3g} s, expected one clock throughout (parts that are so far apart are runs of their own)"
    )


def place(where: object, row: int, heading_line: int = 1) -> str:
    """Where the reader of a message finds a sample (0 is the first): a CSV's line, the row of anything else."""
    return f"row {row + 1}" if str(where).endswith(".parquet") else f"line {row + 1 + heading_line}"


def _like_time(name: str) -> bool:
    return name.lower().strip("_ ").startswith(("time", "timestamp")) or name.lower() in ("t", "t_s", "sec", "seconds")


def numbers(table: pd.DataFrame, path: object) -> pd.DataFrame:
    """The table as floats; InputError names line and column of the first cell that is no number."""
    repeated = table.columns[table.columns.duplicated()]
    if len(repeated):
        raise InputError(f"{path}: column {printable(repeated[0])} is there twice")
    out = {}
    heading_line = table.attrs["layout"].heading_line if "layout" in table.attrs else 1
    for name in table.columns:
        column = table[name]
        kind = column.dtype
        if pd.api.types.is_bool_dtype(kind) and c.is_known(str(name)):
            raise InputError(
                f"{path}, {place(path, 0, heading_line)}, column {name}: expected a number, found {column.iloc[0]}"
            )
        if pd.api.types.is_numeric_dtype(kind) and not pd.api.types.is_complex_dtype(kind):
            out[name] = column.to_numpy(float, na_value=np.nan)
        else:
            out[name] = _from_objects(column, path, str(name), heading_line)
    return pd.DataFrame(out, columns=list(table.columns))


def _from_objects(column: pd.Series, path: object, name: str, heading_line: int) -> np.ndarray:
    values = np.full(len(column), np.nan)
    decimals = not pd.api.types.is_datetime64_any_dtype(column.dtype)
    for row, cell in enumerate(_cells(column)):
        if cell is None or cell is pd.NA or (isinstance(cell, str) and cell.strip().lower() in _MISSING):
            continue
        try:
            if isinstance(cell, bool) and c.is_known(name) or not decimals:
                raise ValueError
            if isinstance(cell, bytes) or isinstance(cell, str) and ("_" in cell or not cell.isascii()):
                raise ValueError
            values[row] = float(cell)
        except (TypeError, ValueError, OverflowError):
            found = printable(repr(cell))
            found = found if len(found) < 60 else found[:57] + "..."
            where = place(path, row, heading_line)
            raise InputError(f"{path}, {where}, column {name}: expected a number, found {found}") from None
    return values


def _cells(column: pd.Series) -> Iterator[object]:
    """The cells of a column one by one; pandas would write out every word of a column of categories at once."""
    if not isinstance(column.dtype, pd.CategoricalDtype):
        return iter(column)
    words = list(column.cat.categories)
    return (words[k] if k >= 0 else None for k in column.cat.codes)
