"""Emulators on pseudo-terminals: what a recorder opens is a real serial device of the system.

Whole worlds by name, for the command line and the tests.
"""

from __future__ import annotations

import errno
import fcntl
import os
import select
import struct
import termios
import threading
import time
import tty
from pathlib import Path

import numpy as np

from rotorid_acquire.emulators.devices import (
    BenchDevice,
    Faults,
    Jr3Device,
    QuadrotorDevice,
    RotorDevice,
    TensileDevice,
    WireHalf,
    World,
    WrenchDevice,
)
from rotorid_acquire.emulators.physics import (
    Battery,
    BenchPhysics,
    CellClamp,
    LoadedSensor,
    StandPhysics,
    TensilePhysics,
    TesterPhysics,
    TurningRotors,
    torque_rig,
)
from rotorid_acquire.emulators.truth import Truth
from rotorid_acquire.io.wire import EXPERIMENTS

_MAX_PENDING = 1 << 16  # bytes a device keeps when nobody reads; older ones are overrun, as in a real UART
_IDLE_S = 0.02
_NAMES = ("bench", "rotor", "wrench", "quadrotor", "stand", "torque", "jr3", "tensile")


class _PseudoTerminal:
    """A pty pair; `link` is a name that stays the same when the device is unplugged and comes back."""

    def __init__(self, link: Path | None = None) -> None:
        self._link = link
        self.master = self._slave = -1
        self.plug()

    @property
    def name(self) -> str:
        """What a recorder opens."""
        return str(self._link) if self._link else os.ttyname(self._slave)

    def plug(self) -> None:
        """Make the device appear."""
        self.master, self._slave = os.openpty()
        tty.setraw(self._slave)  # no echo, no line editing, before anyone has opened it
        os.set_blocking(self.master, False)
        if self._link is not None:
            temporary = self._link.with_name(self._link.name + ".new")
            temporary.unlink(missing_ok=True)
            temporary.symlink_to(os.ttyname(self._slave))
            os.replace(temporary, self._link)

    def unplug(self) -> None:
        """Make it go away: whoever has it open gets an error."""
        if self._link is not None:
            self._link.unlink(missing_ok=True)
        for descriptor in (self.master, self._slave):
            if descriptor >= 0:
                os.close(descriptor)
        self.master = self._slave = -1

    def unread(self) -> int:
        """Bytes that the recorder has not read yet."""
        return struct.unpack("i", fcntl.ioctl(self._slave, termios.FIONREAD, b"\0\0\0\0"))[0]


class EmulatedPorts:
    """Runs a world in a thread and puts each of its lines on a pseudo-terminal.

    `speed`: device seconds per host second; None goes as fast as the recorder reads, one `slice_s` at a
    time. `replug_after_s`: how long an unplugged device stays away, host time; None means for good.
    """

    def __init__(
        self,
        world: World,
        links: list[Path | None] | None = None,
        *,
        speed: float | None = None,
        slice_s: float = 0.02,
        replug_after_s: float | None = 0.05,
    ) -> None:
        self._world = world
        self._speed, self._slice_s, self._replug_after_s = speed, slice_s, replug_after_s
        self.terminals = [_PseudoTerminal(link) for link in links or [None] * len(world.lines)]
        for line in world.lines:  # a watchdog guards against a computer that is gone, and computers live in real time
            line.host_time_s = time.monotonic
        self._pending = [bytearray() for _ in world.lines]
        self.overruns = 0
        self._away_until: dict[int, float] = {}
        self._wake_read, self._wake_write = os.pipe()
        self._stopping = threading.Event()
        self._last = 0.0
        self._thread = threading.Thread(target=self._run, name="emulator", daemon=True)
        self.error: BaseException | None = None

    @property
    def names(self) -> list[str]:
        """Port names, in the order of the world's lines."""
        return [terminal.name for terminal in self.terminals]

    def __enter__(self) -> EmulatedPorts:
        self._thread.start()
        return self

    def __exit__(self, *_) -> None:
        self._stopping.set()
        os.write(self._wake_write, b"x")
        self._thread.join()
        for terminal in self.terminals:
            terminal.unplug()
        os.close(self._wake_read)
        os.close(self._wake_write)
        if self.error is not None:
            raise self.error

    def pull(self, number: int = 0) -> None:
        """Pull the plug of a line, now; what is still in its buffers is lost with it."""
        self._world.lines[number].unplugged = True

    def wait(self) -> None:
        """Run until interrupted (for a terminal of its own)."""
        while self._thread.is_alive():
            self._thread.join(0.2)

    # ---- the thread ----------------------------------------------------------------------------------

    def _run(self) -> None:
        try:
            self._last = time.monotonic()
            while not self._stopping.is_set():
                self._listen()
                self._pass_time()
                for i, line in enumerate(self._world.lines):
                    if line.unplugged:
                        self._stay_away(i, line)
                    else:
                        self._send(i, line)
        except BaseException as error:
            self.error = error

    def _listen(self) -> None:
        """Wait for commands, or until there is something to do."""
        masters = {t.master: i for i, t in enumerate(self.terminals) if t.master >= 0}
        blocked = [t.master for i, t in enumerate(self.terminals) if t.master >= 0 and self._pending[i]]
        readable, _, _ = select.select([*masters, self._wake_read], blocked, [], self._patience_s())
        for descriptor in readable:
            if descriptor in masters:
                try:
                    self._world.lines[masters[descriptor]].receive(os.read(descriptor, 4096))
                except OSError as error:
                    if error.errno not in (errno.EIO, errno.EAGAIN):
                        raise

    def _patience_s(self) -> float:
        if self._speed is not None:
            return self._slice_s / max(self._speed, 1)
        return 0.0 if self._may_go_on() else (2e-4 if self._busy() else _IDLE_S)

    def _busy(self) -> bool:
        return bool(self._away_until) or any(line.busy for line in self._world.lines)

    def _may_go_on(self) -> bool:
        """At full speed: time passes only while the recorder keeps up."""
        if not any(line.busy for line in self._world.lines) or any(self._pending):
            return False
        return all(t.master < 0 or t.unread() == 0 for t in self.terminals)

    def _pass_time(self) -> None:
        if self._speed is not None:
            now = time.monotonic()
            step_s, self._last = (now - self._last) * self._speed, now
            if self._speed > 1:
                # faster than life: rather late than jumping ahead of a host that cannot follow
                step_s = 0.0 if any(self._pending) else min(step_s, 5 * self._slice_s * self._speed)
            self._world.run_until(self._world.now_s + step_s)
        elif self._may_go_on():
            self._world.run_until(self._world.now_s + self._slice_s)

    def _send(self, i: int, line: WireHalf) -> None:
        pending = self._pending[i]
        pending += line.take()
        if len(pending) > _MAX_PENDING:
            self.overruns += len(pending) - _MAX_PENDING
            del pending[: len(pending) - _MAX_PENDING]
        if pending:
            try:
                del pending[: os.write(self.terminals[i].master, pending)]
            except BlockingIOError:
                pass

    def _stay_away(self, i: int, line: WireHalf) -> None:
        terminal = self.terminals[i]
        if terminal.master >= 0:
            terminal.unplug()
            self._pending[i].clear()
            line.cut()
            if self._replug_after_s is not None:
                self._away_until[i] = time.monotonic() + self._replug_after_s
        elif i in self._away_until and time.monotonic() >= self._away_until[i]:
            del self._away_until[i]
            line.unplugged = False
            line.cut()
            line.power_up()
            terminal.plug()


