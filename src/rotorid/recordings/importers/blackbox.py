"""Blackbox logs of Betaflight and its relatives: sessions, their headers, and the numbers of their frames.

Each session has lines of text (`H name:value`) that say how its frames are packed. Key frames (I) stand alone; a frame
between them (P) holds differences from a prediction. A frame is whole where the next one begins with a known letter.
After damage nothing is taken until the next key frame, because the frames between count from the damaged one.

Where a frame ends is known only when it has been read, and each frame counts from the one before: one after the other
that is slow. So every place that has a frame's letter is read as if a frame began there, all at once, then the true
ones are followed; and frames are predicted side by side, the first behind each key frame, the second, and so on.

Sources: Betaflight `src/main/blackbox/` (`blackbox.c`, `blackbox_encoding.c`, `blackbox_fielddefs.h`).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from rotorid.errors import InputError

_FIRST_LINE = b"H Product:Blackbox"
HEADER_LINE = re.compile(rb"H ([^:\n]{1,80}):([^\n]*)\n")
_FRAMES = b"IPGHSE"
_END_OF_LOG = b"\xffEnd of log"
_LONGEST_FRAME = _MOST_FIELDS = 256
_LARGEST_STEP = 5000
_LARGEST_STEP_US = 10_000_000
"""A main frame that leaps farther ahead in iterations or time than this, or back, is damaged."""
_TURN = 1 << 32
"""Numbers have 32 bits: a clock in microseconds begins anew after 71.6 minutes."""
_KEY_EVERY = 32
"""Iterations from key frame to key frame where the header does not say."""
_WINDOW = 1 << 18
"""Bytes whose frames are read at once."""


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
    layout = _Layout(headers)
    read, whole = _Frames(layout, data).read(at)
    values, damaged = _predicted(layout, read)
    time = values[:, layout.time]
    values[:, layout.time] = time + _TURN * np.cumsum(np.diff(time, prepend=time[:1]) < -_TURN // 2)
    return BlackboxSession(headers, layout.names, values, whole, damaged)


def _headers(data: bytes) -> tuple[dict[str, str], int]:
    """The lines of a header by name, and where the frames begin; what is no line is passed over."""
    headers: dict[str, str] = {}
    at = 0
    while at < len(data):
        if line := HEADER_LINE.match(data, at):
            name, value = (part.decode("utf-8", "replace").strip() for part in line.groups())
            headers[name] = value
            at = line.end()
        elif data[at] in _FRAMES.replace(b"H", b""):
            break
        else:
            at += 1
    return headers, at


# Numbers ------------------------------------------------------------------------------------------


class _Bytes:
    """Bytes of a session with zeros behind them: one by one, and eight together from each on, either end first."""

    def __init__(self, data: bytes) -> None:
        self.size = len(data)
        padded = data + bytes(_LONGEST_FRAME)
        self.one = np.frombuffer(padded, np.uint8)
        self.big, self.little = (np.ndarray(self.size + 2, kind, padded, strides=(1,)) for kind in (">i8", "<i8"))

    def after(self, at: np.ndarray, count: int | np.ndarray) -> np.ndarray:
        """Places so many bytes on; all beyond the end are one."""
        return np.minimum(at + count, self.size + 1)


_Read = tuple[list[np.ndarray], np.ndarray]
"""Numbers, and where the next begins."""


def _unsigned(data: _Bytes, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers of seven bits a byte, the lowest first, and where the next begin; 0 where five bytes do not end one."""
    byte = data.one[at]
    value, at = (byte & 127).astype(np.int64), data.after(at, 1)
    more = np.flatnonzero(byte > 127)
    for shift in (7, 14, 21, 28):
        byte = data.one[at[more]]
        value[more] |= (byte & 127).astype(np.int64) << shift
        at[more] = data.after(at[more], 1)
        more = more[byte > 127]
    value[more] = 0
    return value & _TURN - 1, at


