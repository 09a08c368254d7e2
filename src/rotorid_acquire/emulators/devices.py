"""Emulated instruments: firmware (commands in, counts out), and its commands, samples and clock as frames on a line.

Frame numbers of a line's faults count a device's data frames since power-up.
"""

from __future__ import annotations

import math
import struct
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from zlib import crc32

import numpy as np

from rotorid_acquire.emulators.physics import LoadedSensor, StandPhysics, TesterPhysics, TurningRotors
from rotorid_acquire.io import wire
from rotorid_acquire.io.frames import ANSWER, COMMAND, DATA, END, START, Frame, StreamDecoder, encode
from rotorid_acquire.io.wire import (
    ASKED,
    BOOTED,
    COMPLETE,
    GO,
    IDENTIFY,
    KEEP,
    OK,
    REFUSED,
    STOP,
    STOPPED,
    STREAMING,
    UNHEARD,
    unpack_keep,
)

_FIRMWARE = "1.2 (emulated)"  # the committed campaign's


class _CommandRefused(Exception):
    """The device says no; the text says why."""


class Device:
    """What all instruments do: start, stop, one interval. `streaming` makes the wire half sample."""

    instrument: wire.Instrument
    serial_number: str
    needs_watchdog = False  # refuses to move anything before its watchdog is on, as firmware from 1.3 on does

    def __init__(self, physics, serial_number: str = "") -> None:
        self._physics = physics
        self.serial_number = serial_number or self.serial_number
        self.firmware = f"{self.instrument.name} {_FIRMWARE}"
        self.interval_us = self.instrument.interval_us
        self.streaming = False

    def command(self, letter: str, arguments: bytes) -> None:
        """Raises _CommandRefused, or struct.error for arguments of the wrong length."""
        if letter == GO:
            (interval_us,) = struct.unpack("<I", arguments)
            if self.streaming and interval_us not in (0, self.interval_us):
                raise _CommandRefused("a stream of another interval is running; stop it first")
            self.interval_us = interval_us or self.interval_us
            self.streaming = True
        elif letter == STOP:
            self.streaming = False
        else:
            self.operate(letter, arguments)

    def moves(self, letter: str, arguments: bytes) -> bool:
        """Whether a command sets something in motion."""
        return False

    def operate(self, letter: str, arguments: bytes) -> None:
        """The instrument's own commands."""
        raise _CommandRefused(f"there is no command {letter!r}")

    def boot(self) -> None:
        """Power-up: what was started or set is forgotten."""
        self.streaming = False
        self.interval_us = self.instrument.interval_us

    def tick(self, dt_s: float) -> None:
        """Device time passes (programmes go on)."""

    def counts(self) -> list[int]:
        raise NotImplementedError


class BenchDevice(Device):
    """Arduino UNO with two ADS1256."""

    instrument, serial_number = wire.BENCH, "EMU-BENCH-1"

    def counts(self) -> list[int]:
        return [round(volt / wire.VOLTS_PER_COUNT) for volt in self._physics.volts().tolist()]


class RotorDevice(Device):
    """Thrust tester."""

    instrument, serial_number = wire.ROTOR, "EMU-ROTOR-1"

    def __init__(self, physics: TesterPhysics) -> None:
        super().__init__(physics)
        self._left_s = 0.0

    def moves(self, letter: str, arguments: bytes) -> bool:
        return letter == wire.THROTTLE and arguments[:2] != b"\0\0"

    def operate(self, letter: str, arguments: bytes) -> None:
        if letter != wire.THROTTLE:
            super().operate(letter, arguments)
        throttle, self._left_s = wire.unpack_throttle(arguments)
        if throttle > 1:
            raise _CommandRefused("throttle above 1")
        self._physics.rotors.throttle[0] = throttle

    def boot(self) -> None:
        super().boot()
        self._physics.rotors.throttle[0] = 0.0

    def tick(self, dt_s: float) -> None:
        self._left_s -= dt_s
        if self._left_s <= 0 or not self.streaming:
            self._physics.rotors.throttle[0] = 0.0

    def counts(self) -> list[int]:
        rotors = self._physics.rotors
        return [
            round(rotors.throttle[0] / wire.THROTTLE_SCALE),
            round(self._physics.speed_rpm()),
            round(self._physics.thrust_n() * 1e3),
            round(rotors.battery.voltage_v * 1e3),
            round(rotors.battery.current_a * 1e3),
        ]


