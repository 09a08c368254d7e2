"""Faults that once went unnoticed, or cost more than they had to; each row says what was seen before."""

import gzip
import json
import os
import pty
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest

from rotorid_acquire import procedures
from rotorid_acquire.cli import app
from rotorid_acquire.emulators.devices import Faults
from rotorid_acquire.io import rawlog, wire
from rotorid_acquire.io.frames import ANSWER, DATA, END, START, Frame, StreamDecoder, encode
from rotorid_acquire.io.logs import read_log, read_tables
from rotorid_acquire.io.rawlog import read_raw
from rotorid_acquire.io.session import Ended, Session, read_session, session_path, write_session
from rotorid_acquire.io.wire import TRAPEZOID, Programme
from rotorid_acquire.recorder import Recorder, Timings, _source
from rotorid_acquire.transport import AcquireError, SystemClock
from tests.acquire.conftest import ACQUIRE, QUICK, recorded
from tests.acquire.fault_table import TABLE, seen
from tests.acquire.test_faults import assert_metadata_agree, record
from tests.command_line import invoke
from tests.refusals import refused


def a_log(loopback, samples: int = 250) -> Path:
    return recorded(procedures.stream, loopback("bench")[1], samples).path


def flip(path: Path, place: int) -> None:
    data = bytearray(path.read_bytes())
    data[place] ^= 4
    path.write_bytes(data)


def command_line(*arguments: str) -> tuple[int, str]:
    result = invoke(*arguments, app=app)
    return result.exit_code, " ".join(result.output.split())


# ---- 1. a log that is not as it was recorded --------------------------------------------------------------


