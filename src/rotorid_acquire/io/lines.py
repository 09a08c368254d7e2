"""Instruments that send plain lines of text and cannot be taught our frames, read by a small description.

    name: jr3-text
    baud_rate: 9600
    form: csv                # csv, key=value, or fixed (places in the line)
    separator: ","           # of csv and key=value; left out: any white space
    decimal: ","             # where numbers are written 0,25; left out: a point
    columns:
      force_x_n: {field: 0, scale: 4.44822}     # value = scale × number; csv: the field's number from 0
      force_z_n: {field: 2, scale: 4.44822}     # key=value: the key; fixed: {start: 10, stop: 18}

The raw log keeps the bytes as they came, and the metadata the description, so a better one can be applied later.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import pandas as pd
from pydantic import Field, ValidationError, model_validator

from rotorid.errors import InputError
from rotorid.io.models import KnownKeys, Number, read_model
from rotorid.io.text.wording import explain
from rotorid_acquire.io.logs import faults_of, same_recording
from rotorid_acquire.io.rawlog import NOTE, RECEIVED, Damage, read_raw
from rotorid_acquire.io.session import Counts, Session, read_session, session_path

_MAX_LINE = 4096


class _Column(KnownKeys):
    """Where a column's number stands in a line."""

    field: int | str | None = None
    start: int | None = None
    stop: int | None = None
    scale: Number = 1.0


class Description(KnownKeys):
    """How an instrument's lines are read."""

    name: str
    baud_rate: int = Field(default=9600, ge=50, le=12_000_000)
    form: Literal["csv", "key=value", "fixed"] = "csv"
    separator: str | None = Field(default=None, min_length=1)
    decimal: Literal[".", ","] = "."
    begin: str = ""  # sent to start it, escapes as in YAML: "R\r\n"
    end: str = ""  # sent to stop it
    columns: dict[str, _Column]

    @model_validator(mode="after")
    def _fits(self) -> Description:
        if not self.columns:
            raise ValueError("columns: expected at least one")
        if self.separator == self.decimal and self.form != "fixed":
            raise ValueError("separator and decimal are the same sign; no line could be read")
        for name, column in self.columns.items():
            if self.form == "fixed" and (column.start is None or column.stop is None):
                raise ValueError(f"columns.{name}: form `fixed` needs `start` and `stop`")
            wanted = {"csv": int, "key=value": str}.get(self.form)
            if wanted is not None and not isinstance(column.field, wanted):
                what = "the field's number from 0" if wanted is int else "the key"
                raise ValueError(f"columns.{name}: form `{self.form}` needs `field`, {what}")
        return self

    def values(self, line: str) -> tuple[float, ...]:
        """The columns' values. Raises ValueError for a line that is none (a heading, a cut one)."""
        if self.form == "fixed":
            texts = [line[column.start : column.stop] for column in self.columns.values()]
        else:
            parts = [part.strip() for part in line.split(self.separator)]
            if self.form == "csv":
                found = dict(enumerate(parts))
            else:
                found = {key.strip(): value for key, sign, value in (part.partition("=") for part in parts) if sign}
            try:
                texts = [found[column.field] for column in self.columns.values()]
            except KeyError as error:
                raise ValueError(f"no field {error} in {line!r}") from error
        numbers = [self._number(text) for text in texts]
        return tuple(number * column.scale for number, column in zip(numbers, self.columns.values(), strict=True))

    def _number(self, text: str) -> float:
        """Raises ValueError for what is no finite number: a heading, an overload written as text."""
        text = text.strip().strip('"').strip()
        if text[:1] in ("+", "-"):  # scales print the sign in a place of its own
            text = text[0] + text[1:].lstrip()
        number = float(text if self.decimal == "." else text.replace(",", "."))
        if not math.isfinite(number) or "_" in text or (self.decimal == "," and "." in text):
            raise ValueError(f"{text!r} is no number")
        return number


def read_description(path: Path) -> Description:
    """Read and validate. Raises InputError."""
    return read_model(path, Description)