class WrenchDevice(Device):
    """Miniature six-axis sensor: needs power and initialisation before it measures."""

    instrument, serial_number = wire.WRENCH, "EMU-WRENCH-1"

    def __init__(self, physics: StandPhysics | LoadedSensor) -> None:
        super().__init__(physics)
        self._powered = self._initialised = False
        self._runs_left = self._samples_left = self._measuring_times = 0

    def command(self, letter: str, arguments: bytes) -> None:
        if letter == GO and not self._initialised:
            raise _CommandRefused("power on and initialise first")
        super().command(letter, arguments)
        if letter == GO:
            self._samples_left = self._measuring_times

    def operate(self, letter: str, arguments: bytes) -> None:
        if letter == wire.POWER:
            self._powered = arguments == b"\1"
            self._initialised = self._initialised and self._powered
        elif not self._powered:
            raise _CommandRefused("the sensor is not powered")
        elif letter == wire.INITIALISE:
            self.interval_us, self._runs_left, self._measuring_times = wire.unpack_initialise(arguments)
            self._initialised = True
        elif letter == wire.OFFSET:
            self._physics.sensor.offset()
        else:
            super().operate(letter, arguments)

    def boot(self) -> None:
        super().boot()
        self._powered = self._initialised = False

    def counts(self) -> list[int]:
        if self._measuring_times:
            self._samples_left -= 1
            if self._samples_left <= 0:
                self._next_run()
        rotors = self._physics.rotors
        speed = float(rotors.speed.mean()) if rotors is not None else 0.0
        reading = self._physics.sensor.read(speed).tolist()
        force = [round(value / wire.FORCE_RESOLUTION_N) for value in reading[:3]]
        return force + [round(value / wire.MOMENT_RESOLUTION_N_M) for value in reading[3:]]

    def _next_run(self) -> None:
        if self._runs_left > 0:
            self._runs_left -= 1
            self._samples_left = self._measuring_times
        else:
            self.streaming = False


class Jr3Device(Device):
    """Large six-axis sensor."""

    instrument, serial_number = wire.JR3, "EMU-JR3-1"

    def operate(self, letter: str, arguments: bytes) -> None:
        if letter != wire.OFFSET:
            super().operate(letter, arguments)
        self._physics.sensor.offset()

    def counts(self) -> list[int]:
        scaled = self._physics.sensor.read() / np.array(self.instrument.scales)
        return [round(value) for value in scaled.tolist()]


class QuadrotorDevice(Device):
    """ESP32: a command character starts a programme, which ends by itself."""

    instrument, serial_number = wire.QUADROTOR, "EMU-ESP32-1"

    def __init__(self, rotors: TurningRotors, rng: np.random.Generator) -> None:
        super().__init__(rotors)
        self._rotors = rotors
        self._rng = rng
        self._programme: wire.Programme | None = None
        self._time_s = 0.0
        self._led = wire.RED

    def moves(self, letter: str, arguments: bytes) -> bool:
        return letter in wire.DYNAMICS

    def command(self, letter: str, arguments: bytes) -> None:
        if letter == GO:
            raise _CommandRefused("this device starts with a programme, not with G")
        super().command(letter, arguments)
        if letter == STOP:
            self._cut()

    def operate(self, letter: str, arguments: bytes) -> None:
        if letter not in wire.DYNAMICS:
            super().operate(letter, arguments)
        if self._programme is not None:
            raise _CommandRefused("a programme is running; stop it first")
        self._programme = wire.Programme.unpack(arguments)
        self._time_s = 0.0
        self.streaming = True

    def boot(self) -> None:
        super().boot()
        self._cut()

    def tick(self, dt_s: float) -> None:
        if self._programme is None:
            return
        self._time_s += dt_s
        share, self._led = programme_share(self._programme, self._time_s)
        self._rotors.throttle[:] = share * np.array(self._programme.maxima)
        if self._time_s > self._programme.duration_s + 0.5:  # the motors run out for half a second
            self._cut()
            self.streaming = False

    def counts(self) -> list[int]:
        voltage = self._rotors.battery.voltage_v + 0.01 * self._rng.standard_normal()
        throttle = [round(value / wire.THROTTLE_SCALE) for value in self._rotors.throttle.tolist()]
        # a 12-bit converter behind a divider that makes 20 V of its full scale
        return [*throttle, round(round(voltage / 20 * 4095) * 20 / 4095 * 1e3), self._led]

    def _cut(self) -> None:
        self._programme = None
        self._rotors.throttle[:] = 0.0
        self._led = wire.RED


def programme_share(programme: wire.Programme, time_s: float) -> tuple[float, int]:
    """Share of each motor's maximum at a time since the programme's beginning, and the LED's colour."""
    if time_s < 0 or time_s > programme.duration_s:
        return 0.0, wire.RED
    if programme.shape == wire.SINE:
        return 0.5 * (1 - math.cos(2 * math.pi * programme.frequency_hz * time_s)), wire.YELLOW
    if time_s < programme.ramp_s:
        return time_s / programme.ramp_s, wire.YELLOW
    down_s = time_s - programme.ramp_s - programme.hold_s
    if down_s <= 0:
        return 1.0, wire.GREEN
    return max(0.0, 1 - down_s / programme.ramp_s), wire.YELLOW


