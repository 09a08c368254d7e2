"""Raw logs and their metadata: readable up to any cut, atomic, validated, indexed."""

import gzip
import os

import numpy as np
import pandas as pd
import pytest

from rotorid_acquire import procedures
from rotorid_acquire.emulators.devices import Faults
from rotorid_acquire.io import rawlog
from rotorid_acquire.io.logs import read_log
from rotorid_acquire.io.rawlog import read_raw
from rotorid_acquire.io.session import (
    INDEX_COLUMNS,
    RoomAir,
    Session,
    read_index,
    read_session,
    session_path,
    write_index,
    write_session,
)
from rotorid_acquire.io.wire import EXPERIMENTS
from rotorid_acquire.recorder import LogWriter
from tests.acquire.conftest import recorded
from tests.refusals import refused


def short_log(loopback, samples):
    """A short recording with a few faults in it."""
    _, recorder = loopback("bench", Faults(drop=frozenset({5}), repeat=frozenset({9}), swap=frozenset({12})))
    return recorded(procedures.stream, recorder, samples).path


@pytest.fixture
def log_path(loopback):
    return short_log(loopback, 30)


def test_a_log_cut_anywhere_is_read_up_to_the_cut(loopback, tmp_path):
    log_path = short_log(loopback, 15)
    whole = read_log(log_path)
    data = log_path.read_bytes()
    cut = tmp_path / "cut.rlog"
    write_session(whole.session, session_path(cut))
    chunks = read_raw(log_path).chunks
    longest = 0
    for length in range(len(data)):
        cut.write_bytes(data[:length])
        kept = read_raw(cut).chunks
        assert kept == chunks[: len(kept)]
        if length % 7 and length != len(data) - 1:
            continue  # tables cost more: every seventh cut, and the last
        log = read_log(cut)
        rows = len(log.table)
        assert rows >= longest - 1  # a late frame may wait for its place, a row is never lost again
        longest = max(longest, rows)
        same = whole.table.merge(log.table, on=["segment", "index"])
        assert len(same) == rows
        np.testing.assert_array_equal(same.cell_1_v_x, same.cell_1_v_y)
    assert longest == len(whole.table)


