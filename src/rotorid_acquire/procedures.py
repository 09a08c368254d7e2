"""What a recorder does with an instrument, step by step. Each procedure takes open recorders.

Time in here is the device's: a procedure counts samples, so it is the same at any speed of the host.

Recording from Python, by the same way that the command line goes:

    from rotorid_acquire.procedures import record, stream

    record({"bench": "/dev/ttyACM0"}, lambda bench: stream(bench, 500), Path("raw/local"), "first")
"""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path

from rotorid_acquire.io import wire
from rotorid_acquire.io.session import Ended, Session, Setup
from rotorid_acquire.io.wire import INSTRUMENTS, Experiment
from rotorid_acquire.recorder import Recorder, Row, Timings
from rotorid_acquire.transport import AcquireError, SerialTransport, SystemClock

RAMP_S = 3.0
HOLD_S = 8.0
_PERIODS = 5
_LETTERS = {"Hover": "h", "Bounce": "b", "Roll": "r", "Pitch": "p", "Yaw": "y"}

_SETTLING_SAMPLES = 10  # fig. 2.35: voltage spikes dissipate
_TARE_SAMPLES = 25

Prompt = Callable[[str], Callable[[], bool]]
"""Asks a person for something and returns a function that says whether it is done, asked once per sample."""


@dataclass(frozen=True)
class SteadyRule:
    """When a reading counts as steady: low-pass cutoff, samples, and span in the channel's unit."""

    cutoff_hz: float = 1.5
    window: int = 25
    tolerance: float = 2e-7


WAIT_S = 600.0  # device time that a weight, or a steady reading, is waited for
BENCH_TESTS = ("calibrate", "static", "dynamic")
STEADY_JR3 = SteadyRule(cutoff_hz=0.5, tolerance=0.5)  # in N: the reference sensor is noisy


def countdown(samples: int) -> Callable[[], bool]:
    """Done after so many samples *handed over*, not received: a busy host receives seconds of them at once, and
    would count a weight as put down while the procedure still looks at samples from before."""
    left = samples

    def done() -> bool:
        nonlocal left
        left -= 1
        return left <= 0

    return done


def stream(recorder: Recorder, samples: int | None, interval_s: float = 0.0, moves: bool = False) -> None:
    """Record `samples` samples, or until interrupted. An instrument that `moves` something as long as it streams
    has its watchdog on, and a restart makes the run void."""
    if moves:
        recorder.guard()
        recorder.ends_by_itself = True
    recorder.start(interval_s, resumable=not moves)
    recorder.phase = "recording"
    for _ in recorder.rows(samples):
        pass
    recorder.stop()


def calibrate_cell(recorder: Recorder, prompt: Prompt, samples: int = 400, weight_at: int = 50) -> None:
    """Thesis fig. 2.34: so many samples, the weight put on shortly after sample 50."""
    recorder.start()
    recorder.phase = "no load"
    for number, row in enumerate(recorder.rows(samples)):
        if number == weight_at:
            prompt("put the weight on now")
            recorder.mark("load", row)
            recorder.phase = "loaded"
    recorder.stop()


def static_test(
    recorder: Recorder,
    prompt: Prompt,
    samples: int = 50,
    rule: SteadyRule = SteadyRule(),  # noqa: B008
    wait_s: float = WAIT_S,
) -> None:
    """Thesis fig. 2.35: settle, wait until steady, tare, load, wait until steady, read. Raises AcquireError where the
    load or a steady reading takes longer than `wait_s` of device time."""
    recorder.start()
    _tare(recorder, rule, wait_s)
    recorder.phase = "put the load on"
    done = prompt("put the load on")
    for count, row in enumerate(recorder.rows()):  # noqa: B007 - the last row is marked
        if done():
            break
        if count * recorder.instrument.interval_us > wait_s * 1e6:
            text = f"no load within {wait_s:g} s (--wait-s); the device is stopped, the log has what came before"
            raise AcquireError(text, Ended.GAVE_UP)
    recorder.mark("load", row)
    _wait_until_steady(recorder, rule, "load_steady", wait_s)
    recorder.phase = "reading"
    _mark_ends(recorder, samples, "read_start", "read_stop")
    recorder.stop()


def dynamic_test(
    recorder: Recorder,
    prompt: Prompt,
    samples: int = 1500,
    rule: SteadyRule = SteadyRule(),  # noqa: B008
    wait_s: float = WAIT_S,
) -> None:
    """Settle, wait until steady, tare, then record the vehicle's manoeuvre. Raises as `static_test`."""
    recorder.start()
    _tare(recorder, rule, wait_s)
    recorder.phase = "reading"
    prompt("fly the manoeuvre now")
    _mark_ends(recorder, samples, "read_start", "read_stop")
    recorder.stop()


