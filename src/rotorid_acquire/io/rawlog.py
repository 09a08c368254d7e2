"""The file a recorder writes: chunks of bytes as they came, each with the host's monotonic time.

    "ROTORLOG1\\n"  then chunks:  tag u8 | monotonic time u64, ns | length u16 | bytes | CRC-16 of the chunk

Tags: `R` received from the instrument, `T` sent to it, `N` a note of the recorder (JSON, one object).
Nothing is ever rewritten, so a file cut off anywhere is readable up to the cut. Behind bytes that were changed
the reader goes on with the next intact chunk. A finished log may be kept gzipped (`.rlog.gz`); the reader takes
both, and cut and damaged ones of both.
"""

from __future__ import annotations

import re
import struct
import zlib
from binascii import crc_hqx
from collections.abc import Iterator
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

from rotorid.errors import InputError
from rotorid.io.text.files import LARGEST_RAW_LOG, MOST_TRIED_BYTES, read_bytes

MAGIC = b"ROTORLOG1\n"
_CHUNK_HEAD = struct.Struct("<BQH")
_CHUNK_TAIL = struct.Struct("<H")
_MAX_CHUNK = 0xFFFF
RECEIVED, SENT, NOTE = ord("R"), ord("T"), ord("N")
_TAG = re.compile(b"[RTN]")
_LONGEST_PAUSE_NS = 30 * 86_400 * 10**9
"""Between two chunks of one log."""


class _Chunk(NamedTuple):
    """Bytes and the host's monotonic time (ns) at which they were read, sent or noted."""

    tag: int
    host_ns: int
    data: bytes


class Damage(NamedTuple):
    """Bytes `start` up to `stop` of the unpacked file that are no intact chunk; `after` chunks come before them.

    `rescued`: what a damaged chunk of received bytes holds, where its length still fits; the frames in it have
    checksums of their own.
    """

    start: int
    stop: int
    after: int
    rescued: _Chunk | None


@dataclass(frozen=True)
class RawLog:
    """All intact chunks. `cut_at` is the byte (of the unpacked file) where it stops in the middle of a chunk, None
    for a log that goes to its end; `damages` are the places where bytes were changed; `sha256` is that of the unpacked
    file as it is."""

    chunks: tuple[_Chunk, ...]
    cut_at: int | None
    damages: tuple[Damage, ...] = ()
    sha256: str = ""

    @property
    def lost_bytes(self) -> int:
        """Bytes of the file in damaged places, not counting the end that a cut took."""
        return sum(damage.stop - damage.start for damage in self.damages)

    def pieces(self) -> Iterator[_Chunk | Damage]:
        """Chunks and damages in the order of the file."""
        damages = list(self.damages)
        for number, chunk in enumerate(self.chunks):
            while damages and damages[0].after <= number:
                yield damages.pop(0)
            yield chunk
        yield from damages


def pack_chunk(tag: int, host_ns: int, data: bytes) -> bytes:
    """The bytes of one or (beyond 65,535 bytes) several chunks."""
    out = b""
    for start in range(0, max(len(data), 1), _MAX_CHUNK):
        part = data[start : start + _MAX_CHUNK]
        chunk = _CHUNK_HEAD.pack(tag, host_ns, len(part)) + part
        out += chunk + _CHUNK_TAIL.pack(crc_hqx(chunk, 0xFFFF))
    return out


