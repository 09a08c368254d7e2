"""The parts that all instruments share: channels, start and end records, commands and answers."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

BOOTED, ASKED, STREAMING = 0, 1, 2  # why a start record is sent
STOPPED, COMPLETE, _FAULT, UNHEARD = 0, 1, 2, 3  # why a stream ended; 3: the watchdog heard no computer
OK, REFUSED, _UNKNOWN = 0, 1, 2  # how a command was taken

IDENTIFY, GO, STOP = "?", "G", "X"  # commands that every instrument knows
KEEP = "K"  # the watchdog of everything that moves: u16 in ms
_KEEP = struct.Struct("<H")


class Malformed(ValueError):
    """A frame whose checksum fits, but whose payload is not what its kind says."""


def pack_keep(timeout_s: float) -> bytes:
    """Arguments of the watchdog command: how long the device goes on without hearing from the computer."""
    if not 0 < timeout_s <= 65.5:
        raise ValueError(f"a watchdog waits for more than 0 and at most 65.5 s, not {timeout_s}")
    return _KEEP.pack(round(timeout_s * 1e3))


def unpack_keep(arguments: bytes) -> float:
    """Time in s. Raises struct.error for arguments of another length."""
    return _KEEP.unpack(arguments)[0] / 1e3


class StartRecord(NamedTuple):
    """Payload of a start record: who speaks, since which boot, at which promised interval."""

    boot_id: int  # another number after every power-up
    interval_us: int  # promised time between two samples
    reason: int  # BOOTED, ASKED or STREAMING
    instrument: str
    firmware: str
    serial_number: str

    _LAYOUT = struct.Struct("<IIB")

    def pack(self) -> bytes:
        text = "\0".join((self.instrument, self.firmware, self.serial_number))
        return self._LAYOUT.pack(self.boot_id, self.interval_us, self.reason) + text.encode()

    @classmethod
    def unpack(cls, payload: bytes) -> StartRecord:
        """Raises Malformed for a record too short, without its three strings, or with text that is no UTF-8."""
        size = cls._LAYOUT.size
        if len(payload) < size:
            raise Malformed(f"a start record has at least {size} bytes, this one has {len(payload)}")
        try:
            strings = payload[size:].decode().split("\0")
        except UnicodeDecodeError as error:
            raise Malformed(f"a start record's strings are UTF-8, these are not ({error})") from error
        if len(strings) != 3:
            raise Malformed(f"a start record has 3 strings (instrument, firmware, serial number), not {len(strings)}")
        return cls(*cls._LAYOUT.unpack_from(payload), *strings)


class EndRecord(NamedTuple):
    """Payload of an end record: data frames sent in this stream, samples the device had to skip, why."""

    sent: int
    skipped: int
    reason: int

    _LAYOUT = struct.Struct("<IIB")

    def pack(self) -> bytes:
        return self._LAYOUT.pack(*self)

    @classmethod
    def unpack(cls, payload: bytes) -> EndRecord:
        """Raises Malformed for a record of another length."""
        if len(payload) != cls._LAYOUT.size:
            raise Malformed(f"an end record has {cls._LAYOUT.size} bytes, this one has {len(payload)}")
        return cls(*cls._LAYOUT.unpack(payload))


class Answer(NamedTuple):
    """Payload of an answer: the command's letter, OK, REFUSED or UNKNOWN, and a sentence if refused."""

    letter: str
    status: int
    text: str

    def pack(self) -> bytes:
        return self.letter.encode() + bytes([self.status]) + self.text.encode()

    @classmethod
    def unpack(cls, payload: bytes) -> Answer:
        """Raises Malformed for an answer without letter and status."""
        if len(payload) < 2:
            raise Malformed(f"an answer has at least 2 bytes, this one has {len(payload)}")
        return cls(chr(payload[0]), payload[1], payload[2:].decode(errors="replace"))


@dataclass(frozen=True)
class WireChannel:
    """One number of a sample. `column` carries the unit; value = scale × count. `low` and `high` are the
    counts at which the channel saturates; a command or a state (`reading=False`) does not saturate."""

    column: str
    code: str  # struct format of the count
    scale: float
    low: int
    high: int
    reading: bool = True


@dataclass(frozen=True)
class Instrument:
    """An instrument's name and what its data frames hold."""

    name: str
    title: str
    baud_rate: int
    interval_us: int  # when nothing else is asked for
    channels: tuple[WireChannel, ...]
    commands: dict[str, str]  # letter: what it does and its arguments

    @cached_property
    def layout(self) -> struct.Struct:
        return struct.Struct("<" + "".join(channel.code for channel in self.channels))

    @cached_property
    def scales(self) -> tuple[float, ...]:
        return tuple(channel.scale for channel in self.channels)

    @property
    def columns(self) -> tuple[str, ...]:
        return tuple(channel.column for channel in self.channels)

    def encode(self, counts: tuple[int, ...] | list[int]) -> bytes:
        """Payload of a data frame. Counts beyond a channel's range stand at its end, as a converter's do."""
        return self.layout.pack(*(min(max(n, c.low), c.high) for n, c in zip(counts, self.channels, strict=True)))

    def decode(self, payload: bytes) -> tuple[float, ...]:
        """Values in the columns' units. Raises Malformed where the payload has another length."""
        self.check(payload)
        return tuple(n * s for n, s in zip(self.layout.unpack(payload), self.scales, strict=True))

    def check(self, payload: bytes) -> None:
        """Raises Malformed where a sample's payload has another length."""
        if len(payload) != self.layout.size:
            raise Malformed(f"a {self.name} sample has {self.layout.size} bytes, this one has {len(payload)}")


def counts(columns: list[str], code: str, scale: float, high: int, low: int | None = None) -> tuple:
    """Channels of one kind; the range is symmetric unless `low` is given."""
    return tuple(WireChannel(name, code, scale, -high if low is None else low, high) for name in columns)


COMMON_COMMANDS = {
    IDENTIFY: "say who you are (a start record)",
    GO: "start to stream; interval u32 in µs, 0 for the instrument's own",
    STOP: "stop the stream",
}
WATCHDOG = {
    KEEP: "watchdog, u16 in ms: when no intact command has come for so long, what moves is stopped and the stream ended"
}
