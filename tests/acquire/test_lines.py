"""Instruments that send plain lines: read by a description, their bytes kept as they came."""

import io
import os
import threading
import time
import tty
from contextlib import suppress
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from rotorid_acquire.cli import app
from rotorid_acquire.io import rawlog
from rotorid_acquire.io.lines import Description, LineDecoder, read_description, read_line_log
from rotorid_acquire.io.rawlog import RECEIVED, read_raw
from rotorid_acquire.io.session import Counts, Ended, Session, read_session, write_session
from rotorid_acquire.lines import record_lines
from rotorid_acquire.transport import (
    AcquireError,
    DeviceSilent,
    Interrupted,
    PortLost,
    PortMissing,
    SerialTransport,
    SystemClock,
    VirtualClock,
)
from rotorid_acquire.view import LinesPanel, Plot
from tests.acquire.fault_table import seen
from tests.command_line import answer, invoke
from tests.refusals import refused

ROOT = Path(__file__).parents[2]
FORMS = {
    "csv": (
        {"form": "csv", "separator": ",", "columns": {"force_z_n": {"field": 1, "scale": 2.0}, "time_s": {"field": 0}}},
        b"time,force\r\n0.0, 1.5\r\n0.1,-2.5e0\r\n0.2\r\n",
        [(3.0, 0.0), (-5.0, 0.1)],
        2,
    ),
    "key=value": (
        {"form": "key=value", "separator": ";", "columns": {"force_z_n": {"field": "Fz"}}},
        b"Fz=4.0;T=23\nT=23; Fz = 5\nhello\n",
        [(4.0,), (5.0,)],
        1,
    ),
    "fixed": (
        {"form": "fixed", "columns": {"displacement_mm": {"start": 0, "stop": 8}, "force_n": {"start": 8, "stop": 16}}},
        b"   0.010    12.5\r\n   0.020    25.0\r\n",
        [(0.01, 12.5), (0.02, 25.0)],
        0,
    ),
}


REAL = {  # as such instruments print it, with the lines that are none
    "jr3-text": (
        b"JR3 Inc. Force Sensor Receiver v2.1\r\nREADY\r\n0,    12,    -3,  8192,    -1,     2,    -5\r\n"
        b"0,    11,    -3,  8190,    -1,     2,    -5\r\n1,  OVLD,    -3,  OVLD,    -1,     2,    -5\r\n0,    12,  ",
        [(0.1465, -0.0366, 100.0, -0.00122, 0.00244, -0.0061), (0.1343, -0.0366, 99.976, -0.00122, 0.00244, -0.0061)],
        3,
    ),
    "tensile-csv": (
        '\ufeff"Prüfung 17; Probe 100-1"\r\n"Zeit [s]";"Weg [mm]";"Kraft [N]"\r\n"0,00";"0,000";"-0,2"\r\n'
        '"0,10";"0,012";"15,3"\r\n\r\n"0,20";"0,024";"1.530,7"\r\n"Bruch";;\r\n'.encode(),
        [(0.0, 0.0, -0.2), (0.1, 0.012, 15.3)],
        4,
    ),
    "scale-fixed": (b"+  500.48 g  \r\n+  500.4? g ?\r\n-    0.02 g  \r\n           g \r\n", [(500.48,), (-0.02,)], 2),
}


@pytest.mark.parametrize("name", REAL)
@pytest.mark.parametrize("step", [1, 13, 1000])
def test_what_such_instruments_print_is_read_by_the_descriptions_at_hand(name, step):
    data, values, unreadable = REAL[name]
    decoder = LineDecoder(read_description(ROOT / "acquire" / "instruments" / f"{name}.yaml"))
    found = [row for start in range(0, len(data), step) for row in decoder.feed(data[start : start + step])]
    assert found == [pytest.approx(row, rel=2e-3) for row in values] and decoder.unreadable == unreadable


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("step", [1, 7, 1000])
def test_lines_are_read_however_the_bytes_come(form, step):
    told, data, values, unreadable = FORMS[form]
    decoder = LineDecoder(Description(name="x", **told))
    found = [row for start in range(0, len(data), step) for row in decoder.feed(data[start : start + step])]
    assert found == [pytest.approx(row) for row in values] and decoder.unreadable == unreadable


