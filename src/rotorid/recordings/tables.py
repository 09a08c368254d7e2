"""Tables of runs, CSV (plain or gzipped) and Parquet, read strictly: what is not a table of numbers is told where."""

from __future__ import annotations

import csv
import io
import zlib
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.recordings import columns as c
from rotorid.text_files import check_file, check_text, read_bytes
from rotorid.wording import printable

LARGEST_FILE = 4_000_000_000
"""Bytes of a file; an hour at 1 kHz with forty columns has one and a half thousand million."""
LEAST_UNPACKED = 100_000_000
MOST_UNPACKED = 60
"""Bytes that a gzipped file may unpack to: times its own size, and in any case LEAST_UNPACKED (logs have 2 to 10)."""
MOST_CELLS = 400_000_000
BLOCK = 1 << 20
MISSING = frozenset(("", "nan", "na", "n/a", "null", "none", "<na>", "#n/a", "-nan"))
"""What stands for a missing sample, in small letters."""


class TooFewSamples(InputError):
    """A run with a heading and next to nothing below it: a set can do without it."""


def read_csv(path: Path) -> pd.DataFrame:
    """The table of a CSV file, plain or gzipped, not yet checked for its clock."""
    data = unpacked(path) if path.name.endswith(".gz") else read_bytes(path, LARGEST_FILE)
    check_text(data, path)
    data = data.removeprefix(b"\xef\xbb\xbf")
    heading = _heading(data, path)
    _check_cells(data, len(heading), path)
    try:
        table = pd.read_csv(io.BytesIO(data), skipinitialspace=True, index_col=False, low_memory=False)
    except (pd.errors.ParserError, pd.errors.EmptyDataError, csv.Error, OverflowError) as error:
        raise InputError(f"{path}: cannot be read as a table ({printable(error)})") from None
    table.columns = heading
    return _numbers(table, path)


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


def read_parquet(path: Path) -> pd.DataFrame:
    """The table of a Parquet file, not yet checked for its clock."""
    check_file(path)
    if not parquet_is_here():
        raise InputError(f"{path}: {NO_PARQUET}")
    import pyarrow.parquet as parquet

    try:
        with parquet.ParquetFile(path) as file:
            cells = file.metadata.num_rows * max(file.metadata.num_columns, 1)
            names = file.schema_arrow.names
            if cells > MOST_CELLS:
                raise InputError(f"{path}: has {cells:.3g} cells, expected at most {MOST_CELLS:.3g}")
            _check_heading([str(name) for name in names], path)
            table = file.read().to_pandas(ignore_metadata=True)
    except InputError:
        raise
    except Exception as error:  # pyarrow has errors of its own for each way in which a file can be broken
        raise InputError(f"{path}: cannot be read as a table ({printable(str(error)[:150])})") from None
    return _numbers(table.drop(columns=[n for n in names if n.startswith("__index_level_")]), path)


def check_table(table: pd.DataFrame, where: str) -> pd.DataFrame:
    """The table as floats with a usable `time_s`; InputError says what is wrong and where."""
    repeated = table.columns[table.columns.duplicated()]
    if len(repeated):
        raise InputError(f"{where}: column {printable(repeated[0])} is there twice")
    if c.TIME not in table.columns:
        near = next((f"; is {printable(n)} meant?" for n in table.columns if _like_time(str(n))), "")
        raise InputError(f"{where}: column {c.TIME} is missing{near}")
    table = table.astype(float)
    time = table[c.TIME].to_numpy()
    if len(time) < 2:
        raise TooFewSamples(f"{where}: too little data: expected at least two samples, found {len(time)}")
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
    return table


def place(where: object, row: int) -> str:
    """Where the reader of a message finds a sample (0 is the first): a CSV's line, the row of anything else."""
    return f"row {row + 1}" if str(where).endswith(".parquet") else f"line {row + 2}"


def _like_time(name: str) -> bool:
    return name.lower().strip("_ ").startswith(("time", "timestamp")) or name.lower() in ("t", "t_s", "sec", "seconds")


def unpacked(path: Path) -> bytes:
    """Content of a gzipped file; InputError where it is none, is cut off or unpacks to far more than a log would."""
    packed = read_bytes(path, LARGEST_FILE)
    if not packed:
        raise InputError(f"{path}: is empty, expected a gzipped table")
    most = min(LARGEST_FILE, max(LEAST_UNPACKED, MOST_UNPACKED * len(packed)))
    parts, total = [], 0
    try:
        while packed:
            unpacker = zlib.decompressobj(wbits=31)
            rest = packed
            while rest and not unpacker.eof:
                part = unpacker.decompress(rest, BLOCK)
                rest = unpacker.unconsumed_tail
                total += len(part)
                parts.append(part)
                if len(parts) == 1:
                    check_text(part[: part.rfind(b"\n") + 1], path)
                if total > most:
                    raise InputError(f"{path}: unpacks to more than {most / 1e6:.0f} MB, far more than a log does")
            if not unpacker.eof:
                raise InputError(f"{path}: its gzip stream is cut off")
            packed = unpacker.unused_data.lstrip(b"\0")
    except zlib.error as error:
        raise InputError(f"{path}: is no whole gzip file ({error})") from None
    return b"".join(parts)