class TensileDevice(Device):
    """Tensile tester: starting it starts the crosshead; it stops when the specimen is broken."""

    instrument, serial_number = wire.TENSILE, "EMU-AGSX-1"

    def moves(self, letter: str, arguments: bytes) -> bool:
        return letter == GO

    def tick(self, dt_s: float) -> None:
        self._physics.moving = self.streaming

    def counts(self) -> list[int]:
        reading = [round(self._physics.displacement_mm * 1e4), round(self._physics.force_n() * 10)]
        if self._physics.broken:
            self.streaming = False
        return reading


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


_KINDS = ("drop", "repeat", "swap", "corrupt", "half", "garbage")


class WireHalf:
    """One instrument on a line.

    `clock_error` is relative; `burst_s` makes the line deliver in bursts, as Bluetooth does.
    """

    def __init__(
        self,
        device: Device,
        rng: np.random.Generator,
        *,
        clock_error: float = 0.0,
        burst_s: float = 0.0,
        faults: Faults = Faults(),  # noqa: B008 - frozen
    ) -> None:
        self.device = device
        self.due_s: float | None = None  # true time of the next sample
        self.unplugged = False
        self.at_rest = False  # the cable carries nothing, either way, and no port notices
        self.count = 0  # data frames so far
        self.done = dict.fromkeys(_KINDS, 0)  # faults of the line so far
        self._faults = faults
        self._rng = rng
        self._held = b""
        self._clock_rate = 1 + clock_error
        self._burst_s = burst_s
        self._out: deque[tuple[float, bytes]] = deque()
        self._decoder = StreamDecoder()
        self._now_s = 0.0
        self._boots = 0
        self._fired: set[int] = set()  # resets happen once
        self.host_time_s: Callable[[], float] = lambda: self._now_s  # ports that run faster than life set their own
        self._watchdog_s: float | None = None
        self._heard_s = 0.0
        self.power_up()

    # ---- the line ------------------------------------------------------------------------------------

    def receive(self, data: bytes) -> None:
        """Bytes from the host. What is no intact command is ignored, as real firmware does."""
        if self.at_rest:
            return
        for frame in self._decoder.feed(data):
            if frame.kind == COMMAND and frame.payload:
                self._heard_s = self.host_time_s()
                self._obey(chr(frame.payload[0]), frame.payload[1:])

    def take(self) -> bytes:
        """Bytes that have reached the host by now."""
        out = bytearray()
        while self._out and self._out[0][0] <= self._now_s:
            out += self._out.popleft()[1]
        return b"" if self.at_rest else bytes(out)

    @property
    def busy(self) -> bool:
        """Whether something happens by itself as time passes."""
        return self.due_s is not None or bool(self._out) or self.unplugged

    def falls_due(self, time_s: float) -> bool:
        """Whether a sample is due until this time; a device without a cable has no power."""
        return self.due_s is not None and self.due_s <= time_s and not self.unplugged

    # ---- time ----------------------------------------------------------------------------------------

    def advance(self, now_s: float) -> None:
        """True time has come to `now_s`."""
        self.device.tick(now_s - self._now_s)
        self._now_s = now_s
        if self.due_s is not None and not self.device.streaming:
            self._end(COMPLETE)
        if self._watchdog_s is not None and self.host_time_s() - self._heard_s > self._watchdog_s:
            self._stop_unheard()

    def _stop_unheard(self) -> None:
        """The computer is gone: what moves stands still."""
        self.device.command(STOP, b"")
        self.device.tick(0.0)
        if self.due_s is not None:
            self._end(UNHEARD)
        self._watchdog_s = None

    def sample(self) -> None:
        """The moment `due_s` is there: take a sample and send it."""
        number = self.count
        if number in self._faults.reset_at and number not in self._fired:
            self._fired.add(number)
            self.power_up()
            return
        frame = self._frame(DATA, self.device.instrument.encode(self.device.counts()))
        self._sent += 1
        self.due_s += self.device.interval_us * 1e-6 / self._clock_rate / self._faults.pace
        self._emit(self._spoilt(frame))
        if not self.device.streaming:
            self._end(COMPLETE)

    def power_up(self) -> None:
        """Boot: sequence, clock and boot id begin anew; what was running stops."""
        self._boots += 1
        self._sequence = 0
        self._sent = 0
        self.due_s = None
        self._watchdog_s = None
        self._clock_zero_s = self._now_s
        self.device.boot()
        self._start_record(BOOTED)

    def cut(self) -> None:
        """The cable is pulled: what was on its way is lost."""
        self._out.clear()
        self._decoder = StreamDecoder()

    # ---- inside --------------------------------------------------------------------------------------

    def _spoilt(self, encoded: bytes) -> bytes:
        """What of a data frame reaches the other end by the faults of the line."""
        number, self.count = self.count, self.count + 1
        befalls = {kind for kind in _KINDS if number in getattr(self._faults, kind)}
        if self._faults.share:
            befalls |= {kind for kind in _KINDS if self._rng.random() < self._faults.share}
        for kind in befalls:
            self.done[kind] += 1
        out = b""
        if "garbage" in befalls:
            out += self._rng.bytes(16)
        if "corrupt" in befalls:
            place = 2 + int(self._rng.integers(len(encoded) - 3))
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

    def _obey(self, letter: str, arguments: bytes) -> None:
        if letter == IDENTIFY:
            self._start_record(ASKED)
            return
        was_streaming = self.due_s is not None
        status, text = OK, ""
        try:
            if letter in self._faults.refuse:
                raise _CommandRefused("this device is set to refuse it")
            if letter == KEEP and letter in self.device.instrument.commands:
                self._watchdog_s = unpack_keep(arguments)
            elif self.device.needs_watchdog and self._watchdog_s is None and self.device.moves(letter, arguments):
                raise _CommandRefused("switch the watchdog on first (K)")
            else:
                self.device.command(letter, arguments)
        except _CommandRefused as refusal:
            status, text = REFUSED, str(refusal)
        except struct.error:
            status, text = REFUSED, f"{len(arguments)} bytes of arguments are not what {letter!r} takes"
        self._emit(self._frame(ANSWER, wire.Answer(letter, status, text).pack()))
        if self.device.streaming and not was_streaming:
            self._sent = 0
            self.due_s = self._now_s
            self._start_record(STREAMING)
        elif was_streaming and letter == STOP:
            self._end(STOPPED)

    def _start_record(self, reason: int) -> None:
        device = self.device
        boots = 1 if self._faults.same_boot_id else self._boots
        boot_id = crc32(f"{device.serial_number} {boots}".encode())
        record = wire.StartRecord(
            boot_id, device.interval_us, reason, device.instrument.name, device.firmware, device.serial_number
        )
        self._emit(self._frame(START, record.pack()))

    def _end(self, reason: int) -> None:
        self.due_s = None
        self._watchdog_s = None
        if self._faults.lose_end:
            return
        self._emit(self._frame(END, wire.EndRecord(self._sent, 0, reason).pack()))

    def _frame(self, kind: int, payload: bytes) -> bytes:
        clock_us = round((self._now_s - self._clock_zero_s) * 1e6 * self._clock_rate)
        frame = encode(Frame(kind, self._sequence, clock_us + self._faults.clock_start_us, payload))
        self._sequence = (self._sequence + 1) % 65536
        return frame

    def _emit(self, data: bytes) -> None:
        if self._faults.silent_from is not None and self.count > self._faults.silent_from:
            return
        arrival_s = self._now_s
        if self._burst_s:
            arrival_s = (int(arrival_s / self._burst_s) + 1 + 0.3 * self._rng.random()) * self._burst_s
            if self._out:
                arrival_s = max(arrival_s, self._out[-1][0])
        self._out.append((arrival_s, data))