@seen("one bit of a log flipped", "123 of 251 samples survived, check printed 'finished' and ingest 0 missing")
def test_a_flipped_bit_costs_one_sample_and_is_told(loopback):
    path = a_log(loopback)
    had = len(read_log(path).table)
    flip(path, path.stat().st_size // 2)
    log = read_log(path)
    assert had - 2 <= len(log.table) < had and log.missing == had - len(log.table)
    code, text = command_line("check", str(path))
    assert code == 1 and "NOT AS RECORDED: damaged in one place" in text and "SHA-256" in text
    _, sessions = read_tables([path])
    assert sessions.missing[0] == log.missing and "damaged" in sessions.faults[0] and not sessions.complete[0]


@seen("the length of a chunk flipped", "everything behind it was lost without a word")
def test_a_damaged_length_costs_a_chunk(loopback):
    path = a_log(loopback)
    whole = read_log(path)
    data, chunks = path.read_bytes(), read_raw(path).chunks
    largest = max((c for c in chunks[6:]), key=lambda c: len(c.data))
    flip(path, data.index(largest.data) - 1)
    log = read_log(path)
    assert 0 < len(whole.table) - len(log.table) < 30 and log.damaged_bytes > len(largest.data)
    assert log.missing == len(whole.table) - len(log.table) and log.end == whole.end


@seen("a bit of a packed log flipped", "NotALog: nothing of it could be read")
def test_a_damaged_packed_log_is_read_up_to_the_damage(loopback):
    path = a_log(loopback)
    had = len(read_log(path).table)
    packed = path.with_name(path.name + ".gz")
    packed.write_bytes(gzip.compress(path.read_bytes()))
    flip(packed, packed.stat().st_size * 3 // 4)
    log = read_log(packed)
    assert 0 < len(log.table) < had and len(log.table) + log.missing == had
    assert log.cut_at is not None and any("SHA-256" in fault for fault in log.faults)


@seen("a log cut to its half", "0 missing, since nothing comes behind the last sample")
def test_the_end_that_a_cut_took_is_counted(loopback):
    path = a_log(loopback)
    had = len(read_log(path).table)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    log = read_log(path)
    assert log.missing == had - len(log.table) > 100
    _, sessions = read_tables([path])
    assert sessions.missing[0] == log.missing and not sessions.finished[0]


@seen("another recording's bytes under this name", "read as complete; the metadata spoke of something else")
def test_another_recordings_bytes_are_refused(loopback, tmp_path):
    path = a_log(loopback)
    other = read_session(session_path(path)).model_copy(update={"id": "other", "log": "other.rlog"})
    write_session(other, tmp_path / "other.yaml")
    (tmp_path / "other.rlog").write_bytes(path.read_bytes())
    refused("holds the recording 'run-bench'.*those of 'other'", read_log, tmp_path / "other.rlog")
    assert command_line("check", str(tmp_path / "other.rlog"))[0] == 1


@seen("other bytes of the same name, no chunk damaged", "read as complete: log_sha256 was never compared")
def test_bytes_that_are_not_those_recorded_are_refused_at_ingest(loopback):
    path = a_log(loopback)
    path.write_bytes(path.read_bytes() + rawlog.pack_chunk(rawlog.NOTE, 1 << 60, b"{}"))
    refused("not the bytes that were recorded: SHA-256", read_tables, [path])
    code, text = command_line("check", str(path))
    assert code == 1 and "not the bytes that were recorded" in text


@seen("the first samples lost", "0 missing: the device's own count of what it sent was never looked at")
def test_what_the_device_says_it_sent_is_compared(tmp_path):
    path = tmp_path / "run.rlog"
    session_free(path, [(START, start_record()), (DATA, sample()), (DATA, sample()), (END, end_record(sent=5))])
    assert read_log(path).missing == 3


# ---- 2. nothing is overwritten ---------------------------------------------------------------------------


@pytest.mark.parametrize("there", ["run.rlog", "run.rlog.gz", "run.yaml"])
@seen("--id of a recording that is there, packed or by its metadata alone", "run.yaml was replaced")
def test_nothing_of_that_name_is_touched(plugged, tmp_path, there):
    (tmp_path / there).write_bytes(b"mine")
    port = plugged("bench").names[0]
    code, text = command_line("bench", "--port", port, "--samples", "5", "--out", str(tmp_path), "--id", "run")
    assert code == 1 and f"{there}: exists already" in text
    assert [p.name for p in tmp_path.iterdir() if p.name.startswith("run")] == [there]
    assert (tmp_path / there).read_bytes() == b"mine"


# ---- 3. frames whose checksum fits and whose content does not -----------------------------------------------


def start_record(reason: int = 2, boot_id: int = 7, name: str = "bench") -> bytes:
    return wire.StartRecord(boot_id, 20_000, reason, name, "test 1", "T1").pack()


def end_record(sent: int) -> bytes:
    return wire.EndRecord(sent, 0, 0).pack()


def sample(n: int = 0) -> bytes:
    return wire.INSTRUMENTS["bench"].encode([n] * 6)


def session_free(path: Path, frames: list[tuple[int, bytes]]) -> None:
    """A log without metadata that holds these frames."""
    data = rawlog.MAGIC
    for number, (kind, payload) in enumerate(frames):
        chunk = encode(Frame(kind, number, 20_000 * number, payload))
        data += rawlog.pack_chunk(rawlog.RECEIVED, 20_000_000 * number, chunk)
    path.write_bytes(data)


class Script:
    """A transport on a virtual line: answers `?`, `G` and `X`, and sends what it is given in the midst."""

    name, baud_rate = "script", None

    def __init__(self, odd: list[tuple[int, bytes]]) -> None:
        self._odd = odd
        self._out, self._number, self._sent = b"", 0, 0
        self._streaming = False
        self._decoder = StreamDecoder()

    def open(self) -> None: ...

    def close(self) -> None: ...

    def _say(self, kind: int, payload: bytes) -> None:
        self._out += encode(Frame(kind, self._number, 20_000 * self._number, payload))
        self._number += 1
        self._sent += kind == DATA

    def write(self, data: bytes) -> None:
        for frame in self._decoder.feed(data):
            letter = chr(frame.payload[0])
            if letter == "?":
                self._say(START, start_record(1))
                continue
            self._say(ANSWER, wire.Answer(letter, 0, "").pack())
            self._streaming = letter == "G"
            if letter == "X":
                self._say(END, end_record(self._sent))

    def read(self, timeout_s: float) -> bytes:
        if self._streaming:
            self._say(DATA, sample(self._number))
            if self._number == 10:
                for kind, payload in self._odd:
                    self._say(kind, payload)
        out, self._out = self._out, b""
        return out


ODD = {
    "short start record": (START, b"\1\2\3"), "start record with two strings": (START, start_record()[:-3]),
    "start record that is no UTF-8": (START, start_record()[:9] + b"\xff\0\xff\0\xff"),
    "short end record": (END, b"\1"), "long end record": (END, end_record(3) + b"\0"), "empty answer": (ANSWER, b""),
    "sample of 4 bytes": (DATA, b"\1\2\3\4"), "unknown kind": (ord("Q"), b"\1\2\3\4"),
}  # fmt: skip


@pytest.mark.parametrize("what", ODD)
@seen("a malformed frame with a right checksum", "recorder and reader crashed (struct.error, ValueError, IndexError)")
def test_a_malformed_frame_is_counted_and_nothing_else_is_lost(tmp_path, what):
    bench = wire.INSTRUMENTS["bench"]
    recorder = Recorder(bench, Script([ODD[what]]), SystemClock(), tmp_path, "run", durable=False)
    log = recorded(procedures.stream, recorder, 30)
    assert log.session.ended == Ended.FINISHED and len(log.table) >= 29
    counts, unknown = log.session.counts, what == "unknown kind"
    assert (log.malformed, log.unknown_kinds) == (int(not unknown), int(unknown))
    assert (counts.malformed, counts.unknown_kinds) == ((None, 1) if unknown else (1, None))
    assert log.missing == 0 and log.session.warnings
    assert_metadata_agree(log)


@seen("samples that are all of another length", "recorder stopped at the first; the reader raised for the whole log")
def test_a_firmware_of_another_layout_is_told_and_its_log_is_readable(tmp_path):
    script = Script([(DATA, b"\1\2\3\4")] * 25)
    script._number = 9
    recorder = Recorder(wire.INSTRUMENTS["bench"], script, SystemClock(), tmp_path, "run", durable=False)
    real = wire.INSTRUMENTS["bench"].layout.size
    with pytest.raises(AcquireError, match=f"sample has {real} bytes, this one has 4.*update its firmware"), recorder:
        script.read = lambda timeout_s, read=script.read: _only_odd(script)
        procedures.stream(recorder, 30)
    log = read_log(tmp_path / "run.rlog")
    assert len(log.table) == 0 and log.malformed == log.session.counts.malformed >= 20


def _only_odd(script: Script) -> bytes:
    if script._streaming:
        script._say(DATA, b"\1\2\3\4")
    out, script._out = script._out, b""
    return out


@seen("a note in the log that is no JSON object", "the reader raised json.JSONDecodeError")
def test_a_note_that_is_none_hurts_nothing(loopback):
    path = a_log(loopback, 20)
    session = read_session(session_path(path))
    for text in (b"not json", json.dumps([1]).encode()):
        path.write_bytes(path.read_bytes() + rawlog.pack_chunk(rawlog.NOTE, 1 << 60, text))
    write_session(session.model_copy(update={"log_sha256": None}), session_path(path))
    assert len(read_log(path).table) >= 20


@seen("log of an instrument that this version does not know", "LogError although recorder and metadata had accepted it")
def test_a_log_of_an_unknown_instrument_is_readable(tmp_path):
    path = tmp_path / "run.rlog"
    session_free(path, [(START, start_record(name="toaster")), (DATA, b"\1\2"), (END, end_record(1))])
    refused("unknown instrument 'toaster'; known are bench", read_log, path)  # nothing says what was expected
    started = {"started": "2024-03-04T09:00:00-06:00", "host_start_ns": 0}
    write_session(Session(id="run", instrument="bench", log=path.name, **started), tmp_path / "run.yaml")
    log = read_log(path)
    assert len(log.table) == 0 and log.malformed == 1 and "toaster" in log.faults[0]


# ---- 4. every end stops the device ------------------------------------------------------------------------


@seen("the terminal itself goes away", "traceback (EIO), the device streamed on")
def test_a_terminal_that_goes_away_stops_the_device(plugged, tmp_path):
    ports = plugged("bench", speed=20.0)
    child, terminal = pty.fork()
    if child == 0:
        # Started under nohup the tests ignore the signal, and so would the recorder, rightly.
        signal.signal(signal.SIGHUP, signal.SIG_DFL)
        os.execv(sys.executable, [*ACQUIRE, "bench", "--port", ports.names[0], "--out", str(tmp_path), "--id", "run"])
    stop = threading.Event()

    def drain() -> None:
        while not stop.is_set():
            try:
                os.read(terminal, 4096)
            except OSError:
                return

    reader = threading.Thread(target=drain)
    reader.start()
    path = tmp_path / "run.rlog"
    for _ in range(4000):
        if path.exists() and path.stat().st_size > 3000:
            break
        time.sleep(0.005)
    stop.set()
    reader.join()
    os.close(terminal)
    os.waitpid(child, 0)
    log = read_log(path)
    assert log.complete and log.session.ended == Ended.INTERRUPTED


@seen("SIGKILL while a motor turns", "the motor turned on to its hold time (up to 65 s), the tester streamed on")
def test_a_killed_recorder_leaves_no_motor_running(plugged, tmp_path):
    ports = plugged("rotor", speed=1.0)
    command = [*ACQUIRE, "rotor", "--port", ports.names[0], "--throttle", "0.3"]
    command += ["--hold-s", "60", "--rest-s", "0.1", "--out", str(tmp_path), "--id", "run"]
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    device = ports._world.lines[0].device
    until(lambda: device._physics.rotors.throttle[0] > 0)
    process.kill()
    process.wait()
    begin = time.monotonic()
    until(lambda: device._physics.rotors.throttle[0] == 0 and not device.streaming)
    assert time.monotonic() - begin < 10


def until(condition, seconds: float = 30.0) -> None:
    deadline = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.01)


@seen("a motor commanded to turn with the watchdog off", "it turned: there was no watchdog")
def test_nothing_moves_without_its_watchdog(loopback):
    _, recorder = loopback("rotor", timings=Timings(watchdog_s=None))
    with pytest.raises(AcquireError, match="switch the watchdog on first"), recorder:
        procedures.thrust_test(recorder, 0.2, 0.5, 1.0)
    _, recorder = loopback("quadrotor", timings=Timings(watchdog_s=None))
    with pytest.raises(AcquireError, match="watchdog"), recorder:
        procedures.fly_programme(recorder, "h", Programme(TRAPEZOID, (0.1,) * 4, 0.5, 1.0, 0.0))


@seen("firmware without a watchdog", "a motor was started all the same")
def test_firmware_without_a_watchdog_is_refused(plugged, recorder_on):
    port = plugged("rotor", Faults(refuse=frozenset("K"))).names[0]
    with pytest.raises(AcquireError, match="no watchdog.*Update its firmware"), recorder_on("rotor", port) as recorder:
        procedures.thrust_test(recorder, 0.2, 0.5, 1.0)


@seen("the device ends its stream by a fault", "the recording was called finished")
def test_an_end_by_the_devices_watchdog_is_no_finish(loopback):
    world, recorder = loopback("rotor")
    with pytest.raises(AcquireError, match="heard nothing from this computer"), recorder:
        recorder.guard()
        recorder.start(resumable=False)
        world.lines[0]._stop_unheard()
        for _ in recorder.rows(100):
            pass
    assert recorder.session.ended == Ended.DEVICE_FAULT


# ---- 5. folders, disks, names, waits ------------------------------------------------------------------------


@seen("--out is a file, or below one", "traceback")
def test_a_folder_that_cannot_be_written_gets_a_sentence(plugged, tmp_path):
    (tmp_path / "file").write_text("")
    port = plugged("bench").names[0]
    for out in (tmp_path / "file", tmp_path / "file" / "below", Path("/proc/nothing")):
        code, text = command_line("bench", "--port", port, "--samples", "5", "--out", str(out), "--id", "run")
        assert code == 1 and "choose another --out" in text and "Traceback" not in text
    assert not list(tmp_path.rglob("run*"))


@seen("the disk is full at the start", "traceback; log and ballast were left behind")
def test_a_full_disk_at_the_start_leaves_nothing(plugged, recorder_on, tmp_path, monkeypatch):
    port = plugged("bench").names[0]
    write = os.write

    def full(descriptor: int, data: bytes) -> int:
        if bytes(data[:9]) == b"ROTORLOG1":
            raise OSError(28, "No space left on device")
        return write(descriptor, data)

    monkeypatch.setattr(os, "write", full)
    with pytest.raises(AcquireError, match="disk is full|cannot be written any more"):
        record(recorder_on("bench", port), 5)
    monkeypatch.undo()
    assert [p.name for p in tmp_path.iterdir()] == ["ttybench"]


@pytest.mark.parametrize("name", ["../x", "a/b", ".hidden", "/tmp/x", "a b"])
@seen("--id ../x", "a log was written outside of --out")
def test_a_name_never_leads_out_of_the_folder(tmp_path, name):
    out = tmp_path / "in"
    code, text = command_line("bench", "--port", "/dev/nothing", "--out", str(out), f"--id={name}")
    assert code == 1 and "cannot be its name" in text
    assert list(tmp_path.iterdir()) == []


@seen("a reading that never becomes steady", "the recorder waited for ever")
def test_a_reading_that_is_never_steady_ends_with_a_sentence(loopback):
    _, recorder = loopback("bench")
    rule = procedures.SteadyRule(tolerance=-1.0)
    with pytest.raises(AcquireError, match=r"not steady within 5 s.*cell_\d_v still moves.*--tolerance"), recorder:
        procedures.static_test(recorder, lambda text: lambda: True, 50, rule, wait_s=5)
    assert recorder.session.ended == Ended.GAVE_UP and recorder.ended is not None


@seen("a weight that is never put on", "the recorder waited for ever")
def test_a_weight_that_never_comes_ends_with_a_sentence(loopback):
    _, recorder = loopback("bench")
    with pytest.raises(AcquireError, match="no load within 4 s"), recorder:
        procedures.static_test(recorder, lambda text: lambda: False, wait_s=4)
    assert recorder.session.ended == Ended.GAVE_UP


@seen("standard input at its end while Enter is waited for", "the recorder waited for ever")
def test_standard_input_at_its_end_is_an_answer(plugged, tmp_path):
    words = ["bench", "--port", plugged("bench", speed=20.0).names[0], "--test", "static", "--out", str(tmp_path)]
    how = {"stdin": subprocess.DEVNULL, "capture_output": True, "text": True, "timeout": 60}
    done = subprocess.run([*ACQUIRE, *words, "--id", "run"], **how)
    assert done.returncode == 0 and "standard input is at its end" in done.stderr
    assert "input_over" in [event.what for event in read_session(tmp_path / "run.yaml").events]


# ---- 6. what the metadata say -----------------------------------------------------------------------------


@seen("a cable at rest for a while", "given up after 5 s, where an unplugged one has 60 s")
def test_a_cable_at_rest_has_as_long_as_an_unplugged_one(plugged, recorder_on):
    ports = plugged("bench", speed=1.0)
    line = ports._world.lines[0]
    quick = replace(QUICK, silence_s=0.1, reply_s=0.05, reconnect_s=20.0)
    recorder = recorder_on("bench", ports.names[0], quick)

    def rest(row) -> None:
        if recorder.progress == 20:
            line.at_rest = True
            threading.Timer(1.0, setattr, (line, "at_rest", False)).start()

    recorder.on_row = rest
    log = record(recorder, 120)
    assert log.session.ended == Ended.FINISHED and log.resets == 0 and log.missing > 20
    assert len(log.table) + log.missing >= 120
    assert [event.what for event in log.session.events] == ["silence", "silence_over"]
    assert_metadata_agree(log)


@pytest.mark.parametrize(("firmware", "port"), [("bench 1.0 (simulated)", "/dev/ttyACM0"), ("bench 1.0", "/dev/pts/3")])
@seen("a simulated board", "recorded as source: instrument")
def test_a_simulated_board_is_no_instrument(firmware, port):
    assert _source(wire.StartRecord(1, 1, 1, "bench", firmware, "7"), port) == "emulator"
    assert _source(wire.StartRecord(1, 1, 1, "bench", "bench 1.0", "7"), "/dev/ttyACM0") == "instrument"


@seen("an instrument that sends every minute", "'gone silent' after two seconds")
def test_a_slow_instrument_is_not_silent(loopback):
    log = recorded(procedures.measure_wrench, loopback("wrench")[1], 5.0, samples=4)
    assert log.session.ended == Ended.FINISHED and not log.session.events


def test_the_table_names_every_test_here_and_says_what_was_seen():
    names = {name for name in globals() if name.startswith("test_") and "the_table" not in name}
    assert names <= {row[2] for row in TABLE}
    assert all(fault and before for fault, before, _ in TABLE)