def bench_test(
    recorder: Recorder, test: str, prompt: Prompt, samples: int | None, tolerance: float | None, wait_s: float
) -> None:
    """Carry out one of `BENCH_TESTS`; what is None is the test's, or the instrument's, own."""
    more = {} if samples is None else {"samples": samples}
    if test == "calibrate":
        calibrate_cell(recorder, prompt, **more)
        return
    rule = STEADY_JR3 if recorder.instrument.name == "jr3" else SteadyRule()
    if tolerance is not None:
        rule = replace(rule, tolerance=tolerance)
    (static_test if test == "static" else dynamic_test)(recorder, prompt, rule=rule, wait_s=wait_s, **more)


def thrust_test(recorder: Recorder, throttle: float, rest_s: float, hold_s: float) -> None:
    """Rest, throttle on, rest. A device that restarts makes the run void."""
    recorder.guard()
    recorder.start(resumable=False)
    rate_hz = 1e6 / recorder.instrument.interval_us
    _rest(recorder, rest_s, rate_hz)
    _throttle(recorder, throttle, hold_s)
    recorder.phase = f"throttle {throttle:.0%}"
    _mark_ends(recorder, round(hold_s * rate_hz), "on", "off")
    _throttle(recorder, 0.0, 0.0)
    _rest(recorder, rest_s, rate_hz)
    recorder.stop()


def measure_wrench(
    recorder: Recorder,
    interval_s: float,
    restart_times: int = 0,
    measuring_times: int = 0,
    offset: bool = False,
    samples: int | None = None,
) -> None:
    """Power on, initialise, offset if wanted, start, read, stop, power off."""
    recorder.phase = "initialising"
    arguments = wire.pack_initialise(interval_s, restart_times, measuring_times)
    recorder.command(wire.POWER, b"\1")
    recorder.command(wire.INITIALISE, arguments)
    if offset:
        recorder.command(wire.OFFSET)
        recorder.start(interval_s, resumable=False)  # the zero is lost with the power
    else:
        _start_wrench(recorder, interval_s, arguments)
    recorder.ends_by_itself = measuring_times > 0
    recorder.phase = "measuring"
    for _ in recorder.rows(samples):
        pass
    recorder.stop()
    recorder.command(wire.POWER, b"\0")


def _start_wrench(recorder: Recorder, interval_s: float, initialise: bytes | None = None) -> None:
    """Power on, initialise and start, and all of it again should the sensor restart."""
    arguments = initialise or wire.pack_initialise(interval_s, 0, 0)

    def begin() -> None:
        recorder.command(wire.POWER, b"\1")
        recorder.command(wire.INITIALISE, arguments)
        recorder.start(interval_s)

    recorder.resume = begin
    begin()


def fly_programme(recorder: Recorder, letter: str, programme: wire.Programme) -> None:
    """Command character and programme; the vehicle streams until the programme is over."""
    start_programme(recorder, letter, programme)
    for _ in recorder.rows():
        pass


def start_programme(recorder: Recorder, letter: str, programme: wire.Programme) -> None:
    """Send the programme and expect the stream. A vehicle that restarts makes the run void."""
    recorder.guard()
    recorder.command(letter, programme.pack())
    recorder.begin_stream()
    recorder.resume = None
    recorder.ends_by_itself = True
    recorder.phase = wire.DYNAMICS[letter]
    recorder.wanted = round((programme.duration_s + 0.5) * 1e6 / recorder.instrument.interval_us)


def experiment(
    vehicle: Recorder,
    sensor: Recorder,
    letter: str,
    programme: wire.Programme,
    rest_s: float = 2.0,
    interval_s: float = 0.01,
) -> None:
    """Quadrotor and wrench together, each with its own clock: rest, programme, rest."""
    vehicle.guard()
    _start_wrench(sensor, interval_s)
    _together(sensor, rest_s / interval_s, vehicle)
    start_programme(vehicle, letter, programme)
    sensor.phase = vehicle.phase
    while not vehicle.over:
        vehicle.pump()
        sensor.pump()
        vehicle.drop_rows()
        sensor.drop_rows()
    _together(sensor, rest_s / interval_s)
    sensor.stop()
    sensor.command(wire.POWER, b"\0")


def torque_test(
    tester: Recorder, sensor: Recorder, throttle: float, rest_s: float, hold_s: float, interval_s: float = 0.01
) -> None:
    """Motor 1 of the vehicle on the wrench sensor, driven and counted by the thrust tester."""
    tester.guard()
    _start_wrench(sensor, interval_s)
    tester.start(resumable=False)
    _together(sensor, rest_s / interval_s, tester)
    _throttle(tester, throttle, hold_s)
    tester.phase = f"throttle {throttle:.0%}"
    _together(sensor, hold_s / interval_s, tester)
    _throttle(tester, 0.0, 0.0)
    _together(sensor, rest_s / interval_s, tester)
    tester.stop()
    sensor.stop()
    sensor.command(wire.POWER, b"\0")


