"""Blackbox logs byte by byte: the sessions of a file, their headers and main frames, and what of them is missing.

Each session has lines of text (`H name:value`) that say how its frames are packed. Key frames (I) stand alone; a frame
between them (P) holds differences from a prediction. A frame is whole where the next one begins with a known letter.
After damage nothing is taken until the next key frame, because the frames between count from the damaged one.

Sources: Betaflight `src/main/blackbox/blackbox.c`, `blackbox_encoding.c`, `blackbox_fielddefs.h`.
"""

from __future__ import annotations

import re
from array import array
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from rotorid.errors import InputError

_FIRST_LINE = b"H Product:Blackbox"
_HEADER_LINE = re.compile(rb"H ([^:\n]{1,80}):([^\n]*)\n")
_FRAMES = b"IPGHSE"
_END_OF_LOG = b"End of log"
_LONGEST_FRAME = _MOST_FIELDS = 256
_LARGEST_STEP = 5000
_LARGEST_STEP_US = 10_000_000
"""A main frame that leaps farther ahead in iterations or time than this, or back, is damaged."""
_TURN = 1 << 32
"""Numbers have 32 bits: a clock in microseconds begins anew after 71.6 minutes."""


@dataclass(frozen=True)
class BlackboxSession:
    """One session of a blackbox file.

    `names` and `values` (n, k), whole numbers: the main frames in the order of the file, `time` in µs without the
    clock's new beginnings. `whole`: the event of the end is there. `damaged`: frames that could not be read, or count
    from such a one.
    """

    headers: Mapping[str, str]
    names: tuple[str, ...]
    values: np.ndarray
    whole: bool
    damaged: int


def sessions(data: bytes) -> list[BlackboxSession | InputError]:
    """Every session of a blackbox file in its order; for one whose header cannot be read the reason."""
    starts = [match.start() for match in re.finditer(re.escape(_FIRST_LINE), data)]
    found: list[BlackboxSession | InputError] = []
    for start, stop in zip(starts, [*starts[1:], len(data)], strict=True):
        try:
            found.append(_session(data[start:stop]))
        except InputError as error:
            found.append(error)
    return found


