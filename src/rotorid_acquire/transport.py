"""What is below the recorder: where bytes come from, the host's clock, and what can go wrong with an instrument.

Bytes come from a serial port, or from an emulator in the same process: a transport knows bytes and ports, nothing of
frames. The clock is real or virtual, so that a test or a campaign never waits. Each error says what happened and what
to do.
"""

from __future__ import annotations

import errno
import select
import time
from datetime import datetime, timedelta

import serial

from rotorid_acquire.io.session import Ended


class AcquireError(Exception):
    """What ends a recording before its time; `ended` is what the session's metadata say."""

    ended = Ended.FAILED

    def __init__(self, text: str, ended: Ended | None = None) -> None:
        super().__init__(text)
        self.ended = ended or self.ended


class PortMissing(AcquireError):
    """No such port, another program holds it, or we may not open it."""

    ended = Ended.DEVICE_LOST


class PortLost(AcquireError):
    """The port went away while it was open."""

    ended = Ended.DEVICE_LOST


class DeviceSilent(AcquireError):
    """Nothing comes, or no answer."""

    ended = Ended.DEVICE_SILENT


class Refused(AcquireError):
    """The device refused a command, or is not the instrument that was asked for."""

    ended = Ended.REFUSED


class DiskFull(AcquireError):
    """The log cannot be written any more. `stored`: the chunk in hand is whole on disk all the same."""

    ended = Ended.DISK_FULL
    stored = False


class Interrupted(AcquireError):
    """The person at the keyboard has had enough."""

    ended = Ended.INTERRUPTED


class SystemClock:
    """The computer's own clock: monotonic time, date, and waiting."""

    def now_ns(self) -> int:
        return time.monotonic_ns()

    def date(self) -> datetime:
        return datetime.now().astimezone()

    def wait(self, seconds: float) -> None:
        time.sleep(seconds)


class VirtualClock:
    """A clock that stands still unless it is advanced; the world's emulators follow it."""

    def __init__(self, start: datetime) -> None:
        self._start = start
        self._now_ns = 0
        self._followers = []

    def follow(self, run_until) -> None:
        """Call `run_until(seconds)` whenever the time has advanced."""
        self._followers.append(run_until)

    def now_ns(self) -> int:
        return self._now_ns

    def date(self) -> datetime:
        return self._start + timedelta(microseconds=self._now_ns // 1000)

    def wait(self, seconds: float) -> None:
        self._now_ns += round(seconds * 1e9)
        for run_until in self._followers:
            run_until(self._now_ns / 1e9)


class SerialTransport:
    """A serial port, held exclusively. `read` waits at most `timeout_s` and returns what there is, perhaps nothing.

    `gather_s`: once bytes come, wait so long for more before reading them all, so that a fast stream
    costs fifty wake-ups a second and not one per frame. The port's own buffer (4096 bytes) must hold
    what comes in that time: 20 ms are enough up to 2 Mbit/s.
    """

    def __init__(self, port: str, baud_rate: int, gather_s: float = 0.02) -> None:
        self.name = port
        self.baud_rate = baud_rate
        self.gather_s = gather_s
        self._serial: serial.Serial | None = None

    def open(self) -> None:
        """Raises PortMissing."""
        try:
            self._serial = serial.Serial(self.name, self.baud_rate, timeout=0, write_timeout=1, exclusive=True)
        except (serial.SerialException, OSError) as error:
            raise _port_error(self.name, error) from error

    def read(self, timeout_s: float) -> bytes:
        """Raises PortLost."""
        port = self._port()
        try:
            ready, _, _ = select.select([port.fd], [], [], timeout_s)
            if not ready:
                return b""
            data = port.read(4096)
            if self.gather_s and len(data) < 4096:
                select.select([], [], [], self.gather_s)
                data += port.read(max(port.in_waiting, 1))
            if not data:
                raise OSError(errno.EIO, "end of file on the port")
            return data
        except (serial.SerialException, OSError, TypeError, ValueError) as error:
            raise PortLost(f"{self.name} went away while it was read ({error})") from error

    def write(self, data: bytes) -> None:
        """Raises PortLost."""
        port = self._port()
        try:
            port.write(data)
        except (serial.SerialException, OSError) as error:
            raise PortLost(f"{self.name} went away while it was written to ({error})") from error

    def close(self) -> None:
        if self._serial is not None:
            try:
                self._serial.close()
            except OSError:  # the device behind it is gone: there is nothing left to close
                pass
            self._serial = None

    def _port(self) -> serial.Serial:
        if self._serial is None:
            raise PortLost(f"{self.name} is not open")
        return self._serial


def _port_error(name: str, error: Exception) -> PortMissing:
    number = getattr(error, "errno", None)
    text = str(error)
    if number == errno.ENOENT or "No such file" in text or "FileNotFoundError" in text:
        return PortMissing(
            f"{name}: there is no such port. Plug the instrument in, and look at `rotorid-acquire ports`."
        )
    if number in (errno.EACCES, errno.EPERM):
        return PortMissing(
            f"{name}: you may not open this port. On Linux: `sudo usermod -aG dialout $USER`, log in again."
        )
    if number in (errno.EBUSY, errno.EAGAIN) or "lock" in text:
        return PortMissing(f"{name}: another program holds this port. Close it there (a serial monitor?), try again.")
    return PortMissing(f"{name}: cannot be opened ({text}). Unplug the instrument, plug it in, try again.")


class LoopbackTransport:
    """An emulator in the same process, on a virtual clock: waiting for bytes makes the time pass."""

    baud_rate = None

    def __init__(self, device, clock: VirtualClock, name: str = "loopback") -> None:
        self.name = name
        self._device = device
        self._clock = clock

    def open(self) -> None:
        pass

    def read(self, timeout_s: float) -> bytes:
        self._clock.wait(timeout_s)
        return self._device.take()

    def write(self, data: bytes) -> None:
        self._device.receive(data)

    def close(self) -> None:
        pass


Clock = SystemClock | VirtualClock
Transport = SerialTransport | LoopbackTransport
"""Bytes both ways. Tests have others of their own."""
