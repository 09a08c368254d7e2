"""The framing that every instrument speaks: COBS, checksum, sequence number, device clock.

A frame on the wire is

    COBS( kind u8 | sequence u16 | device clock u32, microseconds | payload | CRC-16 ) 0x00

little-endian. COBS (consistent overhead byte stuffing, Cheshire and Baker 1999) removes every zero from
the body, so a zero byte always and only ends a frame: after any garbage the next frame is found again.
The checksum is CRC-16/CCITT-FALSE over everything before it. `docs/wire-formats.md` has the whole.

From bytes in the order of arrival to frames in their true order: gaps, repeats, late frames, resets, rollover.

The recorder (live) and the parser (later) read a line by the same `Intake` with the same `Tracker`, so that both say
the same. Whatever a device may send, nothing is raised here: what is no frame, what is a frame without a sense, and
what is a frame of an unknown kind is counted, and the frames around it lose nothing.
"""

from __future__ import annotations

import struct
from binascii import crc_hqx
from collections.abc import Iterator
from contextlib import suppress
from enum import IntFlag
from typing import NamedTuple

from rotorid_acquire.io import wire
from rotorid_acquire.io.session import Gap
from rotorid_acquire.io.wire import BOOTED

START = ord("S")  # identity: at boot, when asked, and when a stream starts
DATA = ord("D")  # one sample of all channels
END = ord("E")  # the stream ended, with the number of frames sent
ANSWER = ord("A")  # the device's answer to a command
COMMAND = ord("C")  # from the host to the device

_HEAD = struct.Struct("<BHI")
_TAIL = struct.Struct("<H")
_SEQUENCE_PERIOD = 1 << 16
_CLOCK_PERIOD_US = 1 << 32
_MAX_BODY = 253  # so that a COBS block never needs the special code 0xFF
_MAX_WIRE = _MAX_BODY + 2
_UNKNOWN_BOOT = -1  # a reset was noticed whose start record never came
_LATE_US = 1_000_000  # a frame that comes late or twice is not older than this
_LATEST_GAPS = 1000  # a late frame's gap is one of the last; looking through more would take for ever on a ruined line
_UNPACK = {START: wire.StartRecord.unpack, END: wire.EndRecord.unpack, ANSWER: wire.Answer.unpack}


class Frame(NamedTuple):
    """One intact frame: kind (one of the constants above), sequence 0–65535, device clock in µs, payload."""

    kind: int
    sequence: int
    clock_us: int
    payload: bytes


class BrokenFrame(ValueError):
    """A block between two zero bytes that is no frame."""


class ChecksumError(BrokenFrame):
    """A block of the right form whose checksum does not fit its content."""


def cobs_encode(body: bytes) -> bytes:
    """Body without zero bytes, one byte longer. Raises ValueError beyond 253 bytes."""
    if len(body) > _MAX_BODY:
        raise ValueError(f"a frame's body holds at most {_MAX_BODY} bytes, not {len(body)}")
    out = bytearray()
    for part in body.split(b"\0"):
        out.append(len(part) + 1)
        out += part
    return bytes(out)


def cobs_decode(block: bytes) -> bytes:
    """Inverse of `cobs_encode`. Raises BrokenFrame where a length points past the end or at nothing."""
    out = bytearray()
    i, n = 0, len(block)
    while i < n:
        code = block[i]
        j = i + code
        if code == 0 or j > n:
            raise BrokenFrame("a length byte points past the end of the block")
        out += block[i + 1 : j]
        i = j
        if i < n:
            out.append(0)
    return bytes(out)


def encode(frame: Frame) -> bytes:
    """The bytes of a frame on the wire, ending in the zero that delimits it."""
    body = _HEAD.pack(frame.kind, frame.sequence % _SEQUENCE_PERIOD, frame.clock_us % _CLOCK_PERIOD_US)
    body += frame.payload
    return cobs_encode(body + _TAIL.pack(crc_hqx(body, 0xFFFF))) + b"\0"


def decode(block: bytes) -> Frame:
    """A frame from the bytes between two zeros. Raises BrokenFrame or ChecksumError."""
    body = cobs_decode(block)
    if len(body) < _HEAD.size + _TAIL.size:
        raise BrokenFrame(f"{len(body)} bytes are too short for a frame")
    # the CRC of a message followed by its own big-endian CRC is zero; ours is little-endian, so compare
    if crc_hqx(body[:-2], 0xFFFF) != body[-2] | body[-1] << 8:
        raise ChecksumError("checksum does not fit")
    kind, sequence, clock_us = _HEAD.unpack_from(body)
    return Frame(kind, sequence, clock_us, body[_HEAD.size : -2])