class World:
    """Physics shared by one or more instruments, advanced from sample to sample in the order of time.

    `physics.process(dt_s)` advances it.
    """

    def __init__(self, physics, *lines: WireHalf) -> None:
        self.physics = physics
        self.lines = lines
        self.now_s = 0.0
        self._plans: list[tuple[float, str, float]] = []
        self._waiting: list[tuple[float, str, float]] = []
        self._streaming_since: float | None = None

    def plan(self, time_s: float, axis: str, load_gf: float) -> None:
        """Put a weight on, `time_s` after the stream has begun (for an emulator that runs by itself)."""
        self._plans = sorted([*self._plans, (time_s, axis, load_gf)])

    def run_until(self, time_s: float) -> None:
        """Advance to a true time in s, taking every sample that falls due."""
        while True:
            due = [line for line in self.lines if line.falls_due(time_s)]
            if not due:
                break
            line = min(due, key=lambda line: line.due_s)
            self._advance(line.due_s)
            if line.due_s is not None:
                line.sample()
        self._advance(time_s)

    def _advance(self, time_s: float) -> None:
        step_s = time_s - self.now_s
        if step_s > 0:
            for line in self.lines:
                line.advance(time_s)
            self.physics.process(step_s)
            self.now_s = time_s
            if self._plans:
                self._carry_out()

    def _carry_out(self) -> None:
        if not any(line.device.streaming for line in self.lines):
            self._streaming_since = None
            return
        if self._streaming_since is None:  # a new recording: whatever lay on the bench is taken off
            self._streaming_since = self.now_s
            self._waiting = list(self._plans)
            self.physics.place_load("z", 0.0)
        while self._waiting and self.now_s - self._streaming_since >= self._waiting[0][0]:
            self.physics.place_load(*self._waiting.pop(0)[1:])