def test_gzipped_logs_whole_and_cut(log_path, tmp_path):
    whole = read_log(log_path)
    packed = log_path.with_name(log_path.name + ".gz")
    packed.write_bytes(gzip.compress(log_path.read_bytes()))
    pd.testing.assert_frame_equal(read_log(packed).table, whole.table)
    packed.write_bytes(packed.read_bytes()[:600])
    log = read_log(packed)
    assert log.cut_at is not None and len(log.table) <= len(whole.table) and not log.faults
    changed = bytearray(gzip.compress(log_path.read_bytes()))
    changed[len(changed) // 2] ^= 1
    packed.write_bytes(changed)
    session_path(packed).unlink(missing_ok=True)  # without the checksum there
    assert "damaged in one place" in read_log(packed).faults[0]


@pytest.mark.parametrize("number", range(1, 60, 4))
def test_a_bit_flipped_anywhere_costs_two_samples_at_most_or_a_chunk(log_path, number):
    whole = read_log(log_path)
    chunks = read_raw(log_path).chunks
    data = bytearray(log_path.read_bytes())
    place = len(rawlog.MAGIC) + (len(data) - len(rawlog.MAGIC)) * number // 60
    data[place] ^= 1 << number % 8
    log_path.write_bytes(data)
    raw, log = read_raw(log_path), read_log(log_path)
    assert len(raw.chunks) == len(chunks) - 1 and set(raw.chunks) <= set(chunks)
    largest = max(len(chunk.data) for chunk in chunks) // 30
    assert len(whole.table) - len(log.table) <= (2 if raw.damages and raw.damages[0].rescued else largest)
    # a gap counts frames: the records lost with the samples are in it as well
    assert 0 <= log.missing - whole.missing - (len(whole.table) - len(log.table)) <= 3
    assert not log.complete and any("SHA-256" in fault for fault in log.faults)


def test_no_log_at_all(tmp_path):
    path = tmp_path / "table.rlog"
    path.write_text("time_s,force_x_n\n0,1\n")
    refused("table.rlog: does not begin with", read_log, path)
    refused("nothing.rlog: file is missing", read_log, tmp_path / "nothing.rlog")


def test_nothing_says_which_instrument(tmp_path):
    path = tmp_path / "bare.rlog"
    path.write_bytes(rawlog.MAGIC)
    refused("nothing says which instrument", read_log, path)


def test_long_reads_are_split_into_chunks(tmp_path):
    path = tmp_path / "long.rlog"
    writer = LogWriter(path)
    data = os.urandom(150_000)
    writer.write(rawlog.RECEIVED, 42, data)
    writer.close()
    chunks = read_raw(path).chunks
    assert [len(chunk.data) for chunk in chunks] == [65535, 65535, 18930]
    assert b"".join(chunk.data for chunk in chunks) == data and chunks[2].host_ns == 42


def test_saturated_samples_are_flagged(loopback, tmp_path):
    world, recorder = loopback("wrench")
    world.physics.sensor._zero = np.array([0, 0, 500.0, 0, 0, 0])
    table = recorded(procedures.measure_wrench, recorder, 0.01, samples=5).table
    assert (table.quality == 8).all() and (table.force_z_n == 200.0).all()


def test_metadata_are_written_atomically(tmp_path, monkeypatch):
    session = Session(id="a", instrument="bench", started="2024-03-04T09:00:00-06:00", host_start_ns=0, log="a.rlog")
    path = tmp_path / "a.yaml"
    write_session(session, path)
    before = path.read_bytes()

    def refuse(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(OSError):
        write_session(session.model_copy(update={"message": "x"}), path)
    assert path.read_bytes() == before and sorted(p.name for p in tmp_path.iterdir()) == ["a.yaml"]


START = "id: a\ninstrument: bench\nstarted: '2024-03-04T09:00:00-06:00'\n"


def test_metadata_errors_name_file_and_key(tmp_path):
    path = tmp_path / "a.yaml"
    refused("a.yaml: no such file", read_session, path)
    path.write_text(START + "host_start_ns: soon\nlog: a.rlog\n")
    refused("a.yaml: host_start_ns: found .soon., expected a whole number", read_session, path)
    path.write_text(START + "host_start_ns: 1\nlog: a.rlog\nbatery: 4S\n")
    refused("batery", read_session, path)


def test_air_density():
    # dry air at 15 °C and 101,325 Pa: 1.225 kg/m³; moist air is lighter
    for celsius, humidity, density in ((15, 0, 1.225), (30, 1, 1.146)):
        air = RoomAir(temperature_c=celsius, pressure_pa=101325, relative_humidity=humidity)
        assert air.density_kg_m3 == pytest.approx(density, abs=1e-3)


def test_index(log_path):
    raw = log_path.parent
    (raw / "vehicle.yaml").write_text("name: not a session\n")
    rows = write_index(raw)
    assert len(rows) == 1 and list(rows[0]) == INDEX_COLUMNS
    assert rows == read_index(raw)
    assert [rows[0][k] for k in ("file", "missing", "ended")] == ["run-bench.rlog", "1", "finished"]


def test_table_a1_spot_checks():
    # read off the thesis's table A.1
    assert EXPERIMENTS[4].maxima == (0.05, 0.2, 0.2, 0.05) and EXPERIMENTS[4].dynamics == "Roll +"
    assert EXPERIMENTS[13].maxima == (0.05, 0.05, 0.2, 0.2) and EXPERIMENTS[13].dynamics == "Pitch -"
    assert EXPERIMENTS[18].maxima == (0.2, 0.15, 0.2, 0.15)
    assert (EXPERIMENTS[23].signal, EXPERIMENTS[23].frequency_hz) == ("sine", 0.4)
    assert (EXPERIMENTS[30].roll_deg, EXPERIMENTS[30].pitch_deg) == (-15, 0)
    assert (EXPERIMENTS[46].roll_deg, EXPERIMENTS[46].pitch_deg, EXPERIMENTS[46].maxima[0]) == (0, -30, 0.1)
    assert len(EXPERIMENTS) == 48