class StreamDecoder:
    """Turns a stream of bytes, cut anywhere, into frames; counts what was no frame.

    Attributes: `frames`, `checksum_errors`, `broken_frames` (blocks that were none), `lost_bytes` (bytes
    in both). `pending` holds the beginning of a frame whose end has not come yet.
    """

    def __init__(self) -> None:
        self.frames = 0
        self.checksum_errors = 0
        self.broken_frames = 0
        self.lost_bytes = 0
        self.pending = b""

    def feed(self, data: bytes) -> list[Frame]:
        """Frames completed by these bytes, in the order of arrival."""
        *blocks, self.pending = (self.pending + data).split(b"\0")
        if len(self.pending) > _MAX_WIRE:  # no frame is that long: forget the garbage, keep the count
            self.lost_bytes += len(self.pending) - _MAX_WIRE
            self.pending = self.pending[-_MAX_WIRE:]
        found = []
        for block in blocks:
            if not block:  # two zeros in a row: an empty block is a usual way to flush a line
                continue
            try:
                found.append(decode(block))
            except ChecksumError:
                self.checksum_errors += 1
                self.lost_bytes += len(block)
            except BrokenFrame:
                self.broken_frames += 1
                self.lost_bytes += len(block)
        self.frames += len(found)
        return found

    def break_off(self) -> None:
        """The line was cut: what was begun will not be ended by what comes later."""
        self.lost_bytes += len(self.pending)
        self.pending = b""


class Quality(IntFlag):
    """What is special about a sample; 0 is a plain good one."""

    GOOD = 0
    AFTER_GAP = 1  # frames are missing just before this one
    LATE = 2  # came after a younger frame; stands in its right place now
    AFTER_RESET = 4  # the first sample after the device restarted
    SATURATED = 8  # a channel stands at the end of its range


class _Placed(NamedTuple):
    """Where a frame belongs: segment (number of resets before it), index within the segment's unwrapped
    sequence, unwrapped device clock in µs, flags."""

    segment: int
    index: int
    clock_us: int
    flags: int