@pytest.fixture
def line() -> tuple[int, str]:
    master, slave = os.openpty()
    tty.setraw(slave)
    yield master, os.ttyname(slave)
    os.close(master)
    os.close(slave)


@pytest.mark.parametrize("form", FORMS)
def test_every_byte_is_kept_and_the_log_is_read_by_its_own_description(line, tmp_path, form):
    told, data, values, unreadable = FORMS[form]
    description = Description(name="old-sensor", begin="R\r\n", end="S\r\n", **told)
    master, port = line
    heard = []

    def answer() -> None:
        heard.append(os.read(master, 100))
        os.write(master, data)

    thread = threading.Thread(target=answer)
    thread.start()
    transport = SerialTransport(port, 9600)
    session = record_lines(description, transport, SystemClock(), tmp_path, "run", samples=len(values))
    thread.join()
    assert heard == [b"R\r\n"] and os.read(master, 100) == b"S\r\n"
    log = tmp_path / "run.rlog"
    assert b"".join(c.data for c in read_raw(log).chunks if c.tag == RECEIVED) == data
    table = read_line_log(log).table
    assert [tuple(row) for row in table[list(description.columns)].to_numpy()] == [pytest.approx(v) for v in values]
    assert session.counts.samples == len(values) and session.counts.broken_frames == unreadable
    with pytest.raises(AcquireError):
        record_lines(description, transport, SystemClock(), tmp_path, "run", samples=1)


def spoken(line, folder: Path, description: str, said: bytes, *more: str):
    """What `lines` makes of a line that speaks once its log is begun: an opened port forgets what came before."""
    master, port = line
    (folder / "d.yaml").write_text(description)

    def speak() -> None:
        while not (folder / "run.rlog").exists():
            time.sleep(0.005)
        os.write(master, said)

    threading.Thread(target=speak, daemon=True).start()
    words = ["lines", str(folder / "d.yaml"), "--port", port, "--out", str(folder), "--id", "run", *more]
    return invoke(*words, app=app)


PLAIN = "name: x\nseparator: ','\nend: S\ncolumns: {force_z_n: {field: 1}}\n"


def test_by_the_command_line(line, tmp_path):
    assert spoken(line, tmp_path, PLAIN, b"0,1.5\n1,2.5\noops\n2,3.5\n", "--samples", "3").exit_code == 0
    shown = answer("check", tmp_path / "run.rlog", "--csv", tmp_path / "t.csv", app=app)
    assert "3 lines read, 1 could not be" in shown
    assert (tmp_path / "t.csv").read_text().splitlines()[-1].endswith(",3.5")


def test_a_silent_line_ends_with_a_sentence(line, tmp_path):
    description = Description(name="x", **FORMS["csv"][0])
    with pytest.raises(DeviceSilent, match="no byte for 0.1 s"):
        record_lines(description, SerialTransport(line[1], 9600), SystemClock(), tmp_path, "run", silence_s=0.1)
    assert (tmp_path / "run.yaml").exists()


@seen("plain lines: Ctrl-C, a silence, a limit", "the instrument streamed on")
def test_an_instrument_is_told_to_stop_whatever_the_end(line, tmp_path):
    master, port = line
    description, stop = Description(name="x", end="S\r\n", **FORMS["csv"][0]), threading.Event()
    stop.set()
    with pytest.raises(Interrupted):
        record_lines(description, SerialTransport(port, 9600), SystemClock(), tmp_path, "a", stop_asked=stop)
    assert os.read(master, 100) == b"S\r\n"
    with pytest.raises(DeviceSilent):
        record_lines(description, SerialTransport(port, 9600), SystemClock(), tmp_path, "b", silence_s=0.05)
    assert os.read(master, 100) == b"S\r\n"


