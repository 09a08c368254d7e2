"""DataFlash files by their own descriptions, judged by pymavlink."""

import struct
from pathlib import Path

import numpy as np
import pytest

from rotorid.recordings.importers.dataflash import read_dataflash
from tests.public_logs import public
from tests.unit.recordings.importers.test_log_formats import PARAMETERS, dataflash, flown


def by_pymavlink(path: Path, capfd) -> dict[str, list[dict]]:
    """Every message of a file by its name, as pymavlink reads it."""
    reader = pytest.importorskip("pymavlink.DFReader")
    log, rows = reader.DFReader_binary(str(path), zero_time_base=True), {}
    while (message := log.recv_match(type=list(log.name_to_id), strict=True)) is not None:
        rows.setdefault(message.get_type(), []).append(message.to_dict())
    log.close()
    capfd.readouterr()
    return rows


def check_against(path: Path, capfd) -> int:
    """Values of every message are those of pymavlink, to the last digit; how many messages there are."""
    judged = by_pymavlink(path, capfd)
    found, _ = read_dataflash(path, judged)
    for kind, rows in judged.items():
        if kind == "FMT":
            continue
        columns = found[kind].columns
        assert len(found[kind].offsets) == len(rows), kind
        for name, values in columns.items():
            expected = [row[name] for row in rows]
            if values.dtype == object:
                assert values.tolist() == expected, (kind, name)
            else:
                assert np.array_equal(values, np.array(expected), equal_nan=True), (kind, name)
                assert values.dtype.kind == np.array(expected).dtype.kind, (kind, name)
    assert set(found) >= set(judged) - {"FMT"}
    return sum(map(len, judged.values()))


@pytest.mark.parametrize("name", ["copter-3.3-dev_31.BIN", "copter-3.4_22.BIN"])
def test_public_logs_have_the_values_that_pymavlink_reads(name: str, capfd) -> None:
    assert check_against(public(f"logs/ardupilot/{name}"), capfd) > 20_000


@pytest.mark.parametrize("seed", range(6))
def test_stray_bytes_and_lost_ones_cost_the_message_they_are_in_alone(seed: int, tmp_path: Path, capfd) -> None:
    data, rng = bytearray(dataflash(flown().iloc[:200], PARAMETERS)), np.random.default_rng(seed)
    start = len(data) // 10  # behind descriptions and parameters
    for place in sorted(rng.integers(start, len(data) - 600, 8), reverse=True):
        if seed % 2:
            data[place:place] = bytes(rng.integers(1, 160, int(rng.integers(1, 40)), dtype=np.uint8))
        else:
            del data[place : place + int(rng.integers(1, 40))]
    path = tmp_path / "log.bin"
    path.write_bytes(data)
    found, _ = read_dataflash(path, ["IMU", "RCOU", "ESC"])
    # A damaged message may swallow the next; each damage costs two of a kind and what it deleted.
    assert len(found["IMU"].offsets) > 2 * 200 - 8 * 4 and len(found["RCOU"].offsets) > 200 - 8 * 3
    times = found["RCOU"].columns["TimeUS"]
    whole = (np.round(flown()["time_s"].to_numpy()[:200] * 1e6).astype(np.int64) + 2_000_000).tolist()
    near = [int(np.min(np.abs(np.array(whole) - t))) for t in times]
    assert np.mean(np.array(near) <= 1) > 0.95


def test_what_a_file_ends_in_is_counted(tmp_path: Path) -> None:
    data, path = dataflash(flown().iloc[:20], PARAMETERS), tmp_path / "log.bin"
    last = len(data) - data.rindex(b"\xa3\x95")
    for lost, came in ((0, 0), (1, last - 1), (last - 3, 3), (last - 2, 2), (last - 1, 0), (last, 0)):
        path.write_bytes(data[: len(data) - lost])
        found, bytes_came = read_dataflash(path, ["BAT"])
        assert bytes_came == came and len(found["BAT"].offsets) == (20 if lost == 0 else 19)


def test_a_damaged_description_loses_its_own_kind_alone(tmp_path: Path) -> None:
    data = dataflash(flown().iloc[:20], PARAMETERS)
    path = tmp_path / "log.bin"
    place = data.index(b"BAT\0")
    for letters in (b"Qff?", b"Qf"):  # a letter that is none, and fields that do not fill the message
        damaged = bytearray(data)
        damaged[place + 4 : place + 4 + 16] = letters.ljust(16, b"\0")
        path.write_bytes(damaged)
        found, _ = read_dataflash(path, ["BAT", "IMU"])
        assert set(found) == {"IMU"} and len(found["IMU"].offsets) == 40


def test_letters_of_hundredths_and_halves(tmp_path: Path, capfd) -> None:
    head = b"\xa3\x95\x80"
    letters = b"QcCeELgM"
    body = struct.pack("<QhHiIiebB"[:-1], 2**62, -150, 60000, -123456, 4_000_000_000, 475123456, 1.5, -3)
    size = 3 + len(body)
    fmt = struct.pack("<BB4s16s64s", 200, size, b"TST", letters, b"TimeUS,A,B,C,D,E,F,G")
    path = tmp_path / "log.bin"
    own = struct.pack("<BB4s16s64s", 128, 89, b"FMT", b"BBnNZ", b"Type,Length,Name,Format,Columns")
    path.write_bytes((head + own) + (head + fmt) + 20 * (b"\xa3\x95" + bytes([200]) + body))
    found, _ = read_dataflash(path, ["TST"])
    first = {name: values[0] for name, values in found["TST"].columns.items()}
    assert first == {
        "TimeUS": 2**62,
        "A": -1.5,
        "B": 600.0,
        "C": -1234.56,
        "D": 4e7,
        "E": 47.5123456,
        "F": 1.5,
        "G": -3,
    }
    check_against(path, capfd)
