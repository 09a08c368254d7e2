"""The reference firmware: its protocol core on this computer, and the program for the UNO in a simulated one."""

import errno
import os
import shutil
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

from rotorid_acquire import procedures
from rotorid_acquire.io.logs import Log, read_log
from rotorid_acquire.io.session import Ended
from rotorid_acquire.io.wire import SINE, TRAPEZOID, VOLTS_PER_COUNT, Programme
from rotorid_acquire.recorder import Recorder, Timings
from rotorid_acquire.transport import AcquireError, Refused
from tests.acquire.conftest import QUICK, recorded
from tests.acquire.fault_table import seen
from tests.acquire.test_faults import assert_metadata_agree

FIRMWARE = Path(__file__).parents[2] / "firmware"
SIMAVR = Path("/usr/include/simavr/sim_avr.h")
needs_gcc = pytest.mark.skipif(not (shutil.which("gcc") and shutil.which("make")), reason="gcc")
needs_xtensa = pytest.mark.skipif(not shutil.which("xtensa-lx106-elf-gcc"), reason="gcc-xtensa-lx106 and picolibc")
needs_avr = pytest.mark.skipif(not (shutil.which("avr-gcc") and SIMAVR.exists()), reason="avr-gcc")


def slow(value):
    """One of the cases that `.ci/run` looks at and `make test` does not."""
    return pytest.param(value, marks=pytest.mark.slow)


