"""The recorder: reads a transport, appends every byte to a raw log, and only then looks at what it wrote.

A recording is a `with` block around a `Recorder`; what a procedure does with the instrument (tare, throttle,
programme) stands in its own module and only uses `command`, `start`, `rows` and `stop`. However the block
ends, the log is closed and the metadata next to it say how it ended.
"""

from __future__ import annotations

import errno
import json
import os
import re
import tempfile
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from hashlib import file_digest
from pathlib import Path
from typing import NamedTuple

from rotorid_acquire.io import rawlog, wire
from rotorid_acquire.io.frames import ANSWER, COMMAND, DATA, END, START, Frame, Intake, Taken, encode
from rotorid_acquire.io.session import Counts, Ended, Session, Setup, write_session
from rotorid_acquire.io.session import Event as SessionEvent
from rotorid_acquire.io.wire import COMPLETE, GO, IDENTIFY, KEEP, OK, STOP, STOPPED, UNHEARD, pack_keep
from rotorid_acquire.transport import (
    AcquireError,
    Clock,
    DeviceSilent,
    DiskFull,
    Interrupted,
    PortLost,
    PortMissing,
    Refused,
    Transport,
)

_BALLAST_BYTES = 64 * 1024
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
NAME = re.compile(r"\w[\w.+-]{0,99}")  # of a recording: one file name, nothing that leads to another folder
_UNREADABLE_AT_MOST = 20  # samples of a wrong length before the first right one: the firmware is another
_MAX_GAPS_LISTED = 1000
_RATE_TOLERANCE = 0.02


@dataclass(frozen=True)
class Timings:
    """How long a recorder waits, in host seconds."""

    poll_s: float = 0.1  # one read
    reply_s: float = 1.0  # an answer to a command, before it is sent again
    tries: int = 3  # of a command
    silence_s: float = 2.0  # in a stream, before the device is asked whether it is still there
    retry_open_s: float = 0.25  # between two attempts to reopen a port that went away
    reconnect_s: float = 60.0  # before a port that went away, or a device that went silent, is given up
    watchdog_s: float | None = 2.0  # what moves stops when it has not heard us for so long; None: not asked for


class Row(NamedTuple):
    """One sample: segment, index in its sequence, device time in s, values in the columns' units."""

    segment: int
    index: int
    time_s: float
    values: tuple[float, ...]


