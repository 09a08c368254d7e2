"""Records an instrument that sends plain lines of text. The bytes are kept as they come."""

from __future__ import annotations

import json
import threading
from collections.abc import Callable
from contextlib import suppress
from hashlib import file_digest
from pathlib import Path

from rotorid.acquire.recorder import Recorder
from rotorid.acquire.transport import AcquireError, Clock, DeviceSilent, Interrupted, Transport
from rotorid.io import rawlog, wire
from rotorid.io.lines import Description, LineDecoder
from rotorid.io.session import Counts, Ended, Session, Setup, write_session

_SILENCE_S = 60.0


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
) -> Session:
    """Record `samples` lines, or until `stop_asked`. Returns the metadata; raises AcquireError, and then, too, log and
    metadata are there."""
    instrument = wire.Instrument(description.name, description.name, description.baud_rate, 0, (), {})
    procedure = {"name": "lines", "description": description.model_dump(mode="json", exclude_none=True)}
    holder = Recorder(instrument, transport, clock, folder, name, setup, procedure=procedure)  # names, folder, log
    holder.check_name()
    transport.open()
    decoder, received, failure = LineDecoder(description), 0, None
    session = holder.session
    session.source = "instrument"
    try:
        holder._create()
        holder._note("begin", id=session.id, description=json.loads(description.model_dump_json(exclude_none=True)))
        if description.begin:
            holder._write(rawlog.SENT, description.begin.encode())
            transport.write(description.begin.encode())
        last_ns = clock.now_ns()
        while samples is None or decoder.lines < samples:
            if stop_asked is not None and stop_asked.is_set():
                raise Interrupted("stopped at your wish; everything received until then is in the log")
            data = transport.read(0.1)
            if data:
                last_ns = clock.now_ns()
                holder._write(rawlog.RECEIVED, data)
                received += len(data)
                for values in decoder.feed(data):
                    on_row(values)
            elif clock.now_ns() - last_ns > silence_s * 1e9:
                raise DeviceSilent(f"{transport.name}: no byte for {silence_s:g} s; what came before is in the log")
    except AcquireError as error:
        failure = error
        raise
    finally:
        if holder.begun and description.end:  # whatever the end was, the instrument is stopped
            with suppress(AcquireError):
                transport.write(description.end.encode())
                holder._write(rawlog.SENT, description.end.encode())
        transport.close()
        if holder.begun:
            holder._writer.close()
            session.ended = failure.ended if failure else Ended.FINISHED
            session.message = str(failure) if failure else "all that was asked for is there"
            session.counts = Counts(bytes_received=received, samples=decoder.lines, broken_frames=decoder.unreadable)
            if decoder.unreadable:
                session.warnings = [
                    f"{decoder.unreadable} lines could not be read, the last of them {decoder.unread!r}"
                ]
            with open(holder.log_path, "rb") as log:
                session.log_sha256 = file_digest(log, "sha256").hexdigest()
            write_session(session, holder.session_path)
    return session