def made(*targets: str) -> None:
    done = subprocess.run(["make", "-s", "-C", str(FIRMWARE), *targets], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def started(command: list[str]) -> subprocess.Popen:
    """Start a program that may have been linked a moment ago: some file systems still hold it as being written."""
    deadline = time.monotonic() + 5
    while True:
        try:
            return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        except OSError as error:
            if error.errno != errno.ETXTBSY or time.monotonic() > deadline:
                raise
        time.sleep(0.05)


@pytest.fixture
def run_program(tmp_path) -> Iterator[Callable[..., subprocess.Popen]]:
    """Start a program that makes a port; it is ready when this returns, and gone after the test."""
    with ExitStack() as stack:

        def start(*command: str | Path) -> subprocess.Popen:
            process = started([str(word) for word in command])
            stack.callback(lambda: (process.kill(), process.communicate()))
            while "ready" not in process.stdout.readline():
                assert process.poll() is None
            return process

        yield start


@pytest.fixture
def on_host(run_program, tmp_path) -> Callable[..., str]:
    def start(instrument: str, *more: Path) -> str:
        made("host")
        run_program(FIRMWARE / "build" / "host" / instrument, tmp_path / "tty", tmp_path / "boots", *more)
        return str(tmp_path / "tty")

    return start


@pytest.fixture
def on_avr(run_program, tmp_path) -> Callable[..., tuple[str, subprocess.Popen]]:
    def start(instrument: str = "bench", speed: float = 4) -> tuple[str, subprocess.Popen]:
        made("avr", "sim")
        elf = FIRMWARE / "build" / "avr" / f"{instrument}-simulated.elf"
        process = run_program(FIRMWARE / "build" / "run_avr", elf, tmp_path / "tty", speed)
        return str(tmp_path / "tty"), process

    return start


def put_by(recorder: Recorder, name: str) -> None:
    """Give log and metadata another name, so that the next recording may have theirs."""
    for path in (recorder.log_path, recorder.session_path):
        path.rename(path.with_stem(name))


def look_away(recorder: Recorder, after: int) -> None:
    """After so many rows the instrument hears nothing for a second; then on to the end."""
    for _ in recorder.rows(after):
        pass
    time.sleep(1.0)
    for _ in recorder.rows(500):
        pass


def assert_pattern(log: Log) -> None:
    """Cell k of scan n reads 1000 n + k − 1; a scan is missing only where the line lost a sample that was counted."""
    counts = np.rint(log.table[list(log.instrument.columns)].to_numpy() / VOLTS_PER_COUNT).astype(int)
    np.testing.assert_array_equal(counts % 1000, np.tile(np.arange(6), (len(counts), 1)))
    steps = [np.diff(counts[part.index, 0] // 1000) for _, part in log.table.groupby("segment")]
    assert min(step.min() for step in steps) == 1
    assert sum((step - 1).sum() for step in steps) <= log.missing


# ---- the protocol core on this computer -------------------------------------------------------------------


@needs_gcc
def test_core_under_sanitizers_takes_any_bytes():
    made("check", "FUZZ_S=2")


@needs_xtensa
def test_esp32_program_is_code_for_its_family_of_processors():
    """Debian's GCC for the ESP8266 takes every file of it without a word. It says nothing of a board."""
    shutil.rmtree(FIRMWARE / "build" / "xtensa", ignore_errors=True)
    made("esp32-xtensa")
    objects = sorted((FIRMWARE / "build" / "xtensa").glob("*.o"))
    assert [path.stem for path in objects] == ["device", "esp32", "frame", "quadrotor"]
    for path in objects:
        head = path.read_bytes()[:20]
        assert head[:4] == b"\x7fELF" and int.from_bytes(head[18:20], "little") == 94  # EM_XTENSA


@needs_gcc
def test_esp32_board_file_sends_each_frame_and_gives_the_pulses_of_its_programme(on_host, recorder_on, tmp_path):
    boots = []
    for name in ("a", "b"):
        recorder = recorder_on("quadrotor", on_host("esp32", tmp_path / "pulses"))
        programme = Programme(TRAPEZOID, (0.4, 0.2, 0.1, 0.3), 0.2, 0.4, 0.0)
        log = recorded(procedures.fly_programme, recorder, "h", programme)
        assert log.complete and log.end.reason == 1 and log.missing == 0 and log.session.source == "emulator"
        assert log.end.sent == len(log.table) > 50 and log.end.skipped == log.session.counts.device_skipped
        assert (log.start.instrument, log.start.serial_number) == ("quadrotor", "240AC4000102")
        np.testing.assert_allclose(log.table.battery_voltage_v, 16.0, atol=0.02)
        boots.append(log.start.boot_id)
        table = np.loadtxt(tmp_path / "pulses", dtype=int)[4:]  # four lines set the channels up
        zero_ms = 2**14 // 20  # steps in a millisecond of 50 pulses a second
        assert (table[:, 1:5].max(axis=0) == [zero_ms + zero_ms * share // 10 for share in (4, 2, 1, 3)]).all()
        assert (table[[0, -1], 1:5] == zero_ms).all()
        lamps = [int(pin) for pin in table[:, 5]]
        assert lamps[0] == lamps[-1] == 16 and {16, 17, 18} == set(lamps)  # red, yellow, green
        put_by(recorder, name)
        assert_metadata_agree(log)
    assert boots == [1, 2]


@needs_gcc
def test_esp32_board_file_takes_the_pulses_back_when_nobody_is_heard(on_host, recorder_on, tmp_path):
    port = on_host("esp32", tmp_path / "pulses")
    recorder = recorder_on("quadrotor", port, Timings(poll_s=0.02, reply_s=0.5, watchdog_s=0.3))
    with pytest.raises(AcquireError, match="heard nothing"), recorder:
        procedures.start_programme(recorder, "b", Programme(SINE, (0.4, 0.4, 0.4, 0.4), 0.0, 30.0, 1.0))
        look_away(recorder, 10)
    log = read_log(recorder.log_path)
    assert log.end.reason == 3 and log.session.ended == Ended.DEVICE_FAULT and log.table.throttle_1.max() > 0
    pulses = np.loadtxt(tmp_path / "pulses", dtype=int)
    assert (pulses[-1, 1:5] == 2**14 // 20).all() and pulses[:, 1].max() > 2**14 // 20


@needs_gcc
def test_host_bench_sends_every_sample_and_counts_its_boots(on_host, recorder_on, tmp_path):
    boots = []
    for name in ("a", "b"):
        recorder = recorder_on("bench", on_host("bench"))
        log = recorded(procedures.stream, recorder, 200, 0.004)
        assert log.missing == 0 and log.end.sent == len(log.table) >= 150 and log.session.source == "emulator"
        assert len(log.table) + log.end.skipped >= 200 or log.end.skipped == 0
        boots.append(log.start.boot_id)
        put_by(recorder, name)
        assert_metadata_agree(log)
    assert boots[1] == boots[0] + 1


@needs_gcc
def test_what_g_does(on_host, recorder_on):
    """While streaming: the same again is taken, another interval is not; without its four bytes never."""
    with recorder_on("bench", on_host("bench")) as recorder:
        with pytest.raises(Refused, match="G takes 4 bytes"):
            recorder.command("G")
        with pytest.raises(Refused, match="shorter than it can do"):
            recorder.start(0.001)
        recorder.start(0.02)
        recorder.command("G", (20_000).to_bytes(4, "little"))
        recorder.command("G", bytes(4))
        with pytest.raises(Refused, match="another interval is running; stop it first"):
            recorder.command("G", (40_000).to_bytes(4, "little"))
        with pytest.raises(Refused, match="no such command"):
            recorder.command("Z")
        for _ in recorder.rows(5):
            pass
    log = read_log(recorder.log_path)
    assert log.complete and log.end.sent == len(log.table)


@needs_gcc
def test_host_rotor_stops_when_nobody_is_heard(on_host, recorder_on):
    timings = Timings(poll_s=0.02, reply_s=0.5, watchdog_s=0.3)
    recorder = recorder_on("rotor", on_host("rotor"), timings)
    with pytest.raises(AcquireError, match="heard nothing"), recorder:
        with pytest.raises(Refused, match="watchdog"):
            recorder.command("T", bytes.fromhex("c4096009"))
        recorder.guard()
        recorder.start(resumable=False)
        recorder.command("T", bytes.fromhex("c4096009"))
        look_away(recorder, 25)  # half a second: it hears from us four times in 0.3 s
    log = read_log(recorder.log_path)
    assert log.end.reason == 3 and log.session.ended == Ended.DEVICE_FAULT
    turning = log.table.time_s[log.table.throttle > 0]
    assert 0.5 < turning.max() - turning.min() < 1.5 and len(turning) > 25


@needs_gcc
def test_host_rotor_and_quadrotor_by_the_usual_procedures(on_host, recorder_on, tmp_path):
    recorder = recorder_on("rotor", on_host("rotor"))
    log = recorded(procedures.thrust_test, recorder, 0.25, 0.2, 0.4)
    assert log.table.throttle.max() == pytest.approx(0.25) and log.table.throttle.iloc[-1] == 0 and log.complete
    for path in (recorder.log_path, recorder.session_path, tmp_path / "tty"):
        path.unlink()
    recorder = recorder_on("quadrotor", on_host("quadrotor"))
    log = recorded(procedures.fly_programme, recorder, "b", Programme(SINE, (0.4, 0.2, 0.2, 0.4), 0.0, 0.5, 2.0))
    assert log.table.throttle_1.max() == pytest.approx(0.4, abs=0.02) and log.table.throttle_1.iloc[-1] == 0
    assert log.end.reason == 1 and log.complete


# ---- the program for the UNO in a simulated one ---------------------------------------------------------------


@needs_avr
@pytest.mark.parametrize("rate_hz", [slow(10), 50, slow(100), 250])
def test_avr_every_sample_of_the_pattern(on_avr, recorder_on, rate_hz):
    recorder = recorder_on("bench", on_avr()[0])
    wanted = 15 + rate_hz // 3
    log = recorded(procedures.stream, recorder, wanted, 1 / rate_hz)
    assert_pattern(log)
    assert log.missing == 0 and log.end.sent == len(log.table) >= wanted
    # A byte on the simulated SPI takes about 0.1 ms, six channels 9.5 ms: only at 250 Hz is any skipped.
    assert (log.end.skipped > 0) == (rate_hz == 250)
    # what the device says it skipped is what its clock says: sent and skipped fill the time
    spanned = round(log.table.time_s.iloc[-1] * rate_hz) + 1
    assert abs(log.end.sent + log.end.skipped - spanned) <= 2
    assert log.end.skipped == log.session.counts.device_skipped
    assert_metadata_agree(log)


@needs_avr
def test_avr_an_interval_it_cannot_do_is_refused(on_avr, recorder_on):
    with pytest.raises(Refused, match="shorter than it can do"), recorder_on("bench", on_avr()[0]) as recorder:
        procedures.stream(recorder, 10, 0.003)


@needs_avr
@pytest.mark.parametrize("word", ["reset", slow("brownout")])
@seen("reset and brown-out of the simulated UNO in the midst of a recording")
def test_avr_reset_in_the_midst(on_avr, recorder_on, word):
    port, process = on_avr()
    recorder = recorder_on("bench", port, Timings(poll_s=0.02, reply_s=1.0, silence_s=1.0, reconnect_s=20))

    def hit(row) -> None:
        if recorder.progress == 30:
            process.stdin.write(f"{word}\n")
            process.stdin.flush()

    recorder.on_row = hit
    log = recorded(procedures.stream, recorder, 80, 0.01)
    assert log.resets == 1 and log.session.ended == Ended.FINISHED
    assert (log.table.segment == 0).sum() >= 30 and (log.table.segment == 1).sum() >= 10
    assert_pattern(log)
    assert_metadata_agree(log)


@needs_avr
@pytest.mark.slow
@seen("the computer looks away for a second, the simulated UNO sends on")
def test_avr_and_host_starved_of_time(on_avr, recorder_on):
    """The computer looks away for a second: the port's buffers hold what they can, and every loss is counted."""
    port, process = on_avr(speed=1)
    recorder = recorder_on("bench", port, QUICK)

    def starve(row) -> None:
        if recorder.progress == 30:
            time.sleep(0.7)
            os.kill(process.pid, signal.SIGSTOP)
            time.sleep(0.3)
            os.kill(process.pid, signal.SIGCONT)

    recorder.on_row = starve
    log = recorded(procedures.stream, recorder, 120, 0.01)
    assert log.end.sent == len(log.table) + log.missing and log.resets == 0
    assert_pattern(log)
    assert_metadata_agree(log)


@needs_avr
def test_avr_thrust_tester(on_avr, recorder_on):
    recorder = recorder_on("rotor", on_avr("rotor")[0])
    log = recorded(procedures.thrust_test, recorder, 0.25, 0.2, 0.5)
    assert log.complete and log.table.throttle.max() == pytest.approx(0.25) and log.table.throttle.iloc[-1] == 0