class Recorder:
    """One recording of one instrument.

    `resume` (set by a procedure) brings a device that restarted back to streaming; None means that the run
    is void after a reset. `say` prints to the person at the keyboard. `stop_asked` may be set from another thread or a
    signal handler.
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
        source: str | None = None,
        limits: Mapping[str, tuple[float, float]] | None = None,
    ) -> None:
        if not NAME.fullmatch(recording_id):
            raise AcquireError(
                f"a recording is called by letters, digits, '.', '_', '+' and '-', such as static-z-3; "
                f"{recording_id!r} cannot be its name"
            )
        self.instrument = instrument
        self.log_path = Path(folder) / f"{recording_id}.rlog"
        self.session_path = Path(folder) / f"{recording_id}.yaml"
        self.phase = "opening"
        self.wanted: int | None = None
        self.resume: Callable[[], None] | None = None
        self.on_row: Callable[[Row], None] | None = None
        self.stop_asked = stop_asked or threading.Event()
        self.ends_by_itself = False  # a programme that the device finishes without a command
        self.over = False  # the stream has ended
        self.ended: wire.EndRecord | None = None
        self.identity: wire.StartRecord | None = None
        self._transport = transport
        self._clock = clock
        self._timings = timings or Timings()
        self.say = say
        self._durable = durable
        self._source = source
        self._limits = [
            (instrument.columns.index(column), low, high)
            for column, (low, high) in (limits or {}).items()
            if column in instrument.columns
        ]
        self._exceeded = ""
        self._intake = Intake(instrument)
        self._tracker = self._intake.tracker
        self._decoder = self._intake.decoder
        self._rows: deque[Row] = deque()
        self._answers: deque[wire.Answer] = deque(maxlen=64)
        self._sequence = 0
        self._bytes = 0
        self._last_bytes = b""
        self._samples = 0
        self._consumed = 0
        self._port_losses = 0
        self._skipped = 0
        self._last_values: tuple[float, ...] = ()
        self._aside: Intake | None = None
        self._answered = False
        self._last_sample_ns = 0
        self._last_sent_ns = 0
        self._watched = False  # the device's watchdog is on and wants to hear from us
        self._disk_full = False
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
        self.check_name()
        self._transport.open()  # before the log: a port that is not there leaves no empty log behind
        try:
            self._create()
            self._note("begin", id=self.session.id)
            self._identify()
        except BaseException as error:
            self._finish(error)
            raise
        return self

    def __exit__(self, kind, error, trace) -> None:
        self._finish(error)

    def check_name(self) -> None:
        """Raises AcquireError where a recording of this name is there, packed or not: none is ever overwritten."""
        for path in (self.log_path, self.log_path.with_name(self.log_path.name + ".gz"), self.session_path):
            if os.path.lexists(path):
                raise AcquireError(f"{path}: exists already; a recording is never overwritten. Choose another --id.")

    def _create(self) -> None:
        """Log and metadata, or, where the folder does not take both, neither."""
        folder = self.log_path.parent
        writer = None
        try:
            folder.mkdir(parents=True, exist_ok=True)
            writer = LogWriter(self.log_path, self._durable)
            write_session(self.session, self.session_path)
        except FileExistsError as error:
            if error.filename is not None and Path(error.filename) == self.log_path:  # made since we looked
                raise AcquireError(f"{error.filename}: exists already; choose another --id.") from error
            raise AcquireError(f"{folder}: is a file, not a folder; choose another --out.") from error
        except OSError as error:
            if writer is not None:
                writer.discard()
            if error.errno in _FULL:
                raise DiskFull(f"{folder}: the disk is full; free some space or choose another --out.") from error
            raise AcquireError(
                f"{error.filename or folder}: cannot be written ({os.strerror(error.errno or errno.EIO)}); "
                "choose another --out."
            ) from error
        self._writer = writer

    def _finish(self, error: BaseException | None) -> None:
        """Stop the device, close the log, write the metadata; never raises over the error that led here."""
        self._closing = True
        if self._writer is None:
            self._transport.close()
            return
        try:
            if self._streaming and not isinstance(error, (PortLost, PortMissing, DeviceSilent)):
                self.stop()
            elif self._streaming or self._watched:  # it may hear us, though we did not hear it
                self._send(STOP, b"")
        except AcquireError as late:
            self._event("stop", f"the device could not be stopped: {late}")
        finally:
            self._transport.close()
            self._writer.close()
            self.session.ended, self.session.message = _how(error)
            self.phase = str(self.session.ended)
            self._fill_session()
            with open(self.log_path, "rb") as log:
                self.session.log_sha256 = file_digest(log, "sha256").hexdigest()
            try:
                write_session(self.session, self.session_path)
            except OSError as late:
                self.say(f"{self.session_path}: cannot be written ({late}); the log itself is whole")

    # ---- what procedures use -------------------------------------------------------------------------

    def command(self, letter: str, arguments: bytes = b"") -> wire.Answer:
        """Send a command and wait for its answer, repeating it if none comes.

        Raises Refused where the device says no, AcquireError where it says so because it restarted in a run that
        this makes void, DeviceSilent where it says nothing.
        """
        for _ in range(self._timings.tries):
            self._answers.clear()
            self._send(letter, arguments)
            deadline = self._clock.now_ns() + round(self._timings.reply_s * 1e9)
            while self._clock.now_ns() < deadline:
                self._pump()
                for answer in list(self._answers):
                    if answer.letter == letter:
                        if answer.status != OK:
                            if self._streaming and self._restarted and self.resume is None:
                                self._after_restart()  # it refuses because it restarted: that is what to say
                            raise Refused(f"the {self.instrument.title} refused {letter!r}: {answer.text}")
                        return answer
        raise DeviceSilent(
            f"the {self.instrument.title} on {self._transport.name} does not answer the command {letter!r} "
            f"({self._timings.tries} tries). Is it powered, and is this the right port?"
        )

    def guard(self) -> None:
        """Switch on the watchdog of a device that moves something: should this computer die, the motion stops.

        From here on the device hears from us at least four times in that time. Raises Refused where the firmware
        has no watchdog.
        """
        if self._timings.watchdog_s is None:
            return
        if self._watched and self._clock.now_ns() - self._last_sent_ns < self._timings.watchdog_s / 2 * 1e9:
            return  # it was switched on just now
        try:
            self.command(KEEP, pack_keep(self._timings.watchdog_s))
        except Refused as error:
            raise Refused(
                f"the {self.instrument.title} has no watchdog (command {KEEP!r}): what it moves would go on should "
                "this computer die. Update its firmware."
            ) from error
        self._watched = True

    def start(self, interval_s: float = 0.0, resumable: bool = True) -> None:
        """Start the stream; an interval of 0 leaves the choice to the instrument. A stream that is not
        `resumable` is void when the device restarts."""
        arguments = round(interval_s * 1e6).to_bytes(4, "little")

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
        self._last_sample_ns = self._clock.now_ns()

    def stop(self) -> None:
        """Stop the stream and take in what is still on its way, up to the end record."""
        self._closing = True
        self.command(STOP)
        self._pump_until(lambda: self.ended is not None)
        self._streaming = self._watched = False

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

    def note(self, what: str, text: str) -> None:
        """Something happened that belongs into log and metadata; the person is informed as well."""
        self._event(what, text)
        self.say(text)

    @property
    def begun(self) -> bool:
        """Whether there is a log of this recording."""
        return self._writer is not None

    def status(self) -> tuple[tuple[float, ...], dict[str, str]]:
        """What a live view shows, which may ask from another thread: the last values, and by heading how it goes."""
        samples, missing, wanted, rate = self._samples, self._tracker.missing, self.wanted, self._measured_rate()
        known = wanted is not None and rate
        return self._last_values, {
            "samples": f"{samples}" + (f"/{wanted}" if wanted else ""),
            "rate [1/s]": f"{rate:.1f}" if rate else "–",
            "missing": str(missing) + (f" ({missing / (samples + missing):.2%})" if missing else ""),
            "damaged": str(self._decoder.checksum_errors + self._decoder.broken_frames),
            "elapsed [s]": f"{(self._clock.now_ns() - self.session.host_start_ns) / 1e9:.1f}",
            "remaining [s]": f"{max(0, wanted - samples - missing) / rate:.0f}" if known else "–",
        }

    def pump(self) -> None:
        """One read: write, decode, keep watch. Raises Interrupted, DeviceSilent and others."""
        if self.stop_asked.is_set() and not self._closing:
            raise Interrupted("stopped at your wish; everything received until then is in the log")
        self._pump()
        if self._streaming and not self._closing:
            if self._restarted:
                self._after_restart()
            elif self._clock.now_ns() - self._last_sample_ns > self._silence_s() * 1e9:
                self._after_silence()

    # ---- inside --------------------------------------------------------------------------------------

    def _pump_until(self, done: Callable[[], bool]) -> bool:
        """Read until something is there, for as long as an answer may take; whether it is."""
        deadline = self._clock.now_ns() + round(self._timings.reply_s * 1e9)
        while not done() and self._clock.now_ns() < deadline:
            self._pump()
        return done()

    def _pump(self) -> None:
        if self._watched and self._clock.now_ns() - self._last_sent_ns > self._timings.watchdog_s / 4 * 1e9:
            self._send(KEEP, pack_keep(self._timings.watchdog_s))
        try:
            data = self._transport.read(self._timings.poll_s)
        except PortLost as error:
            self._reconnect(error)
            return
        if not data:
            return
        now_ns = self._clock.now_ns()
        try:
            stored = self._write(rawlog.RECEIVED, data)  # first of all
        except DiskFull as full:
            if full.stored:
                self._absorb(data, now_ns)
            raise
        if stored:
            self._absorb(data, now_ns)
        else:
            self._overhear(data)

    def _absorb(self, data: bytes, now_ns: int) -> None:
        """Bytes that are in the log: count them, and hand on what they say."""
        tracker = self._tracker
        resets, before = tracker.resets, self._data_frames()
        self._bytes += len(data)
        self._last_bytes = data[-24:]
        for taken in self._intake.feed(data):
            self._take(taken, now_ns)
        if tracker.resets > resets:
            self._restarted = True
            self._event("reset", "the device restarted")
        if self._data_frames() > before:
            self._last_sample_ns = now_ns
        if self._closing:
            return
        if self._exceeded:
            raise AcquireError(self._exceeded, Ended.LIMIT_EXCEEDED)
        if not self._samples and self._intake.malformed_samples >= _UNREADABLE_AT_MOST:
            raise Refused(
                f"the {self.instrument.title} sends what this version cannot read ({self._intake.fault}): "
                "update its firmware or this program"
            )
        if self.ended is not None and self.ended.reason not in (STOPPED, COMPLETE):
            unheard = self.ended.reason == UNHEARD
            raise AcquireError(
                f"the {self.instrument.title} ended the stream by itself: "
                + ("its watchdog heard nothing from this computer" if unheard else "it reports a fault")
                + ". What it moved stands still; what came before is in the log.",
                Ended.DEVICE_FAULT,
            )

    def _data_frames(self) -> int:
        return self._samples + self._intake.malformed_samples + self._tracker.repeated

    def _overhear(self, data: bytes) -> None:
        """Bytes that no log could take any more: listened to for the device's end, and not counted."""
        if self._aside is None:
            self._aside = Intake(self.instrument)
            self._aside.decoder.pending = self._decoder.pending
        for kind, _, content in self._aside.feed(data):
            if kind == ANSWER:
                self._answers.append(content)
            elif kind == END:
                self.ended, self.over = content, True
                self._streaming = self._watched = False

    def _take(self, taken: Taken, now_ns: int) -> None:
        kind, place, content = taken
        if kind == DATA:
            values = self.instrument.decode(content)
            row = Row(place.segment, place.index, place.clock_us / 1e6, values)
            self._samples += 1
            self._last_values = values
            self._rows.append(row)
            self._time(row, now_ns)
            for number, low, high in self._limits:
                if not low <= values[number] <= high and not self._exceeded:
                    column = self.instrument.columns[number]
                    self._exceeded = f"{column} is {values[number]:.5g}, allowed are {low:g} to {high:g}: stopped"
            if self.on_row is not None:
                self.on_row(row)
        elif kind == ANSWER:
            self._answers.append(content)
        elif kind == START:
            self.identity = content
            self._answered = True
        elif kind == END:
            self.ended = content
            self._skipped += content.skipped
            self._streaming = self._watched = False
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
        self._last_sent_ns = self._clock.now_ns()
        self._write(rawlog.SENT, data)
        try:
            # the leading zero ends whatever noise the line has put into the device's buffer
            self._transport.write(b"\0" + data)
        except PortLost as error:
            self._reconnect(error)

    def _ask_identity(self, patience_s: float | None = None) -> bool:
        """Ask the device who it is, a few times or for so long; whether it answered. Its start record also shows a
        restart; samples, should they come instead, will do as a sign of life."""
        self._answered = False
        samples = self._data_frames()
        begin_ns, asked = self._clock.now_ns(), 0
        while asked < self._timings.tries or (
            patience_s is not None and self._clock.now_ns() - begin_ns < patience_s * 1e9
        ):
            if self.stop_asked.is_set() and patience_s is not None:
                raise Interrupted("stopped at your wish while nothing was heard of the device; the log is safe")
            self._send(IDENTIFY, b"")
            asked += 1
            if self._pump_until(lambda: self._answered or patience_s is not None and self._data_frames() > samples):
                return True
        return False

    def _identify(self) -> None:
        if not self._ask_identity():
            if self._intake.fault:
                raise Refused(
                    f"{self._transport.name} answers, but not as docs/wire-formats.md asks: {self._intake.fault}. "
                    "Update its firmware."
                )
            raise DeviceSilent(
                f"{self._transport.name} is open but nothing on it answers like a {self.instrument.title}. "
                "Is it powered, is this the right port, is the baud rate right "
                f"({self._transport.baud_rate or self.instrument.baud_rate})? {self._heard()}"
            )
        if self.identity.instrument != self.instrument.name:
            raise Refused(
                f"{self._transport.name} is a {self.identity.instrument!r} ({self.identity.firmware}), "
                f"not a {self.instrument.name!r}; see `rotorid-acquire ports --identify`"
            )
        self._restarted = False
        self.session.firmware = self.identity.firmware
        self.session.serial_number = self.identity.serial_number
        self.session.source = self._source or _source(self.identity, self._transport.name)
        write_session(self.session, self.session_path)

    def _heard(self) -> str:
        """What came instead of an answer, for a message."""
        if not self._bytes:
            return "Heard: nothing at all."
        if self._decoder.frames:
            return f"Heard: {self._decoder.frames} frames, none of them a start record."
        return f"Heard: {self._bytes} bytes and no frame, the last of them {self._last_bytes!r}."

    def _silence_s(self) -> float:
        """How long a stream may be without a sample: never less than three of its own intervals."""
        interval_s = self.identity.interval_us / 1e6 if self.identity is not None else 0.0
        return max(self._timings.silence_s, 3 * interval_s)

    def _after_restart(self) -> None:
        """Bring a device that restarted, or whose port was gone, back to streaming."""
        if self.resume is None:
            raise AcquireError(
                f"the {self.instrument.title} restarted in the middle of the run, which is void. "
                "Check its supply and plug, then record again; what came before is in the log.",
                Ended.DEVICE_RESET,
            )
        # its start record has to come before its samples, or these look like old ones
        if not self._ask_identity():
            self._give_up()
        self._restarted = False
        self._go_on()

    def _go_on(self) -> None:
        self.say(f"making the {self.instrument.title} go on")
        self.resume()

    def _give_up(self) -> None:
        raise DeviceSilent(
            f"the {self.instrument.title} on {self._transport.name} has gone silent. "
            "Check its power and cable, then record again; what came before is in the log."
        )

    def _after_silence(self) -> None:
        """A line at rest has as long as a port that is gone; what then comes decides how the recording goes on."""
        self._event("silence", f"no sample for {self._silence_s():g} s")
        self.say(f"nothing from the {self.instrument.title}; waiting up to {self._timings.reconnect_s:g} s for it")
        samples = self._data_frames()
        if not self._ask_identity(self._timings.reconnect_s):
            self._give_up()
        if self._restarted:
            self._after_restart()
            return
        # it answers; if it still streams, a sample is not far
        self._pump_until(lambda: self._data_frames() != samples or self.over)
        if self._data_frames() > samples:
            self._event("silence_over", "samples come again")
        elif self.over:
            return
        elif self.ends_by_itself:
            self._event("end_lost", "the device is there and idle: its end record was lost on the way")
            self._streaming = self._watched = False
            self.over = True
        elif self.resume is not None:
            self._go_on()
        else:
            raise AcquireError(
                f"the {self.instrument.title} answers, but no longer streams: the run is void. "
                "Record again; what came before is in the log.",
                Ended.DEVICE_FAULT,
            )

    def _reconnect(self, error: PortLost) -> None:
        """Wait for a port that went away. Raises PortLost when it does not come back."""
        self._port_losses += 1
        self._event("port_lost", str(error))
        self._decoder.break_off()
        if self._closing:
            raise error
        self.say(f"{self._transport.name} went away; waiting up to {self._timings.reconnect_s:g} s for it")
        self._transport.close()
        deadline = self._clock.now_ns() + round(self._timings.reconnect_s * 1e9)
        while self._clock.now_ns() < deadline:
            if self.stop_asked.is_set():
                raise Interrupted("stopped at your wish while the port was gone; the log is safe")
            try:
                self._transport.open()
            except PortMissing:
                self._clock.wait(self._timings.retry_open_s)
                continue
            self._event("port_back", f"{self._transport.name} is back")
            self.say(f"{self._transport.name} is back; going on")
            self._last_sample_ns = self._clock.now_ns()
            if self._streaming:
                self._restarted = True  # whatever it was: it needs the command to go on
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

    def _write(self, tag: int, data: bytes) -> bool:
        """To disk; whether it is there. While closing, a full disk no longer hinders: the device still has to be
        stopped. Behind a chunk that found no room nothing is written any more."""
        if self._disk_full:
            return False
        try:
            self._writer.write(tag, self._clock.now_ns(), data)
        except DiskFull as full:
            self._disk_full = True
            if not self._closing:
                raise
            return full.stored
        return True

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
            malformed=self._intake.malformed or None,
            malformed_samples=self._intake.malformed_samples or None,
            unknown_kinds=self._intake.unknown_kinds or None,
        )
        session.gaps = tracker.gaps[:_MAX_GAPS_LISTED]
        session.gaps_left_out = max(0, len(tracker.gaps) - _MAX_GAPS_LISTED)
        rate = self._measured_rate()
        if self.identity is not None and self.identity.interval_us:
            session.promised_rate_hz = round(1e6 / self.identity.interval_us, 6)
        if rate is not None:
            device_s = self._latest.time_s - self._first.time_s
            host_s = (self._latest_host_ns - self._first_host_ns) / 1e9
            session.measured_rate_hz = round(rate, 6)
            session.duration_s = round(device_s + self._restart_device_s, 6)
            # bytes come up to one read late, so a short recording says little about the clock
            if host_s > 4 * self._timings.poll_s / _RATE_TOLERANCE:
                session.device_clock_ratio = round(device_s / host_s, 6)
        session.warnings = list(_warnings(session))


