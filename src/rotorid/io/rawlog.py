"""The file a recorder writes: chunks of bytes as they came, each with the host's monotonic time.

    "ROTORLOG1\\n"  then chunks:  tag u8 | monotonic time u64, ns | length u16 | bytes | CRC-16 of the chunk

Tags: `R` received from the instrument, `T` sent to it, `N` a note of the recorder (JSON, one object).
Nothing is ever rewritten, so a file cut off anywhere is readable up to the cut. A finished log may be
kept gzipped (`.rlog.gz`); the reader takes both, and cut ones of both.
"""

from __future__ import annotations

import struct
import zlib
from binascii import crc_hqx
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

MAGIC = b"ROTORLOG1\n"
CHUNK_HEAD = struct.Struct("<BQH")
CHUNK_TAIL = struct.Struct("<H")
MAX_CHUNK = 0xFFFF
RECEIVED, SENT, NOTE = ord("R"), ord("T"), ord("N")


class NotALog(ValueError):
    """The file is not a raw log at all."""


class Chunk(NamedTuple):
    """Bytes and the host's monotonic time (ns) at which they were read, sent or noted."""

    tag: int
    host_ns: int
    data: bytes


@dataclass(frozen=True)
class RawLog:
    """All chunks up to the end or the cut. `cut_at` is the byte (of the unpacked file) where a cut or
    damaged chunk begins, None for a whole log."""

    chunks: tuple[Chunk, ...]
    cut_at: int | None


def pack_chunk(tag: int, host_ns: int, data: bytes) -> bytes:
    """The bytes of one or (beyond 65,535 bytes) several chunks."""
    out = b""
    for start in range(0, max(len(data), 1), MAX_CHUNK):
        part = data[start : start + MAX_CHUNK]
        chunk = CHUNK_HEAD.pack(tag, host_ns, len(part)) + part
        out += chunk + CHUNK_TAIL.pack(crc_hqx(chunk, 0xFFFF))
    return out


def read_raw(path: str | Path) -> RawLog:
    """Read a log, whole or cut, plain or gzipped. Raises NotALog, or OSError where there is no file."""
    data = Path(path).read_bytes()
    truncated = False
    if data[:2] == b"\x1f\x8b":
        unpacker = zlib.decompressobj(wbits=31)
        try:
            data = unpacker.decompress(data)
            truncated = not unpacker.eof
        except zlib.error as error:
            raise NotALog(f"{path}: damaged gzip stream ({error}); fetch the file again") from error
    if not MAGIC.startswith(data[: len(MAGIC)]):
        raise NotALog(f"{path}: does not begin with {MAGIC!r}, so it is no raw log of rotorid-acquire")
    if len(data) < len(MAGIC):  # cut inside the first ten bytes: a log with nothing in it
        return RawLog((), len(data))
    chunks = []
    position = len(MAGIC)
    for chunk, end in _walk(data, position):
        chunks.append(chunk)
        position = end
    cut = position if truncated or position < len(data) else None
    return RawLog(tuple(chunks), cut)


def _walk(data: bytes, position: int) -> Iterator[tuple[Chunk, int]]:
    """Intact chunks and where each ends, up to the first that is cut or damaged."""
    while position + CHUNK_HEAD.size + CHUNK_TAIL.size <= len(data):
        tag, host_ns, length = CHUNK_HEAD.unpack_from(data, position)
        body_end = position + CHUNK_HEAD.size + length
        if body_end + CHUNK_TAIL.size > len(data):
            return
        if crc_hqx(data[position:body_end], 0xFFFF) != CHUNK_TAIL.unpack_from(data, body_end)[0]:
            return
        position_of_data = position + CHUNK_HEAD.size
        position = body_end + CHUNK_TAIL.size
        yield Chunk(tag, host_ns, data[position_of_data:body_end]), position
