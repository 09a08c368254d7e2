"""Records an instrument that sends plain lines of text. The bytes are kept as they come."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from rotorid_acquire.io import rawlog, wire
from rotorid_acquire.io.lines import Description, LineDecoder, line_counts, line_warnings
from rotorid_acquire.io.session import Session, Setup
from rotorid_acquire.recorder import Recorder
from rotorid_acquire.transport import AcquireError, Clock, DeviceSilent, Refused, Transport

_SILENCE_S = 60.0
_UNREADABLE_BYTES = 4096
"""Bytes in a row without a line that can be read, after which a recording is given up: headings are shorter."""


def record_lines(
    description: Description,
    transport: Transport,
    clock: Clock,
    folder: Path,
    name: str,
    setup: Setup | None = None,
    *,
    samples: int | None = None,
    stop_asked: threading.Event | None = None,
    silence_s: float = _SILENCE_S,
    on_row: Callable[[tuple[float, ...]], None] = lambda values: None,
    say: Callable[[str], None] = lambda text: None,
) -> Session:
    """Record `samples` lines, or until `stop_asked`. Returns the metadata; raises AcquireError, and then, too, log and
    metadata are there. `say` prints to the person at the keyboard."""
    recorder = _LineRecorder(description, transport, clock, folder, name, setup, stop_asked, silence_s, on_row, say)
    with recorder:
        while samples is None or recorder.lines < samples:
            recorder.pump()
    return recorder.session


class _LineRecorder(Recorder):
    """The recorder of frames, for a device that knows no frames: it is never asked, and only `begin` and `end` are sent
    to it."""

    def __init__(
        self, description: Description, transport, clock, folder, name, setup, stop_asked, silence_s, on_row, say
    ) -> None:
        self._description, self._patience_s, self._on_values = description, silence_s, on_row
        self._stated = description.model_dump(mode="json", exclude_none=True)
        instrument = wire.Instrument(description.name, description.name, description.baud_rate, 0, (), {})
        procedure = {"name": "lines", "description": self._stated}
        super().__init__(
            instrument, transport, clock, folder, name, setup, procedure=procedure, say=say, stop_asked=stop_asked
        )
        self._decoder = LineDecoder(description)
        self._unread_from = 0

    @property
    def lines(self) -> int:
        """Lines read so far."""
        return self._decoder.lines

    def stop(self) -> None:
        self._write_text(self._description.end)
        self._streaming = False

    def _identify(self) -> None:
        self.session.source = "instrument"
        self._note("description", description=self._stated)
        self.begin_stream()
        self._write_text(self._description.begin)

    def _write_text(self, text: str) -> None:
        if text:
            self._write(rawlog.SENT, text.encode())
            self._transport.write(text.encode())

    def _send(self, letter: str, arguments: bytes) -> None:
        """Whatever the end was, the instrument is stopped: the only command that is sent unasked."""
        with suppress(AcquireError):
            self._write_text(self._description.end)

    def _absorb(self, data: bytes, now_ns: int) -> None:
        self._bytes += len(data)
        self._last_sample_ns = now_ns
        for values in self._decoder.feed(data):
            self._on_values(values)
            self._unread_from = self._bytes
        if self._bytes - self._unread_from >= _UNREADABLE_BYTES and not self._closing:
            raise Refused(
                f"no line of the last {self._bytes - self._unread_from} bytes could be read: is the baud rate right "
                f"({self._description.baud_rate}), and does the description fit? What came is in the log."
            )

    def _overhear(self, data: bytes) -> None:
        """Nothing is waited for behind a full disk."""

    def _silence_s(self) -> float:
        return self._patience_s

    def _after_silence(self) -> None:
        raise DeviceSilent(
            f"{self._transport.name}: no byte for {self._patience_s:g} s; what came before is in the log"
        )

    def _after_restart(self) -> None:
        self._restarted = False
        self._write_text(self._description.begin)

    def _warnings(self) -> list[str]:
        decoder = self._decoder
        return line_warnings(
            self._description, self._bytes, decoder.lines, decoder.unreadable, decoder.unread, self._port_losses
        )

    def _fill_session(self) -> None:
        decoder = self._decoder
        self.session.counts = line_counts(self._bytes, decoder.lines, decoder.unreadable, self._port_losses)
        self.session.warnings = self._warnings()
        for warning in self.session.warnings:
            self.say(f"note: {warning}")
