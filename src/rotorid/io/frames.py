"""The framing that every instrument speaks: COBS, checksum, sequence number, device clock.

A frame on the wire is

    COBS( kind u8 | sequence u16 | device clock u32, microseconds | payload | CRC-16 ) 0x00

little-endian. COBS (consistent overhead byte stuffing, Cheshire and Baker 1999) removes every zero from
the body, so a zero byte always and only ends a frame: after any garbage the next frame is found again.
The checksum is CRC-16/CCITT-FALSE over everything before it. `docs/wire-formats.md` has the whole.
"""

from __future__ import annotations

import struct
from binascii import crc_hqx
from typing import NamedTuple

START = ord("S")  # identity: at boot, when asked, and when a stream starts
DATA = ord("D")  # one sample of all channels
END = ord("E")  # the stream ended, with the number of frames sent
ANSWER = ord("A")  # the device's answer to a command
COMMAND = ord("C")  # from the host to the device

_HEAD = struct.Struct("<BHI")
_TAIL = struct.Struct("<H")
SEQUENCE_PERIOD = 1 << 16
CLOCK_PERIOD_US = 1 << 32
_MAX_BODY = 253  # so that a COBS block never needs the special code 0xFF
_MAX_WIRE = _MAX_BODY + 2


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
    body = _HEAD.pack(frame.kind, frame.sequence % SEQUENCE_PERIOD, frame.clock_us % CLOCK_PERIOD_US)
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
