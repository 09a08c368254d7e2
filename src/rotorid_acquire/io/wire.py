"""What each instrument says inside a frame, shared by recorder, emulator and parser; `INSTRUMENTS` has them by name.

First the parts that all instruments share (channels, start and end records, commands and answers), then one instrument
after the other.

The 48 dynamics experiments of the thesis's table A.1, by number.
"""

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
# number: signal, maxima of motors 1–4 as fractions, frequency in Hz, mount roll and pitch in degrees, name
_HOVER, _LOW_HIGH = (0.1, 0.15, 0.2), (0.05, 0.1, 0.15)
_PATTERNS = (  # which motors take the small value, in table A.1's order; the others take 0.2
    ("Roll +", (1, 4)),
    ("Roll -", (2, 3)),
    ("Pitch +", (3, 4)),
    ("Pitch -", (1, 2)),
    ("Yaw +", (2, 4)),
    ("Yaw -", (1, 3)),
)
_BOUNCE_HZ = (0.25, 0.4, 0.5)
_MOUNTS = (  # name, roll, pitch
    ("15° Right", 15, 0),
    ("-15° Left", -15, 0),
    ("15° Backward", 0, 15),
    ("-15° Forward", 0, -15),
    ("30° Right", 30, 0),
    ("-30° Left", -30, 0),
    ("30° Backward", 0, 30),
    ("-30° Forward", 0, -30),
)


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
class _WireChannel:
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
    channels: tuple[_WireChannel, ...]
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


def _counts(columns: list[str], code: str, scale: float, high: int) -> tuple:
    """Channels of one kind and of symmetric range."""
    return tuple(_WireChannel(name, code, scale, -high, high) for name in columns)


_COMMON_COMMANDS = {
    IDENTIFY: "say who you are (a start record)",
    GO: "start to stream; interval u32 in µs, 0 for the instrument's own",
    STOP: "stop the stream",
}
_WATCHDOG = {
    KEEP: "watchdog, u16 in ms: when no intact command has come for so long, what moves is stopped and the stream ended"
}

THROTTLE_SCALE = 1e-4
"""Share of full throttle of a count."""


# Load-cell bench ---------------------------------------------------------------------------------------------
# The load-cell bench: Arduino UNO with two ADS1256, six bridges read one after the other (thesis 2.1, 2.6).
#
# The UNO sends the converters' counts, sign-extended to 32 bits. The ADS1256 resolves 2·V_ref/gain in 2^24
# steps: with V_ref = 2.5 V and gain 64 full scale is ±78.125 mV and a count 9.31 nV.

REFERENCE_V = 2.5
GAIN = 64
_FULL_SCALE = (1 << 23) - 1
VOLTS_PER_COUNT = 2 * REFERENCE_V / GAIN / _FULL_SCALE

BENCH = Instrument(
    name="bench",
    title="load-cell bench",
    baud_rate=115200,
    interval_us=20_000,
    channels=_counts([f"cell_{i}_v" for i in range(1, 7)], "i", VOLTS_PER_COUNT, _FULL_SCALE),
    commands=_COMMON_COMMANDS,
)


# Wrench --------------------------------------------------------------------------------------------
# The miniature six-axis force-torque sensor (thesis 3.5.1, table 3.2): 40 N, 0.4 N m; 0.1 N, 0.001 N m.
#
# Its operations are those of the sensor's own software: port, power, initialise with sampling interval,
# restart times and measuring times, start, stop, offset. A measuring run ends after `measuring_times` samples
# (0: when stopped) and is started anew `restart_times` times.

POWER, INITIALISE, OFFSET = "P", "I", "O"
FORCE_RESOLUTION_N = 0.1
MOMENT_RESOLUTION_N_M = 0.001
_WRENCH_COLUMNS = ["force_x_n", "force_y_n", "force_z_n", "moment_x_n_m", "moment_y_n_m", "moment_z_n_m"]
_INITIALISE = struct.Struct("<IHI")

WRENCH = Instrument(
    name="wrench",
    title="six-axis force-torque sensor",
    baud_rate=115200,
    interval_us=10_000,
    channels=_counts(_WRENCH_COLUMNS[:3], "h", FORCE_RESOLUTION_N, 2000)  # load capacity 200 N
    + _counts(_WRENCH_COLUMNS[3:], "h", MOMENT_RESOLUTION_N_M, 1800),  # and 1.8 N m
    commands=_COMMON_COMMANDS
    | {
        POWER: "power, u8: 1 on, 0 off",
        INITIALISE: "sampling interval u32 in µs, restart times u16, measuring times u32",
        OFFSET: "take the present reading as zero",
    },
)


def pack_initialise(interval_s: float, restart_times: int, measuring_times: int) -> bytes:
    """Arguments of the initialise command."""
    if not 0 < interval_s <= 60:
        raise ValueError(f"the sampling interval lies between 0 and 60 s, not at {interval_s}")
    return _INITIALISE.pack(round(interval_s * 1e6), restart_times, measuring_times)


def unpack_initialise(arguments: bytes) -> tuple[int, int, int]:
    """Interval in µs, restart times, measuring times. Raises struct.error for another length."""
    return _INITIALISE.unpack(arguments)