class Tracker:
    """Unwraps sequence numbers (u16) and device clocks (u32 µs) and notices what is missing.

    A reset shows as a start record with another boot id, or, should that record be lost or the boot id be the
    same, as an old sequence number with a clock that does not fit it; sequence and clock then begin anew in a
    new segment. A gap that spans half the sequence's period or more is counted with the help of the clock.
    """

    def __init__(self) -> None:
        self.segment = -1
        self.boot_id: int | None = None
        self.interval_us: int | None = None
        self.resets = 0
        self.missing = 0  # frames that never came
        self.repeated = 0
        self.late = 0
        self.gaps: list[Gap] = []
        self._index: int | None = None  # the youngest frame's
        self._clock = 0
        self._origin = (0, 0)  # index and clock of the segment's first frame
        self._kind = START
        self._rollovers = 0
        self._flags = Quality.GOOD  # for the next sample

    @property
    def rollovers(self) -> int:
        """How often the device clock ran over 2^32 µs (71.6 minutes)."""
        return self._rollovers + max(0, self._clock // _CLOCK_PERIOD_US)

    def place(self, frame: Frame) -> _Placed | None:
        """The frame's place, or None for a frame that was here before."""
        record = None
        if frame.kind == START:
            with suppress(wire.Malformed):
                record = wire.StartRecord.unpack(frame.payload)
        if record is not None:
            self.interval_us = record.interval_us or self.interval_us
            if self.boot_id == _UNKNOWN_BOOT:
                self.boot_id = record.boot_id
            elif record.boot_id != self.boot_id:
                self._begin_segment(record.boot_id)
        if self._index is None:
            return self._first(frame)
        step = _signed(frame.sequence - self._index, _SEQUENCE_PERIOD)
        ticks = _signed(frame.clock_us - self._clock, _CLOCK_PERIOD_US)
        if frame.kind == DATA == self._kind:  # between other frames the device may have idled for hours
            step += self._whole_periods(step, ticks)
            if self._contradicts(step, ticks):
                self._begin_segment(_UNKNOWN_BOOT)
                return self._first(frame)
        elif self._began_anew(step, ticks, record):
            self._begin_segment(_UNKNOWN_BOOT if record is None else record.boot_id)
            return self._first(frame)
        index, clock = self._index + step, self._clock + ticks
        if step <= 0:
            return self._old(index, clock)
        if step > 1:
            since = {"segment": self.segment, "first_index": self._index + 1, "start_s": self._clock / 1e6}
            self.gaps.append(Gap(**since, count=step - 1, stop_s=clock / 1e6))
            self.missing += step - 1
            self._flags |= Quality.AFTER_GAP
        self._index, self._clock, self._kind = index, clock, frame.kind
        return _Placed(self.segment, index, clock, self._take_flags(frame))

    def _first(self, frame: Frame) -> _Placed:
        if self.segment < 0:
            self.segment = 0
        self._index, self._clock, self._kind = frame.sequence, frame.clock_us, frame.kind
        self._origin = (self._index, self._clock)
        return _Placed(self.segment, self._index, self._clock, self._take_flags(frame))

    def _begin_segment(self, boot_id: int) -> None:
        # frames may come before the first start record: they belong to the boot it names
        if self.boot_id is not None:
            self.resets += 1
            self._rollovers = self.rollovers
            self._flags = Quality.AFTER_RESET
            self.segment += 1
            self._index = None
            self._clock = 0
        self.boot_id = boot_id

    def _take_flags(self, frame: Frame) -> Quality:
        """Gaps and resets are reported by the next sample, whatever frames come between."""
        if frame.kind != DATA:
            return Quality.GOOD
        flags, self._flags = self._flags, Quality.GOOD
        return flags

    def _whole_periods(self, step: int, ticks: int) -> int:
        """Multiples of 65,536 frames that the clock says have passed unseen."""
        if not self.interval_us or ticks <= _SEQUENCE_PERIOD * self.interval_us // 4:
            return 0
        return round((ticks / self.interval_us - step) / _SEQUENCE_PERIOD) * _SEQUENCE_PERIOD

    def _contradicts(self, step: int, ticks: int) -> bool:
        """Whether a step back, or over periods unseen, goes with a clock that does not fit it: a reset."""
        if not self.interval_us or 0 < step < _SEQUENCE_PERIOD // 2:
            return False
        return abs(ticks - step * self.interval_us) > max(1_000_000, ticks // 100) + 50 * self.interval_us

    def _began_anew(self, step: int, ticks: int, record: wire.StartRecord | None) -> bool:
        """Whether an old sequence number is that of a device that restarted with the boot id it had before.

        A frame that came late or twice is old by its sequence and by its clock, and by no more than a second; the
        first record of a boot that is not the one already seen needs no such patience.
        """
        if step > 0:
            return False
        if record is not None and record.reason == BOOTED:
            return (self._index + step, self._clock + ticks) != self._origin
        return abs(ticks) > _LATE_US + 50 * (self.interval_us or 0)

    def unreadable(self) -> None:
        """The frame just placed holds no sample: the next sample says that one is missing before it."""
        self._flags |= Quality.AFTER_GAP

    def _old(self, index: int, clock: int) -> _Placed | None:
        for i in range(len(self.gaps) - 1, max(len(self.gaps) - _LATEST_GAPS, 0) - 1, -1):
            gap = self.gaps[i]
            if gap.segment == self.segment and gap.first_index <= index < gap.first_index + gap.count:
                # what is left of the gap on both sides, now that this frame has come after all
                before, after, clock_s = index - gap.first_index, gap.first_index + gap.count - 1 - index, clock / 1e6
                first = gap.model_copy(update={"count": before, "stop_s": clock_s})
                second = {"first_index": index + 1, "count": after, "start_s": clock_s}
                parts = (first, gap.model_copy(update=second))
                self.gaps[i : i + 1] = [part for part in parts if part.count]
                self.late += 1
                self.missing -= 1
                return _Placed(self.segment, index, clock, Quality.LATE)
        self.repeated += 1
        return None


def _signed(difference: int, period: int) -> int:
    """A difference modulo `period`, from −period/2 to period/2 − 1."""
    return (difference + period // 2) % period - period // 2


_Content = wire.StartRecord | wire.EndRecord | wire.Answer | bytes
Taken = tuple[int, _Placed | None, _Content]
"""Kind and place of a frame of a known kind, and what it says: a record, an answer, or the payload of a sample.

The place is None for a frame that was here before; only a start record is handed on then.
"""


class Intake:
    """Decodes, places and unpacks. `instrument` says how long a sample is; None takes samples of any length.

    Attributes: `decoder` and `tracker` with their counts, `malformed` (the checksum fits, the payload does not
    what its kind asks for), `malformed_samples` (those of them that should have been samples), `unknown_kinds`,
    `fault` (the last sentence about a malformed frame).
    """

    def __init__(self, instrument: wire.Instrument | None = None) -> None:
        self.instrument = instrument
        self.decoder = StreamDecoder()
        self.tracker = Tracker()
        self.malformed = 0
        self.malformed_samples = 0
        self.unknown_kinds = 0
        self.fault = ""

    def feed(self, data: bytes) -> Iterator[Taken]:
        """What these bytes complete, in the order of arrival; the counts are those up to the frame in hand."""
        for frame in self.decoder.feed(data):
            taken = self._take(frame)
            if taken is not None:
                yield taken

    def _take(self, frame: Frame) -> Taken | None:
        if frame.kind == COMMAND:  # our own words, sent back by the line: no frame of the device
            self.unknown_kinds += 1
            return None
        content = self._content(frame)
        place = self.tracker.place(frame)
        if content is None:
            if place is not None and frame.kind == DATA:
                self.tracker.unreadable()
            return None
        if place is None and frame.kind != START:
            return None
        return frame.kind, place, content

    def _content(self, frame: Frame) -> _Content | None:
        """What a frame says, or None, counted, where it says nothing that could be understood."""
        try:
            if frame.kind == DATA:
                if self.instrument is not None:
                    self.instrument.check(frame.payload)
                return frame.payload
            if frame.kind in _UNPACK:
                return _UNPACK[frame.kind](frame.payload)
            self.unknown_kinds += 1
        except wire.Malformed as error:
            self.malformed += 1
            self.malformed_samples += frame.kind == DATA
            self.fault = str(error)
        return None