def _heading(data: bytes, path: Path) -> list[str]:
    """Names of the columns, from the first line that is not blank."""
    if not data.strip():
        raise InputError(f"{path}: is empty, expected a line of column names and samples below")
    start = len(data) - len(data.lstrip(b"\r\n"))
    ends = [k for k in (data.find(b"\n", start), data.find(b"\r", start)) if k >= 0]
    first = data[start : min(ends, default=len(data))]
    if len(first) > BLOCK:
        raise InputError(f"{path}: its first line has {len(first) / 1e6:.3g} MB, expected column names")
    text = first.decode("utf-8")
    names = [name.strip() for name in next(csv.reader([text], skipinitialspace=True), [])]
    if len(names) == 1 and names[0] != c.TIME:
        for sign, what in ((";", "semicolons"), ("\t", "tabs"), ("|", "bars")):
            if sign in text:
                raise InputError(
                    f"{path}, line 1: columns are separated by {what}, expected commas (and decimal points)"
                )
    _check_heading(names, path)
    return names


def _check_heading(names: list[str], path: Path) -> None:
    seen: set[str] = set()
    for number, name in enumerate(names, 1):
        if not name:
            raise InputError(f"{path}, line 1: column {number} has no name")
        if not name.isprintable():
            raise InputError(
                f"{path}, line 1: the name of column {number} holds a control character ({printable(name)})"
            )
        if name in seen:
            raise InputError(f"{path}, line 1: column {name} is there twice")
        seen.add(name)
    if all(_is_number(name) for name in names):
        raise InputError(f"{path}, line 1: expected the names of the columns, found numbers")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _check_cells(data: bytes, count: int, path: Path) -> None:
    """InputError where a line has not as many cells as the heading."""
    if b'"' in data:
        _check_quoted(data, count, path)
        return
    end_of_line = b"\n" if b"\n" in data else b"\r"
    line, start = 1, 0
    while start < len(data):
        stop = len(data)
        if stop - start > 64 * BLOCK:  # in parts: the places of all commas take more room than the text
            stop = data.rfind(end_of_line, start, start + 64 * BLOCK) + 1 or stop
        array = np.frombuffer(data, np.uint8, stop - start, start)
        ends = np.flatnonzero(array == end_of_line[0])
        starts = np.concatenate([[0], ends + 1])
        ends = np.concatenate([ends, [len(array)]])
        commas = np.flatnonzero(array == ord(","))
        cells = np.searchsorted(commas, ends) - np.searchsorted(commas, starts) + 1
        for k in np.flatnonzero(cells != count):
            text = data[start + starts[k] : start + ends[k]]
            if text.strip():
                last = not data[start + ends[k] :].strip()
                raise InputError(_wrong_cells(path, line + int(k), int(cells[k]), count, last))
        line, start = line + len(ends) - 1, stop


def _check_quoted(data: bytes, count: int, path: Path) -> None:
    reader = csv.reader(io.StringIO(data.decode("utf-8"), newline=""), skipinitialspace=True)
    try:
        for row in reader:
            if row and len(row) != count:
                raise InputError(_wrong_cells(path, reader.line_num, len(row), count, last=False))
    except csv.Error as error:
        raise InputError(f"{path}, line {reader.line_num}: cannot be read as a table ({error})") from None


def _wrong_cells(path: Path, line: int, found: int, count: int, last: bool) -> str:
    cut = " (the file is cut off: delete its last line)" if last and found < count else ""
    return f"{path}, line {line}: has {found} cell{'s' * (found != 1)}, the heading has {count}{cut}"


def _numbers(table: pd.DataFrame, path: Path) -> pd.DataFrame:
    """The table as floats; InputError names line and column of the first cell that is no number."""
    out = {}
    for name in table.columns:
        column = table[name]
        kind = column.dtype
        if pd.api.types.is_bool_dtype(kind) and c.is_known(str(name)):
            raise InputError(f"{path}, {place(path, 0)}, column {name}: expected a number, found {column.iloc[0]}")
        if pd.api.types.is_numeric_dtype(kind) and not pd.api.types.is_complex_dtype(kind):
            out[name] = column.to_numpy(float, na_value=np.nan)
        else:
            out[name] = _from_objects(column, path, str(name))
    return pd.DataFrame(out, columns=list(table.columns))


def _from_objects(column: pd.Series, path: Path, name: str) -> np.ndarray:
    values = np.full(len(column), np.nan)
    decimals = not pd.api.types.is_datetime64_any_dtype(column.dtype)
    for row, cell in enumerate(column):
        if cell is None or cell is pd.NA or (isinstance(cell, str) and cell.strip().lower() in MISSING):
            continue
        try:
            if isinstance(cell, bool) and c.is_known(name) or not decimals:
                raise ValueError
            if isinstance(cell, str) and "_" in cell:
                raise ValueError
            values[row] = float(cell)
        except (TypeError, ValueError, OverflowError):
            found = printable(repr(cell))
            found = found if len(found) < 60 else found[:57] + "..."
            raise InputError(f"{path}, {place(path, row)}, column {name}: expected a number, found {found}") from None
    return values
