"""The thrust tester: one motor with its propeller (thesis 3.5.3, fig. 3.20a)."""

import struct

from rotorid.io.wire.base import COMMON_COMMANDS, WATCHDOG, Instrument, WireChannel

THROTTLE = "T"
_THROTTLE = struct.Struct("<HH")
THROTTLE_SCALE = 1e-4

INSTRUMENT = Instrument(
    name="rotor",
    title="thrust tester",
    baud_rate=115200,
    interval_us=20_000,
    channels=(
        WireChannel("throttle", "H", THROTTLE_SCALE, 0, 10_000, reading=False),
        WireChannel("speed_rpm", "H", 1.0, 0, 0xFFFF),
        WireChannel("thrust_n", "i", 1e-3, -50_000, 50_000),
        WireChannel("battery_voltage_v", "H", 1e-3, 0, 30_000),
        WireChannel("battery_current_a", "H", 1e-3, 0, 50_000),
    ),
    commands=COMMON_COMMANDS
    | WATCHDOG
    | {
        THROTTLE: "throttle u16 in 1e-4, hold u16 in ms; the motor stops by itself when the time is over, "
        "so that a host that died leaves no motor running"
    },
)


def pack_throttle(throttle: float, hold_s: float) -> bytes:
    """Arguments of the throttle command: 0–1, and for how long (at most 65.5 s)."""
    if not 0 <= throttle <= 1:
        raise ValueError(f"throttle is a fraction from 0 to 1, not {throttle}")
    if not 0 <= hold_s <= 65.5:
        raise ValueError(f"a throttle is held for 0 to 65.5 s, not {hold_s}")
    return _THROTTLE.pack(round(throttle / THROTTLE_SCALE), round(hold_s * 1e3))


def unpack_throttle(arguments: bytes) -> tuple[float, float]:
    """Throttle 0–1 and hold time in s. Raises struct.error for arguments of another length."""
    throttle, hold_ms = _THROTTLE.unpack(arguments)
    return throttle * THROTTLE_SCALE, hold_ms / 1e3
