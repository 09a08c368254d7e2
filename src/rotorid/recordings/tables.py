"""Tables of runs, CSV (plain or gzipped) and Parquet, read strictly: the place of what is not a number is reported.

A CSV file is looked through in blocks, never as a whole in the memory. What is no table (other text, another encoding,
a line with a cell too many, a file cut off, a bomb) is refused with its line before anything is made of it.
"""

from __future__ import annotations

import csv
import io
import re
import zlib
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.io.text.files import (
    LARGEST_FILE,
    LEAST_UNPACKED,
    LONGEST_JUMP_S,
    MOST_CELLS,
    MOST_GRID,
    MOST_GZIP_MEMBERS,
    MOST_HOLES,
    MOST_ROWS,
    MOST_UNPACKED,
    check_file,
    check_text,
)
from rotorid.io.text.wording import printable
from rotorid.recordings import columns as c

_BLOCK = 1 << 20
_PIECE_CELLS = 1 << 21
"""Cells of a table that are parsed at once: 16 MB as floats, several times that as text."""
MANY_ROWS = 200_000
"""Rows from which a table's columns stay apart: one block of all is quicker to select from, but takes them twice."""
_PACKED_BLOCK = 1 << 16
"""Bytes taken from a gzipped file at once: what is left of them is copied for each of its parts."""
_SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars"}
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_UTF_8, _LATIN_1 = "utf-8", "cp1252"
"""How text is written; the second is Latin-1 as Windows has it, in which instruments and spreadsheets write `°`."""
_NO_LATIN_1 = frozenset(b"\0\x81\x8d\x8f\x90\x9d")
"""Bytes that are no text so written."""
_MOST_ABOVE, _ROWS_BELOW = 200, 3
"""Lines that may stand above a heading, and rows of numbers below by which one is known."""
_DECIMAL_COMMA = re.compile(r"\s*[-+]?\d+,\d+([eE][-+]?\d+)?\s*")
_DECIMAL_POINT = re.compile(r"\s*[-+]?\d*\.\d+([eE][-+]?\d+)?\s*")
_THOUSANDS = re.compile(r"\s*[-+]?\d{1,3},\d{3}\s*")
_DECIMAL_COMMAS = 1.5
"""A line with so many times the cells of its heading has commas in its numbers."""
_MISSING = frozenset(("", "nan", "na", "n/a", "null", "none", "<na>", "#n/a", "-nan"))
"""What stands for a missing sample, in small letters."""


class _Content(io.RawIOBase):
    """Blocks of bytes as a file that can be read."""

    def __init__(self, parts: Iterator[bytes]) -> None:
        super().__init__()
        self._parts, self._rest = parts, b""

    def readable(self) -> bool:
        return True

    def readinto(self, buffer) -> int:
        self._rest = self._rest or next(self._parts, b"")
        count = min(len(buffer), len(self._rest))
        buffer[:count], self._rest = self._rest[:count], self._rest[count:]
        return count


def _opened(path: Path) -> io.BufferedReader:
    """The file's unpacked content, to be read once `look_through` has found it sound."""
    return io.BufferedReader(_Content(_blocks(path)), _BLOCK)


@dataclass(frozen=True)
class _CsvLayout:
    """How a table is written: names of its columns, the sign between them, and what is no row of it."""

    names: list[str]
    separator: str
    above: tuple[str, ...] = ()
    """Lines above the heading that are none of the table (what a motion capture says of its take)."""
    heading_line: int = 1
    """Line of the heading in the file, counted from 1; of several the last."""
    cut_off: bool = False
    """Whether the last line ends before its last cell."""
    decimal: str = "."
    """The sign before the fraction of a number."""
    encoding: str = _UTF_8
    lines: int = 0
    """Lines of the file: it has not more rows."""


class _NoUtf8(Exception):
    """A foreign table is Latin-1."""


def _look_through(path: Path, foreign: bool = False) -> _CsvLayout:
    """How the table of a file is written; the rest as `_looked_through`."""
    try:
        return _looked_through(path, foreign, _UTF_8)
    except _NoUtf8:
        return _looked_through(path, foreign, _LATIN_1)


