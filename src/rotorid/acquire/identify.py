"""Who is on a serial port: stable names, and the question that every instrument answers."""

from __future__ import annotations

import time
from pathlib import Path

from rotorid.acquire.errors import PortBusy, PortLost, PortMissing
from rotorid.acquire.transport import SerialTransport
from rotorid.io import wire
from rotorid.io.frames import COMMAND, START, Frame, encode
from rotorid.io.intake import Intake
from rotorid.io.wire.base import IDENTIFY

BY_ID = Path("/dev/serial/by-id")
WAIT_S = 2.5  # an UNO restarts when its port is opened, and its boot loader keeps it for a second or two


def stable_name(device: str, folder: Path = BY_ID) -> str:
    """The name under /dev/serial/by-id that stays the same wherever the board is plugged in; else the device's own."""
    if folder.is_dir():
        for link in sorted(folder.iterdir()):
            if link.resolve() == Path(device).resolve():
                return str(link)
    return device


def who_is_there(port: str, wait_s: float = WAIT_S) -> str:
    """One sentence about what answers on a port, asked at each baud rate that an instrument has. Nothing is started."""
    heard = b""
    for baud_rate in sorted({instrument.baud_rate for instrument in wire.INSTRUMENTS.values()}, reverse=True):
        transport, intake = SerialTransport(port, baud_rate), Intake()
        try:
            transport.open()
            deadline = time.monotonic() + wait_s
            asked_s = 0.0
            while time.monotonic() < deadline:
                if time.monotonic() - asked_s > 0.5:
                    transport.write(b"\0" + encode(Frame(COMMAND, 0, 0, IDENTIFY.encode())))
                    asked_s = time.monotonic()
                data = transport.read(0.1)
                heard += data
                for kind, _, content in intake.feed(data):
                    if kind == START:
                        known = "" if content.instrument in wire.INSTRUMENTS else " (not known to this version)"
                        return (
                            f"{content.instrument}{known}, firmware {content.firmware}, serial {content.serial_number}"
                        )
        except (PortMissing, PortBusy, PortLost) as error:
            return str(error)
        finally:
            transport.close()
    if not heard:
        return "nothing answers"
    return f"no instrument of ours; heard {len(heard)} bytes, the last of them {heard[-24:]!r}"


def udev_rule(vendor: str, product: str, serial_number: str | None, name: str) -> str:
    """A rule that gives a board the name /dev/NAME wherever it is plugged in."""
    serial = f', ATTRS{{serial}}=="{serial_number}"' if serial_number else ""
    return (
        f'SUBSYSTEM=="tty", ATTRS{{idVendor}}=="{vendor}", ATTRS{{idProduct}}=="{product}"{serial}, '
        f'SYMLINK+="{name}", GROUP="dialout", MODE="0660"'
    )
