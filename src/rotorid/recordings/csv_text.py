"""The text of a CSV file, plain or gzipped, looked through in blocks: it never stands in the memory as a whole.

What is no table (other text, another encoding, a line with a cell too many, a file cut off, a bomb) is refused with its
line before anything is made of it.
"""

from __future__ import annotations

import csv
import io
import re
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from rotorid.errors import InputError
from rotorid.io.text.files import (
    LARGEST_FILE,
    LEAST_UNPACKED,
    MOST_CELLS,
    MOST_GZIP_MEMBERS,
    MOST_ROWS,
    MOST_UNPACKED,
    check_file,
    check_text,
)
from rotorid.io.text.wording import printable

_BLOCK = 1 << 20
_PACKED_BLOCK = 1 << 16
"""Bytes taken from a gzipped file at once: what is left of them is copied for each of its parts."""
_SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars"}
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"
_MOST_ABOVE, _ROWS_BELOW = 200, 3
"""Lines that may stand above a heading, and rows of numbers below by which one is known."""
_DECIMAL_COMMA = re.compile(r"\s*[-+]?\d+,\d+([eE][-+]?\d+)?\s*")
_DECIMAL_COMMAS = 1.5
"""A line with so many times the cells of its heading has commas in its numbers."""


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


def opened(path: Path) -> io.BufferedReader:
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


def look_through(path: Path, foreign: bool = False) -> _CsvLayout:
    """How the table of a file is written.

    `foreign`: a table of one's own, not of a recording set. Its columns may be separated by semicolons, tabs, bars or
    blanks as well (its numbers may then have decimal commas), one without a name is called by its number (`column_3`),
    lines may stand above the heading, the heading may have several lines, and the last line may be cut off.

    Raises
    ------
    InputError
        The file is no table, has a line with more or fewer cells than its heading, or is too large.
    """
    found, quoted, cut = None, False, False
    for line, text in _whole_lines(path):
        check_text(text, path, line)
        check_size(line - 2, len(found.names) if found else 0, path)
        if found is None and text.strip():
            found, text = _heading(text, path, foreign)
            line += found.heading_line - 1
            below = text[:_PACKED_BLOCK].decode("utf-8", "replace").splitlines()[1 : 1 + _MOST_ABOVE]
            commas = [_DECIMAL_COMMA.fullmatch(cell) for row in below for cell in _names(row, found.separator)]
            if foreign and found.separator != "," and any(commas):
                found = replace(found, decimal=",")
        quoted = quoted or b'"' in text
        if found and not quoted:
            cut = _check_cells(text, line, len(found.names), found.separator, path, foreign)
    if found is None:
        raise InputError(f"{path}: is empty, expected a line of column names and samples below")
    if quoted:
        cut = _check_quoted(path, found, foreign)
    return replace(found, cut_off=cut)


def check_size(rows: int, columns: int, where: object) -> None:
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


def _heading(text: bytes, path: Path, foreign: bool) -> tuple[_CsvLayout, bytes]:
    """How the table is written by the beginning of its text, and the text from the last line of the heading on."""
    if foreign and (below := _below_other_lines(text, path)) is not None:
        layout, rest = below
        check_heading(layout.names, path, layout.heading_line)
        return layout, rest
    first = text.lstrip(b"\r\n").splitlines()[0].decode("utf-8")
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
    check_heading(_numbered(names) if foreign else names, path)
    return _CsvLayout(_numbered(names) if foreign else names, separator), text


def _separator(line: str) -> str:
    """The sign that parts a line into most cells."""
    return max(_SEPARATORS, key=lambda sign: len(_names(line, sign)))


def _numbered(names: list[str]) -> list[str]:
    """The names of a foreign table: without the sign of a comment before the first, a number where there is none."""
    names = [names[0].lstrip("#% "), *names[1:]]
    return [name or f"column_{number}" for number, name in enumerate(names, 1)]


def _below_other_lines(text: bytes, path: Path) -> tuple[_CsvLayout, bytes] | None:
    """The layout of a table with other lines above its heading, or several of heading; None where line 1 is all.

    A heading is what stands above three rows of numbers with as many cells. Where it names columns alike, or nothing
    but units, the lines above with as many cells are a part of it.
    """
    if b"\r" in text[:_BLOCK].replace(b"\r\n", b"\n"):
        return None
    lines = text[:_BLOCK].split(b"\n")[: _MOST_ABOVE + _ROWS_BELOW + 1]
    cells = []
    for line in lines:
        decoded = line.decode("utf-8").rstrip("\r")
        sign = _separator(decoded)
        cells.append((_names(decoded, sign), sign))
    for k in range(1, len(cells) - _ROWS_BELOW):
        if k > 1 and not _is_row(cells[k - 1][0]) and all(_is_row(row) for row, _ in cells[k : k + _ROWS_BELOW]):
            raise InputError(f"{path}, line {k + 1}: expected the names of the columns above, found numbers")
        names, sign = cells[k]
        below = [_names(line.decode("utf-8").rstrip("\r"), sign) for line in lines[k + 1 : k + 1 + _ROWS_BELOW]]
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
        above = tuple(line.decode("utf-8").strip() for line in lines[:first] if line.strip())
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


def check_heading(names: list[str], path: Path, line: int = 1) -> None:
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


def with_point(text: str) -> str:
    """A number with a decimal comma as one with a point; any other text as it is."""
    return text.replace(",", ".") if _DECIMAL_COMMA.fullmatch(text) else text


def _is_number(text: str) -> bool:
    try:
        float(with_point(text))
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
    with io.TextIOWrapper(opened(path), "utf-8-sig", newline="") as text:
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