class Scripted:
    """A port that gives bytes, raises errors, or is away, one after the other; then silence."""

    name, baud_rate = "scripted", 9600

    def __init__(self, *said: bytes | BaseException) -> None:
        self.said, self.sent = list(said), []

    def open(self) -> None:
        if self.said and isinstance(self.said[0], PortMissing):
            raise self.said.pop(0)

    def read(self, timeout_s: float) -> bytes:
        said = self.said.pop(0) if self.said else b""
        if isinstance(said, BaseException):
            raise said
        return said

    def write(self, data: bytes) -> None:
        self.sent.append(data)

    def close(self) -> None:
        pass


def recorded(folder: Path, *said: bytes | BaseException, begin: str = "") -> tuple[list[bytes], Session]:
    """What is sent to an instrument that says this, and the metadata."""
    description = Description(name="x", begin=begin, end="S", separator=",", columns={"force_z_n": {"field": 1}})
    port, clock = Scripted(*said), VirtualClock(datetime(2026, 1, 1, tzinfo=UTC))
    with suppress(AcquireError, KeyboardInterrupt):
        record_lines(description, port, clock, folder, "run", samples=3)
    return port.sent, read_session(folder / "run.yaml")


def test_a_line_that_is_stopped_twice_was_interrupted_and_one_that_failed_failed(tmp_path: Path) -> None:
    assert recorded(tmp_path / "twice", b"0,1\n", KeyboardInterrupt())[1].ended == Ended.INTERRUPTED
    with pytest.raises(ZeroDivisionError):
        recorded(tmp_path / "fault", ZeroDivisionError())
    assert read_session(tmp_path / "fault" / "run.yaml").ended == Ended.FAILED


def test_a_plug_that_comes_back_goes_on_and_the_gap_is_in_the_metadata(tmp_path: Path) -> None:
    sent, session = recorded(tmp_path, b"0,1\n0,", PortLost("gone"), PortMissing("no"), b"5,2\n", b"6,3\n", begin="R")
    assert session.ended == Ended.FINISHED and sent == [b"R", b"R", b"S"]
    assert [event.what for event in session.events] == ["port_lost", "port_back"]
    found = read_line_log(tmp_path / "run.rlog")
    assert list(found.table.force_z_n) == [1, 2, 3] and found.counts == session.counts  # no "0,5" of two halves
    assert "the port went away 1 times" in answer("check", tmp_path / "run.rlog", app=app)


def test_a_killed_recording_of_lines_is_completed(tmp_path: Path) -> None:
    _, whole = recorded(tmp_path, b"0,1\n", b"0,2\nno\n0,3\n")
    change = {"ended": Ended.RECORDING, "counts": Counts(), "log_sha256": None, "warnings": []}
    write_session(whole.model_copy(update=change), tmp_path / "run.yaml")
    shown = answer("check", tmp_path / "run.rlog", app=app)
    assert "never finished; completed now" in shown and "ended: recording" in shown
    completed = read_session(tmp_path / "run.yaml")
    assert completed.counts == whole.counts and completed.log_sha256 == whole.log_sha256


def test_a_wrong_baud_rate_is_noticed(tmp_path: Path) -> None:
    noise = bytes(np.random.default_rng(1).integers(0, 256, 5000, dtype=np.uint8))
    _, session = recorded(tmp_path / "all", noise)
    assert session.ended == Ended.REFUSED and "is the baud rate right (9600)" in session.message
    _, session = recorded(tmp_path / "later", b"0,1\n", noise)
    assert session.ended == Ended.REFUSED and "is the baud rate right (9600)" in session.message
    _, session = recorded(tmp_path / "some", noise[:300], KeyboardInterrupt())
    assert "is the baud rate right (9600)" in session.warnings[0]
    assert "is the baud rate right (9600)" in answer("check", tmp_path / "some" / "run.rlog", app=app)


