"""Messages of ArduPilot's DataFlash files as tables: the file says by its FMT messages how each is laid out.

A message is `a3 95`, its type, and a body whose length its FMT message states. Where no known message begins, the next
`a3 95` is looked for, byte by byte: loggers leave stray bytes, and damaged pages. One walk over the file notes where
messages begin; the bodies of a kind are then one array. Of 3 MB the walk takes some hundredths of a second.

What the letters of a format mean: ArduPilot, `libraries/AP_Logger/README.md`.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

HEAD = b"\xa3\x95"
_FMT, _FMT_BYTES = 0x80, 89
_LETTERS = {
    "a": ("<i2", 32, None), "b": ("i1", 1, None), "B": ("u1", 1, None), "h": ("<i2", 1, None), "H": ("<u2", 1, None),
    "i": ("<i4", 1, None), "I": ("<u4", 1, None), "f": ("<f4", 1, None), "d": ("<f8", 1, None), "g": ("<f2", 1, None),
    "n": ("S4", 1, None), "N": ("S16", 1, None), "Z": ("S64", 1, None), "c": ("<i2", 1, 100.0),
    "C": ("<u2", 1, 100.0), "e": ("<i4", 1, 100.0), "E": ("<u4", 1, 100.0), "L": ("<i4", 1, 1e7), "M": ("i1", 1, None),
    "q": ("<i8", 1, None), "Q": ("<u8", 1, None),
}  # fmt: skip
"""To the letter of a field its type, how many of them, and what its whole numbers are divided by."""


@dataclass(frozen=True)
class _MessageLayout:
    """How the messages of a type lie in the file."""

    name: str
    size: int
    """Bytes with the head."""
    letters: str
    columns: tuple[str, ...]

    def fields(self) -> np.dtype | None:
        """The body's fields `0`, `1`, …; None where they do not fill it: the description is damaged."""
        if not set(self.letters) <= set(_LETTERS):
            return None
        kinds = [_LETTERS[letter][:2] for letter in self.letters]
        fields = np.dtype(
            [(str(n), kind) if count == 1 else (str(n), kind, count) for n, (kind, count) in enumerate(kinds)]
        )
        return fields if fields.itemsize == self.size - len(HEAD) - 1 else None


@dataclass(frozen=True)
class Messages:
    """Messages of one kind."""

    offsets: np.ndarray
    """Where each begins in the file, bytes, (n,)."""
    columns: dict[str, np.ndarray]
    """To the name of a field its values, (n,): whole numbers, floating-point numbers, or texts."""


def read_dataflash(path: Path, kinds: Collection[str]) -> tuple[dict[str, Messages], int]:
    """The messages of these kinds, and how many bytes of a last message came that the file ends in (0 for none).

    A kind that the file does not have, or whose messages do not fit their description, is left out.
    """
    data = path.read_bytes()
    layouts, offsets, cut = _walk(data)
    by_name = {layout.name: (layout, offsets[number]) for number, layout in layouts.items() if offsets.get(number)}
    whole = np.frombuffer(data, np.uint8)
    found = {}
    for kind in kinds:
        layout, starts = by_name.get(kind, (None, []))
        fields = layout.fields() if layout else None
        if fields is None:
            continue
        places = np.asarray(starts, np.int64)
        bodies = whole[places[:, None] + np.arange(len(HEAD) + 1, layout.size)].reshape(-1).view(fields)
        named = zip(layout.columns, enumerate(layout.letters), strict=False)
        columns = {name: _values(bodies[str(n)], letter) for name, (n, letter) in named if letter != "a"}
        found[kind] = Messages(places, columns)
    return found, cut


def _walk(data: bytes) -> tuple[dict[int, _MessageLayout], dict[int, list[int]], int]:
    """To each type its layout and where its whole messages begin, and the bytes of a message that the file ends in."""
    layouts, offsets, sizes = {}, {_FMT: []}, {_FMT: _FMT_BYTES}
    at, end = 0, len(data)
    while True:
        if data[at : at + 2] != HEAD:
            at = data.find(HEAD, at + 1)
            if at < 0:
                return layouts, offsets, 0  # a single byte of a head is none: every 256th whole file ends with it
        if at + 3 > end:
            return layouts, offsets, end - at
        number = data[at + 2]
        size = sizes.get(number)
        if size is None:
            at += 1
            continue
        if at + size > end:
            return layouts, offsets, end - at
        offsets[number].append(at)
        if number == _FMT:
            layout = _layout(data[at + 3 : at + size])
            described = data[at + 3]
            if described != _FMT and layout.size > 3 and layout.name:
                layouts[described], sizes[described] = layout, layout.size
                offsets.setdefault(described, [])
        at += size


def _layout(body: bytes) -> _MessageLayout:
    """What an FMT message says: type, length, name, format, columns."""
    name, letters, columns = (_text(part) for part in (body[2:6], body[6:22], body[22:86]))
    return _MessageLayout(name, body[1], letters, tuple(columns.split(",")) if columns else ())


def _text(raw: bytes) -> str:
    """Text up to its first zero byte; what is no UTF-8 is taken for Latin 1."""
    raw = raw.split(b"\0", 1)[0]
    try:
        return raw.decode("utf-8")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def _values(raw: np.ndarray, letter: str) -> np.ndarray:
    """Values of a field as numbers of eight bytes, or as texts."""
    divisor: Any = _LETTERS[letter][2]
    if raw.dtype.kind == "S":
        return np.array([_text(text) for text in raw.tolist()], dtype=object)
    if divisor is not None:
        return raw / divisor
    if raw.dtype.kind == "f":
        return raw.astype(float)
    return raw.astype(np.int64) if raw.dtype != np.uint64 or raw.max(initial=0) < 2**63 else raw.astype(float)
