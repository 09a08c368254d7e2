"""The recorder: reads a transport, writes every byte, then looks at what it wrote.

A recording is a `with` block around a `Recorder`; what a procedure does with the instrument (tare, throttle,
programme) stands in its own module and only uses `command`, `start`, `rows` and `stop`. However the block
ends, the log is closed and the metadata beside it say how it ended.
"""

from __future__ import annotations

import json
import struct
import threading
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from hashlib import file_digest
from pathlib import Path
from typing import NamedTuple

from acquire.clock import Clock
from acquire.errors import (
    AcquireError,
    DeviceReset,
    DeviceSilent,
    DiskFull,
    Interrupted,
    PortBusy,
    PortLost,
    PortMissing,
    Refused,
)
from acquire.log_writer import LogWriter
from acquire.transport import Transport
from rotorid.io import rawlog, wire
from rotorid.io.frames import ANSWER, COMMAND, DATA, END, START, Frame, StreamDecoder, encode
from rotorid.io.sequence import Tracker
from rotorid.io.session import Counts, Ended, GapEntry, Session, Setup, write_session
from rotorid.io.session import Event as SessionEvent
from rotorid.io.wire.base import GO, IDENTIFY, OK, STOP

MAX_GAPS_LISTED = 1000
RATE_TOLERANCE = 0.02


@dataclass(frozen=True)
class Timings:
    """How long a recorder waits, in host seconds."""

    poll_s: float = 0.1  # one read
    reply_s: float = 1.0  # an answer to a command, before it is sent again
    tries: int = 3  # of a command
    silence_s: float = 2.0  # in a stream, before the device is asked whether it is still there
    retry_open_s: float = 0.25  # between two attempts to reopen a port that went away
    reconnect_s: float = 60.0  # before a port that went away is given up


class Row(NamedTuple):
    """One sample: segment, index in its sequence, device time in s, values in the columns' units."""

    segment: int
    index: int
    time_s: float
    values: tuple[float, ...]


@dataclass(frozen=True)
class Status:
    """What a live view shows, a snapshot."""

    phase: str
    values: tuple[float, ...]
    samples: int
    wanted: int | None
    rate_hz: float | None
    missing: int
    bad_frames: int
    elapsed_s: float
    remaining_s: float | None