@seen("a bit of a log of plain lines flipped", "two halves made a line of a wrong number, and nothing was reported")
def test_damage_joins_no_halves_of_lines_and_is_told(tmp_path):
    description = Description(name="x", **FORMS["csv"][0])
    parts = [b"0.0,1.5\n0.1,2", b".5\n0.2,3.", b"5\n0.3,4.5\n"]
    chunks = [rawlog.pack_chunk(RECEIVED, 10**9 + number, part) for number, part in enumerate(parts)]
    path = tmp_path / "run.rlog"
    path.write_bytes(rawlog.MAGIC + b"".join(chunks))
    told = {"name": "lines", "description": description.model_dump(mode="json", exclude_none=True)}
    whole = sha256(path.read_bytes()).hexdigest()
    session = Session(
        id="run", instrument="x", started="2024-03-04T09:00:00-06:00", host_start_ns=0, log=path.name, log_sha256=whole
    )
    write_session(session.model_copy(update={"procedure": told, "ended": Ended.FINISHED}), tmp_path / "run.yaml")
    assert list(read_line_log(path).table.force_z_n) == [3.0, 5.0, 7.0, 9.0] and not read_line_log(path).faults
    data = bytearray(path.read_bytes())
    data[len(rawlog.MAGIC) + len(chunks[0]) + 15] ^= 1  # inside the second
    path.write_bytes(data)
    found = read_line_log(path)
    assert list(found.table.force_z_n) == [3.0, 9.0] and len(found.faults) == 2  # not 2 and 5 as 25
    shown = invoke("check", path, app=app)
    assert shown.exit_code == 1 and shown.output.count("NOT AS RECORDED") == 2
    # The last chunk, of a recording that was killed: it is whole, so nothing was cut.
    write_session(session.model_copy(update={"procedure": told, "log_sha256": None}), tmp_path / "run.yaml")
    data[-3] ^= 1
    path.write_bytes(data)
    shown = invoke("check", path, app=app)
    assert shown.exit_code == 1 and "damaged in one place" in shown.output and "cut off" not in shown.output


def test_a_limit_ends_the_recording_and_columns_are_those_of_the_description(line, tmp_path):
    done = spoken(line, tmp_path, PLAIN, b"0,1.5\n1,99\n2,3.5\n", "--limit", "force_z_n:-10:10")
    assert done.exit_code == 1 and "force_z_n is 99, allowed are -10 to 10: stopped" in done.output
    assert read_session(tmp_path / "run.yaml").ended == Ended.LIMIT_EXCEEDED
    assert os.read(line[0], 100) == b"S"
    words = ["lines", str(tmp_path / "d.yaml"), "--port", line[1], "--out", str(tmp_path), "--id", "run"]
    assert invoke(*words, "--plot", "force", app=app).exit_code == 2


def test_the_look_at_lines_while_recording():
    now = [0.0]
    panel = LinesPanel("old-sensor", ["force_z_n"], 40, lambda: now[0])
    plot = Plot("force_z_n", 0)
    for number in range(20):
        now[0] += 0.1
        for one in (panel, plot):
            one.see((float(number),))
    console = Console(width=100, file=io.StringIO())
    console.print(panel.render(), plot.render())
    shown = console.file.getvalue()
    for words in ("20/40", "10.0", "2.0", "19", "noise 0.707"):
        assert words in shown, shown


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("name: x\nform: fixed\ncolumns: {a_n: {field: 1}}", "columns.a_n: form `fixed` needs `start` and `stop`"),
        ("name: x\ncolumns: {a_n: {field: Fz}}", "needs `field`, the field's number from 0"),
        ("name: x\ncolums: {}", "d.yaml: colums: no such key is known; did you mean columns?"),
        ("{", "d.yaml, line 1: not valid YAML"),
    ],
)
def test_mistakes_in_a_description_get_one_sentence(tmp_path: Path, text, sentence):
    path = tmp_path / "d.yaml"
    path.write_text(text)
    assert sentence in refused(None, read_description, path)
