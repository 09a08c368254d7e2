"""The quadrotor's ESP32 over Bluetooth serial: command character, programme, streamed motor data.

The command character names the dynamics (thesis 3.4, algorithms 1 and 2); the programme that follows it says
what each motor does: a trapezoid (ramp up, hold, ramp down) or a sine between zero and the motor's maximum.
"""

import struct
from typing import NamedTuple

from rotorid.io.wire.base import COMMON_COMMANDS, WATCHDOG, Instrument, WireChannel

THROTTLE_SCALE = 1e-4
RED, YELLOW, GREEN = 0, 1, 2  # no motor turns, speeds change, speeds constant
TRAPEZOID, SINE = 0, 1
DYNAMICS = {
    "h": "hover",
    "b": "bounce",
    "r": "roll",
    "p": "pitch",
    "y": "yaw",
    "t": "tilted",
    "m": "one motor",
}

INSTRUMENT = Instrument(
    name="quadrotor",
    title="quadrotor (ESP32)",
    baud_rate=115200,
    interval_us=20_000,
    channels=(
        *(WireChannel(f"throttle_{i}", "H", THROTTLE_SCALE, 0, 10_000, reading=False) for i in range(1, 5)),
        WireChannel("battery_voltage_v", "H", 1e-3, 0, 30_000),
        WireChannel("led", "B", 1, 0, 3, reading=False),
    ),
    commands={letter: text for letter, text in COMMON_COMMANDS.items() if letter != "G"}
    | WATCHDOG
    | {letter: f"run a programme: {text}" for letter, text in DYNAMICS.items()},
)


class Programme(NamedTuple):
    """What the motors do. Throttles are fractions 0–1, times seconds, frequency hertz."""

    shape: int  # TRAPEZOID or SINE
    maxima: tuple[float, float, float, float]
    ramp_s: float  # trapezoid: up and, again, down
    hold_s: float  # trapezoid: at the maximum; sine: the whole duration
    frequency_hz: float  # sine only

    _LAYOUT = struct.Struct("<B4HHHH")

    @property
    def duration_s(self) -> float:
        return self.hold_s + (2 * self.ramp_s if self.shape == TRAPEZOID else 0)

    def pack(self) -> bytes:
        if not all(0 <= maximum <= 1 for maximum in self.maxima):
            raise ValueError(f"a motor's maximum is a fraction from 0 to 1: {self.maxima}")
        return self._LAYOUT.pack(
            self.shape,
            *(round(maximum / THROTTLE_SCALE) for maximum in self.maxima),
            round(self.ramp_s * 1e3),
            round(self.hold_s * 1e3),
            round(self.frequency_hz * 1e3),
        )

    @classmethod
    def unpack(cls, arguments: bytes) -> "Programme":
        shape, *maxima, ramp_ms, hold_ms, millihertz = cls._LAYOUT.unpack(arguments)
        scaled = tuple(maximum * THROTTLE_SCALE for maximum in maxima)
        return cls(shape, scaled, ramp_ms / 1e3, hold_ms / 1e3, millihertz / 1e3)