def _looked_through(path: Path, foreign: bool, encoding: str) -> _CsvLayout:
    """How the table of a file is written.

    `foreign`: a table of one's own, not of a recording set. Its columns may be separated by semicolons, tabs, bars or
    blanks as well (its numbers may then have decimal commas), one without a name is called by its number (`column_3`),
    lines may stand above the heading, the heading may have several lines, the last line may be cut off, and it may be
    Latin-1. _NoUtf8 where it is that and not yet read as such.
    InputError where the file is no table, has a line with more or fewer cells than its heading, or is too large.
    """
    found, quoted, cut, lines = None, False, False, 0
    for line, text in _whole_lines(path):
        _check_encoding(text, path, line, foreign, encoding)
        lines = line + text.count(b"\n" if b"\n" in text else b"\r")
        _check_size(line - 2, len(found.names) if found else 0, path)
        if found is None and text.strip():
            found, text = _heading(text, path, foreign, encoding)
            line += found.heading_line - 1
            below = text[:_PACKED_BLOCK].decode(encoding, "replace").splitlines()[1 : 1 + _MOST_ABOVE]
            cells = [cell for row in below for cell in _names(row, found.separator)]
            commas = list(filter(_DECIMAL_COMMA.fullmatch, cells)) if foreign and found.separator != "," else []
            if commas:
                point = next(filter(_DECIMAL_POINT.fullmatch, cells), "")
                if point and all(map(_THOUSANDS.fullmatch, commas)):
                    both = f"{commas[0].strip()!r} next to {point.strip()!r}"
                    raise InputError(f"{path}: has {both}, expected nothing between thousands")
                found = replace(found, decimal=",")
        quoted = quoted or b'"' in text
        if found and not quoted:
            cut = _check_cells(text, line, len(found.names), found.separator, path, foreign)
    if found is None:
        raise InputError(f"{path}: is empty, expected a line of column names and samples below")
    if quoted:
        cut = _check_quoted(path, replace(found, encoding=encoding), foreign)
    return replace(found, cut_off=cut, encoding=encoding, lines=lines)


def _check_encoding(text: bytes, path: Path, line: int, foreign: bool, encoding: str) -> None:
    """_NoUtf8 where a foreign table turns out to be Latin-1; InputError where bytes are no text at all."""
    try:
        check_text(text, path, line)
    except InputError:
        if not foreign or text.startswith((b"\xff\xfe", b"\xfe\xff")) or set(text) & _NO_LATIN_1:
            raise
        if encoding == _UTF_8:
            raise _NoUtf8 from None


def _check_size(rows: int, columns: int, where: object) -> None:
    """InputError where a table is larger than any recording."""
    for found, most, what in ((rows, MOST_ROWS, "samples"), (rows * columns, MOST_CELLS, "cells")):
        if found > most:
            raise InputError(f"{where}: has more than {most} {what}, expected at most that; cut it into several runs")


def _blocks(path: Path) -> Iterator[bytes]:
    """The file's content, unpacked, block by block; InputError where it is too large or no whole gzip file."""
    size = check_file(path)
    if size > LARGEST_FILE:
        raise InputError(f"{path}: has {size / 1e6:.0f} MB, expected at most {LARGEST_FILE / 1e6:.0f} MB")
    try:
        with open(path, "rb") as file:
            if path.name.endswith(".gz"):
                yield from _unpacked(iter(partial(file.read, _PACKED_BLOCK), b""), size, path)
            else:
                yield from iter(partial(file.read, _BLOCK), b"")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None


def _unpacked(packed_blocks: Iterator[bytes], size: int, path: Path) -> Iterator[bytes]:
    """Content of gzipped parts, one behind the other, with zero bytes between them or behind."""
    if not size:
        raise InputError(f"{path}: is empty, expected a gzipped table")
    most = min(LARGEST_FILE, max(LEAST_UNPACKED, MOST_UNPACKED * size))
    unpacker, total, members, padding = zlib.decompressobj(wbits=31), 0, 1, 0
    try:
        for packed in packed_blocks:
            full = False
            while packed or full:
                if unpacker.eof:
                    padding += len(packed) - len(packed := packed.lstrip(b"\0"))
                    if padding > _BLOCK:
                        raise InputError(
                            f"{path}: has more than {_BLOCK / 1e6:.0f} MB of zero bytes behind its content"
                        )
                    if not packed:
                        break
                    unpacker, members = zlib.decompressobj(wbits=31), members + 1
                    if members > MOST_GZIP_MEMBERS:
                        raise InputError(f"{path}: has more than {MOST_GZIP_MEMBERS} gzipped parts, expected one")
                part = unpacker.decompress(packed, _BLOCK)
                total += len(part)
                if total > most:
                    raise InputError(f"{path}: unpacks to more than {most / 1e6:.0f} MB, far more than a log does")
                if part:
                    yield part
                full = len(part) == _BLOCK
                packed = unpacker.unused_data if unpacker.eof else unpacker.unconsumed_tail
    except zlib.error as error:
        raise InputError(f"{path}: is no whole gzip file ({error})") from None
    if not unpacker.eof:
        raise InputError(f"{path}: its gzip stream is cut off")