class Recorder:
    """One recording of one instrument.

    `resume` (set by a procedure) brings a device that restarted back to streaming; None means that the run
    is void after a reset. `stop_asked` may be set from another thread or a signal handler.
    """

    def __init__(
        self,
        instrument: wire.Instrument,
        transport: Transport,
        clock: Clock,
        folder: Path,
        recording_id: str,
        setup: Setup | None = None,
        *,
        group: str | None = None,
        procedure: dict | None = None,
        timings: Timings | None = None,
        say: Callable[[str], None] = lambda text: None,
        stop_asked: threading.Event | None = None,
        durable: bool = True,
    ) -> None:
        self.instrument = instrument
        self.log_path = Path(folder) / f"{recording_id}.rlog"
        self.session_path = Path(folder) / f"{recording_id}.yaml"
        self.phase = "opening"
        self.wanted: int | None = None
        self.resume: Callable[[], None] | None = None
        self.on_row: Callable[[Row], None] | None = None
        self.stop_asked = stop_asked or threading.Event()
        self.ends_by_itself = False  # a programme that the device finishes without being told
        self.over = False  # the stream has ended
        self.ended: wire.EndRecord | None = None
        self.identity: wire.StartRecord | None = None
        self._transport = transport
        self._clock = clock
        self._timings = timings or Timings()
        self._say = say
        self._durable = durable
        self._decoder = StreamDecoder()
        self._tracker = Tracker()
        self._rows: deque[Row] = deque()
        self._answers: list[wire.Answer] = []
        self._sequence = 0
        self._bytes = 0
        self._samples = 0
        self._consumed = 0
        self._port_losses = 0
        self._skipped = 0
        self._last_values: tuple[float, ...] = ()
        self._last_byte_ns = 0
        self._streaming = False
        self._closing = False
        self._restarted = False
        self._first: Row | None = None
        self._latest: Row | None = None
        self._first_host_ns = self._latest_host_ns = 0
        self._restart_device_s = 0.0
        self._writer: LogWriter | None = None
        self.session = Session(
            id=recording_id,
            group=group,
            instrument=instrument.name,
            started=clock.date().isoformat(timespec="microseconds"),
            host_start_ns=clock.now_ns(),
            port=transport.name,
            baud_rate=transport.baud_rate,
            setup=setup or Setup(),
            procedure=procedure or {},
            log=self.log_path.name,
        )

    # ---- opening and closing -------------------------------------------------------------------------

    def __enter__(self) -> Recorder:
        """Open the port, create the log, ask the device who it is. Raises AcquireError."""
        self._transport.open()  # first of all: a port that is not there leaves no empty log behind
        try:
            self.log_path.parent.mkdir(parents=True, exist_ok=True)
            self._writer = LogWriter(self.log_path, self._durable)
            write_session(self.session, self.session_path)
            self._note("begin", id=self.session.id)
            self._last_byte_ns = self._clock.now_ns()
            self._identify()
        except BaseException as error:
            self._finish(error)
            raise
        return self

    def __exit__(self, kind, error, trace) -> None:
        self._finish(error)

    def _finish(self, error: BaseException | None) -> None:
        """Stop the device, close the log, write the metadata; never raises over the error that led here."""
        self._closing = True
        if self._writer is None:
            self._transport.close()
            return
        try:
            if self._streaming and not isinstance(error, (PortLost, PortMissing)):
                self.stop()
        except AcquireError as late:
            self._event("stop", f"the device could not be stopped: {late}")
        finally:
            self._transport.close()
            self._writer.close()
            self.session.ended, self.session.message = _how(error)
            self.phase = str(self.session.ended)
            self._fill_session()
            try:
                write_session(self.session, self.session_path)
            except OSError as late:
                self._say(f"{self.session_path}: cannot be written ({late}); the log itself is whole")

    # ---- what procedures use -------------------------------------------------------------------------

    def command(self, letter: str, arguments: bytes = b"") -> wire.Answer:
        """Send a command and wait for its answer, repeating it if none comes.

        Raises Refused where the device says no, DeviceSilent where it says nothing.
        """
        for _ in range(self._timings.tries):
            self._answers.clear()
            self._send(letter, arguments)
            deadline = self._clock.now_ns() + round(self._timings.reply_s * 1e9)
            while self._clock.now_ns() < deadline:
                self._pump()
                for answer in self._answers:
                    if answer.letter == letter:
                        if answer.status != OK:
                            raise Refused(f"the {self.instrument.title} refused {letter!r}: {answer.text}")
                        return answer
        raise DeviceSilent(
            f"the {self.instrument.title} on {self._transport.name} does not answer the command {letter!r} "
            f"({self._timings.tries} tries). Is it powered, and is this the right port?"
        )

    def start(self, interval_s: float = 0.0, resumable: bool = True) -> None:
        """Start the stream; an interval of 0 leaves the choice to the instrument. A stream that is not
        `resumable` is void when the device restarts."""
        arguments = struct.pack("<I", round(interval_s * 1e6))

        def go() -> None:
            self.command(GO, arguments)
            self.begin_stream()

        go()
        if not resumable:
            self.resume = None
        elif self.resume is None:
            self.resume = go

    def begin_stream(self) -> None:
        """From now on the device is expected to send without being asked."""
        self._streaming = True
        self._last_byte_ns = self._clock.now_ns()

    def stop(self) -> None:
        """Stop the stream and take in what is still on its way, up to the end record."""
        self._closing = True
        self.command(STOP)
        deadline = self._clock.now_ns() + round(self._timings.reply_s * 1e9)
        while self.ended is None and self._clock.now_ns() < deadline:
            self._pump()
        self._streaming = False

    def rows(self, count: int | None = None) -> Iterator[Row]:
        """Samples as they come: `count` of them, or all until the device ends the stream.

        Samples known to be lost count as well, so that a recording does not grow longer by its losses.
        """
        self.wanted = None if count is None else self._consumed + count + self._tracker.missing
        goal = self.wanted
        while goal is None or self._consumed + self._tracker.missing < goal:
            if self._rows:
                self._consumed += 1
                yield self._rows.popleft()
            elif self.over:
                return
            else:
                self.pump()

    def drop_rows(self) -> None:
        """Pass over samples that no one looks at now; they are in the log."""
        self._consumed += len(self._rows)
        self._rows.clear()

    @property
    def progress(self) -> int:
        """Samples that came or are known to be missing."""
        return self._samples + self._tracker.missing

    def mark(self, name: str, row: Row) -> None:
        """Remember at which sample a step of the procedure began or ended."""
        self.session.marks[name] = row.index
        self._note("mark", name=name, index=row.index, segment=row.segment)

    def say(self, text: str) -> None:
        """Tell the person at the keyboard."""
        self._say(text)

    def status(self) -> Status:
        """A snapshot for a live view; may be called from another thread."""
        elapsed = (self._clock.now_ns() - self.session.host_start_ns) / 1e9
        rate = self._measured_rate()
        remaining = None
        if self.wanted is not None and rate:
            remaining = max(0, self.wanted - self.progress) / rate
        return Status(
            phase=self.phase,
            values=self._last_values,
            samples=self._samples,
            wanted=self.wanted,
            rate_hz=rate,
            missing=self._tracker.missing,
            bad_frames=self._decoder.checksum_errors + self._decoder.broken_frames,
            elapsed_s=elapsed,
            remaining_s=remaining,
        )

    def pump(self) -> None:
        """One read: write, decode, keep watch. Raises Interrupted, DeviceSilent, DeviceReset and others."""
        if self.stop_asked.is_set() and not self._closing:
            raise Interrupted("stopped at your wish; everything received until then is in the log")
        self._pump()
        if self._streaming and not self._closing:
            if self._restarted:
                self._after_restart()
            elif self._clock.now_ns() - self._last_byte_ns > self._timings.silence_s * 1e9:
                self._after_silence()

    # ---- inside --------------------------------------------------------------------------------------

    def _pump(self) -> None:
        try:
            data = self._transport.read(self._timings.poll_s)
        except PortLost as error:
            self._reconnect(error)
            return
        if not data:
            return
        now_ns = self._clock.now_ns()
        self._write(rawlog.RECEIVED, data)  # first of all
        self._bytes += len(data)
        self._last_byte_ns = now_ns
        for frame in self._decoder.feed(data):
            self._take(frame, now_ns)

    def _take(self, frame: Frame, now_ns: int) -> None:
        resets = self._tracker.resets
        place = self._tracker.place(frame)
        if self._tracker.resets > resets:
            self._restarted = True
            self._event("reset", "the device restarted")
        if place is None:
            return
        if frame.kind == DATA:
            try:
                values = self.instrument.decode(frame.payload)
            except struct.error:
                raise Refused(
                    f"the {self.instrument.title} sends samples of {len(frame.payload)} bytes, "
                    f"this version expects {self.instrument.layout.size}: update its firmware or this program"
                ) from None
            row = Row(place.segment, place.index, place.clock_us / 1e6, values)
            self._samples += 1
            self._last_values = values
            self._rows.append(row)
            self._time(row, now_ns)
            if self.on_row is not None:
                self.on_row(row)
        elif frame.kind == ANSWER:
            self._answers.append(wire.Answer.unpack(frame.payload))
        elif frame.kind == START:
            self.identity = wire.StartRecord.unpack(frame.payload)
        elif frame.kind == END:
            self.ended = wire.EndRecord.unpack(frame.payload)
            self._skipped += self.ended.skipped
            self._streaming = False
            self.over = True

    def _time(self, row: Row, now_ns: int) -> None:
        """Keep the first and the latest sample of the present segment, for rate and clock ratio."""
        if self._first is None or row.segment != self._first.segment:
            if self._first is not None:
                self._restart_device_s += self._latest.time_s - self._first.time_s
            self._first, self._first_host_ns = row, now_ns
            self._latest, self._latest_host_ns = row, now_ns
        elif row.time_s > self._latest.time_s:
            self._latest, self._latest_host_ns = row, now_ns

    def _send(self, letter: str, arguments: bytes) -> None:
        payload = letter.encode() + arguments
        data = encode(Frame(COMMAND, self._sequence, self._clock.now_ns() // 1000, payload))
        self._sequence += 1
        self._write(rawlog.SENT, data)
        try:
            # the leading zero ends whatever noise the line has put into the device's buffer
            self._transport.write(b"\0" + data)
        except PortLost as error:
            self._reconnect(error)

    def _ask_identity(self) -> bool:
        """Ask the device who it is; whether it answered. Its start record also tells a restart."""
        self.identity = None
        for _ in range(self._timings.tries):
            self._send(IDENTIFY, b"")
            deadline = self._clock.now_ns() + round(self._timings.reply_s * 1e9)
            while self.identity is None and self._clock.now_ns() < deadline:
                self._pump()
            if self.identity is not None:
                return True
        return False

    def _identify(self) -> None:
        if not self._ask_identity():
            raise DeviceSilent(
                f"{self._transport.name} is open but nothing on it answers like a {self.instrument.title}. "
                "Is it powered, is this the right port, is the baud rate right "
                f"({self._transport.baud_rate or self.instrument.baud_rate})?"
            )
        if self.identity.instrument != self.instrument.name:
            raise Refused(
                f"{self._transport.name} is a {self.identity.instrument!r} ({self.identity.firmware}), "
                f"not a {self.instrument.name!r}; see `rotorid-acquire ports`"
            )
        self._restarted = False
        self.session.firmware = self.identity.firmware
        self.session.serial_number = self.identity.serial_number
        self.session.source = "emulator" if "emulat" in self.identity.firmware else "instrument"
        write_session(self.session, self.session_path)

    def _after_restart(self) -> None:
        """Bring a device that restarted, or whose port was gone, back to streaming."""
        if self.resume is None:
            raise DeviceReset(
                f"the {self.instrument.title} restarted in the middle of the run, which is void. "
                "Check its supply and plug, then record again; what came before is in the log."
            )
        # its start record has to come before its samples, or these look like old ones
        if not self._ask_identity():
            self._streaming = False
            raise DeviceSilent(
                f"the {self.instrument.title} on {self._transport.name} has gone silent. "
                "Check its power and cable, then record again; what came before is in the log."
            )
        self._restarted = False
        self._say(f"telling the {self.instrument.title} to go on")
        self.resume()

    def _after_silence(self) -> None:
        self._event("silence", f"nothing for {self._timings.silence_s:g} s")
        if self.ends_by_itself and self._ask_identity() and not self._restarted:
            self._event("end_lost", "the device is there and idle: its end record was lost on the way")
            self._streaming = False
            self.over = True
            return
        self._after_restart()

    def _reconnect(self, error: PortLost) -> None:
        """Wait for a port that went away. Raises PortLost when it does not come back."""
        self._port_losses += 1
        self._event("port_lost", str(error))
        self._decoder.break_off()
        if self._closing:
            raise error
        self._say(f"{self._transport.name} went away; waiting up to {self._timings.reconnect_s:g} s for it")
        self._transport.close()
        deadline = self._clock.now_ns() + round(self._timings.reconnect_s * 1e9)
        while self._clock.now_ns() < deadline:
            if self.stop_asked.is_set():
                raise Interrupted("stopped at your wish while the port was gone; the log is safe")
            try:
                self._transport.open()
            except (PortMissing, PortBusy):
                self._clock.wait(self._timings.retry_open_s)
                continue
            self._event("port_back", f"{self._transport.name} is back")
            self._say(f"{self._transport.name} is back; going on")
            self._last_byte_ns = self._clock.now_ns()
            if self._streaming:
                self._restarted = True  # whatever it was: it has to be told to go on
            return
        self._streaming = False
        raise PortLost(
            f"{self._transport.name} went away and did not come back within {self._timings.reconnect_s:g} s. "
            "Check plug and cable, then record again; what came before is in the log."
        )

    def _event(self, what: str, text: str) -> None:
        host_s = (self._clock.now_ns() - self.session.host_start_ns) / 1e9
        self.session.events.append(SessionEvent(host_s=round(host_s, 6), what=what, text=text))
        self._note(what, text=text)

    def _note(self, what: str, **more) -> None:
        self._write(rawlog.NOTE, json.dumps({"note": what, **more}, separators=(",", ":")).encode())

    def _write(self, tag: int, data: bytes) -> None:
        """To disk. While closing, a full disk no longer hinders: the device still has to be stopped."""
        try:
            self._writer.write(tag, self._clock.now_ns(), data)
        except DiskFull:
            if not self._closing:
                raise

    def _measured_rate(self) -> float | None:
        first, latest = self._first, self._latest
        if first is None or latest is None or latest.time_s <= first.time_s:
            return None
        return (latest.index - first.index) / (latest.time_s - first.time_s)

    def _fill_session(self) -> None:
        session, tracker, decoder = self.session, self._tracker, self._decoder
        session.counts = Counts(
            bytes_received=self._bytes,
            frames=decoder.frames,
            samples=self._samples,
            missing=tracker.missing,
            repeated=tracker.repeated,
            late=tracker.late,
            checksum_errors=decoder.checksum_errors,
            broken_frames=decoder.broken_frames,
            lost_bytes=decoder.lost_bytes,
            resets=tracker.resets,
            clock_rollovers=tracker.rollovers,
            port_losses=self._port_losses,
            device_skipped=self._skipped,
        )
        session.gaps = [GapEntry(**vars(gap)) for gap in tracker.gaps[:MAX_GAPS_LISTED]]
        session.gaps_left_out = max(0, len(tracker.gaps) - MAX_GAPS_LISTED)
        rate = self._measured_rate()
        if self.identity is not None and self.identity.interval_us:
            session.promised_rate_hz = round(1e6 / self.identity.interval_us, 6)
        if rate is not None:
            device_s = self._latest.time_s - self._first.time_s
            host_s = (self._latest_host_ns - self._first_host_ns) / 1e9
            session.measured_rate_hz = round(rate, 6)
            session.duration_s = round(device_s + self._restart_device_s, 6)
            # bytes come up to one read late, so a short recording says little about the clock
            if host_s > 4 * self._timings.poll_s / RATE_TOLERANCE:
                session.device_clock_ratio = round(device_s / host_s, 6)
        session.warnings = list(_warnings(session))
        with open(self.log_path, "rb") as log:
            session.log_sha256 = file_digest(log, "sha256").hexdigest()


def _how(error: BaseException | None) -> tuple[Ended, str]:
    """Ending and message for the metadata."""
    if error is None:
        return Ended.FINISHED, "all that was asked for is there"
    if isinstance(error, AcquireError):
        return error.ended, str(error)
    if isinstance(error, KeyboardInterrupt):
        return Ended.INTERRUPTED, "interrupted from the keyboard"
    return Ended.FAILED, f"{type(error).__name__}: {error}"


def _warnings(session: Session) -> Iterator[str]:
    """One sentence for each thing a person should look at."""
    counts = session.counts
    if counts.missing:
        share = counts.missing / (counts.samples + counts.missing)
        yield f"{counts.missing} samples are missing ({share:.2%}), {len(session.gaps)} gaps; check the cable"
    bad = counts.checksum_errors + counts.broken_frames
    if bad:
        yield f"{bad} frames came damaged; a loose plug, a long cable or a wrong baud rate does that"
    if counts.device_skipped:
        yield f"the device itself skipped {counts.device_skipped} samples; ask for a lower rate"
    promised, measured = session.promised_rate_hz, session.measured_rate_hz
    if promised and measured and abs(measured / promised - 1) > RATE_TOLERANCE:
        pace = "faster" if measured > promised else "slower"
        yield f"the device is {pace} than promised: {measured:.1f} instead of {promised:.1f} samples a second"
    if session.device_clock_ratio and abs(session.device_clock_ratio - 1) > RATE_TOLERANCE:
        yield f"the device's clock runs at {session.device_clock_ratio:.3f} of the host's; one of them is off"