def _signed(data: _Bytes, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    value, at = _unsigned(data, at)
    return value >> 1 ^ -(value & 1), at


def _extended(value: np.ndarray, bits: int) -> np.ndarray:
    """The lowest bits of numbers, of which the highest is the sign."""
    return value << 64 - bits >> 64 - bits


def _one(turned: Callable[[np.ndarray], np.ndarray]) -> Callable[[_Bytes, np.ndarray, int], _Read]:
    """One number, turned into what it stands for."""

    def read(data: _Bytes, at: np.ndarray, count: int) -> _Read:
        value, at = _unsigned(data, at)
        return [turned(value)], at

    return read


def _up_to_eight(data: _Bytes, at: np.ndarray, count: int) -> _Read:
    """A bit for each number that is not zero, then those."""
    if count == 1:
        value, at = _signed(data, at)
        return [value], at
    given, at, values = data.one[at], data.after(at, 1), []
    for k in range(count):
        value, there = np.zeros(len(at), np.int64), np.flatnonzero(given >> k & 1)
        value[there], at[there] = _signed(data, at[there])
        values.append(value)
    return values, at


def _four(data: _Bytes, at: np.ndarray, count: int) -> _Read:
    """Two bits for the width of each number (0, 4, 8, 16 bits), then these one behind the other."""
    lead, packed = data.one[at], data.big[data.after(at, 1)].astype(np.int64)
    values, used = [], np.zeros(len(at), np.int64)
    for k in range(4):
        width = np.array([0, 4, 8, 16])[lead >> 2 * k & 3]
        values.append(np.where(width, packed << used >> 64 - np.maximum(width, 1), 0))
        used += width
    return values, data.after(at, 1 + (used + 7) // 8)


def _three(layouts: tuple) -> Callable[[_Bytes, np.ndarray, int], _Read]:
    """Three numbers by the layout that the highest two bits choose: bytes, and shift and width of each number.

    The last choice gives each number whole bytes, from one to four, the lowest first.
    """
    sizes = np.array([size for size, _ in layouts])
    shifts, widths = np.moveaxis([fields for _, fields in layouts], -1, 0)
    first = 8 * sizes[:, None] - shifts - widths

    def read(data: _Bytes, at: np.ndarray, count: int) -> _Read:
        lead, packed = data.one[at], data.big[at].astype(np.int64)
        which = np.minimum(lead >> 6, len(layouts) - 1)
        values = [packed << first[which, k] >> 64 - widths[which, k] for k in range(3)]
        large = np.flatnonzero(lead >> 6 == 3)
        after, place = data.after(at, sizes[which]), data.after(at[large], 1)
        for k in range(3):
            size = (lead[large] >> 2 * k & 3).astype(np.int64) + 1
            values[k][large] = _extended(data.little[place].astype(np.int64), 8 * size)
            place = data.after(place, size)
        after[large] = place
        return values, after

    return read


_ENCODINGS: dict[int, tuple[Callable[[_Bytes, np.ndarray, int], _Read], int]] = {
    0: (lambda data, at, count: _up_to_eight(data, at, 1), 1),
    1: (_one(lambda value: value), 1),
    3: (_one(lambda value: -_extended(value, 14)), 1),
    6: (_up_to_eight, 8),
    7: (_three(((1, ((4, 2), (2, 2), (0, 2))), (2, ((8, 4), (4, 4), (0, 4))), (3, ((16, 6), (8, 6), (0, 6))))), 3),
    8: (_four, 4),
    9: (lambda data, at, count: ([np.zeros(len(at), np.int64)], at), 1),
    10: (_three(((1, ((4, 2), (2, 2), (0, 2))), (2, ((9, 5), (4, 5), (0, 4))), (3, ((14, 8), (7, 7), (0, 7))))), 3),
}
"""To the number of an encoding its reader and how many fields it packs together (`_up_to_eight`: at most)."""
_EVENTS: dict[int, int] = {0: 1, 14: 2, 15: 1, 30: 2, 40: 1}
"""To an event how many unsigned numbers follow: beep, log resumed, disarmed, flight mode, a sensor's fault (iNAV)."""
_RESUMED, _ADJUSTED = 14, 13


# Frames -------------------------------------------------------------------------------------------


class _Layout:
    """What a header says of the frames: names of the fields, how they are packed and predicted.

    InputError where it is damaged.
    """

    def __init__(self, headers: Mapping[str, str]) -> None:
        self.names = tuple(headers.get("Field I name", "").split(","))
        if not {"time", "loopIteration"} <= set(self.names):
            raise InputError("the header of the log is damaged: it does not name the fields loopIteration and time")
        if len(self.names) > _MOST_FIELDS:
            raise InputError(f"the header of the log is damaged: it names {len(self.names)} fields")
        self.time, self.iteration = self.names.index("time"), self.names.index("loopIteration")
        self.motor = self.names.index("motor[0]") if "motor[0]" in self.names else 0
        self.plans: dict[int, list[tuple[Callable, int]]] = {}
        for letter in _FRAMES.decode().replace("E", ""):
            encodings = _numbers_of(headers, f"Field {letter} encoding")
            if encodings or letter == "I":
                count = len(self.names) if letter in "IP" else len(encodings)
                self.plans[ord(letter)] = _plan(encodings, count, letter)
        self.predictors = {ord(k): np.array(_numbers_of(headers, f"Field {k} predictor")) for k in "IP"}
        if any(len(self.predictors[k]) != len(self.names) for k in self.predictors if k in self.plans):
            raise InputError("the header of the log is damaged: its lists of fields have different lengths")
        first = {name: (_numbers_of(headers, name) or [default])[0]
                 for name, default in (("minthrottle", 1150), ("vbatref", 4095), ("motorOutput", 0))}  # fmt: skip
        self._fixed = {4: first["minthrottle"], 8: 1500, 9: first["vbatref"], 11: first["motorOutput"]}
        self._key_every = max((_numbers_of(headers, "I interval") or [_KEY_EVERY])[0], 1)
        share = [int(n) for n in re.findall(r"\d+", headers.get("P interval", "1"))] or [1]
        self._of, self._every = (share[0], max(share[1], 1)) if len(share) > 1 else (1, max(share[0], 1))

    def predict(self, letter: int, read: np.ndarray, before: np.ndarray, earlier: np.ndarray) -> np.ndarray:
        """Fields of main frames, (n, k), of what was read and of the frames before and before those.

        By the header each field counts from nothing, the frame before, the line through the two before, their mean, a
        value of the header, a count of iterations, or the first motor.
        """
        how = self.predictors[letter]
        if len(unknown := sorted(set(how.tolist()) - {0, 1, 2, 3, 5, 6, *self._fixed})):
            raise InputError(f"the header of the log is damaged: there is no predictor {unknown[0]}")
        now = read + before * ((how == 1) + 2 * (how == 2)) - earlier * (how == 2)
        by_motor = np.flatnonzero(how == 5)
        early = by_motor[by_motor < self.motor]
        now[:, early] += read[:, self.motor, None]
        mean = np.flatnonzero(how == 3)
        both = before[:, mean] + earlier[:, mean]
        now[:, mean] += both + (both < 0) >> 1  # towards zero, as the firmware divides
        for number, value in self._fixed.items():
            now[:, how == number] += value
        counted = np.flatnonzero(how == 6)
        now[:, counted] = before[:, counted] + 1 + self._left_out(before[:, self.iteration])[:, None]
        for k in by_motor[by_motor >= self.motor]:
            now[:, k] += now[:, self.motor]
        predicted = how > 0
        now[:, predicted] = _extended(now[:, predicted], 32)
        now[:, self.time] %= _TURN
        return now

    def _left_out(self, iteration: np.ndarray) -> np.ndarray:
        """Iterations behind these that the log leaves out by its rate."""
        following = (iteration + 1) % self._key_every
        past = (following + self._of - 1) % self._every
        return np.where(past < self._of, 0, np.minimum(self._every - past, self._key_every - following)) * (
            self._of > 0
        )


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


_BAD, _RESUMES = 0, 1
"""What stands in a log next to main frames, whose kind is their letter: what could not be read, a new beginning."""
_KEY, _BETWEEN, _EVENT = b"IPE"
_Stream = tuple[np.ndarray, np.ndarray]
"""What there is in order: its kind, (n,), and its numbers as read, (n, k).

Of a new beginning the numbers are its iteration and time. Of what could not be read there is one for each letter of a
frame where none was found; its first number is 1 where that letter is a key frame's.
"""


class _Frames:
    """Reads the frames of one session, window by window."""

    def __init__(self, layout: _Layout, data: bytes) -> None:
        self._layout, self._data, self._bytes = layout, data, _Bytes(data)
        known = np.zeros(256, bool)
        known[list(_FRAMES)] = True
        self._begins = known[self._bytes.one]
        self._begins[len(data)] = True

    def read(self, at: int) -> tuple[_Stream, bool]:
        """What there is from a place to the event of the end, or of the data; whether that event was there."""
        kinds, numbers = [np.empty(0, np.int64)], [np.empty((0, len(self._layout.names)), np.int64)]
        whole = False
        while at < len(self._data) and not whole:
            (kind, number), at, whole = self._window(at, min(at + _WINDOW, len(self._data)))
            kinds.append(kind)
            numbers.append(number)
        return (np.concatenate(kinds), np.concatenate(numbers)), whole

    def _window(self, at: int, stop: int) -> tuple[_Stream, int, bool]:
        """What begins in a part of the data, where to go on, and whether the event of the end was there."""
        places = at + np.flatnonzero(self._begins[at:stop])
        letters = self._bytes.one[places]
        ends = np.full(len(places), -1)
        values = np.zeros((len(places), len(self._layout.names)), np.int64)
        for letter in self._layout.plans:
            those = np.flatnonzero(letters == letter)
            numbers, ends[those] = self._frames(letter, places[those])
            if letter in b"IP":
                values[those] = numbers
        kinds = np.where((ends < 0) & (letters != _EVENT), _BAD, letters).astype(np.int64)
        values[(kinds == _BAD), 0] = letters[kinds == _BAD] == _KEY
        steps = np.where(ends < 0, np.arange(len(places)) + 1, np.searchsorted(places, ends)).tolist()
        events, order, k = set(np.flatnonzero(letters == _EVENT).tolist()), [], 0
        while k < len(places):
            order.append(k)
            if k in events:
                place = int(places[k])
                if self._data.startswith(_END_OF_LOG, place + 1):
                    return self._main(order, kinds, values), place, True
                kinds[k], ends[k] = self._event(place + 1, values[k])
                steps[k] = k + 1 if ends[k] < 0 else int(np.searchsorted(places, ends[k]))
            k = steps[k]
        return self._main(order, kinds, values), max(stop, *ends[order[-1:]].tolist()), False

    @staticmethod
    def _main(order: list[int], kinds: np.ndarray, values: np.ndarray) -> _Stream:
        """Of what there is in order that which matters for main frames."""
        kept = np.array(order, int)[np.isin(kinds[order], (_BAD, _RESUMES, _KEY, _BETWEEN))]
        return kinds[kept], values[kept]

    def _frames(self, letter: int, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Numbers, (n, k), of frames with a letter at these places, and where they end; -1 where none is."""
        numbers, at = [], places + 1
        for read, count in self._layout.plans[letter]:
            values, at = read(self._bytes, at, count)
            numbers += values
        return np.transpose(numbers), np.where(self._begins[at] & (at - places <= _LONGEST_FRAME), at, -1)

    def _event(self, at: int, values: np.ndarray) -> tuple[int, int]:
        """Kind and end of an event at a place, -1 where none is; of a new beginning its numbers are put into values."""
        kind, place = self._bytes.one[at], np.array([at + 1])
        if kind == _ADJUSTED:
            decimal = self._bytes.one[at + 1] & 128
            place = place + 5 if decimal else _signed(self._bytes, place + 1)[1]
        elif kind not in _EVENTS:
            return _BAD, -1
        numbers = []
        for _ in range(_EVENTS.get(int(kind), 0)):
            number, place = _unsigned(self._bytes, place)
            numbers.append(number)
        if not self._begins[place[0]]:
            return _BAD, -1
        if kind == _RESUMED:
            values[[self._layout.iteration, self._layout.time]] = np.ravel(numbers)
        return _RESUMES if kind == _RESUMED else _EVENT, int(place[0])


def _predicted(layout: _Layout, stream: _Stream) -> tuple[np.ndarray, int]:
    """Main frames, (n, k), that can be relied on, and how many others there are."""
    kinds, values = stream
    main, heads = (kinds == _KEY) | (kinds == _BETWEEN), (kinds == _KEY) | (kinds == _BAD)
    behind_key = kinds[np.maximum.accumulate(np.where(heads, np.arange(len(kinds)), 0))] == _KEY
    frames = np.flatnonzero(main & behind_key)
    now, keys = values[frames], np.flatnonzero(kinds[frames] == _KEY)
    _predict(layout, now, keys)
    marks = values[:, [layout.iteration, layout.time]]
    marks[frames] = now[:, [layout.iteration, layout.time]]
    taken = _following(kinds, marks, frames, keys)
    sound = np.zeros(len(kinds), bool)
    sound[frames] = taken
    rest = kinds != _RESUMES
    unread = kinds[rest] == _BAD
    lost = unread & (values[rest, 0] | np.append(False, sound[rest][:-1])).astype(bool)
    return now[taken], int(lost.sum() + main.sum() - taken.sum())


def _predict(layout: _Layout, frames: np.ndarray, keys: np.ndarray) -> None:
    """Make of frames as read, (n, k), those that were meant: the first behind each key frame, the second, and so on."""
    counts = np.diff(keys, append=len(frames))
    nothing = np.zeros((len(keys), frames.shape[1]), np.int64)
    frames[keys] = layout.predict(_KEY, frames[keys], nothing, nothing)
    for k in range(1, int(counts.max(initial=0))):
        those = keys[counts > k] + k
        frames[those] = layout.predict(_BETWEEN, frames[those], frames[those - 1], frames[those - min(k, 2)])


def _following(kinds: np.ndarray, marks: np.ndarray, frames: np.ndarray, keys: np.ndarray) -> np.ndarray:
    """Which frames, (n,), go on from what is before them: iterations and times `marks`, (m, 2), of all that there is.

    Behind one that does not, none is taken up to the next key frame; that is held against the last that was looked at.
    """
    leaps = np.flatnonzero(~_follows(marks[frames], marks[frames - 1]) & (kinds[frames] == _BETWEEN))
    stops = np.append(keys, len(frames))[1:]
    first = np.append(leaps, len(frames))[np.searchsorted(leaps, keys)]
    resumed = np.maximum.accumulate(np.where(kinds == _RESUMES, np.arange(len(kinds)), -1))
    taken, last = np.ones(len(frames), bool), -1
    for key, leap, stop in zip(keys, np.minimum(first, stops), stops, strict=True):
        before = max(last, resumed[frames[key]])
        if before >= 0 and not _follows(marks[frames[key]], marks[before]):
            leap, last = key, frames[key]
        else:
            last = frames[min(leap, stop - 1)]
        taken[leap:stop] = False
    return taken


def _follows(marks: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Whether iterations and times go on from those before."""
    step, step_us = np.moveaxis(marks - before, -1, 0)
    return (step >= 0) & (step < _LARGEST_STEP) & (step_us % _TURN < _LARGEST_STEP_US)