def _whole_lines(path: Path) -> Iterator[tuple[int, bytes]]:
    """Parts of the text that end where a line ends, each with the number of its first line, counted from 1."""
    line, rest, end_of_line = 1, b"", b""
    for number, block in enumerate(_blocks(path)):
        text = rest + (block.removeprefix(_BYTE_ORDER_MARK) if number == 0 else block)
        end_of_line = end_of_line or next((sign for sign in (b"\n", b"\r") if sign in text), b"")
        stop = text.rfind(end_of_line) + 1 if end_of_line else 0
        if stop:
            yield line, text[:stop]
            line += text.count(end_of_line, 0, stop)
        rest = text[stop:]
        if len(rest) > _BLOCK:
            if (zero := rest.find(b"\0")) >= 0:
                check_text(rest[: zero + 2000], path, line)
            expected = "column names" if line == 1 else "a row of numbers"
            raise InputError(f"{path}, line {line}: is longer than {_BLOCK / 1e6:.0f} MB, expected {expected}")
    if rest:
        yield line, rest


def _heading(text: bytes, path: Path, foreign: bool, encoding: str) -> tuple[_CsvLayout, bytes]:
    """How the table is written by the beginning of its text, and the text from the last line of the heading on."""
    if foreign and (below := _below_other_lines(text, path, encoding)) is not None:
        layout, rest = below
        _check_heading(layout.names, path, layout.heading_line)
        return layout, rest
    first = text.lstrip(b"\r\n").splitlines()[0].decode(encoding)
    separator = _separator(first)
    widths = {",": len(_names(first, ",")), separator: len(_names(first, separator))}
    if not foreign:
        if separator != "," and widths[","] == 1:
            raise InputError(
                f"{path}, line 1: columns are separated by {_SEPARATORS[separator]}, expected commas (and decimal "
                "points)"
            )
        separator = ","
    elif widths[separator] == 1:
        separator = " "
    names = _names(first, separator)
    _check_heading(_numbered(names) if foreign else names, path)
    return _CsvLayout(_numbered(names) if foreign else names, separator), text


def _separator(line: str) -> str:
    """The sign that parts a line into most cells."""
    return max(_SEPARATORS, key=lambda sign: len(_names(line, sign)))


def _numbered(names: list[str]) -> list[str]:
    """The names of a foreign table: without the sign of a comment before the first, a number where there is none."""
    names = [names[0].lstrip("#% "), *names[1:]]
    return [name or f"column_{number}" for number, name in enumerate(names, 1)]


def _below_other_lines(text: bytes, path: Path, encoding: str) -> tuple[_CsvLayout, bytes] | None:
    """The layout of a table with other lines above its heading, or several of heading; None where line 1 is all.

    A heading is what stands above three rows of numbers with as many cells. Where it names columns alike, or nothing
    but units, the lines above with as many cells are a part of it.
    """
    if b"\r" in text[:_BLOCK].replace(b"\r\n", b"\n"):
        return None
    lines = text[:_BLOCK].split(b"\n")[: _MOST_ABOVE + _ROWS_BELOW + 1]
    cells = []
    for line in lines:
        decoded = line.decode(encoding).rstrip("\r")
        sign = _separator(decoded)
        cells.append((_names(decoded, sign), sign))
    for k in range(1, len(cells) - _ROWS_BELOW):
        if k > 1 and not _is_row(cells[k - 1][0]) and all(_is_row(row) for row, _ in cells[k : k + _ROWS_BELOW]):
            raise InputError(f"{path}, line {k + 1}: expected the names of the columns above, found numbers")
        names, sign = cells[k]
        below = [_names(line.decode(encoding).rstrip("\r"), sign) for line in lines[k + 1 : k + 1 + _ROWS_BELOW]]
        if _is_row(names) or not all(len(row) == len(names) and _is_row(row) for row in below):
            continue
        if k and len(cells[0][0]) == len(names) and _is_row(cells[1][0]):
            return None  # line 1 is the heading, and a word stands among the numbers
        names, first = list(names), k
        while (
            first
            and len(cells[first - 1][0]) == len(names)
            and (len(set(filter(None, names))) < len(list(filter(None, names))) or all(_is_unit(n) for n in names))
        ):
            first -= 1
            names = [" ".join(filter(None, pair)) for pair in zip(cells[first][0], names, strict=True)]
        above = tuple(line.decode(encoding).strip() for line in lines[:first] if line.strip())
        return _CsvLayout(_numbered(names), sign, above, k + 1), b"\n".join(text.split(b"\n", k)[k:])
    return None


