"""Everything that goes wrong on a serial line, through real pseudo-terminals."""

import os
import resource
import signal
import subprocess
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from rotorid_acquire import procedures
from rotorid_acquire import transport as t
from rotorid_acquire.emulators.devices import Faults
from rotorid_acquire.io import wire
from rotorid_acquire.io.frames import Quality
from rotorid_acquire.io.logs import Log, read_log
from rotorid_acquire.io.rawlog import read_raw
from rotorid_acquire.io.session import Ended, read_session
from rotorid_acquire.io.wire import TRAPEZOID, Programme
from rotorid_acquire.transport import AcquireError, Refused, SerialTransport
from tests.acquire.conftest import ACQUIRE, QUICK, recorded
from tests.acquire.fault_table import seen

SAMPLES = 300


def record(recorder, samples=SAMPLES, interval_s=0.0):
    return recorded(procedures.stream, recorder, samples, interval_s)


def frame_numbers(log):
    """Which of the device's data frames are in the table (all other frames come before the first)."""
    return (log.table["index"] - log.table["index"].iloc[0]).to_numpy()


def assert_metadata_agree(log):
    """The recorder's live account and the parser's later one are the same."""
    counts = log.session.counts
    assert counts.samples == len(log.table) and counts.missing == log.missing
    assert counts.repeated == log.repeated and counts.resets == log.resets
    assert (counts.checksum_errors, counts.broken_frames) == (log.checksum_errors, log.broken_frames)
    assert [(g.segment, g.first_index, g.count) for g in log.session.gaps] == [
        (g.segment, g.first_index, g.count) for g in log.gaps
    ]


@seen("a good line loses nothing")
def test_a_good_line_loses_nothing(plugged, recorder_on):
    log = record(recorder_on("bench", plugged("bench").names[0]))
    assert log.complete and log.end.sent == len(log.table) >= SAMPLES
    assert (log.table.quality == 0).all()
    np.testing.assert_allclose(np.diff(log.table.time_s), 0.02, atol=2e-6)
    assert log.session.ended == Ended.FINISHED and log.session.warnings == []
    assert_metadata_agree(log)


@seen("port missing")
def test_port_missing(recorder_on, tmp_path):
    with pytest.raises(t.PortMissing, match="no such port.*rotorid-acquire ports"):
        with recorder_on("bench", str(tmp_path / "nothing")):
            pass
    assert list(tmp_path.iterdir()) == []


@seen("port busy")
def test_port_busy(plugged, recorder_on, tmp_path):
    port = plugged("bench").names[0]
    other = SerialTransport(port, 115200)
    other.open()
    with pytest.raises(t.PortMissing, match="another program holds this port"), recorder_on("bench", port):
        pass
    other.close()
    assert record(recorder_on("bench", port)).complete


def pull_at(ports, recorder, samples):
    """Pull the plug, once, as soon as the recorder has seen so many samples."""

    def watch(row):
        if recorder.progress == samples:
            ports.pull()

    recorder.on_row = watch


@seen("port vanishes and comes back")
def test_port_vanishes_and_comes_back(plugged, recorder_on):
    ports = plugged("bench", replug_after_s=0.02)
    recorder = recorder_on("bench", ports.names[0])
    pull_at(ports, recorder, 100)
    wanted = 5000  # more than all buffers on the way hold, so that the plug is out before the recording is over
    log = record(recorder, wanted)
    assert log.resets == 1 and log.session.counts.port_losses == 1
    before, after = (log.table[log.table.segment == segment] for segment in (0, 1))
    # what was in the cable's buffers when it was pulled is lost; what was received is there without a gap
    assert len(before) >= 100 and len(before) + len(after) >= wanted and log.missing == 0
    assert Quality(int(after.quality.iloc[0])) & Quality.AFTER_RESET
    assert (np.diff(log.table.time_s) > 0).all()
    assert [e.what for e in log.session.events] == ["port_lost", "port_back", "reset"]
    assert log.session.ended == Ended.FINISHED
    assert_metadata_agree(log)


@seen("port vanishes for good")
def test_port_vanishes_for_good(plugged, recorder_on):
    ports = plugged("bench", replug_after_s=None)
    recorder = recorder_on("bench", ports.names[0], replace(QUICK, reconnect_s=0.02))
    pull_at(ports, recorder, 100)
    with pytest.raises(t.PortLost, match="did not come back.*what came before is in the log"):
        record(recorder, None)
    log = read_log(recorder.log_path)
    assert len(log.table) >= 100 and log.missing == 0 and log.session.ended == Ended.DEVICE_LOST
    assert_metadata_agree(log)