def _session(data: bytes) -> BlackboxSession:
    headers, at = _headers(data)
    frames = _Frames(headers, data)
    whole = frames.read(at)
    values = np.array(frames.values, dtype=np.int64).reshape(-1, len(frames.names))
    time = values[:, frames.time]
    values[:, frames.time] = time + _TURN * np.cumsum(np.diff(time, prepend=time[:1]) < -_TURN // 2)
    return BlackboxSession(headers, frames.names, values, whole, frames.damaged)


def _headers(data: bytes) -> tuple[dict[str, str], int]:
    """The lines of a header by name, and where the frames begin; what is no line is passed over."""
    headers: dict[str, str] = {}
    at = 0
    while at < len(data):
        if line := _HEADER_LINE.match(data, at):
            name, value = (part.decode("utf-8", "replace").strip() for part in line.groups())
            headers[name] = value
            at = line.end()
        elif data[at] in _FRAMES.replace(b"H", b""):
            break
        else:
            at += 1
    return headers, at


# Numbers ------------------------------------------------------------------------------------------


def _unsigned(data: bytes, at: int) -> tuple[int, int]:
    """A number of seven bits a byte, the lowest first, and where the next begins."""
    value = shift = 0
    while True:
        byte = data[at]
        at += 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value & _TURN - 1, at
        shift += 7
        if shift > 28:
            return 0, at


def _signed(data: bytes, at: int) -> tuple[int, int]:
    value, at = _unsigned(data, at)
    return value >> 1 ^ -(value & 1), at


def _extended(value: int, bits: int) -> int:
    """The lowest bits of a number, of which the highest is the sign."""
    sign = 1 << bits - 1
    return (value & (sign << 1) - 1 ^ sign) - sign


def _one_signed(data: bytes, at: int, count: int) -> tuple[list[int], int]:
    value, at = _signed(data, at)
    return [value], at


def _one_unsigned(data: bytes, at: int, count: int) -> tuple[list[int], int]:
    value, at = _unsigned(data, at)
    return [value], at


def _one_negative(data: bytes, at: int, count: int) -> tuple[list[int], int]:
    value, at = _unsigned(data, at)
    return [-_extended(value, 14)], at


def _up_to_eight(data: bytes, at: int, count: int) -> tuple[list[int], int]:
    """A bit for each number that is not zero, then those."""
    if count == 1:
        return _one_signed(data, at, 1)
    given, values = data[at], []
    at += 1
    for k in range(count):
        value = 0
        if given >> k & 1:
            value, at = _signed(data, at)
        values.append(value)
    return values, at


def _four(data: bytes, at: int, count: int) -> tuple[list[int], int]:
    """Two bits for the width of each number (0, 4, 8, 16 bits), then these one behind the other."""
    widths = [(0, 4, 8, 16)[data[at] >> shift & 3] for shift in (0, 2, 4, 6)]
    size = -(-sum(widths) // 8)
    packed, left, values = int.from_bytes(data[at + 1 : at + 1 + size], "big"), 8 * size, []
    for width in widths:
        left -= width
        values.append(_extended(packed >> left, width) if width else 0)
    return values, at + 1 + size


def _three(layouts: tuple) -> Callable[[bytes, int, int], tuple[list[int], int]]:
    """Three numbers by the layout that the highest two bits choose: bytes, and shift and width of each number.

    The last choice gives each number whole bytes, from one to four, the lowest first.
    """

    def read(data: bytes, at: int, count: int) -> tuple[list[int], int]:
        lead = data[at]
        if lead >> 6 < 3:
            size, fields = layouts[lead >> 6]
            packed = int.from_bytes(data[at : at + size], "big")
            return [_extended(packed >> shift, width) for shift, width in fields], at + size
        values, at = [], at + 1
        for shift in (0, 2, 4):
            size = (lead >> shift & 3) + 1
            values.append(int.from_bytes(data[at : at + size], "little", signed=True))
            at += size
        return values, at

    return read


_ENCODINGS: dict[int, tuple[Callable, int]] = {
    0: (_one_signed, 1),
    1: (_one_unsigned, 1),
    3: (_one_negative, 1),
    6: (_up_to_eight, 8),
    7: (_three(((1, ((4, 2), (2, 2), (0, 2))), (2, ((8, 4), (4, 4), (0, 4))), (3, ((16, 6), (8, 6), (0, 6))))), 3),
    8: (_four, 4),
    9: (lambda data, at, count: ([0], at), 1),
    10: (_three(((1, ((4, 2), (2, 2), (0, 2))), (2, ((9, 5), (4, 5), (0, 4))), (3, ((14, 8), (7, 7), (0, 7))))), 3),
}
"""To the number of an encoding its reader and how many fields it packs together (`_up_to_eight`: at most)."""
_EVENTS: dict[int, int] = {0: 1, 14: 2, 15: 1, 30: 2}
"""To an event how many unsigned numbers follow: beep, log resumed, disarmed, flight mode."""
_RESUMED, _ADJUSTED, _ENDED = 14, 13, 255


# Frames -------------------------------------------------------------------------------------------


class _Frames:
    """Reads the frames of one session into `values`, a row of fields behind the other."""

    def __init__(self, headers: Mapping[str, str], data: bytes) -> None:
        self._data, self.values, self.damaged = data, array("q"), 0
        self.names = tuple(headers.get("Field I name", "").split(","))
        if not {"time", "loopIteration"} <= set(self.names):
            raise InputError("the header of the log is damaged: it does not name the fields loopIteration and time")
        if len(self.names) > _MOST_FIELDS:
            raise InputError(f"the header of the log is damaged: it names {len(self.names)} fields")
        self.time, self._iteration = self.names.index("time"), self.names.index("loopIteration")
        self._motor = self.names.index("motor[0]") if "motor[0]" in self.names else 0
        self._plans = {}
        for letter in _FRAMES.decode().replace("E", ""):
            encodings = _numbers_of(headers, f"Field {letter} encoding")
            if encodings or letter == "I":
                count = len(self.names) if letter in "IP" else len(encodings)
                self._plans[ord(letter)] = _plan(encodings, count, letter)
        self._predictors = {ord(k): _numbers_of(headers, f"Field {k} predictor") for k in "IP"}
        if any(len(self._predictors[k]) != len(self.names) for k in self._predictors if k in self._plans):
            raise InputError("the header of the log is damaged: its lists of fields have different lengths")
        first = {name: (_numbers_of(headers, name) or [default])[0]
                 for name, default in (("minthrottle", 1150), ("vbatref", 4095), ("motorOutput", 0))}  # fmt: skip
        self._fixed = {4: first["minthrottle"], 8: 1500, 9: first["vbatref"], 11: first["motorOutput"]}
        self._key_every = max((_numbers_of(headers, "I interval") or [1])[0], 1)
        share = [int(n) for n in re.findall(r"\d+", headers.get("P interval", "1"))] or [1]
        self._of, self._every = (share[0], max(share[1], 1)) if len(share) > 1 else (1, max(share[0], 1))
        self._history: list[list[int]] = []
        self._last: tuple[int, int] | None = None
        """Iteration and time of the last main frame, or of the event that the log resumes."""

    def read(self, at: int) -> bool:
        """Read from a place on to the event of the end, or of the data; whether that event was there."""
        data, size, sound = self._data, len(self._data), False
        while at < size:
            letter, start = data[at], at
            if letter == ord("E"):
                if data.startswith(_END_OF_LOG, at + 2) and data[at + 1] == _ENDED:
                    return True
                after = self._event(at + 1)
            else:
                after = self._frame(letter, at + 1) if letter in self._plans else None
            if after is None or not self._begins(after) or after - start > _LONGEST_FRAME:
                # What is no frame is looked through byte by byte for the next one.
                self.damaged += sound or letter == ord("I")
                at, sound = start + 1, False
                continue
            if letter in b"IP":
                sound = self._take(letter, sound)
                self.damaged += not sound
            at = after
        return False

    def _begins(self, at: int) -> bool:
        return at == len(self._data) or (at < len(self._data) and self._data[at] in _FRAMES)

    def _frame(self, letter: int, at: int) -> int | None:
        """Where the frame that begins here ends, its numbers in `_now`; None where the data end in it."""
        self._now: list[int] = []
        try:
            for read, count in self._plans[letter]:
                values, at = read(self._data, at, count)
                self._now += values
        except IndexError:
            return None
        return at if at <= len(self._data) else None

    def _event(self, at: int) -> int | None:
        """Where an event ends; None where it is not known, or the data end in it."""
        data = self._data
        try:
            kind, at = data[at], at + 1
            if kind == _ADJUSTED:
                return at + 5 if data[at] & 128 else _signed(data, at + 1)[1]
            if kind not in _EVENTS:
                return None
            values = []
            for _ in range(_EVENTS[kind]):
                value, at = _unsigned(data, at)
                values.append(value)
        except IndexError:
            return None
        if kind == _RESUMED and self._begins(at):
            self._last = values[0], values[1]
        return at

    def _take(self, letter: int, sound: bool) -> bool:
        """Add the main frame just read; whether it, and what counts from it, can be relied on."""
        if letter == ord("P") and not sound:
            return False
        now = self._predicted(letter)
        at = now[self._iteration], now[self.time]
        follows = self._last is None or (
            0 <= at[0] - self._last[0] < _LARGEST_STEP and (at[1] - self._last[1]) % _TURN < _LARGEST_STEP_US
        )
        self._last = at  # a key frame after a true leap is not taken, the next one is
        if not follows:
            return False
        self._history = [now, now] if letter == ord("I") else [now, self._history[0]]
        self.values.extend(now)
        return True

    def _predicted(self, letter: int) -> list[int]:
        """The fields of a main frame: what was read and its predictions."""
        now, zero = self._now, [0] * len(self.names)
        before, earlier = self._history if letter == ord("P") else (zero, zero)
        for k, predictor in enumerate(self._predictors[letter]):
            if predictor == 0:
                continue
            if predictor == 1:
                now[k] += before[k]
            elif predictor == 2:
                now[k] += 2 * before[k] - earlier[k]
            elif predictor == 3:
                now[k] += int((before[k] + earlier[k]) / 2)  # towards zero, as the firmware divides
            elif predictor == 5:
                now[k] += now[self._motor]
            elif predictor == 6:
                now[k] = before[k] + 1 + self._left_out()
            elif predictor in self._fixed:
                now[k] += self._fixed[predictor]
            else:
                raise InputError(f"the header of the log is damaged: there is no predictor {predictor}")
            if not -_TURN // 2 <= now[k] < _TURN // 2:
                now[k] = now[k] % _TURN if k == self.time else _extended(now[k], 32)
        now[self.time] %= _TURN
        return now

    def _left_out(self) -> int:
        """Iterations behind the last frame that the log leaves out by its rate."""
        following = self._history[0][self._iteration] + 1
        for count in range(self._key_every):
            if ((following + count) % self._key_every + self._of - 1) % self._every < self._of:
                return count
        return 0


def _plan(encodings: list[int], count: int, letter: str) -> list[tuple[Callable, int]]:
    """Readers of the fields of a kind of frame, each with the number of fields that it takes."""
    plan, k = [], 0
    while k < len(encodings):
        if encodings[k] not in _ENCODINGS:
            raise InputError(f"the header of the log is damaged: there is no encoding {encodings[k]}")
        read, takes = _ENCODINGS[encodings[k]]
        if encodings[k] == 6:
            takes = next((n for n in range(1, 8) if encodings[k + n : k + n + 1] != [6]), 8)
        plan.append((read, takes))
        k += takes
    if k != count:
        raise InputError(f"the header of the log is damaged: the fields of frames {letter} are packed for {k} numbers")
    return plan


def _numbers_of(headers: Mapping[str, str], name: str) -> list[int]:
    """Whole numbers of a header's list; empty where it is not there or holds something else."""
    parts = headers.get(name, "").split(",")
    return [int(p) for p in parts] if all(re.fullmatch(r"-?\d{1,10}", p.strip()) for p in parts) else []