def _is_row(cells: list[str]) -> bool:
    """Whether cells are a row of numbers: half of what is written or more, and two or more."""
    given = [cell for cell in cells if cell]
    count = sum(map(_is_number, given))
    return count >= 2 and 2 * count >= len(given)


def _is_unit(name: str) -> bool:
    """Whether a cell of a heading is empty or a unit: in brackets, or a word of a few letters with a fraction."""
    return not name or name[0] + name[-1] in ("()", "[]", "<>") or (len(name) < 6 and ("/" in name or len(name) < 3))


def _names(line: str, separator: str) -> list[str]:
    return [name.strip() for name in next(csv.reader([line], delimiter=separator, skipinitialspace=True), [])]


def _check_heading(names: list[str], path: Path, line: int = 1) -> None:
    """InputError where a column has no name or one that is there twice, or where the names are numbers."""
    seen: set[str] = set()
    for number, name in enumerate(names, 1):
        if not name:
            raise InputError(f"{path}, line {line}: column {number} has no name")
        if not name.isprintable():
            raise InputError(
                f"{path}, line {line}: the name of column {number} holds a control character ({printable(name)})"
            )
        if name in seen:
            raise InputError(f"{path}, line {line}: column {name} is there twice")
        seen.add(name)
    if all(_is_number(name) for name in names):
        raise InputError(f"{path}, line {line}: expected the names of the columns, found numbers")


def _with_point(text: str) -> str:
    """A number with a decimal comma as one with a point; any other text as it is."""
    return text.replace(",", ".") if _DECIMAL_COMMA.fullmatch(text) else text


def _is_number(text: str) -> bool:
    try:
        float(_with_point(text))
    except ValueError:
        return False
    return True


def _check_cells(text: bytes, first_line: int, count: int, separator: str, path: Path, foreign: bool) -> bool:
    """Whether the text ends in a line that is cut off; InputError where a line has not as many cells as the heading."""
    array = np.frombuffer(text, np.uint8)
    ends = np.flatnonzero(array == ord("\n" if b"\n" in text else "\r"))
    starts = np.concatenate([[0], ends + 1])
    ends = np.concatenate([ends, [len(array)]])
    signs = np.flatnonzero(array == ord(separator))
    cells = np.searchsorted(signs, ends) - np.searchsorted(signs, starts) + 1
    for k in np.flatnonzero(cells != count):
        if text[starts[k] : ends[k]].strip():
            last = ends[k] == len(text)
            if foreign and last and cells[k] < count:
                return True
            raise InputError(_wrong_cells(path, first_line + int(k), int(cells[k]), count, last))
    return False


def _check_quoted(path: Path, layout: _CsvLayout, foreign: bool) -> bool:
    """The same where some cells stand in quotes."""
    count, short = len(layout.names), None
    encoding = "utf-8-sig" if layout.encoding == _UTF_8 else layout.encoding
    with io.TextIOWrapper(_opened(path), encoding, newline="") as text:
        for _ in range(layout.heading_line - 1):
            text.readline()
        reader = csv.reader(text, delimiter=layout.separator, skipinitialspace=True)
        try:
            for row in reader:
                if short is not None:
                    raise InputError(_wrong_cells(path, *short, count, last=False))
                if row and len(row) != count:
                    short = reader.line_num + layout.heading_line - 1, len(row)
                    if not foreign or len(row) > count:
                        raise InputError(_wrong_cells(path, *short, count, last=False))
        except csv.Error as error:
            raise InputError(f"{path}, line {reader.line_num}: cannot be read as a table ({error})") from None
    return short is not None


