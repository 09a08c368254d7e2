"""The reference firmware: its protocol core on this computer, and the program for the UNO in a simulated one."""

from __future__ import annotations

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

from rotorid.acquire import procedures
from rotorid.acquire.errors import DeviceFault, Refused
from rotorid.acquire.recorder import Timings
from rotorid.io.logs import Log, read_log
from rotorid.io.session import Ended
from rotorid.io.wire.bench import VOLTS_PER_COUNT
from rotorid.io.wire.quadrotor import SINE, Programme
from tests.acquire.conftest import QUICK
from tests.acquire.test_faults import assert_metadata_agree

FIRMWARE = Path(__file__).parents[2] / "firmware"
SIMAVR = Path("/usr/include/simavr/sim_avr.h")
needs_gcc = pytest.mark.skipif(not (shutil.which("gcc") and shutil.which("make")), reason="gcc")
needs_avr = pytest.mark.skipif(not (shutil.which("avr-gcc") and SIMAVR.exists()), reason="avr-gcc")
pytestmark = pytest.mark.xdist_group("firmware")  # one build at a time


def slow(value):
    """One of the cases that `.ci/run` looks at and `make test` does not."""
    return pytest.param(value, marks=pytest.mark.slow)


def made(*targets: str) -> None:
    done = subprocess.run(["make", "-s", "-C", str(FIRMWARE), *targets], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


@pytest.fixture
def run_program(tmp_path) -> Iterator[Callable[..., subprocess.Popen]]:
    """Start a program that makes a port; it is ready when this returns, and gone after the test."""
    with ExitStack() as stack:

        def start(*command: str | Path) -> subprocess.Popen:
            process = subprocess.Popen(
                [str(word) for word in command], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
            )
            stack.callback(lambda: (process.kill(), process.communicate()))
            while "ready" not in process.stdout.readline():
                assert process.poll() is None
            return process

        yield start


@pytest.fixture
def on_host(run_program, tmp_path) -> Callable[[str], str]:
    def start(instrument: str) -> str:
        made("host")
        run_program(FIRMWARE / "build" / "host" / instrument, tmp_path / "tty", tmp_path / "boots")
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


def assert_pattern(log: Log, whole: bool = True) -> None:
    """Cell k of scan n reads 1000 n + k − 1; no scan is missing, unless the line lost one."""
    counts = np.rint(log.table[list(log.instrument.columns)].to_numpy() / VOLTS_PER_COUNT).astype(int)
    np.testing.assert_array_equal(counts % 1000, np.tile(np.arange(6), (len(counts), 1)))
    for _, part in log.table.groupby("segment"):
        scans = counts[part.index, 0] // 1000
        np.testing.assert_array_equal(np.diff(scans), 1)
        if whole:
            np.testing.assert_array_equal(np.diff(part["index"]), 1)


# ---- the protocol core on this computer -------------------------------------------------------------------


@needs_gcc
def test_core_under_sanitizers_takes_any_bytes():
    made("check", "FUZZ_S=2")


@needs_gcc
def test_host_bench_sends_every_sample_and_counts_its_boots(on_host, recorder_on, tmp_path):
    boots = []
    for name in ("a", "b"):
        recorder = recorder_on("bench", on_host("bench"))
        with recorder:
            procedures.stream(recorder, 200, 0.004)
        log = read_log(recorder.log_path)
        assert log.missing == 0 and log.end.sent == len(log.table) >= 150 and log.session.source == "emulator"
        assert len(log.table) + log.end.skipped >= 200 or log.end.skipped == 0
        boots.append(log.start.boot_id)
        for path in (recorder.log_path, recorder.session_path):
            path.rename(path.with_stem(name))
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
    with pytest.raises(DeviceFault, match="heard nothing"):
        with recorder:
            with pytest.raises(Refused, match="watchdog"):
                recorder.command("T", bytes.fromhex("c4096009"))
            recorder.guard()
            recorder.start(resumable=False)
            recorder.command("T", bytes.fromhex("c4096009"))
            for _ in recorder.rows(25):  # half a second: it hears from us four times in 0.3 s
                pass
            time.sleep(1.0)
            for _ in recorder.rows(500):
                pass
    log = read_log(recorder.log_path)
    assert log.end.reason == 3 and log.session.ended == Ended.DEVICE_FAULT
    turning = log.table.time_s[log.table.throttle > 0]
    assert 0.5 < turning.max() - turning.min() < 1.5 and len(turning) > 25


@needs_gcc
def test_host_rotor_and_quadrotor_by_the_usual_procedures(on_host, recorder_on, tmp_path):
    recorder = recorder_on("rotor", on_host("rotor"))
    with recorder:
        procedures.thrust_test(recorder, 0.25, 0.2, 0.4)
    log = read_log(recorder.log_path)
    assert log.table.throttle.max() == pytest.approx(0.25) and log.table.throttle.iloc[-1] == 0 and log.complete
    for path in (recorder.log_path, recorder.session_path, tmp_path / "tty"):
        path.unlink()
    recorder = recorder_on("quadrotor", on_host("quadrotor"))
    with recorder:
        procedures.fly_programme(recorder, "b", Programme(SINE, (0.4, 0.2, 0.2, 0.4), 0.0, 0.5, 2.0))
    log = read_log(recorder.log_path)
    assert log.table.throttle_1.max() == pytest.approx(0.4, abs=0.02) and log.table.throttle_1.iloc[-1] == 0
    assert log.end.reason == 1 and log.complete


# ---- the program for the UNO in a simulated one ---------------------------------------------------------------


@needs_avr
@pytest.mark.parametrize("rate_hz", [slow(10), 50, slow(100), 250])
def test_avr_every_sample_of_the_pattern(on_avr, recorder_on, rate_hz):
    recorder = recorder_on("bench", on_avr()[0])
    wanted = 15 + rate_hz // 3
    with recorder:
        procedures.stream(recorder, wanted, 1 / rate_hz)
    log = read_log(recorder.log_path)
    assert_pattern(log)
    assert log.missing == 0 and log.end.sent == len(log.table) >= wanted
    # what the device says it skipped is what its clock says: sent and skipped fill the time
    spanned = round(log.table.time_s.iloc[-1] * rate_hz) + 1
    assert abs(log.end.sent + log.end.skipped - spanned) <= 2
    assert log.end.skipped == log.session.counts.device_skipped
    assert_metadata_agree(log)


@needs_avr
def test_avr_an_interval_it_cannot_do_is_refused(on_avr, recorder_on):
    with pytest.raises(Refused, match="shorter than it can do"):
        with recorder_on("bench", on_avr()[0]) as recorder:
            procedures.stream(recorder, 10, 0.003)


@needs_avr
@pytest.mark.parametrize("word", ["reset", slow("brownout")])
def test_avr_reset_in_the_midst(on_avr, recorder_on, word):
    port, process = on_avr()
    recorder = recorder_on("bench", port, Timings(poll_s=0.02, reply_s=1.0, silence_s=1.0, reconnect_s=20))

    def hit(row) -> None:
        if recorder.progress == 30:
            process.stdin.write(f"{word}\n")
            process.stdin.flush()

    recorder.on_row = hit
    with recorder:
        procedures.stream(recorder, 80, 0.01)
    log = read_log(recorder.log_path)
    assert log.resets == 1 and log.session.ended == Ended.FINISHED
    assert (log.table.segment == 0).sum() >= 30 and (log.table.segment == 1).sum() >= 10
    assert_pattern(log)
    assert_metadata_agree(log)


@needs_avr
@pytest.mark.slow
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
    with recorder:
        procedures.stream(recorder, 120, 0.01)
    log = read_log(recorder.log_path)
    assert log.end.sent == len(log.table) + log.missing and log.resets == 0
    assert_pattern(log, whole=log.missing == 0)
    assert_metadata_agree(log)


@needs_avr
def test_avr_thrust_tester(on_avr, recorder_on):
    recorder = recorder_on("rotor", on_avr("rotor")[0])
    with recorder:
        procedures.thrust_test(recorder, 0.25, 0.2, 0.5)
    log = read_log(recorder.log_path)
    assert log.complete and log.table.throttle.max() == pytest.approx(0.25) and log.table.throttle.iloc[-1] == 0