@seen("garbage and half frames")
def test_garbage_and_half_frames(plugged, recorder_on):
    faults = Faults(garbage=frozenset({20, 150}), half=frozenset({60, 151, 200}))
    log = record(recorder_on("bench", plugged("bench", faults).names[0]))
    # a frame without its end runs into the next: both are lost. Garbage may take the frame behind it.
    lost = {60, 61, 151, 152, 200, 201}
    missing = set(range(SAMPLES)) - set(frame_numbers(log))
    assert lost <= missing <= lost | {20, 150}
    assert log.checksum_errors + log.broken_frames >= 3
    assert any("damaged" in warning for warning in log.session.warnings)
    assert_metadata_agree(log)


@seen("wrong checksum")
def test_wrong_checksum(plugged, recorder_on):
    bad = frozenset({10, 11, 170})
    log = record(recorder_on("bench", plugged("bench", Faults(corrupt=bad)).names[0]))
    assert set(range(SAMPLES)) - set(frame_numbers(log)) == bad
    # a flipped bit may also make or break a delimiter's neighbour, but never let a wrong value through
    assert log.checksum_errors + log.broken_frames >= len(bad)
    assert [(gap.first_index - log.table["index"].iloc[0], gap.count) for gap in log.gaps] == [(10, 2), (170, 1)]
    assert_metadata_agree(log)


@seen("dropped repeated and reordered frames")
def test_dropped_repeated_and_reordered_frames(plugged, recorder_on):
    faults = Faults(drop=frozenset({30, 31, 32, 100}), repeat=frozenset({40, 41, 200}), swap=frozenset({50, 150}))
    log = record(recorder_on("bench", plugged("bench", faults).names[0]))
    numbers = frame_numbers(log)
    assert (np.diff(numbers) > 0).all()
    assert set(range(SAMPLES)) - set(numbers) == {30, 31, 32, 100}
    assert log.repeated == 3 and log.session.counts.late == 2
    flags = dict(zip(numbers, log.table.quality, strict=True))
    assert {n for n, flag in flags.items() if flag & Quality.LATE} == {50, 150}
    assert {33, 101} <= {n for n, flag in flags.items() if flag & Quality.AFTER_GAP}
    np.testing.assert_allclose(log.table.time_s, 0.02 * numbers, atol=2e-6)
    assert_metadata_agree(log)


@pytest.mark.parametrize("seed", range(3))
@seen("everything at once at random")
def test_everything_at_once_at_random(plugged, recorder_on, seed):
    ports = plugged("bench", Faults(share=0.01))
    line = ports._world.lines[0]
    line._rng = np.random.default_rng(seed)
    log = record(recorder_on("bench", ports.names[0]), samples=1000)
    done = line.done
    assert (np.diff(frame_numbers(log)) > 0).all()
    # what cannot arrive: dropped, corrupted, halved (with its neighbour), and at most one frame per garbage
    worst = done["drop"] + done["corrupt"] + 2 * done["half"] + done["garbage"] + done["swap"]
    assert line.count - len(log.table) <= worst
    assert_metadata_agree(log)


@pytest.mark.parametrize("same_boot_id", [False, True])
@seen("device resets and the recording goes on")
@seen("a reset with the boot id it had before", "'gone silent', although the device answered")
def test_device_resets_and_the_recording_goes_on(plugged, recorder_on, same_boot_id):
    faults = Faults(reset_at=frozenset({120}), same_boot_id=same_boot_id)
    log = record(recorder_on("bench", plugged("bench", faults).names[0]))
    assert log.resets == 1 and (log.table.segment == 0).sum() == 120 and (np.diff(log.table.time_s) > 0).all()
    assert log.session.ended == Ended.FINISHED
    # A reset with the boot id it had before may first be noticed by the silence.
    assert [event.what for event in log.session.events if not (same_boot_id and event.what == "silence")] == ["reset"]
    assert_metadata_agree(log)


@seen("a reset makes a thrust test void")
def test_a_reset_makes_a_thrust_test_void(plugged, recorder_on):
    port = plugged("rotor", Faults(reset_at=frozenset({80}))).names[0]
    with pytest.raises(AcquireError, match="void.*record again"), recorder_on("rotor", port) as recorder:
        procedures.thrust_test(recorder, 0.2, 1.0, 2.0)
    log = read_log(recorder.log_path)
    assert len(log.table) == 80 and log.session.ended == Ended.DEVICE_RESET


