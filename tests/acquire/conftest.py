"""Emulated instruments on real pseudo-terminals, and recorders that do not wait long."""

import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from datetime import UTC, datetime
from pathlib import Path

import pytest

from rotorid_acquire.emulators.devices import Faults
from rotorid_acquire.emulators.ports import EmulatedPorts, build
from rotorid_acquire.emulators.truth import Truth
from rotorid_acquire.io.logs import Log, read_log
from rotorid_acquire.io.wire import INSTRUMENTS
from rotorid_acquire.recorder import Recorder, Timings
from rotorid_acquire.transport import LoopbackTransport, SerialTransport, SystemClock, VirtualClock

ACQUIRE = (sys.executable, "-m", "rotorid_acquire")
QUICK = Timings(poll_s=0.02, reply_s=0.5, tries=3, silence_s=2.0, retry_open_s=0.002, reconnect_s=5.0)


def recorded(procedure: Callable, recorder: Recorder, *arguments, **options) -> Log:
    """Record by a procedure, and read back what is on disk."""
    with recorder:
        procedure(recorder, *arguments, **options)
    return read_log(recorder.log_path)


@pytest.fixture
def plugged(tmp_path: Path) -> Iterator[Callable[..., EmulatedPorts]]:
    """Plug an emulator in: `plugged("bench", Faults(...))` gives running ports with stable names."""
    with ExitStack() as stack:

        def plug(what: str, faults: Faults | None = None, truth: Truth | None = None, **options) -> EmulatedPorts:
            world = build(what, truth or Truth(), faults=faults)
            links = [tmp_path / f"tty{line.device.instrument.name}" for line in world.lines]
            return stack.enter_context(EmulatedPorts(world, links, **options))

        yield plug


@pytest.fixture
def recorder_on(tmp_path: Path) -> Callable[..., Recorder]:
    """A recorder for a port, as the command line makes it, but without waiting for more bytes."""

    def make(instrument: str, port: str, timings: Timings = QUICK, **options) -> Recorder:
        known = INSTRUMENTS[instrument]
        transport = SerialTransport(port, known.baud_rate, gather_s=0)
        return Recorder(known, transport, SystemClock(), tmp_path, "run", timings=timings, **options)

    return make


@pytest.fixture
def loopback(tmp_path: Path) -> Callable[..., tuple]:
    """A world, and recorders on it, on a virtual clock."""

    def make(
        what: str,
        faults: Faults | None = None,
        truth: Truth | None = None,
        timings: Timings = Timings(),  # noqa: B008
        **options,
    ) -> tuple:
        world = build(what, truth or Truth(), faults=faults, **options)
        clock = VirtualClock(datetime(2024, 3, 4, 15, tzinfo=UTC))
        clock.follow(world.run_until)
        recorders = [
            Recorder(known, LoopbackTransport(line, clock), clock, tmp_path, f"run-{known.name}", timings=timings,
                     durable=False)
            for line in world.lines if (known := line.device.instrument)
        ]  # fmt: skip
        return world, *recorders

    return make
