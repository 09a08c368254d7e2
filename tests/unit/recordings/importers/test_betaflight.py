"""Blackbox sessions written here bit by bit: every encoding, prediction and event, damage, and every header field on
which values depend, over its range."""

import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rotorid.errors import InputError
from rotorid.recordings import columns as c
from rotorid.recordings.importers import blackbox as format_
from rotorid.recordings.importers.betaflight import convert, throttles
from rotorid.recordings.importers.faults import moving_on
from rotorid.recordings.importers.logfile import read_log
from tests.refusals import refused

END = b"E\xffEnd of log\0"
MOST = 1 << 32


def unsigned(value: int) -> bytes:
    rest, out = value % MOST, bytearray()
    while rest > 127:
        out.append(rest & 127 | 128)
        rest >>= 7
    return bytes([*out, rest])


def signed(value: int) -> bytes:
    return unsigned((value << 1) ^ (value >> 63))


def fits(value: int, bits: int) -> bool:
    return -(1 << bits - 1) <= value < 1 << bits - 1


def up_to_eight(values: list[int]) -> bytes:
    which = bytes([sum((v != 0) << k for k, v in enumerate(values))])
    return which + b"".join(map(signed, filter(None, values))) if len(values) > 1 else signed(values[0])


def four(values: list[int]) -> bytes:
    kinds = [0 if v == 0 else next(k for k, bits in ((1, 4), (2, 8), (3, 16)) if fits(v, bits)) for v in values]
    bits = "".join(f"{v % (1 << w):0{w}b}" for v, k in zip(values, kinds, strict=True) if (w := (0, 4, 8, 16)[k]))
    bits += "0" * (-len(bits) % 8)
    packed_bits = bytes(int(bits[i : i + 8], 2) for i in range(0, len(bits), 8))
    return bytes([sum(k << 2 * i for i, k in enumerate(kinds))]) + packed_bits


def whole_bytes(values: list[int]) -> bytes:
    sizes = [next(n for n in (1, 2, 3, 4) if fits(v, 8 * n)) for v in values]
    lead = 3 << 6 | sum(n - 1 << 2 * k for k, n in enumerate(sizes))
    return bytes([lead]) + b"".join(v.to_bytes(n, "little", signed=True) for v, n in zip(values, sizes, strict=True))


def three(values: list[int]) -> bytes:
    a, b, d = values
    if all(fits(v, 2) for v in values):
        return bytes([(a & 3) << 4 | (b & 3) << 2 | d & 3])
    if all(fits(v, 4) for v in values):
        return bytes([1 << 6 | a & 15, (b & 15) << 4 | d & 15])
    if all(fits(v, 6) for v in values):
        return bytes([2 << 6 | a & 63, b & 63, d & 63])
    return whole_bytes(values)


def three_of_any_width(values: list[int]) -> bytes:
    a, b, d = values
    if all(fits(v, 2) for v in values):
        return three(values)
    if fits(a, 5) and fits(b, 5) and fits(d, 4):
        return (1 << 14 | (a & 31) << 9 | (b & 31) << 4 | d & 15).to_bytes(2, "big")
    if fits(a, 8) and fits(b, 7) and fits(d, 7):
        return (2 << 22 | (a & 255) << 14 | (b & 127) << 7 | d & 127).to_bytes(3, "big")
    return whole_bytes(values)


ENCODERS = {
    0: (lambda v: signed(v[0]), 1),
    1: (lambda v: unsigned(v[0]), 1),
    3: (lambda v: unsigned(-v[0] & 0x3FFF), 1),
    6: (up_to_eight, 8),
    7: (three, 3),
    8: (four, 4),
    9: (lambda v: b"", 1),
    10: (three_of_any_width, 3),
}


def packed(values: list[int], encodings: list[int]) -> bytes:
    out, k = b"", 0
    while k < len(values):
        encode, count = ENCODERS[encodings[k]]
        if encodings[k] == 6:
            count = next((n for n in range(1, 8) if encodings[k + n : k + n + 1] != [6]), 8)
        out += encode([int(v) for v in values[k : k + count]])
        k += count
    return out