def test_a_reset_before_the_command_is_a_reset_and_no_refusal(plugged, recorder_on):
    port = plugged("rotor", Faults(reset_at=frozenset({1}))).names[0]  # on a busy computer: before it sends again
    with pytest.raises(AcquireError, match="void.*record again"), recorder_on("rotor", port) as recorder:
        recorder.guard()
        recorder.start(resumable=False)
        recorder.command(wire.THROTTLE, wire.pack_throttle(0.2, 1.0))


@seen("clock rollover")
def test_clock_rollover(plugged, recorder_on):
    faults = Faults(clock_start_us=(1 << 32) - 2_000_000)  # rolls over two seconds into the stream
    log = record(recorder_on("bench", plugged("bench", faults).names[0]))
    assert (log.session.counts.clock_rollovers, log.resets, log.missing) == (1, 0, 0)
    np.testing.assert_allclose(np.diff(log.table.time_s), 0.02, atol=2e-6)


@pytest.mark.parametrize(("pace", "word", "rate"), [(0.8, "slower", 40.0), (1.25, "faster", 62.5)])
@seen("device slower or faster than promised")
def test_device_slower_or_faster_than_promised(plugged, recorder_on, pace, word, rate):
    log = record(recorder_on("bench", plugged("bench", Faults(pace=pace)).names[0]))
    assert log.missing == 0 and log.session.promised_rate_hz == 50.0
    assert log.session.measured_rate_hz == pytest.approx(rate, rel=1e-3)
    assert any(f"{word} than promised" in warning for warning in log.session.warnings)


@seen("silent device")
@seen("a device that never comes back", "5 s, three questions")
def test_silent_device(plugged, recorder_on):
    port = plugged("bench", Faults(silent_from=100)).names[0]
    with pytest.raises(t.DeviceSilent, match="gone silent.*power and cable"):
        record(recorder_on("bench", port, replace(QUICK, silence_s=0.03, reply_s=0.03, reconnect_s=0.2)))
    log = read_log(Path(port).with_name("run.rlog"))
    assert len(log.table) == 100 and log.session.ended == Ended.DEVICE_SILENT


@seen("port without a device")
def test_port_without_a_device(recorder_on, tmp_path):
    master, slave = os.openpty()
    try:
        with pytest.raises(t.DeviceSilent, match="nothing on it answers"):
            with recorder_on("bench", os.ttyname(slave), replace(QUICK, reply_s=0.01)):
                pass
    finally:
        os.close(master)
        os.close(slave)
    assert read_session(tmp_path / "run.yaml").ended == Ended.DEVICE_SILENT


@seen("another instrument on the port")
def test_another_instrument_on_the_port(plugged, recorder_on):
    with pytest.raises(Refused, match="is a 'bench'.*not a 'rotor'"), recorder_on("rotor", plugged("bench").names[0]):
        pass


@seen("refused command")
def test_refused_command(plugged, recorder_on):
    port = plugged("wrench", Faults(refuse=frozenset("I"))).names[0]
    with pytest.raises(Refused, match="refused 'I'"), recorder_on("wrench", port) as recorder:
        procedures.measure_wrench(recorder, 0.01, samples=10)
    assert read_session(recorder.session_path).ended == Ended.REFUSED


@seen("sensor that resets is powered and initialised again")
def test_sensor_that_resets_is_powered_and_initialised_again(plugged, recorder_on):
    port = plugged("wrench", Faults(reset_at=frozenset({50}))).names[0]
    log = recorded(procedures.measure_wrench, recorder_on("wrench", port), 0.005, samples=200)
    assert log.resets == 1 and log.session.ended == Ended.FINISHED
    np.testing.assert_allclose(np.diff(log.table[log.table.segment == 1].time_s), 0.005, atol=2e-6)


@seen("a programme whose end record is lost still ends")
def test_a_programme_whose_end_record_is_lost_still_ends(plugged, recorder_on):
    port = plugged("quadrotor", Faults(lose_end=True)).names[0]
    programme = Programme(TRAPEZOID, (0.1, 0.1, 0.1, 0.1), 0.5, 1.0, 0.0)
    recorder = recorder_on("quadrotor", port, replace(QUICK, silence_s=0.05))
    log = recorded(procedures.fly_programme, recorder, "h", programme)
    assert log.end is None and log.table.throttle_1.max() == pytest.approx(0.1)
    assert log.table.throttle_1.iloc[-1] == 0 and log.session.ended == Ended.FINISHED
    assert [event.what for event in log.session.events] == ["silence", "end_lost"]