def read_raw(path: str | Path) -> RawLog:
    """Read a log, whole, cut or damaged, plain or gzipped. Raises InputError where there is none."""
    data = read_bytes(Path(path), LARGEST_RAW_LOG)
    truncated = changed = False
    if data[:2] == b"\x1f\x8b":
        data, truncated, changed = _unpacked(data)
        if len(data) > LARGEST_RAW_LOG:
            raise InputError(f"{path}: unpacks to more than {LARGEST_RAW_LOG / 1e6:g} MB, expected at most that")
    if not MAGIC.startswith(data[: len(MAGIC)]):
        raise InputError(f"{path}: does not begin with {MAGIC!r}, so it is no raw log of rotorid-acquire")
    digest = sha256(data).hexdigest()
    if len(data) < len(MAGIC):  # cut inside the first ten bytes: a log with nothing in it
        return RawLog((), len(data), sha256=digest)
    chunks, damages, position = [], [], len(MAGIC)
    for chunk, begin, end in _walk(data, len(MAGIC)):
        if begin > position:
            damages.append(Damage(position, begin, len(chunks), _rescued(data, position, begin, chunks, chunk)))
        chunks.append(chunk)
        position = end
    cut = position if truncated or changed or position < len(data) else None
    if changed or (cut is not None and not truncated and not _is_cut(data[position:])):
        last = _rescued(data, position, len(data), chunks, None)
        damages.append(Damage(position, len(data), len(chunks), last))
        cut = cut if changed else None  # of a packed file nothing behind the damage can be read
    return RawLog(tuple(chunks), cut, tuple(damages), digest)


def _unpacked(data: bytes) -> tuple[bytes, bool, bool]:
    """What a gzip stream holds up to its end or to where it is damaged, whether it is cut off, whether it is damaged.

    Ends soon behind `LARGEST_RAW_LOG` bytes.
    """
    unpacker, out = zlib.decompressobj(wbits=31), bytearray()
    try:
        for start in range(0, len(data), 512):  # in small pieces: an error costs no more than one of them
            out += unpacker.decompress(data[start : start + 512])
            if len(out) > LARGEST_RAW_LOG or not MAGIC.startswith(out[: len(MAGIC)]):
                break
    except zlib.error:
        return bytes(out), False, True
    return bytes(out), not unpacker.eof, False


def _walk(data: bytes, position: int) -> Iterator[tuple[_Chunk, int, int]]:
    """Intact chunks, each with where it begins and ends; what lies between two of them is damaged."""
    earliest, latest, tried, following = 0, 2**64, 0, position
    while (place := _TAG.search(data, position)) is not None and tried < MOST_TRIED_BYTES:
        position = place.start()
        if position + _CHUNK_HEAD.size + _CHUNK_TAIL.size > len(data):
            return
        tag, host_ns, length = _CHUNK_HEAD.unpack_from(data, position)
        begin = position + _CHUNK_HEAD.size
        end = begin + length
        # behind a damage any two bytes may look like a checksum: the time, too, has to go on
        timely = earliest <= host_ns and (host_ns <= latest or position == following)
        if timely and end + _CHUNK_TAIL.size <= len(data):
            if crc_hqx(data[position:end], 0xFFFF) == _CHUNK_TAIL.unpack_from(data, end)[0]:
                earliest, latest = host_ns, host_ns + _LONGEST_PAUSE_NS
                yield _Chunk(tag, host_ns, data[begin:end]), position, end + _CHUNK_TAIL.size
                position = following = end + _CHUNK_TAIL.size
                continue
            tried += length
        position += 1


def _is_cut(rest: bytes) -> bool:
    """Whether these last bytes can be the beginning of a chunk, or zeros that a power cut left; else bits changed."""
    if not rest.strip(b"\0"):
        return True
    if _TAG.match(rest) is None:
        return False
    if len(rest) < _CHUNK_HEAD.size:
        return True
    return _CHUNK_HEAD.size + _CHUNK_HEAD.unpack_from(rest)[2] + _CHUNK_TAIL.size > len(rest)


def _rescued(data: bytes, start: int, stop: int, before: list[_Chunk], following: _Chunk | None) -> _Chunk | None:
    """The content of one damaged chunk of received bytes whose length still leads to the next chunk, or the end."""
    if stop - start < _CHUNK_HEAD.size + _CHUNK_TAIL.size:
        return None
    tag, host_ns, length = _CHUNK_HEAD.unpack_from(data, start)
    if tag != RECEIVED or start + _CHUNK_HEAD.size + length + _CHUNK_TAIL.size != stop:
        return None
    earliest = before[-1].host_ns if before else 0
    content = data[start + _CHUNK_HEAD.size : stop - _CHUNK_TAIL.size]
    return _Chunk(tag, min(max(host_ns, earliest), following.host_ns if following else 2**64 - 1), content)