def header(names, encodings_i, predictors_i, encodings_p=None, predictors_p=None, more=()) -> bytes:
    def listed(values) -> str:
        return ",".join(map(str, values))

    lines = [
        "Product:Blackbox flight data recorder by Nicholas Sherlock", "Data version:2",
        f"Field I name:{listed(names)}", f"Field I signed:{listed([1] * len(names))}",
        f"Field I predictor:{listed(predictors_i)}", f"Field I encoding:{listed(encodings_i)}",
        f"Field P predictor:{listed(predictors_p or predictors_i)}",
        f"Field P encoding:{listed(encodings_p or encodings_i)}",
        *more,
    ]  # fmt: skip
    return "".join(f"H {line}\n" for line in lines).encode()


def only(data: bytes) -> format_.BlackboxSession:
    (session,) = format_.sessions(data)
    assert isinstance(session, format_.BlackboxSession), session
    return session


NAMES = ["loopIteration", "time"]
RNG = np.random.default_rng(0)


@pytest.mark.parametrize("count", range(1, 10))
@pytest.mark.parametrize("encoding", sorted(ENCODERS))
def test_every_encoding_over_its_range(encoding: int, count: int) -> None:
    """Numbers of every size behind each other, in groups of every number of fields that the encoding packs."""
    _, together = ENCODERS[encoding]
    fields = count if together in (1, 8) else together * (1 + count // 5)
    bits = {3: 14, 8: 16, 9: 0}.get(encoding, 31)
    widths = RNG.integers(0, bits + 1, (300, fields)) if bits else np.zeros((300, fields), int)
    values = RNG.integers(-(2 ** np.maximum(widths - 1, 0)), 2 ** np.maximum(widths - 1, 0))
    values = np.where(widths == 0, 0, np.abs(values) if encoding == 1 else values)
    if encoding == 3:
        values = np.clip(values, -8191, 8191)
    names = [*NAMES, *(f"x[{k}]" for k in range(fields)), "last"]
    encodings = [1, 1, *[encoding] * fields, 0]
    data = header(names, encodings, [0] * len(names))
    for k, row in enumerate(values):
        data += b"I" + packed([k, 1000 * k, *row, -k], encodings)
    session = only(data + END)
    assert session.whole and session.damaged == 0
    np.testing.assert_array_equal(session.values[:, 2:-1], values)


FIELDS = {
    # name: encoding and predictor of key frames, of frames between; as Betaflight 4.5 has them
    "loopIteration": (1, 0, 9, 6), "time": (1, 0, 0, 2),
    "axisI[0]": (0, 0, 7, 1), "axisI[1]": (0, 0, 7, 1), "axisI[2]": (0, 0, 7, 1),
    "rcCommand[0]": (0, 0, 8, 1), "rcCommand[1]": (0, 0, 8, 1), "rcCommand[2]": (0, 0, 8, 1),
    "rcCommand[3]": (1, 0, 8, 1),
    "vbatLatest": (3, 9, 6, 1), "amperageLatest": (0, 0, 6, 1), "rssi": (1, 0, 6, 1),
    "gyroADC[0]": (0, 0, 0, 3), "gyroADC[1]": (0, 0, 0, 3), "gyroADC[2]": (0, 0, 0, 3),
    "motor[0]": (1, 11, 0, 3), "motor[1]": (0, 5, 0, 3), "motor[2]": (0, 5, 0, 3), "motor[3]": (0, 5, 0, 3),
    "throttle": (1, 4, 0, 1), "servo": (0, 8, 0, 1),
}  # fmt: skip
COLUMNS = [list(column) for column in zip(*FIELDS.values(), strict=True)]
SET = ("I interval:32", "P interval:1/4", "minthrottle:1070", "vbatref:1600", "motorOutput:158,2047",
       "Field S name:flightModeFlags,state", "Field S predictor:0,0", "Field S encoding:1,1",
       "Field G name:time,GPS_numSat", "Field G predictor:10,0", "Field G encoding:1,1")  # fmt: skip


def divided(a: int) -> int:
    """Half of a whole number, towards zero."""
    return abs(a) // 2 * (1 if a >= 0 else -1)


def written(values: np.ndarray, every: int = 8) -> list[bytes]:
    """Frames of main values (n, k), a key frame at each `every`th."""
    names, frames = list(FIELDS), []
    fixed = {4: 1070, 8: 1500, 9: 1600, 11: 158}
    for k, row in enumerate(values.astype(object)):
        key = k % every == 0
        before = values[k - 1].astype(object)
        earlier = values[k - 2].astype(object) if k % every > 1 else before
        rest = []
        for f, name in enumerate(names):
            predictor = FIELDS[name][1 if key else 3]
            guess = {0: 0, 5: row[names.index("motor[0]")], **fixed}.get(predictor)
            if guess is None:
                guess = {1: before[f], 2: 2 * before[f] - earlier[f], 3: divided(before[f] + earlier[f])}.get(predictor)
            rest.append(0 if predictor == 6 else (row[f] - guess + MOST // 2) % MOST - MOST // 2)
        frames.append((b"I" if key else b"P") + packed(rest, COLUMNS[0 if key else 2]))
    return frames


def main_values(count: int = 200, first_us: int = 5_000_000) -> np.ndarray:
    """Values of main frames, one of four iterations logged; motors stand still at times."""
    rng = np.random.default_rng(1)
    values = rng.integers(-500, 500, (count, len(FIELDS)))
    names = list(FIELDS)
    values[:, 0] = 4 * np.arange(count)
    values[:, 1] = (first_us + 1000 * np.arange(count) + rng.integers(-20, 20, count)) % MOST
    for name in names:
        if name.startswith("motor"):
            values[:, names.index(name)] = np.where(rng.random(count) < 0.2, 0, rng.integers(158, 2047, count))
    values[:, names.index("rcCommand[3]")] = rng.integers(1000, 2000, count)
    values[:, names.index("rssi")] = rng.integers(0, 1023, count)
    values[:, names.index("vbatLatest")] = rng.integers(1200, 1680, count)
    values[:, names.index("throttle")] = rng.integers(1070, 2000, count)
    return values


HEAD = header(list(FIELDS), *COLUMNS[:2], *COLUMNS[2:], more=SET)


@pytest.mark.parametrize("first_us", [MOST - 100_000, MOST // 2 - 100_000, MOST - 1])
def test_the_clock_that_begins_anew(first_us: int) -> None:
    values = main_values(first_us=first_us)
    session = only(HEAD + b"".join(written(values)) + END)
    time = session.values[:, 1]
    assert session.damaged == 0 and (np.diff(time) > 0).all()
    np.testing.assert_array_equal(time % MOST, values[:, 1])


@pytest.mark.parametrize("early_us", [-11_100_000, 11_100_000])
def test_a_first_frame_that_is_left_from_before_is_no_part_of_the_flight(early_us: int) -> None:
    values = main_values(first_us=50_000_000)
    values[0, 1] += early_us
    session = only(HEAD + b"".join(written(values)) + END)
    keep, faults = moving_on(session.values[:, 1] * 1e-6)
    assert keep.sum() >= len(values) - 40 and session.values[keep, 1].min() >= 50_000_000
    assert np.diff(session.values[keep, 1]).max() < 1_000_000


EVENTS = {
    "nothing": b"",
    "beep": b"E\0" + unsigned(5_000_000),
    "flight mode": b"E\x1e" + unsigned(ord("I")) + unsigned(ord("P")),
    "disarmed": b"E\x0f" + unsigned(ord("I")),
    "adjusted": b"E\x0d" + bytes([3]) + signed(-ord("P")),
    "adjusted to a decimal number": b"E\x0d" + bytes([3 | 128]) + struct.pack("<f", 12.5),
    "slow frame": b"S" + unsigned(ord("I")) + unsigned(ord("P")),
    "place": b"G" + unsigned(ord("I")) + unsigned(ord("E")),
}


@pytest.mark.parametrize("name", EVENTS)
def test_what_stands_between_main_frames(name: str) -> None:
    """Nothing: every prediction. Each event holds letters of frames among its numbers, which are none."""
    values = main_values()
    session = only(HEAD + b"".join(f + EVENTS[name] for f in written(values)) + END)
    assert session.whole and session.damaged == 0
    np.testing.assert_array_equal(session.values, values)


def test_a_log_that_was_stopped_and_resumes() -> None:
    """The event states where iterations and clock go on, here in bytes that look like frames."""
    values = main_values()
    values[96:, 0] += ord("I") << 14
    values[96:, 1] += 60_000_000
    frames = written(values)
    resumed = b"E\x0e" + unsigned(int(values[96, 0])) + unsigned(int(values[96, 1]))
    session = only(HEAD + b"".join(frames[:96]) + resumed + b"".join(frames[96:]) + END)
    assert session.damaged == 0
    np.testing.assert_array_equal(session.values, values)


@pytest.mark.parametrize("cut", range(1, 60))
def test_a_session_cut_off_at_any_byte_keeps_its_whole_frames(cut: int) -> None:
    values = main_values()
    frames = written(values)
    session = only((HEAD + b"".join(frames))[:-cut])
    lengths = np.cumsum([len(f) for f in frames[::-1]])
    assert not session.whole
    np.testing.assert_array_equal(session.values, values[: len(values) - 1 - np.searchsorted(lengths, cut)])


@pytest.mark.parametrize("behind", [b"\xff" * 4096, b"\0" * 4096, b"\x1a"])
def test_what_stands_behind_a_session_is_no_frame(behind: bytes) -> None:
    """A memory that was erased (all bits 1) or never written."""
    values = main_values()
    np.testing.assert_array_equal(only(HEAD + b"".join(written(values)) + behind).values, values[:-1])
    whole = only(HEAD + b"".join(written(values)) + END + behind)
    assert whole.whole and len(whole.values) == len(values)


@pytest.mark.parametrize("frame", range(40, 56))
def test_damage_takes_what_counts_from_it_and_nothing_else(frame: int) -> None:
    """Bytes are lost in one frame: it and those up to the next key frame go, no other value changes."""
    values = main_values()
    frames = written(values)
    damaged = [*frames[:frame], frames[frame][: len(frames[frame]) // 2], *frames[frame + 1 :]]
    session = only(HEAD + b"".join(damaged) + END)
    truth = {int(row[0]): row for row in values}
    for row in session.values:
        np.testing.assert_array_equal(row, truth[int(row[0])])
    assert session.whole and session.damaged > 0
    assert len(session.values) >= len(values) - 9


def test_of_two_sessions_the_unfinished_one_too() -> None:
    first, second = main_values(), main_values(120)
    data = HEAD + b"".join(written(first)) + END + HEAD + b"".join(written(second))[:-3]
    one, two = format_.sessions(data)
    assert (one.whole, two.whole) == (True, False)
    assert (len(one.values), len(two.values)) == (200, 119)


@pytest.mark.parametrize(
    "line",
    [
        b"H Field I encoding:1,1,5\n", b"H Field I encoding:1\n", b"H Field I name:a,b\n",
        b"H Field I name:" + b"x," * 999, b"H Field I predictor:0\n",
    ],
)  # fmt: skip
def test_a_damaged_header_is_one_sentence(line: bytes) -> None:
    (reason,) = format_.sessions(HEAD + line + b"".join(written(main_values())) + END)
    assert isinstance(reason, InputError) and "header" in str(reason)


# Values by the header -----------------------------------------------------------------------------

RATE = 100.0
STATED = {
    "Firmware revision": "Betaflight 4.5.1 (77d01ba3b) STM32F7X2", "gyro_scale": "0x3f800000", "acc_1G": "2048",
    "motorOutput": "158,2047", "motor_poles": "14", "features": "541130760", "minthrottle": "1070",
    "maxthrottle": "2000", "vbatscale": "110",
}  # fmt: skip


def frames_of(count: int = 1000, **changed) -> pd.DataFrame:
    """Main frames in flight throughout: 57.3 deg/s about x, 1 g, motors at a half, 30 hundreds of electrical turns."""
    wave = np.sin(np.arange(count))
    columns = {"loopIteration": np.arange(count), "time": 1e6 / RATE * np.arange(count)}
    columns |= {f"gyroADC[{k}]": 57.3 * (k == 0) + 0 * wave for k in range(3)}
    columns |= {f"accSmooth[{k}]": 2048.0 * (k == 2) + 0 * wave for k in range(3)}
    columns |= {f"motor[{k}]": 1102.5 + wave for k in range(4)}
    columns |= {f"eRPM[{k}]": 30.0 + 0 * wave for k in range(4)}
    columns |= {"vbatLatest": 1600.0 + 0 * wave, "amperageLatest": 1200.0 + 0 * wave}
    return pd.DataFrame(columns).assign(**changed)


def run_of(raw: pd.DataFrame, **stated) -> tuple[pd.DataFrame, str]:
    """The one flight of frames and what was found, in words; `None` takes a line of the header away."""
    headers = {k: v for k, v in (STATED | stated).items() if v is not None}
    runs, faults = convert(raw, headers, "log", "log.bbl")
    (run,) = runs.values()
    return run, " ".join(f.sentence for f in faults)


def middle(run: pd.DataFrame, name: str) -> float:
    return float(np.nanmedian(run[name]))


@pytest.mark.parametrize(
    ("stated", "rate"),
    [
        ({}, 1.0),
        ({"gyro_scale": "0x3d79c190"}, 0.060976),  # 1/16.4: counts of the sensor, before 3.1
        ({"gyro_scale": None}, 1.0),
        ({"gyro_scale": None, "gyro.scale": "0x3f000000"}, 0.5),
        ({"gyro_scale": "1"}, 1.0),
        ({"blackbox_high_resolution": "1"}, 0.1),
        ({"blackbox_high_resolution": "0"}, 1.0),
        ({"blackbox_high_resolution": "1", "gyro_scale": "0x3f000000"}, 0.05),
    ],
)
def test_rates_by_the_header(stated: dict, rate: float) -> None:
    run, _ = run_of(frames_of(), **stated)
    assert middle(run, c.ANGULAR_VELOCITY[0]) == pytest.approx(rate * np.radians(57.3), rel=1e-3)


@pytest.mark.parametrize("one_g", [256, 512, 1024, 2048, 4096, 8192])
def test_accelerometer_by_the_header(one_g: int) -> None:
    run, _ = run_of(frames_of(**{"accSmooth[2]": float(one_g)}), acc_1G=str(one_g))
    assert middle(run, c.SPECIFIC_FORCE[2]) == pytest.approx(-9.80665)


def test_an_accelerometer_without_its_scale_is_named() -> None:
    run, told = run_of(frames_of(), acc_1G=None)
    assert c.SPECIFIC_FORCE[2] not in run and "does not state acc_1G" in told


@pytest.mark.parametrize("poles", [2, 8, 12, 14, 22, 28, 42])
def test_speeds_by_the_number_of_poles(poles: int) -> None:
    run, _ = run_of(frames_of(), motor_poles=str(poles))
    assert middle(run, "rotor_speed_1_rad_s") == pytest.approx(3000 / (poles / 2) * np.pi / 30)


@pytest.mark.parametrize("stated", [None, "0", "?"])
def test_poles_that_are_not_stated_are_said_to_be_assumed(stated: str | None) -> None:
    run, told = run_of(frames_of(), motor_poles=stated)
    assert middle(run, "rotor_speed_1_rad_s") == pytest.approx(3000 / 7 * np.pi / 30) and "motor_poles" in told


NO_3D, WITH_3D = 541130760 & ~(1 << 12), 541130760 | 1 << 12


@pytest.mark.parametrize(
    ("motor", "stated", "share"),
    [
        (158, {}, 0.0), (1102.5, {}, 0.5), (2047, {}, 1.0), (0, {}, 0.0),
        (48, {"motorOutput": "48,2047"}, 0.0), (1500, {"motorOutput": "1070,2000"}, 430 / 930),
        (1500, {"motorOutput": "1000,2000"}, 0.5), (1100, {"motorOutput": "158,1858"}, (1100 - 158) / 1700),
        (1500, {"motorOutput": None}, 430 / 930), (1500, {"motorOutput": None, "minthrottle": None}, 0.5),
        (700, {"motorOutput": None}, (700 - 48) / 1999), (1500, {"motorOutput": "2000,1000"}, 430 / 930),
        # 3D: forward from 1048 (and idle), backwards below; pulses forward from the dead band
        (1048 + 110, {"features": WITH_3D}, 0.0), (2047, {"features": WITH_3D}, 1.0),
        (1602.5, {"features": WITH_3D}, 0.5), (600, {"features": WITH_3D}, np.nan), (0, {"features": WITH_3D}, 0.0),
        (1602.5, {"features": NO_3D}, (1602.5 - 158) / 1889),
        (1757, {"features": WITH_3D, "motorOutput": "1000,2000"}, 0.5),
        (1200, {"features": WITH_3D, "motorOutput": "1000,2000"}, np.nan),
        (1460, {"features": WITH_3D, "motorOutput": "1000,2000"}, 0.0),
    ],
)  # fmt: skip
def test_throttle_by_the_header(motor: float, stated: dict, share: float) -> None:
    headers = {k: str(v) for k, v in (STATED | stated).items() if v is not None}
    found, _ = throttles(np.array([[motor, motor]]), headers)
    np.testing.assert_allclose(found, share, atol=1e-9)


def test_motors_that_turn_backwards_are_named_and_their_cells_empty() -> None:
    raw = frames_of()
    raw.loc[:, [f"motor[{k}]" for k in range(4)]] += 500
    raw.loc[400:449, "motor[2]"] = 500.0
    run, told = run_of(raw, features=str(WITH_3D))
    assert run["throttle_3"].isna().sum() == run["rotor_speed_3_rad_s"].isna().sum() == 50
    assert run["throttle_1"].notna().all() and "50 samples have a motor that turns backwards" in told


@pytest.mark.parametrize(
    ("revision", "stated", "volts", "amperes"),
    [
        ("Betaflight 4.5.1 (x) Y", {}, 16.0, 12.0), ("Betaflight 4.0.0 (x) Y", {}, 16.0, 12.0),
        ("Betaflight 2025.12.0-beta (x) Y", {}, 16.0, 12.0), ("Betaflight 3.5.7 (x) Y", {}, 160.0, 12.0),
        ("Betaflight 3.1.0 (x) Y", {}, 160.0, 12.0),
        ("Betaflight 3.0.1 (x) Y", {"currentMeter": "0,400"}, 1600 * 330 * 110 / 4095 / 1000, 1200 * 3300 / 4095 / 40),
        ("Betaflight 3.0.1 (x) Y", {"currentMeter": "10,400"}, 1600 * 330 * 110 / 4095 / 1000,
         (1200 * 3300 / 4095 - 10) / 40),
    ],
)  # fmt: skip
def test_battery_by_the_version(revision: str, stated: dict, volts: float, amperes: float) -> None:
    run, _ = run_of(frames_of(), **{"Firmware revision": revision}, **stated)
    assert middle(run, c.BATTERY_VOLTAGE) == pytest.approx(volts)
    assert middle(run, c.BATTERY_CURRENT) == pytest.approx(amperes)


@pytest.mark.parametrize("stated", [{"Firmware revision": "Betaflight"}, {"Firmware revision": "Betaflight 3.0.1"}])
def test_a_battery_whose_unit_is_not_known_is_named(stated: dict) -> None:
    run, told = run_of(frames_of(), vbatscale=None, **stated)
    assert c.BATTERY_VOLTAGE not in run and "vbatLatest" in told and "amperageLatest" in told


@pytest.mark.parametrize(
    ("base", "other"),
    [("gyroADC", "gyroData"), ("gyroADC", "gyroUnfilt"), ("accSmooth", "accADC"), ("eRPM", "eRPM(/100)")],
)  # fmt: skip
def test_names_of_other_releases(base: str, other: str) -> None:
    raw = frames_of()
    renamed = raw.rename(columns=lambda n: n.replace(base, other))
    pd.testing.assert_frame_equal(run_of(raw)[0], run_of(renamed)[0])


@pytest.mark.parametrize("stands_still", [False, True])
def test_a_motor_without_telemetry_keeps_the_speeds_of_the_others(stands_still: bool) -> None:
    raw = frames_of()
    raw = raw.assign(**{"eRPM[2]": 0}) if stands_still else raw.drop(columns="eRPM[2]")
    run, told = run_of(raw)
    assert [n for n in run if n.startswith("rotor_speed")] == [f"rotor_speed_{k}_rad_s" for k in (1, 2, 4)]
    assert "rotor_speed_3_rad_s: its eRPM is not logged, or 0 throughout; column left out" in told


@pytest.mark.parametrize(("motors", "what"), [(1, "fixed wing"), (2, "bicopter"), (3, "tricopter")])
def test_fewer_motors_than_four_are_no_multirotor(motors: int, what: str) -> None:
    few = frames_of().drop(columns=[f"motor[{k}]" for k in range(motors, 4)])
    refused(f"log.bbl: the log is of a.*{what}.* \\({motors} motors\\); only multirotors", run_of, few)


@pytest.mark.parametrize(
    ("base", "other"), [("gyroADC", "gyroScaled"), ("accSmooth", "acc_g"), ("eRPM", "erpm_raw"), ("vbatLatest", "vbat")]
)
def test_a_field_that_looks_like_a_known_one_is_named(base: str, other: str) -> None:
    _, told = run_of(frames_of().rename(columns=lambda n: n.replace(base, other)))
    assert f"{base} is not logged, but {other}" in told


# Files --------------------------------------------------------------------------------------------


def flight() -> bytes:
    raw = frames_of().round().astype(int)
    signed_all = [0] * len(raw.columns)
    data = header(list(raw), signed_all, signed_all, more=[f"{k}:{v}" for k, v in STATED.items()])
    return data + b"".join(b"I" + packed(list(row), signed_all) for row in raw.to_numpy())


def test_a_log_without_its_end_is_kept_and_said_to_break_off(tmp_path: Path) -> None:
    path = tmp_path / "log.bbl"
    path.write_bytes(flight() + END + flight()[:-5])
    found = read_log(path)
    assert [len(t) for t in found.runs.values()] == [1000, 999]
    told = " ".join(f.sentence for f in found.faults)
    assert "breaks off" in told and "999 frames up to 9.98 s kept" in told


def test_a_session_that_holds_no_flight_is_named(tmp_path: Path) -> None:
    path = tmp_path / "log.bbl"
    path.write_bytes(flight() + END + HEAD + END)
    found = read_log(path)
    assert len(found.runs) == 1 and "session 2" in " ".join(f.sentence for f in found.faults)


def test_the_readers_load_nothing_that_takes_time_before_a_log_needs_it() -> None:
    """Each of these takes a tenth of a second or more."""
    heavy = "('scipy.spatial', 'scipy.io', 'scipy.optimize', 'numba')"
    read = f"import sys, rotorid.recordings.importers.logfile; sys.exit(any(m in sys.modules for m in {heavy}))"
    assert subprocess.run([sys.executable, "-c", read]).returncode == 0