def _source(identity: wire.StartRecord, port: str) -> str:
    """`instrument` or `emulator`: what says so itself, or sits on a pseudo-terminal, is no instrument."""
    says = f"{identity.firmware} {identity.serial_number}".lower()
    pretends = "emulat" in says or "simul" in says
    return "emulator" if pretends or os.path.realpath(port).startswith("/dev/pts/") else "instrument"


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
    if counts.malformed:
        yield f"{counts.malformed} frames came whole and make no sense; does the firmware fit docs/wire-formats.md?"
    if counts.unknown_kinds:
        yield f"{counts.unknown_kinds} frames are of a kind this version does not know; is the firmware a newer one?"
    if counts.device_skipped:
        yield f"the device itself skipped {counts.device_skipped} samples; ask for a lower rate"
    promised, measured = session.promised_rate_hz, session.measured_rate_hz
    if promised and measured and abs(measured / promised - 1) > _RATE_TOLERANCE:
        pace = "faster" if measured > promised else "slower"
        yield f"the device is {pace} than promised: {measured:.1f} instead of {promised:.1f} samples a second"
    if session.device_clock_ratio and abs(session.device_clock_ratio - 1) > _RATE_TOLERANCE:
        yield f"the device's clock runs at {session.device_clock_ratio:.3f} of the host's; one of them is off"