def build(
    what: str,
    truth: Truth,
    seed: int = 1,
    material: str = "al",
    experiment: int = 1,
    infill_percent: int = 100,
    fault_share: float = 0.0,
    faults: Faults | None = None,
    cell: int | None = None,
) -> World:
    """A world with one instrument, or (`stand`) with quadrotor and wrench, or (`torque`) with thrust tester
    and wrench. `cell`: of the bench this cell alone, clamped for its calibration. Raises ValueError for a name,
    material, experiment, infill or cell that does not exist."""
    rng = np.random.default_rng(seed)

    def line(device, **options) -> WireHalf:
        error = getattr(truth.clocks, device.instrument.name)
        chosen = faults or Faults(share=fault_share)
        device.needs_watchdog = True
        return WireHalf(device, rng, clock_error=error, faults=chosen, **options)

    if cell is not None and (what != "bench" or cell not in range(1, 7)):
        raise ValueError(f"a cell is one of the bench, 1 to 6, not {cell} of {what!r}")
    if what == "bench" and cell is not None:
        clamp = CellClamp(truth.cells, rng, cell)
        return World(clamp, line(BenchDevice(clamp)))
    if what == "bench":
        if material not in truth.bench:
            raise ValueError(f"the bench is made of {' or '.join(truth.bench)}, not of {material!r}")
        physics = BenchPhysics(truth.cells, truth.bench[material], rng)
        return World(physics, line(BenchDevice(physics)))
    if what == "jr3":
        physics = LoadedSensor(truth.jr3, rng)
        return World(physics, line(Jr3Device(physics)))
    if what == "tensile":
        if infill_percent not in truth.plastic:
            raise ValueError(f"specimens have an infill of {list(truth.plastic)} percent, not {infill_percent}")
        physics = TensilePhysics(truth.plastic[infill_percent], 1.0, 0.05, rng)
        return World(physics, line(TensileDevice(physics)))
    if what == "rotor":
        rotors = TurningRotors(truth.rotor, Battery(truth.battery), 1)
        physics = TesterPhysics(rotors, truth.rotor, truth.tester, rng)
        return World(physics, line(RotorDevice(physics)))
    if what == "torque":
        stand, tester = torque_rig(truth, Battery(truth.battery), rng)
        return World(stand, line(RotorDevice(tester)), line(WrenchDevice(stand)))
    if what not in _NAMES:
        raise ValueError(f"there is no emulator {what!r}; there are {', '.join(_NAMES)}")
    if experiment not in EXPERIMENTS:
        raise ValueError(f"table A.1 has experiments 1 to 48, not {experiment}")
    row = EXPERIMENTS[experiment]
    rotors = TurningRotors(truth.rotor, Battery(truth.battery), 4)
    stand = StandPhysics(truth.vehicle, truth.rotor, truth.wrench, rotors, row.roll_deg, row.pitch_deg, rng)
    vehicle = line(QuadrotorDevice(rotors, rng), burst_s=0.04)
    sensor = line(WrenchDevice(stand))
    lines = {"quadrotor": [vehicle], "wrench": [sensor], "stand": [vehicle, sensor]}[what]
    return World(stand, *lines)


def parse_load(text: str) -> tuple[float, str, float]:
    """Time in s since the stream began, axis and weight in gf, from `AXIS:GF@SECONDS`."""
    try:
        axis, rest = text.split(":")
        load_gf, time_s = (float(part) for part in rest.split("@"))
        if axis not in "xyz":
            raise ValueError(axis)
    except ValueError as error:
        raise ValueError(f"a load is AXIS:GF@SECONDS such as z:500.48@6, not {text!r}") from error
    return time_s, axis, load_gf
