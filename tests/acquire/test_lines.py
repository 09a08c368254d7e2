"""Instruments that send plain lines: read by a description, their bytes kept as they came."""

from __future__ import annotations

import os
import threading
import time
import tty
from pathlib import Path

import pytest
from typer.testing import CliRunner

from rotorid.acquire.cli import app
from rotorid.acquire.clock import SystemClock
from rotorid.acquire.errors import BadName, DeviceSilent
from rotorid.acquire.lines import record_lines
from rotorid.acquire.transport import SerialTransport
from rotorid.io.lines import Description, DescriptionError, LineDecoder, read_description, read_line_log
from rotorid.io.rawlog import RECEIVED, read_raw

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
    with pytest.raises(BadName):
        record_lines(description, transport, SystemClock(), tmp_path, "run", samples=1)


def test_by_the_command_line(line, tmp_path):
    master, port = line
    description = tmp_path / "d.yaml"
    description.write_text("name: x\nseparator: ','\ncolumns: {force_z_n: {field: 1}}\n")

    def speak() -> None:  # an opened port forgets what came before
        while not (tmp_path / "run.rlog").exists():
            time.sleep(0.005)
        os.write(master, b"0,1.5\n1,2.5\noops\n2,3.5\n")

    threading.Thread(target=speak, daemon=True).start()
    words = ["lines", str(description), "--port", port, "--samples", "3", "--out", str(tmp_path), "--id", "run"]
    assert CliRunner().invoke(app, words).exit_code == 0
    shown = CliRunner().invoke(app, ["check", str(tmp_path / "run.rlog"), "--csv", str(tmp_path / "t.csv")])
    assert "3 lines read, 1 could not be" in shown.output
    assert (tmp_path / "t.csv").read_text().splitlines()[-1].endswith(",3.5")


def test_a_silent_line_ends_with_a_sentence(line, tmp_path):
    description = Description(name="x", **FORMS["csv"][0])
    with pytest.raises(DeviceSilent, match="no byte for 0.1 s"):
        record_lines(description, SerialTransport(line[1], 9600), SystemClock(), tmp_path, "run", silence_s=0.1)
    assert (tmp_path / "run.yaml").exists()


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
    with pytest.raises(DescriptionError) as error:
        read_description(path)
    assert sentence in str(error.value)