class LineDecoder:
    """Lines out of bytes that come as they like; counts those that are none. `unread` keeps the last such line."""

    def __init__(self, description: Description) -> None:
        self.description = description
        self.lines = 0
        self.unreadable = 0
        self.unread = ""
        self._pending = b""
        self._broken = False

    def break_off(self, within: bool = False) -> None:
        """Bytes are missing here: what was begun is no line, nor, `within` a stream, what comes up to the next end of
        one. After a port was away it begins as at first, with the line that comes."""
        self.unreadable += bool(self._pending.strip()) and not within
        self._pending, self._broken = b"", within

    def feed(self, data: bytes) -> list[tuple[float, ...]]:
        """Values of the lines that these bytes complete."""
        *whole, self._pending = (self._pending + data).replace(b"\r", b"\n").split(b"\n")
        self._pending = self._pending[-_MAX_LINE:]
        if self._broken and whole:
            self._broken = False
            del whole[0]
            self.unreadable += 1
        found = []
        for line in whole:
            text = line.decode(errors="replace").strip("\0")
            if not text.strip():
                continue
            try:
                found.append(self.description.values(text))
                self.lines += 1
            except ValueError:
                self.unreadable += 1
                self.unread = text[:120]
        return found


def line_counts(received: int, lines: int, unreadable: int, port_losses: int) -> Counts:
    """What the metadata of a log of lines count."""
    return Counts(bytes_received=received, samples=lines, broken_frames=unreadable, port_losses=port_losses)


def line_warnings(
    description: Description, received: int, lines: int, unreadable: int, unread: str, port_losses: int
) -> list[str]:
    """One sentence for each thing a person should look at."""
    last = f", the last of them {unread!r}" if unread else ""
    asked = f"is the baud rate right ({description.baud_rate}), and does the description fit?"
    found = []
    if received and not lines:
        found.append(f"not one line of {received} bytes could be read{last}: {asked}")
    elif unreadable:
        found.append(f"{unreadable} lines could not be read{last}" + (f": {asked}" if unreadable > lines else ""))
    if port_losses:
        found.append(f"the port went away {port_losses} times; lines are missing there, and nothing counts them")
    return found


@dataclass(frozen=True)
class _LineLog:
    """`table`: `host_time_s` (when the line's end was read, from the beginning of the log), `index` and the columns.
    `faults`: a sentence each, in what the file is not what the recorder wrote."""

    table: pd.DataFrame
    unreadable: int
    cut_at: int | None
    damaged_bytes: int
    session: Session | None
    counts: Counts
    warnings: list[str]
    faults: tuple[str, ...] = ()


def read_line_log(path: Path, description: Description | None = None) -> _LineLog:
    """Read a log of plain lines by its own description or by another, around damage.

    Raises InputError, also where log and metadata are of two recordings.
    """
    beside = session_path(path)
    session = read_session(beside) if description is None or beside.exists() else None
    if description is None:
        stored = session.procedure.get("description")
        if stored is None:
            raise InputError(f"{beside}: holds no description of lines; is this a log of frames?")
        try:
            description = Description.model_validate(stored)
        except ValidationError as error:
            raise InputError(f"{beside}: procedure.description." + explain(error, Description)) from None
    raw, decoder, rows, received, losses = read_raw(path), LineDecoder(description), [], 0, 0
    same_recording(path, raw, session)
    for piece in raw.pieces():
        if isinstance(piece, Damage):  # a line has no checksum of its own: nothing of a damaged chunk is taken
            decoder.break_off(within=True)
        elif piece.tag == NOTE and b'"note":"port_lost"' in piece.data:
            losses += 1
            decoder.break_off()
        elif piece.tag == RECEIVED:
            received += len(piece.data)
            host_s = (piece.host_ns - raw.chunks[0].host_ns) / 1e9
            rows += [(host_s, *values) for values in decoder.feed(piece.data)]
    table = pd.DataFrame(rows, columns=["host_time_s", *description.columns])
    table.insert(1, "index", range(len(table)))
    counts = line_counts(received, decoder.lines, decoder.unreadable, losses)
    warnings = line_warnings(description, received, decoder.lines, decoder.unreadable, decoder.unread, losses)
    faults = tuple(faults_of(raw, session))
    return _LineLog(table, decoder.unreadable, raw.cut_at, raw.lost_bytes, session, counts, warnings, faults)
