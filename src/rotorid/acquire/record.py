"""Recording from Python, by the same way that the command line goes.

from rotorid.acquire import procedures
from rotorid.acquire.record import record

record({"bench": "/dev/ttyACM0"}, lambda bench: procedures.stream(bench, 500), Path("raw/local"), "first")
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from datetime import datetime
from pathlib import Path

from rotorid.acquire.clock import SystemClock
from rotorid.acquire.recorder import Recorder, Timings
from rotorid.acquire.transport import SerialTransport
from rotorid.io.session import Session, Setup
from rotorid.io.wire import INSTRUMENTS

_Limits = Mapping[str, tuple[float, float]]


def recorders_for(
    ports: Mapping[str, str],
    out: Path,
    name: str | None = None,
    setups: Mapping[str, Setup] | None = None,
    *,
    procedure: dict | None = None,
    limits: _Limits | None = None,
    say: Callable[[str], None] = lambda text: None,
    stop_asked: threading.Event | None = None,
    source: str | None = None,
    timings: Timings | None = None,
) -> list[Recorder]:
    """A recorder for each instrument of `ports` (name: serial port), none of them open yet.

    One instrument is recorded as `name`, several as `name-instrument`; without a name it is instruments and time.
    Raises AcquireError for a name that is none, or that a recording in `out` has already.
    """
    stem = name or f"{'-'.join(ports)}-{datetime.now():%Y%m%d-%H%M%S}"
    recorders = [
        Recorder(
            INSTRUMENTS[instrument],
            SerialTransport(port, INSTRUMENTS[instrument].baud_rate),
            SystemClock(),
            out,
            stem if len(ports) == 1 else f"{stem}-{instrument}",
            (setups or {}).get(instrument),
            group=stem,
            procedure=procedure,
            say=say,
            stop_asked=stop_asked,
            source=source,
            limits=limits,
            timings=timings,
        )
        for instrument, port in ports.items()
    ]
    for recorder in recorders:  # all of them before the first one leaves a log
        recorder.check_name()
    return recorders


def run_with(recorders: list[Recorder], run: Callable[..., None]) -> None:
    """Open all recorders, hand them to `run`, close them however it ends. Raises AcquireError."""
    with ExitStack() as stack:
        run(*(stack.enter_context(recorder) for recorder in recorders))


def record(
    ports: Mapping[str, str],
    run: Callable[..., None],
    out: Path,
    name: str | None = None,
    setups: Mapping[str, Setup] | None = None,
    **options,
) -> list[Session]:
    """Record `run` (called with one open recorder for each port, in order) and return the metadata.

    `options` are those of `recorders_for`. Raises AcquireError; what came before it is in the log.
    """
    recorders = recorders_for(ports, out, name, setups, **options)
    run_with(recorders, run)
    return [recorder.session for recorder in recorders]
