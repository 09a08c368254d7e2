"""The instruments' firmware without its bytes: commands in, counts out."""

from __future__ import annotations

import math
import struct

import numpy as np

from rotorid.acquire.emulators.physics import (
    BenchPhysics,
    CellClamp,
    LoadedSensor,
    StandPhysics,
    TensilePhysics,
    TesterPhysics,
    TurningRotors,
)
from rotorid.io import wire
from rotorid.io.wire import GO, STOP

_FIRMWARE = "1.2 (emulated)"  # the committed campaign's


class CommandRefused(Exception):
    """The device says no; the text says why."""


class Device:
    """What all instruments do: start, stop, one interval. `streaming` makes the wire half sample."""

    instrument: wire.Instrument
    needs_watchdog = False  # refuses to move anything before its watchdog is on, as firmware from 1.3 on does

    def __init__(self, serial_number: str) -> None:
        self.serial_number = serial_number
        self.firmware = f"{self.instrument.name} {_FIRMWARE}"
        self.interval_us = self.instrument.interval_us
        self.streaming = False

    def command(self, letter: str, arguments: bytes) -> None:
        """Raises CommandRefused, or struct.error for arguments of the wrong length."""
        if letter == GO:
            (interval_us,) = struct.unpack("<I", arguments)
            if self.streaming and interval_us not in (0, self.interval_us):
                raise CommandRefused("a stream of another interval is running; stop it first")
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
        raise CommandRefused(f"there is no command {letter!r}")

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

    instrument = wire.BENCH

    def __init__(self, physics: BenchPhysics | CellClamp, serial_number: str = "EMU-BENCH-1") -> None:
        super().__init__(serial_number)
        self._physics = physics

    def counts(self) -> list[int]:
        return [round(volt / wire.VOLTS_PER_COUNT) for volt in self._physics.volts().tolist()]


class RotorDevice(Device):
    """Thrust tester."""

    instrument = wire.ROTOR

    def __init__(self, physics: TesterPhysics, serial_number: str = "EMU-ROTOR-1") -> None:
        super().__init__(serial_number)
        self._physics = physics
        self._left_s = 0.0

    def moves(self, letter: str, arguments: bytes) -> bool:
        return letter == wire.THROTTLE and arguments[:2] != b"\0\0"

    def operate(self, letter: str, arguments: bytes) -> None:
        if letter != wire.THROTTLE:
            super().operate(letter, arguments)
        throttle, self._left_s = wire.unpack_throttle(arguments)
        if throttle > 1:
            raise CommandRefused("throttle above 1")
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

    instrument = wire.WRENCH

    def __init__(self, physics: StandPhysics | LoadedSensor, serial_number: str = "EMU-WRENCH-1") -> None:
        super().__init__(serial_number)
        self._physics = physics
        self._powered = self._initialised = False
        self._runs_left = self._samples_left = self._measuring_times = 0

    def command(self, letter: str, arguments: bytes) -> None:
        if letter == GO and not self._initialised:
            raise CommandRefused("power on and initialise first")
        super().command(letter, arguments)
        if letter == GO:
            self._samples_left = self._measuring_times

    def operate(self, letter: str, arguments: bytes) -> None:
        if letter == wire.POWER:
            self._powered = arguments == b"\1"
            self._initialised = self._initialised and self._powered
        elif not self._powered:
            raise CommandRefused("the sensor is not powered")
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

    instrument = wire.JR3

    def __init__(self, physics: LoadedSensor, serial_number: str = "EMU-JR3-1") -> None:
        super().__init__(serial_number)
        self._physics = physics

    def operate(self, letter: str, arguments: bytes) -> None:
        if letter != wire.OFFSET:
            super().operate(letter, arguments)
        self._physics.sensor.offset()

    def counts(self) -> list[int]:
        scaled = self._physics.sensor.read() / np.array(self.instrument.scales)
        return [round(value) for value in scaled.tolist()]


class QuadrotorDevice(Device):
    """ESP32: a command character starts a programme, which ends by itself."""

    instrument = wire.QUADROTOR

    def __init__(self, rotors: TurningRotors, rng: np.random.Generator, serial_number: str = "EMU-ESP32-1") -> None:
        super().__init__(serial_number)
        self._rotors = rotors
        self._rng = rng
        self._programme: wire.Programme | None = None
        self._time_s = 0.0
        self._led = wire.RED

    def moves(self, letter: str, arguments: bytes) -> bool:
        return letter in wire.DYNAMICS

    def command(self, letter: str, arguments: bytes) -> None:
        if letter == GO:
            raise CommandRefused("this device starts with a programme, not with G")
        super().command(letter, arguments)
        if letter == STOP:
            self._cut()

    def operate(self, letter: str, arguments: bytes) -> None:
        if letter not in wire.DYNAMICS:
            super().operate(letter, arguments)
        if self._programme is not None:
            raise CommandRefused("a programme is running; stop it first")
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

    instrument = wire.TENSILE

    def __init__(self, physics: TensilePhysics, serial_number: str = "EMU-AGSX-1") -> None:
        super().__init__(serial_number)
        self._physics = physics

    def moves(self, letter: str, arguments: bytes) -> bool:
        return letter == GO

    def tick(self, dt_s: float) -> None:
        self._physics.moving = self.streaming

    def counts(self) -> list[int]:
        reading = [round(self._physics.displacement_mm * 1e4), round(self._physics.force_n() * 10)]
        if self._physics.broken:
            self.streaming = False
        return reading