# Reference sensor ----------------------------------------------------------------------------------
# The large six-axis sensor that the thesis takes as reference for the bench (thesis 2.8, fig. 2.41c).

JR3 = Instrument(
    name="jr3",
    title="reference force-torque sensor",
    baud_rate=115200,
    interval_us=20_000,
    channels=_counts(_WRENCH_COLUMNS[:3], "i", 0.01, 20_000) + _counts(_WRENCH_COLUMNS[3:], "i", 1e-3, 10_000),
    commands=_COMMON_COMMANDS | {OFFSET: "take the present reading as zero"},
)


# Thrust tester -------------------------------------------------------------------------------------
# The thrust tester: one motor with its propeller (thesis 3.5.3, fig. 3.20a).

THROTTLE = "T"
_THROTTLE = struct.Struct("<HH")

ROTOR = Instrument(
    name="rotor",
    title="thrust tester",
    baud_rate=115200,
    interval_us=20_000,
    channels=(
        _WireChannel("throttle", "H", THROTTLE_SCALE, 0, 10_000, reading=False),
        _WireChannel("speed_rpm", "H", 1.0, 0, 0xFFFF),
        _WireChannel("thrust_n", "i", 1e-3, -50_000, 50_000),
        _WireChannel("battery_voltage_v", "H", 1e-3, 0, 30_000),
        _WireChannel("battery_current_a", "H", 1e-3, 0, 50_000),
    ),
    commands=_COMMON_COMMANDS
    | _WATCHDOG
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


# Quadrotor -----------------------------------------------------------------------------------------
# The quadrotor's ESP32 over Bluetooth serial: command character, programme, streamed motor data.
#
# The command character names the dynamics (thesis 3.4, algorithms 1 and 2); the programme that follows it says
# what each motor does: a trapezoid (ramp up, hold, ramp down) or a sine between zero and the motor's maximum.

RED, YELLOW, GREEN = 0, 1, 2  # no motor turns, speeds change, speeds constant
TRAPEZOID, SINE = 0, 1
DYNAMICS = {"h": "hover", "b": "bounce", "r": "roll", "p": "pitch", "y": "yaw", "t": "tilted", "m": "one motor"}

QUADROTOR = Instrument(
    name="quadrotor",
    title="quadrotor (ESP32)",
    baud_rate=115200,
    interval_us=20_000,
    channels=(
        *(_WireChannel(f"throttle_{i}", "H", THROTTLE_SCALE, 0, 10_000, reading=False) for i in range(1, 5)),
        _WireChannel("battery_voltage_v", "H", 1e-3, 0, 30_000),
        _WireChannel("led", "B", 1, 0, 3, reading=False),
    ),
    commands={letter: text for letter, text in _COMMON_COMMANDS.items() if letter != "G"}
    | _WATCHDOG
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
    def unpack(cls, arguments: bytes) -> Programme:
        shape, *maxima, ramp_ms, hold_ms, millihertz = cls._LAYOUT.unpack(arguments)
        scaled = tuple(maximum * THROTTLE_SCALE for maximum in maxima)
        return cls(shape, scaled, ramp_ms / 1e3, hold_ms / 1e3, millihertz / 1e3)


# Tensile tester ------------------------------------------------------------------------------------
# The tensile tester (thesis 2.6.4): 10 mm/min, ten samples a second, 40 mm between the grips.

TENSILE = Instrument(
    name="tensile",
    title="tensile tester",
    baud_rate=9600,
    interval_us=100_000,
    channels=(
        _WireChannel("displacement_mm", "i", 1e-4, -1_000_000, 1_000_000),
        _WireChannel("force_n", "i", 0.1, -50_000, 50_000),
    ),
    commands=_COMMON_COMMANDS | _WATCHDOG,
)


INSTRUMENTS = {entry.name: entry for entry in (BENCH, JR3, QUADROTOR, ROTOR, TENSILE, WRENCH)}


@dataclass(frozen=True)
class Experiment:
    """One row of table A.1. Throttles are fractions 0–1; `frequency_hz` is None for a trapezoid."""

    number: int
    signal: str  # trapezoidal | sine
    maxima: tuple[float, float, float, float]
    frequency_hz: float | None
    roll_deg: float
    pitch_deg: float
    dynamics: str


def _rows() -> list[tuple]:
    rows = [("trapezoidal", (value,) * 4, None, 0, 0, "Hover") for value in _HOVER]
    for name, small in _PATTERNS:
        for value in _LOW_HIGH:
            maxima = tuple(value if motor in small else 0.2 for motor in (1, 2, 3, 4))
            rows.append(("trapezoidal", maxima, None, 0, 0, name))
    rows += [("sine", (0.2,) * 4, frequency, 0, 0, "Bounce") for frequency in _BOUNCE_HZ]
    for name, roll, pitch in _MOUNTS:
        rows += [("trapezoidal", (value,) * 4, None, roll, pitch, name) for value in _HOVER]
    return rows


EXPERIMENTS: dict[int, Experiment] = {number: Experiment(number, *row) for number, row in enumerate(_rows(), start=1)}