# ---- steps ---------------------------------------------------------------------------------------------


def _tare(recorder: Recorder, rule: SteadyRule, wait_s: float) -> None:
    recorder.phase = "settling"
    for row in recorder.rows(_SETTLING_SAMPLES):
        last = row
    recorder.mark("settled", last)
    _wait_until_steady(recorder, rule, "steady", wait_s)
    recorder.phase = "taring"
    sums = [0.0] * len(recorder.instrument.channels)
    for count, row in enumerate(recorder.rows(_TARE_SAMPLES), start=1):
        if count == 1:
            recorder.mark("tare_start", row)
        sums = [total + value for total, value in zip(sums, row.values, strict=True)]
    recorder.mark("tare_stop", row)
    means = (total / count for total in sums)
    recorder.session.tare = dict(zip(recorder.instrument.columns, means, strict=True))


def _wait_until_steady(recorder: Recorder, rule: SteadyRule, mark: str, wait_s: float) -> None:
    recorder.phase = "waiting until steady"
    steadiness = Steadiness(rule, recorder.instrument.interval_us * 1e-6)
    for count, row in enumerate(recorder.rows()):
        if steadiness.update(row.values):
            recorder.mark(mark, row)
            return
        if count * recorder.instrument.interval_us > wait_s * 1e6:
            spans = steadiness.spans()
            worst = max(range(len(spans)), key=spans.__getitem__)
            raise AcquireError(
                f"not steady within {wait_s:g} s (--wait-s): {recorder.instrument.columns[worst]} still moves by "
                f"{spans[worst]:.3g} over {rule.window} samples, {rule.tolerance:.3g} is allowed (--tolerance)",
                Ended.GAVE_UP,
            )


def _mark_ends(recorder: Recorder, samples: int, first: str, last: str) -> None:
    row: Row | None = None
    for number, row in enumerate(recorder.rows(samples)):
        if not number:
            recorder.mark(first, row)
    if row is not None:
        recorder.mark(last, row)


def _rest(recorder: Recorder, rest_s: float, rate_hz: float) -> None:
    recorder.phase = "at rest"
    for _ in recorder.rows(round(rest_s * rate_hz)):
        pass


def _throttle(recorder: Recorder, throttle: float, hold_s: float) -> None:
    # the tester's own limit lies a little later, for the case that we are gone by then
    recorder.command(wire.THROTTLE, wire.pack_throttle(throttle, hold_s + 0.5 if hold_s else 0.0))


def _together(leader: Recorder, samples: float, *others: Recorder) -> None:
    """Pump all of them until the leader has so many samples more."""
    goal = leader.progress + round(samples)
    while leader.progress < goal:
        leader.pump()
        for other in others:
            other.pump()
            other.drop_rows()
        leader.drop_rows()


class Steadiness:
    """Steady: over the last samples of a window no channel's low-passed value spans more than is tolerated.

    The low-pass is of first order, y += α (x − y) with α = 1 − exp(−2π f_c Δt); the first sample passes unchanged.
    """

    def __init__(self, rule: SteadyRule, interval_s: float) -> None:
        self._alpha = 1 - math.exp(-2 * math.pi * rule.cutoff_hz * interval_s)
        self._tolerance = rule.tolerance
        self._last: deque[list[float]] = deque(maxlen=rule.window)

    def update(self, values: tuple[float, ...]) -> bool:
        """Take one more sample; True once the window is full and steady."""
        before = self._last[-1] if self._last else values
        self._last.append([y + self._alpha * (x - y) for y, x in zip(before, values, strict=True)])
        return len(self._last) == self._last.maxlen and all(span <= self._tolerance for span in self.spans())

    def spans(self) -> list[float]:
        """What each channel spans over the window so far."""
        return [max(channel) - min(channel) for channel in zip(*self._last, strict=True)]


def programme_of(experiment: Experiment) -> tuple[str, wire.Programme]:
    """Command character and programme."""
    letter = _LETTERS.get(experiment.dynamics.split()[0], "t")
    if experiment.signal == "sine":
        duration_s = _PERIODS / experiment.frequency_hz
        return letter, wire.Programme(wire.SINE, experiment.maxima, 0.0, duration_s, experiment.frequency_hz)
    return letter, wire.Programme(wire.TRAPEZOID, experiment.maxima, RAMP_S, HOLD_S, 0.0)


def recorders_for(
    ports: Mapping[str, str],
    out: Path,
    name: str | None = None,
    setups: Mapping[str, Setup] | None = None,
    *,
    procedure: dict | None = None,
    limits: Mapping[str, tuple[float, float]] | None = None,
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