def _wrong_cells(path: Path, line: int, found: int, count: int, last: bool) -> str:
    why = ""
    if last and found < count:
        why = " (the file is cut off: delete its last line)"
    elif found > _DECIMAL_COMMAS * count:
        why = " (are decimals written with commas? expected points)"
    return f"{path}, line {line}: has {found} cell{'s' * (found != 1)}, the heading has {count}{why}"


class UnusableRun(InputError):
    """A run that is a table and cannot be used: a set can do without it."""


def read_cells(path: Path, foreign: bool = False, used: Collection[str] | None = None) -> pd.DataFrame:
    """The cells of a Parquet or CSV file, plain or gzipped: numbers where a column holds nothing else.

    Of a CSV: `foreign` as in `_looked_through`; the table's `attrs` then hold the `layout` that was found. `used` names
    the columns that are wanted, those of them that are there; None is all. The table is in the memory once.
    """
    if path.name.endswith(".parquet"):
        return _read_parquet_cells(path)
    layout = _look_through(path, foreign)
    kept = [k for k, name in enumerate(layout.names) if used is None or name in used] or [0]
    try:
        with _opened(path) as file:
            for _ in range(layout.heading_line - 1):
                file.readline()
            how = {"skipinitialspace": True, "index_col": False, "low_memory": False, "encoding": layout.encoding}
            at_once = max(1, _PIECE_CELLS // len(layout.names))
            with pd.read_csv(
                file, sep=layout.separator, decimal=layout.decimal, usecols=kept, chunksize=at_once, **how
            ) as pieces:
                columns, rows = _joined(pieces, len(kept), layout)
    except (pd.errors.ParserError, pd.errors.EmptyDataError, OverflowError) as error:
        raise InputError(f"{path}: cannot be read as a table ({printable(error)})") from None
    _check_size(rows, len(kept), path)
    table = pd.DataFrame(dict(enumerate(columns)), copy=rows < MANY_ROWS).iloc[: rows - layout.cut_off]
    table.columns = [layout.names[k] for k in kept]
    if foreign:
        table.attrs["layout"] = layout
    return table


def _joined(pieces: Iterable[pd.DataFrame], count: int, layout: _CsvLayout) -> tuple[list[np.ndarray | pd.Series], int]:
    """The columns of a table that comes in pieces, and its rows.

    A column of numbers is filled into one array as they come. One with anything else is text in the pieces that have
    it, and its numbers are those of the others.
    """
    filled = [np.empty(layout.lines) for _ in range(count)]
    others: dict[int, list[pd.Series]] = {}
    row = 0
    for piece in pieces:
        for k in range(count):
            column = piece.iloc[:, k]
            numeric = pd.api.types.is_numeric_dtype(column.dtype) and not pd.api.types.is_bool_dtype(column.dtype)
            if numeric and k not in others:
                filled[k][row : row + len(piece)] = column
                continue
            if not numeric and not pd.api.types.is_bool_dtype(column.dtype) and layout.decimal == ",":
                column = column.map(_with_point, na_action="ignore")
            others.setdefault(k, [pd.Series(filled[k][:row])] if row else []).append(column)
        row += len(piece)
    return [_one_column(others[k]) if k in others else filled[k][:row] for k in range(count)], row


def _one_column(parts: list[pd.Series]) -> pd.Series:
    """The parts of a column of which one at least is no numbers."""
    if len({part.dtype for part in parts}) > 1:
        truths = [pd.api.types.is_bool_dtype(part.dtype) for part in parts]
        parts = [p.astype(str if truth else object) for p, truth in zip(parts, truths, strict=True)]
        parts = [part.astype(object) for part in parts]
    return pd.concat(parts, ignore_index=True)


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


def _read_parquet_cells(path: Path) -> pd.DataFrame:
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

    _check_heading([str(name) for name in file.schema_arrow.names], path)
    _check_size(file.metadata.num_rows, max(file.metadata.num_columns, 1), path)
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
    _check_size(*table.shape, where)
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
    # A step of the clock longer than so many usual ones is a jump; a slow clock has long steps throughout.
    jump_steps = 10.0
    with np.errstate(over="ignore"):
        steps = np.abs(np.diff(time_s))
    if not len(steps):
        return None
    usual, row = float(np.median(steps)), int(np.argmax(steps))
    long = steps[row] > max(LONGEST_JUMP_S, jump_steps * usual)
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
    if all(kind == np.float64 for kind in table.dtypes):
        same = table.copy(deep=False)  # a large table would be there twice
        same.attrs = {}
        return same
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
