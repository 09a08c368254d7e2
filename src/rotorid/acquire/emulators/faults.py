"""Switches for what goes wrong on a line. Frame numbers count a device's data frames since power-up."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Faults:
    """All off by default."""

    drop: frozenset[int] = frozenset()  # never sent
    repeat: frozenset[int] = frozenset()  # sent twice
    swap: frozenset[int] = frozenset()  # sent after its successor
    corrupt: frozenset[int] = frozenset()  # one bit flipped
    half: frozenset[int] = frozenset()  # only the first half of its bytes
    garbage: frozenset[int] = frozenset()  # sixteen random bytes before it
    share: float = 0.0  # each of the six kinds above befalls a frame at random with this probability
    reset_at: frozenset[int] = frozenset()  # the device restarts instead of sending it
    silent_from: int | None = None  # nothing from here on, no answers either
    same_boot_id: bool = False  # a device that does not count its boots
    lose_end: bool = False  # the end record never arrives
    refuse: frozenset[str] = frozenset()  # commands refused
    pace: float = 1.0  # samples per promised sample
    clock_start_us: int = 0  # the device clock at power-up


KINDS = ("drop", "repeat", "swap", "corrupt", "half", "garbage")


@dataclass
class FaultyLine:
    """Applies the faults of the line to encoded frames."""

    faults: Faults
    rng: np.random.Generator
    count: int = 0  # data frames so far
    done: dict[str, int] = field(default_factory=lambda: dict.fromkeys(KINDS, 0))
    _held: bytes = b""

    def send(self, encoded: bytes) -> bytes:
        """What reaches the other end when this data frame is sent."""
        number, self.count = self.count, self.count + 1
        befalls = {kind for kind in KINDS if number in getattr(self.faults, kind)}
        if self.faults.share:
            befalls |= {kind for kind in KINDS if self.rng.random() < self.faults.share}
        for kind in befalls:
            self.done[kind] += 1
        out = b""
        if "garbage" in befalls:
            out += self.rng.bytes(16)
        if "corrupt" in befalls:
            place = 2 + int(self.rng.integers(len(encoded) - 3))
            encoded = encoded[:place] + bytes([encoded[place] ^ 0x10]) + encoded[place + 1 :]
        if "half" in befalls:
            encoded = encoded[: len(encoded) // 2]
        if "drop" in befalls:
            encoded = b""
        if "repeat" in befalls:
            encoded *= 2
        if "swap" in befalls and not self._held:
            self._held = encoded
            return out
        out, self._held = out + encoded + self._held, b""
        return out