@pytest.mark.parametrize("limit", [60_001, 80_000])
@seen("disk full")
@seen("metadata after a full disk", "'3 missing; check the cable', although the line was clean")
def test_disk_full(plugged, recorder_on, limit):
    """The kernel refuses to let the file grow (EFBIG), as a full disk does (ENOSPC)."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    port = plugged("bench").names[0]
    try:
        with pytest.raises(t.DiskFull, match="Free some space"), recorder_on("bench", port) as recorder:
            resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
            procedures.stream(recorder, 100_000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert recorder.log_path.stat().st_size == limit  # filled to the last byte
    log = read_log(recorder.log_path)
    # The last byte ends a chunk by chance now and then; with one byte less it does not.
    recorder.log_path.with_suffix(".less").write_bytes(recorder.log_path.read_bytes()[:-1])
    assert log.cut_at is not None or read_raw(recorder.log_path.with_suffix(".less")).cut_at is not None
    assert len(log.table) > 1000 and log.missing == 0
    assert log.session.ended == Ended.DISK_FULL and log.session.warnings == []
    assert_metadata_agree(log)
    # the device got the command to stop, and its answer was still listened to
    assert recorder.ended is not None


@seen("a recording is never overwritten")
def test_a_recording_is_never_overwritten(plugged, recorder_on):
    port = plugged("bench").names[0]
    first = record(recorder_on("bench", port))
    with pytest.raises(AcquireError, match="exists already"):
        record(recorder_on("bench", port))
    assert len(read_log(first.path).table) == len(first.table)


@seen("stop asked from outside")
def test_stop_asked_from_outside(plugged, recorder_on):
    recorder = recorder_on("bench", plugged("bench").names[0])
    recorder.on_row = lambda row: recorder.stop_asked.set() if row.index > 50 else None
    with pytest.raises(t.Interrupted):
        record(recorder, None)
    log = read_log(recorder.log_path)
    # the device was stopped and everything up to its end record is there
    assert log.complete and log.session.ended == Ended.INTERRUPTED


def hang_up_as_usual() -> None:
    """Let SIGHUP end the process: started under nohup the tests ignore it, and so would the recorder, rightly."""
    signal.signal(signal.SIGHUP, signal.SIG_DFL)


def ended_by(number: signal.Signals, port: str, folder: Path) -> tuple[subprocess.Popen, str, str, Log]:
    """A recorder in a process of its own that is sent this signal in the midst: the process, what it said, its log."""
    command = [*ACQUIRE, "bench", "--port", port, "--out", str(folder), "--id", "run"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    process, path = subprocess.Popen(command, preexec_fn=hang_up_as_usual, **pipes), folder / "run.rlog"
    while not path.exists() or path.stat().st_size < 3000:
        assert process.poll() is None, process.stderr.read()
        time.sleep(0.002)
    process.send_signal(number)
    out, err = process.communicate(timeout=20)
    return process, out, err, read_log(path)


@seen("ctrl c")
def test_ctrl_c(plugged, tmp_path):
    process, out, err, log = ended_by(signal.SIGINT, plugged("bench", speed=20.0).names[0], tmp_path)
    assert process.returncode == 130
    assert "stopped at your wish" in err and "samples, 0 missing" in out
    assert log.complete and log.session.ended == Ended.INTERRUPTED
    assert_metadata_agree(log)


@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGTERM])
@seen("SIGHUP: the terminal is closed", "the recorder died, the device streamed on, metadata said 'recording'")
def test_hang_up_stops_the_device(plugged, tmp_path, number):
    ports = plugged("bench", speed=20.0)
    *_, log = ended_by(number, ports.names[0], tmp_path)
    assert log.complete and log.session.ended == Ended.INTERRUPTED
    assert not ports._world.lines[0].device.streaming


@seen("sigkill", "log and metadata held; a ballast of 64 KiB stayed beside them")
def test_sigkill(plugged, tmp_path):
    *_, log = ended_by(signal.SIGKILL, plugged("bench", speed=20.0).names[0], tmp_path)
    assert sorted(path.name for path in tmp_path.glob("run*")) == ["run.rlog", "run.yaml"]  # no ballast
    assert len(log.table) > 10 and log.missing == 0
    assert log.session.ended == Ended.RECORDING and "killed" in log.session.message
    check = subprocess.run([*ACQUIRE, "check", str(log.path)], capture_output=True, text=True)
    assert check.returncode == 0 and "completed now" in check.stdout
    assert read_session(tmp_path / "run.yaml").counts.samples == len(log.table)