class LogWriter:
    """An open raw log.

    A ballast keeps 64 KiB of the disk in reserve: a file that is open and has no name any more, so that it is gone with
    this program, however that ends. When the disk runs full the ballast is given up, so that the chunk in hand and the
    session's metadata still find room; then DiskFull is raised.
    """

    def __init__(self, path: Path, durable: bool = True) -> None:
        """Creates the log. `durable` forces it to disk every second and at the end (a power cut loses no
        more than that). Raises FileExistsError: a recording is never overwritten."""
        self.path = path
        self.bytes_written = 0
        self.durable = durable
        self._synced_ns = 0
        self._ballast = -1
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        try:
            if durable:
                self._take_ballast()
            self._append(rawlog.MAGIC)
        except OSError as error:
            self.discard()
            raise self._full(error) from error

    def write(self, tag: int, host_ns: int, data: bytes) -> None:
        """Append a chunk. Raises DiskFull; the chunk is whole on disk if the ballast gave room for it."""
        packed, start = rawlog.pack_chunk(tag, host_ns, data), self.bytes_written
        try:
            self._append(packed)
            if self.durable and host_ns - self._synced_ns > 1_000_000_000:
                os.fdatasync(self._file)
                self._synced_ns = host_ns
        except OSError as error:
            if error.errno not in _FULL:
                raise
            self._drop_ballast()
            full = self._full(error)
            try:
                self._append(packed[self.bytes_written - start :])
                full.stored = True
            except OSError:  # not even the ballast's room was enough: the log ends in a cut chunk
                pass
            raise full from error

    def close(self) -> None:
        if self._file < 0:
            return
        if self.durable:
            os.fsync(self._file)
        os.close(self._file)
        self._file = -1
        self._drop_ballast()

    def discard(self) -> None:
        """Leave nothing behind: for a recording that never began."""
        self.durable = False
        self.close()
        self.path.unlink(missing_ok=True)

    def _take_ballast(self) -> None:
        try:
            # Never with a name, however early this program is killed.
            self._ballast = os.open(self.path.parent, os.O_WRONLY | os.O_TMPFILE, 0o600)
        except (AttributeError, OSError):  # not every system, nor every file system, has such files
            # A new file that nobody can have laid a link for.
            self._ballast, path = tempfile.mkstemp(".ballast", f"{self.path.name}.", self.path.parent)
            os.unlink(path)
        data = bytes(_BALLAST_BYTES)
        while data:
            data = data[os.write(self._ballast, data) :]

    def _drop_ballast(self) -> None:
        if self._ballast >= 0:
            os.close(self._ballast)
            self._ballast = -1

    def _append(self, data: bytes) -> None:
        while data:
            written = os.write(self._file, data)
            self.bytes_written += written
            data = data[written:]

    def _full(self, error: OSError) -> DiskFull:
        return DiskFull(
            f"{self.path}: cannot be written any more ({os.strerror(error.errno)}). "
            "What came before is safe. Free some space or use another disk (--out), then record again."
        )
