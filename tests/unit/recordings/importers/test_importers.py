"""Importers on small files written here, byte by byte where the format is binary."""

import struct
from pathlib import Path
from zlib import crc32

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat
from scipy.spatial.transform import Rotation

from rotorid.errors import InputError
from rotorid.recordings import columns as c
from rotorid.recordings import templates
from rotorid.recordings.files import check_belief
from rotorid.recordings.importers import crazyflie, px4_ulog
from rotorid.recordings.importers.crazyflie import TYPES, decode_usd_log, read_usd_log
from rotorid.recordings.importers.faults import (
    blank_held,
    cut,
    drop_repeated_times,
    flights,
    moving_on,
    on_grid,
    report_gaps,
    true_stretches,
)
from rotorid.recordings.importers.known import Parameters
from rotorid.recordings.importers.mapping import (
    continuous,
    half_turn_about_x,
    quaternion_from_euler_frd,
    quaternion_to_frd_ned,
)
from rotorid.recordings.importers.neurobem import USED, read_neurobem
from rotorid.recordings.importers.rcbenchmark import decode_text, read_rcbenchmark
from rotorid_lab.public_sets import read_imrc_bench, read_vicon_csv
from tests.refusals import refused


def kinds(faults) -> list[str]:
    return [fault.kind for fault in faults]


# Frames -------------------------------------------------------------------------------------------


def test_half_a_turn_about_x_keeps_forward_and_turns_left_and_up_over() -> None:
    assert half_turn_about_x([[1.0, 2.0, 3.0]]).tolist() == [[1.0, -2.0, -3.0]]


def test_a_quaternion_turned_over_turns_the_same_vectors() -> None:
    rng = np.random.default_rng(1)
    attitude = Rotation.random(20, rng=rng)
    body_flu = rng.normal(size=(20, 3))
    wxyz = quaternion_to_frd_ned(attitude.as_quat()[:, [3, 0, 1, 2]])
    turned = Rotation.from_quat(wxyz[:, [1, 2, 3, 0]])
    expected = half_turn_about_x(attitude.apply(body_flu))
    np.testing.assert_allclose(turned.apply(half_turn_about_x(body_flu)), expected, atol=1e-12)


def test_quaternions_are_made_continuous_in_sign() -> None:
    once = np.array([[1.0, 0, 0, 0], [-1.0, 0, 0, 0], [-0.9, 0.1, 0, 0], [0.9, 0, 0, 0]])
    assert (continuous(once)[:, 0] > 0).all()


def test_euler_angles_nose_up_is_positive_pitch() -> None:
    wxyz = quaternion_from_euler_frd(np.zeros(1), np.radians([90.0]), np.zeros(1))
    nose = Rotation.from_quat(wxyz[:, [1, 2, 3, 0]]).apply([1.0, 0, 0])
    np.testing.assert_allclose(nose, [[0, 0, -1.0]], atol=1e-12)


# Cleaning -----------------------------------------------------------------------------------------


def test_rows_that_do_not_move_the_clock_on_are_dropped_and_counted() -> None:
    table = pd.DataFrame({"time_s": [0.0, 1.0, 1.0, 0.5, 2.0, np.nan], "x": range(6)})
    kept, faults = drop_repeated_times(table)
    assert kept["x"].tolist() == [0, 1, 4]
    assert kinds(faults) == ["repeated_time"] and faults[0].samples == 3
    assert "3 rows do not move the clock on (first at 1 s)" in faults[0].sentence


def test_held_values_become_empty_cells_and_rows_with_nothing_go() -> None:
    table = pd.DataFrame(
        {"time_s": np.arange(6.0), "a": [1, 1, 2, 2, 3, 3.0], "b": [1, 2, 3, 4, 5, 5.0], "d": [1, 1, 1, 1, 1, 1.0]}
    )
    kept, faults = blank_held(table, {"slow": ["a"], "fast": ["b"]}, share=0.3)
    assert kept["a"].isna().tolist() == [False, True, False, True, False, True]
    assert kept["b"].tolist() == [1, 2, 3, 4, 5, 5]
    assert kinds(faults) == ["held"]
    dropped, _ = blank_held(table[["time_s", "a"]], {"slow": ["a"]})
    assert dropped["time_s"].tolist() == [0, 2, 4]


def test_gaps_are_reported_and_left() -> None:
    assert kinds(report_gaps(pd.DataFrame({"time_s": np.array([0, 1, 2, 3, 8, 9.0])}))) == ["gap"]
    assert report_gaps(pd.DataFrame({"time_s": np.arange(5.0)})) == []


def test_stretches_of_true_and_cutting() -> None:
    time = np.arange(10.0)
    mask = np.array([0, 1, 1, 1, 0, 0, 1, 1, 1, 1], bool)
    assert true_stretches(mask, time, 2.5) == [(6.0, 9.0)]
    assert true_stretches(mask, time, 2.0) == [(1.0, 3.0), (6.0, 9.0)]
    assert cut(pd.DataFrame({"time_s": time}), 1.0, 3.0)["time_s"].tolist() == [0, 1, 2]


# RCbenchmark --------------------------------------------------------------------------------------

HEADING = (
    "Time (s),ESC signal (µs),Servo 1 (µs),Servo 2 (µs),Servo 3 (µs),Thrust (gf),Voltage (V),Current (A),"
    "Motor Electrical Speed (RPM),Motor Optical Speed (RPM),Electrical Power (W),Overall Efficiency (gf/W),"
    "App message,"
)
ROWS = [
    "0,1050,,,,10,11.1,0.5,0,0,5,2,,",
    "1.7,1500,,,,100,11.0,2.5,9549.2966,0,28,3.5,,",
    "3.4,1500,,,,400,11.0,2.5,19098.5932,0,28,3.5,,",
    "5.1,2000,,,,900,10.8,9.5,28647.8898,0,100,3.5,,",
]


def bench(tmp_path: Path, rows=None, encoding="utf-8-sig", end="\n") -> Path:
    path = tmp_path / "a1_11.csv"
    path.write_bytes((end.join([HEADING, *(rows or ROWS)]) + end).encode(encoding))
    return path


def test_a_bench_run_has_si_units_and_the_thrust_points_up(tmp_path: Path) -> None:
    table, faults = read_rcbenchmark(bench(tmp_path))
    assert table["rotor_speed_1_rad_s"].tolist() == pytest.approx([0, 1000, 2000, 3000], abs=1e-3)
    assert table["force_z_n"].tolist() == pytest.approx([-0.0980665, -0.980665, -3.92266, -8.825985])
    assert table["throttle_1"].tolist() == [0.05, 0.5, 0.5, 1.0]
    assert table["battery_voltage_v"].tolist() == [11.1, 11.0, 11.0, 10.8]
    assert kinds(faults) == ["byte_order_mark", "speed_missing"]


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1"])
def test_every_encoding_and_line_end_gives_the_same_table(tmp_path: Path, encoding: str, end: str) -> None:
    expected, _ = read_rcbenchmark(bench(tmp_path))
    table, faults = read_rcbenchmark(bench(tmp_path, encoding=encoding, end=end))
    pd.testing.assert_frame_equal(table, expected)
    assert ("encoding" in kinds(faults)) == (encoding == "latin-1")
    assert ("line_ends" in kinds(faults)) == (end == "\r")


def test_a_flipped_sign_is_flagged_and_kept(tmp_path: Path) -> None:
    table, faults = read_rcbenchmark(bench(tmp_path, [row.replace(",,,,", ",,,,-", 1) for row in ROWS]))
    assert "flipped_sign" in kinds(faults)
    assert table["force_z_n"].iloc[-1] == pytest.approx(8.825985)


def test_a_speed_far_too_low_for_its_thrust_is_flagged(tmp_path: Path) -> None:
    rows = [ROWS[0], "0.9,1150,,,,50,11.0,1,286,0,9,3,,", *ROWS[1:]]
    assert "speed_lost" in kinds(read_rcbenchmark(bench(tmp_path, rows))[1])


def test_bench_messages_name_line_and_column(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"line 3, column Thrust \(gf\): expected a number, found 'x'"):
        read_rcbenchmark(bench(tmp_path, [ROWS[0], ROWS[1].replace(",100,", ",x,")]))
    path = tmp_path / "b.csv"
    path.write_text("Time (s),ESC signal\n0,1000\n")
    refused("no column whose heading starts with 'Thrust'", read_rcbenchmark, path)
    path.write_text("")
    refused("expected a heading and rows", read_rcbenchmark, path)
    refused("file is missing", read_rcbenchmark, tmp_path / "none.csv")
    assert decode_text(b"a\r\nb")[1] == []


# NeuroBEM -----------------------------------------------------------------------------------------


def neurobem_matrix(samples: int = 50, columns: int = 41) -> np.ndarray:
    """FLU: a hover, nose turned left by 90 degrees, moving forward at 2 m/s and up at 1 m/s."""
    matrix = np.zeros((samples, columns))
    matrix[:, 0] = 9.0 + np.arange(samples) * 0.0025
    matrix[:, 1:4] = [1.0, 2.0, 3.0]
    matrix[:, 4:7] = [0.1, 0.2, 0.3]
    matrix[:, 7:11] = Rotation.from_euler("z", 90, degrees=True).as_quat()
    matrix[:, 11:14] = [0.1, 0.2, 9.81]
    matrix[:, 14:17] = [2.0, 0.0, 1.0]
    matrix[:, 17:20] = [1.0, 2.0, 3.0]
    matrix[:, 20:24] = [1000.0, 1100.0, 1200.0, 1300.0]
    matrix[:, 28] = 160.0
    matrix[:, 29:32] = [0.1, 0.2, 7.5]
    matrix[:, 32:35] = [0.01, 0.02, 0.03]
    return matrix


def test_neurobem_ends_in_north_east_down_and_forward_right_down(tmp_path: Path) -> None:
    savemat(tmp_path / "bemnn1.mat", {"bemnn1": neurobem_matrix()})
    table, faults = read_neurobem(tmp_path / "bemnn1.mat")
    row = table.iloc[0]
    assert row["time_s"] == 0.0
    # Turned left by 90 degrees, forward is y of the z-up world; y and z change sign.
    assert [row[n] for n in c.VELOCITY] == pytest.approx([0.0, -2.0, -1.0], abs=1e-12)
    assert [row[n] for n in c.POSITION] == [1.0, -2.0, -3.0]
    assert [row[n] for n in c.SPECIFIC_FORCE] == [0.1, -0.2, -9.81]
    assert [row[n] for n in c.ANGULAR_VELOCITY] == [0.1, -0.2, -0.3]
    # Left seen from above is a negative yaw when z points down.
    assert [row[n] for n in c.QUATERNION] == pytest.approx([np.sqrt(0.5), 0, 0, -np.sqrt(0.5)])
    assert [row[n] for n in c.rotor_columns("rotor_speed", 4)] == [1000, 1100, 1200, 1300]
    assert row["battery_voltage_v"] == 16.0
    assert [row[f"neurobem_force_{a}_n"] for a in "xyz"] == [0.1, -0.2, -7.5]
    assert [row[f"neurobem_moment_{a}_n_m"] for a in "xyz"] == [0.01, -0.02, -0.03]
    assert [row[f"angular_acceleration_{a}_rad_s2"] for a in "xyz"] == [1.0, -2.0, -3.0]
    assert kinds(faults) == ["unit", "superseded", "derived"]
    assert "6 columns of residuals" in faults[1].found


def test_neurobem_messages(tmp_path: Path) -> None:
    savemat(tmp_path / "few.mat", {"m": neurobem_matrix()[:, : USED - 1]})
    refused(f"expected one matrix with at least {USED} columns", read_neurobem, tmp_path / "few.mat")
    (tmp_path / "text.mat").write_text("no")
    refused("not a MATLAB file", read_neurobem, tmp_path / "text.mat")
    refused("file is missing", read_neurobem, tmp_path / "none.mat")


# Vicon --------------------------------------------------------------------------------------------


def vicon_rows(seconds: float = 12.0, rate: float = 50.0) -> np.ndarray:
    """At rest for 2 s, in the air at 0.5 m for 8 s, at rest again; nose up 2 deg, rolled right 3 deg."""
    time = np.arange(int(seconds * rate)) / rate
    air = (time >= 2) & (time < 10)
    rows = np.zeros((len(time), 25))
    rows[:, 0] = time
    rows[:, 1:4] = np.column_stack([0.001 * time, 0.002 * time, np.where(air, 0.5, 0.05) + 1e-4 * np.sin(time)])
    rows[:, 4:7] = [0.1, 0.2, 0.3]
    rows[:, 7:10] = [3.0, 2.0, 0.0]
    rows[:, 10:13] = np.column_stack([np.sin(time), np.cos(time), time])
    slow = np.floor(time * 5) / 5  # rotor speeds come at 5 Hz and are held
    rows[:, 13:17] = np.where(air[:, None], 6000 + slow[:, None], 0)
    rows[:, 17:21] = 15.0 + 0.001 * slow[:, None]
    rows[:, 21:25] = 2.5
    return rows


def write_vicon(path: Path, rows: np.ndarray, tail: str = "") -> Path:
    path.write_text("\n".join(",".join(f"{v:.9g}" for v in row) for row in rows) + "\n" + tail)
    return path


def test_vicon_turns_only_the_height_over_and_keeps_the_part_in_the_air(tmp_path: Path) -> None:
    rows = vicon_rows()
    rows[:3, 1:4] = np.nan
    table, faults = read_vicon_csv(write_vicon(tmp_path / "v.csv", rows, tail="12,0.1,0.2"))
    assert kinds(faults) == ["cut_off", "no_lock", "on_ground", "held", "held"]
    assert "last line has 3 of 25 columns" in faults[0].found
    assert table["time_s"].iloc[0] == 0.0
    assert table["time_s"].iloc[-1] == pytest.approx(6.98)  # 3 to 9.98 s of the log
    assert table["position_z_m"].iloc[0] == pytest.approx(-0.5, abs=1e-3)
    assert table["height_m"].iloc[0] == pytest.approx(0.5, abs=1e-3)
    assert table[list(c.VELOCITY)].iloc[0].tolist() == pytest.approx([0.1, 0.2, -0.3])
    attitude = Rotation.from_quat(table.loc[0, [f"quaternion_{a}" for a in "xyzw"]].to_numpy(float))
    thrust = attitude.apply([0, 0, -1.0])
    assert thrust[0] < 0  # nose up: pushed backwards
    assert thrust[1] > 0  # rolled right: pushed to the right
    assert table["battery_current_a"].dropna().iloc[0] == 10.0


def test_vicon_empties_held_rotor_speeds(tmp_path: Path) -> None:
    table, _ = read_vicon_csv(write_vicon(tmp_path / "v.csv", vicon_rows()))
    speeds = table["rotor_speed_1_rad_s"]
    assert 34 <= speeds.notna().sum() <= 36  # 7 s at 5 Hz
    assert speeds.dropna().iloc[1] == pytest.approx((6000 + 3.2) * 2 * np.pi / 60)
    assert table["angular_velocity_x_rad_s"].notna().all()


def test_vicon_messages(tmp_path: Path) -> None:
    path = tmp_path / "v.csv"
    good = ",".join(["1"] * 25)
    path.write_text(f"{good}\n{good.replace('1', 'x', 1)}\n{good}\n")
    refused("line 2, column 1: expected a number, found 'x'", read_vicon_csv, path)
    path.write_text(f"{good}\n1,2\n{good}\n")
    refused("line 2: expected 25 columns, found 2", read_vicon_csv, path)
    path.write_text("")
    refused("expected at least two rows of 25 numbers", read_vicon_csv, path)
    rows = vicon_rows()
    rows[:, 13:17] = 0
    refused(r"v.csv: no stretch of 5 s in the air", read_vicon_csv, write_vicon(path, rows))
    refused("file is missing", read_vicon_csv, tmp_path / "none.csv")


# IMRC bench ---------------------------------------------------------------------------------------


def test_a_vehicle_on_a_scale_in_both_layouts(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("pwm,vbat[V],rpm1,rpm2,rpm3,rpm4,thrust[g]\n32768,4.0,9549.2966,0,1,1,100\n0,4.1,0,0,0,0,0\n")
    table, faults = read_imrc_bench(path)
    assert table["force_z_n"].tolist() == pytest.approx([-0.980665, 0])
    assert table["throttle_4"].tolist() == [0.5, 0.0]
    assert table["rotor_speed_1_rad_s"].tolist() == pytest.approx([1000, 0])
    assert [(f.kind, f.column) for f in faults] == [("no_clock", "time_s"), ("speed_dropout", "rotor_speed_2_rad_s")]
    path.write_text(
        "weight[g],pwm,vbat[V],rpm1,rpm2,rpm3,rpm4,v[V],i[A],p[W]\n1,0,4,0,0,0,0,4,0.5,2\n1,0,x,0,0,0,0,4,1,4\n"
    )
    refused(r"line 3, column vbat\[V\]: expected a number, found 'x'", read_imrc_bench, path)
    path.write_text("pwm,rpm1\n1,2\n")
    refused(r"line 1: expected the column vbat\[V\]", read_imrc_bench, path)
    refused("file is missing", read_imrc_bench, tmp_path / "none.csv")


# Crazyflie uSD ------------------------------------------------------------------------------------


def usd_bytes(variables, rows, version: int = 2, times=None, name: str = "fixedFrequency", extra=b"") -> bytes:
    """A log as the firmware writes it: header, events, checksum. `rows` match `variables` [(name, type)]."""
    data = struct.pack("<BHH", 0xBC, version, 1) + struct.pack("<H", 7) + name.encode() + b"\0"
    data += struct.pack("<H", len(variables))
    for variable, letter in variables:
        data += f"{variable}({letter})".encode() + b"\0"
    layout = "<" + "".join(letter for _, letter in variables)
    for number, row in enumerate(rows):
        stamp = number * (2000 if version == 2 else 2) if times is None else times[number]
        data += struct.pack("<HQ" if version == 2 else "<HI", 7, stamp) + struct.pack(layout, *row)
    data += extra
    return data + struct.pack("<I", crc32(data))


def test_a_usd_log_is_decoded_type_by_type() -> None:
    variables = [("acc.z", "f"), ("motor.m1", "I"), ("rpm.m1", "H"), ("state", "B"), ("error", "h")]
    data = usd_bytes(variables, [(1.5, 40000, 20000, 3, -5), (0.5, 41000, 20001, 4, 6)])
    tables, faults = decode_usd_log(data)
    assert faults == []
    table = tables["fixedFrequency"]
    assert table["time_s"].tolist() == [0.0, 0.002] and table["acc.z"].tolist() == [1.5, 0.5]
    assert table["motor.m1"].tolist() == [40000, 41000] and table["error"].tolist() == [-5, 6]


def test_version_1_counts_milliseconds() -> None:
    tables, _ = decode_usd_log(usd_bytes([("a", "f")], [(1,), (2,)], version=1))
    assert tables["fixedFrequency"]["time_s"].tolist() == [0.0, 0.002]


def test_the_clock_of_version_1_goes_on_where_it_begins_anew() -> None:
    data = usd_bytes([("a", "f")], [(1,), (2,), (3,)], version=1, times=[2**32 - 2, 0, 2])
    assert np.diff(decode_usd_log(data)[0]["fixedFrequency"]["time_s"]).tolist() == pytest.approx([0.002, 0.002])


def test_a_wrong_checksum_is_told_and_the_log_kept() -> None:
    data = bytearray(usd_bytes([("a", "f")], [(1,), (2,)]))
    data[-6] ^= 0xFF
    tables, faults = decode_usd_log(bytes(data))
    assert kinds(faults) == ["checksum"]
    assert len(tables["fixedFrequency"]) == 2


def test_a_log_cut_off_anywhere_keeps_every_whole_event() -> None:
    data = usd_bytes([("a", "f")], [(float(n),) for n in range(5)])
    header = len(usd_bytes([("a", "f")], [])) - 4
    for length in range(header + 4, len(data)):
        tables, faults = decode_usd_log(data[:length])
        whole, rest = divmod(length - header, 14)
        assert len(tables["fixedFrequency"]) == whole
        assert kinds(faults) == ["checksum" if rest == 4 else "cut_off"]  # four bytes may be a wrong checksum


def test_an_unknown_event_stops_the_reading_there() -> None:
    data = usd_bytes([("a", "f")], [(1,)], extra=struct.pack("<HQ", 99, 5) + b"abcd")
    tables, faults = decode_usd_log(data)
    assert kinds(faults) == ["unknown_event"]
    assert len(tables["fixedFrequency"]) == 1


def test_usd_messages(tmp_path: Path) -> None:
    refused("starting with 0xBC, found 0x41", decode_usd_log, b"A" * 20)
    refused("found an empty file", decode_usd_log, b"")
    refused("expected format version 1 or 2, found 3", decode_usd_log, usd_bytes([], [], version=3))
    refused("header is cut off", decode_usd_log, usd_bytes([("a", "f")], [])[:-9])
    refused(r"variable 'a\(z\)' has a type that is not known", decode_usd_log, usd_bytes([("a", "z")], []))
    refused("file is missing", read_usd_log, tmp_path / "none")


def flight_log(samples: int = 4000) -> pd.DataFrame:
    """500 Hz, in the air from 1 s to 7 s, rolled left; the state estimate is new every other sample."""
    time = np.arange(samples) * 0.002
    air = (time >= 1.0) & (time < 7.0)
    half = np.repeat(np.arange(samples // 2), 2) * 1e-3
    left = Rotation.from_euler("x", -10, degrees=True).as_quat()  # FLU: left side down is negative roll
    log = {"time_s": 10 + time, "pm.vbatMV": 3700.0 + np.arange(samples)}
    for k, axis in enumerate("xyz"):
        log[f"stateEstimate.{axis}"] = half + (np.where(air, 1.0, 0.0) if axis == "z" else 0)
        log[f"stateEstimate.v{axis}"] = half + k
        log[f"gyro.{axis}"] = np.full(samples, 180.0 * (k + 1))
        log[f"acc.{axis}"] = np.full(samples, [0.1, 0.2, 1.0][k])
        log[f"stateEstimate.q{axis}"] = np.full(samples, left[k])
    log["stateEstimate.qw"] = np.full(samples, left[3])
    for i in range(1, 5):
        log[f"pwm.m{i}_pwm"] = np.where(air, 32768.0, 0.0)
        log[f"rpm.m{i}"] = np.where(air, 20000.0 + i, 0.0)
    return pd.DataFrame(log)


def test_a_crazyflie_flight_has_contract_units_and_axes() -> None:
    table, _ = crazyflie.convert(flight_log())
    row = table.iloc[1000]
    assert [row[n] for n in c.ANGULAR_VELOCITY] == pytest.approx([np.pi, -2 * np.pi, -3 * np.pi])
    assert [row[n] for n in c.SPECIFIC_FORCE] == pytest.approx([0.981, -1.962, -9.81])
    assert row["position_z_m"] == pytest.approx(-1.5, abs=1e-9) and row["throttle_1"] == 0.5
    assert row["rotor_speed_2_rad_s"] == pytest.approx(20002 * 2 * np.pi / 60)
    assert row["battery_voltage_v"] == pytest.approx(4.7)
    attitude = Rotation.from_quat([row[f"quaternion_{a}"] for a in "xyzw"])
    assert attitude.apply([0, 0, -1.0])[1] < 0  # left side down: pushed to the left, which is -y


def test_the_part_in_the_air_is_cut_out_with_a_margin() -> None:
    table, _ = crazyflie.convert(flight_log())
    assert crazyflie.in_the_air(table) == [(pytest.approx(12.0), pytest.approx(15.998))]
    run, faults = crazyflie.flight_run(table, 12.0, 15.998)
    assert run["time_s"].iloc[0] == 0.0
    assert kinds(faults) == ["held"]
    assert run["position_x_m"].isna().mean() == pytest.approx(0.5, abs=0.01)
    assert run["rotor_speed_1_rad_s"].notna().all()


def test_a_rotor_speed_that_drops_to_zero_is_flagged_and_kept() -> None:
    log = flight_log()
    log.loc[1500:1600, "rpm.m1"] = 0
    log["pm.vbatMV"] = 3700.0
    table, _ = crazyflie.convert(log)
    run, faults = crazyflie.flight_run(table, 12.0, 15.998)
    assert "speed_dropout" in kinds(faults)
    dropout = faults[kinds(faults).index("speed_dropout")]
    assert dropout.column == "rotor_speed_1_rad_s" and dropout.samples == 101
    assert (run["rotor_speed_1_rad_s"] == 0).sum() == 101
    assert "stuck" in kinds(faults)
    assert "battery_voltage_v" not in run


def test_attitude_without_pitch_finds_the_pitch_of_a_thrust_along_z() -> None:
    roll, pitch, yaw = (np.radians([[5.0, -8.0]]).T.ravel(), np.radians([12.0, 3.0]), np.radians([40.0, -100.0]))
    attitude = Rotation.from_euler("ZYX", np.column_stack([yaw, pitch, roll]))
    force = attitude.apply([[0.0, 0.05, 1.1], [0.0, -0.02, 0.9]])
    wxyz, body = crazyflie.attitude_without_pitch(force, roll, yaw)
    np.testing.assert_allclose(np.abs(np.sum(wxyz * attitude.as_quat()[:, [3, 0, 1, 2]], axis=1)), 1, atol=1e-12)
    np.testing.assert_allclose(body, [[0.0, 0.05, 1.1], [0.0, -0.02, 0.9]], atol=1e-12)


def test_a_log_without_gyro_leaves_the_missing_axis_empty() -> None:
    log = flight_log().drop(columns=[f"gyro.{a}" for a in "xyz"] + [f"acc.{a}" for a in "xyz"])
    log = log.drop(columns=[f"stateEstimate.q{a}" for a in "wxyz"])
    log = log.assign(**{"stateEstimate.ax": 0.0, "stateEstimate.ay": 0.0, "stateEstimate.az": 0.1})
    log = log.assign(**{"stateEstimate.roll": 0.0, "stateEstimate.yaw": 0.0})
    table, faults = crazyflie.convert(log)
    assert "no_pitch" in kinds(faults)
    assert "specific_force_x_m_s2" not in table
    assert table["specific_force_z_m_s2"].iloc[0] == pytest.approx(-1.1 * 9.81)


def compressed(xyzw: np.ndarray) -> np.ndarray:
    """Quaternions as the firmware packs them: the number of the largest, then sign and nine bits of each other."""
    codes = []
    for q in xyzw:
        largest = int(np.argmax(np.abs(q)))
        code = largest
        for k in range(4):
            if k != largest:
                negative = (q[k] < 0) != (q[largest] < 0)
                code = code << 10 | int(negative) << 9 | int(511 * abs(q[k]) * np.sqrt(2) + 0.5)
        codes.append(code)
    return np.array(codes)


def of_every_form() -> tuple[pd.DataFrame, pd.DataFrame]:
    """What the firmware logs of 200 states in each of its forms, and the same in contract columns."""
    rng = np.random.default_rng(3)
    turns = Rotation.random(200, random_state=3)  # forward-left-up to z up
    flip = np.array([1.0, -1.0, -1.0])
    place, moves, rates, force = rng.normal(size=(4, 200, 3))
    yaw, pitch, roll = turns.as_euler("ZYX", degrees=True).T
    xyzw = turns.as_quat()
    own = turns.inv().apply(moves)
    log = {"time_s": np.arange(200) * 0.01, "stateEstimateZ.quat": compressed(xyzw)}
    groups = (
        ("stateEstimate", "qx qy qz qw", xyzw), ("kalman", "q1 q2 q3 q0", xyzw),
        ("stateEstimate", "roll pitch yaw", np.column_stack([roll, -pitch, yaw])),  # nose up
        ("stabilizer", "roll pitch yaw", np.column_stack([roll, -pitch, yaw])),
        ("stateEstimate", "x y z", place), ("stateEstimateZ", "x y z", place * 1000),
        ("kalman", "stateX stateY stateZ", place), ("stateEstimate", "vx vy vz", moves),
        ("stateEstimateZ", "vx vy vz", moves * 1000), ("kalman", "statePX statePY statePZ", own),
        ("gyro", "x y z", np.degrees(rates)), ("acc", "x y z", force),
        ("stateEstimateZ", "rateRoll ratePitch rateYaw", rates * np.array([1, -1, 1]) * 1000),
    )  # fmt: skip
    for group, names, values in groups:
        log |= {f"{group}.{name}": v for name, v in zip(names.split(), values.T, strict=True)}
    true = {n: v for n, v in zip(c.QUATERNION, (xyzw[:, [3, 0, 1, 2]] * [1, 1, -1, -1]).T, strict=True)}
    for names, values in (
        (c.POSITION, place), (c.VELOCITY, moves), (c.ANGULAR_VELOCITY, rates), (c.SPECIFIC_FORCE, 9.81 * force)
    ):  # fmt: skip
        true |= dict(zip(names, (values * flip).T, strict=True))
    return pd.DataFrame(log), pd.DataFrame(true)


@pytest.mark.parametrize(
    ("names", "own"), [(names, own) for names, forms in crazyflie.FORMS.items() for own, _ in forms]
)
def test_a_crazyflie_state_is_read_in_each_of_its_forms(names: tuple[str, ...], own: tuple[str, ...]) -> None:
    log, true = of_every_form()
    table, faults = crazyflie.convert(log[["time_s", *own]])
    expected, found = true[list(names)].to_numpy(), table[list(names)].to_numpy()
    if names == c.QUATERNION:
        expected = expected * np.sign(np.sum(expected * found, axis=1))[:, None]
    np.testing.assert_allclose(found, expected, atol=3e-3 if own == ("stateEstimateZ.quat",) else 1e-9)
    assert faults == []


def test_a_velocity_in_body_axes_is_turned_by_the_attitude() -> None:
    log, true = of_every_form()
    table, _ = crazyflie.convert(
        log[["time_s", *crazyflie.BODY_VELOCITY, "kalman.q0", "kalman.q1", "kalman.q2", "kalman.q3"]]
    )
    np.testing.assert_allclose(table[list(c.VELOCITY)], true[list(c.VELOCITY)], atol=1e-9)
    assert not set(c.VELOCITY) & set(crazyflie.convert(log[["time_s", *crazyflie.BODY_VELOCITY]])[0])


def test_pitch_is_not_called_missing_where_it_is_in_the_log() -> None:
    log, true = of_every_form()
    log = log[["time_s", "stateEstimate.roll", "stateEstimate.pitch", "stateEstimate.yaw"]]
    log = log.assign(**{"stateEstimate.ax": 0.0, "stateEstimate.ay": 0.0, "stateEstimate.az": 0.1})
    table, faults = crazyflie.convert(log)
    assert faults == [] and not set(c.SPECIFIC_FORCE) & set(table)
    along = np.abs(np.sum(table[list(c.QUATERNION)].to_numpy() * true[list(c.QUATERNION)].to_numpy(), axis=1))
    np.testing.assert_allclose(along, 1, atol=1e-12)


@pytest.mark.parametrize("letter", TYPES)
def test_each_type_of_a_usd_variable_is_read(letter: str) -> None:
    value = 1.5 if letter in "efd" else 100
    tables, faults = decode_usd_log(usd_bytes([("before", "f"), ("a", letter), ("after", "H")], [(2.5, value, 7)] * 3))
    assert faults == []
    assert tables["fixedFrequency"][["before", "a", "after"]].to_numpy().tolist() == [[2.5, value, 7]] * 3


# PX4 ----------------------------------------------------------------------------------------------


ULOG = b"ULog\x01\x12\x35\x01" + bytes(8)


def ulog_message(kind: str, body: bytes) -> bytes:
    return struct.pack("<HB", len(body), ord(kind)) + body


def ulog_bytes(topics: dict[str, tuple[str, np.ndarray]]) -> bytes:
    """A ULog: magic, formats, subscriptions, data, a dropout. `topics`: name -> (format, rows)."""
    data = ULOG + ulog_message("B", bytes(40))
    for name, (text, _) in topics.items():
        data += ulog_message("F", f"{name}:{text}".encode())
    for number, name in enumerate(topics):
        data += ulog_message("A", struct.pack("<BH", 0, number) + name.encode())
    for number, (_, rows) in enumerate(topics.values()):
        for row in rows:
            data += ulog_message("D", struct.pack("<H", number) + row.tobytes())
    return data + ulog_message("O", struct.pack("<H", 20))


def ulog_rows(count: int, first_us: int, step_us: int, **values: tuple[str, object]) -> np.ndarray:
    """Rows of a topic: its timestamps, then fields of a type and value."""
    rows = np.zeros(count, [("timestamp", "<u8"), *((name, kind) for name, (kind, _) in values.items())])
    rows["timestamp"] = first_us + np.arange(count) * step_us
    for name, (_, value) in values.items():
        rows[name] = value
    return rows


def test_a_px4_log_is_laid_out_on_the_fastest_inertial_clock(tmp_path: Path) -> None:
    rates = ulog_rows(50, 1_000_000, 4000, xyz=("3<f4", [0.1, 0.2, 0.3]))
    pose = ulog_rows(10, 1_001_000, 20_000, x=("<f4", 0), y=("<f4", 0), z=("<f4", -np.arange(10.0)))
    motors = ulog_rows(50, 1_000_000, 4000, control=("4<f4", [0.25, 0.5, 0.75, 1.0]))
    topics = {
        "vehicle_angular_velocity": ("uint64_t timestamp;float[3] xyz;", rates),
        "vehicle_local_position": ("uint64_t timestamp;float x;float y;float z;", pose),
        "actuator_motors": ("uint64_t timestamp;float[4] control;", motors),
    }
    path = tmp_path / "log.ulg"
    path.write_bytes(ulog_bytes(topics))
    table, faults, *_ = px4_ulog.convert(px4_ulog.open_log(path), 4)
    assert table["time_s"].tolist() == pytest.approx(np.arange(50) * 0.004)
    assert table[list(c.ANGULAR_VELOCITY)].iloc[0].tolist() == pytest.approx([0.1, 0.2, 0.3])
    assert table["throttle_3"].tolist() == [0.75] * 50
    assert table["position_z_m"].dropna().index.tolist() == list(range(0, 50, 5))
    assert table["position_z_m"].dropna().tolist() == [-float(n) for n in range(10)]
    assert kinds(faults) == ["dropout"] and "1 stretches, 0.02 s in all" in faults[0].found


def px4(parameters=None, **topics) -> px4_ulog.Px4Log:
    """A log of topics given as one instance or a list of instances."""
    instances = {k: v if isinstance(v, list) else [v] for k, v in topics.items()}
    return px4_ulog.Px4Log(instances, Parameters(parameters or {}))


def gyro(count: int = 5, step_us: int = 1000) -> dict:
    return {"timestamp": np.arange(count) * step_us, **{f"gyro_rad[{i}]": np.ones(count) for i in range(3)}}


def outputs(*pulses: float, count: int = 5) -> dict:
    return {"timestamp": np.arange(count) * 1000, **{f"output[{i}]": np.full(count, p) for i, p in enumerate(pulses)}}


def test_px4_rotor_speeds_and_messages(tmp_path: Path) -> None:
    time = np.arange(5) * 1000
    speeds = {"timestamp": time, "esc[0].esc_rpm": np.full(5, 6000.0)}
    log = px4(sensor_combined=gyro(), esc_status=speeds, actuator_outputs=outputs(1500.0))
    made, found, *_ = px4_ulog.convert(log, rotors=1)
    assert made["rotor_speed_1_rad_s"].tolist() == pytest.approx([200 * np.pi] * 5)
    assert made["throttle_1"].tolist() == [0.5] * 5
    assert kinds(found) == ["unit"]
    assert kinds(px4_ulog.convert(px4(sensor_combined=gyro(), esc_status=speeds), 1)[1]) == ["no_command"]
    refused("to take the clock from", px4_ulog.convert, px4(battery_status={"timestamp": time}), rotors=1)
    (tmp_path / "x.ulg").write_bytes(b"nothing")
    refused("not a ULog file", px4_ulog.open_log, tmp_path / "x.ulg")
    refused("file is missing", px4_ulog.open_log, tmp_path / "none.ulg")


def test_px4_pulses_take_the_range_of_their_own_output() -> None:
    parameters = {"PWM_MAIN_MIN": 1075, "PWM_MAIN_MAX": 1950, "PWM_MAIN_MIN2": 1000, "PWM_MAIN_MAX1": -1}
    log = px4(parameters, sensor_combined=gyro(), actuator_outputs=outputs(1512.5, 1475.0, 900.0))
    table, found, *_ = px4_ulog.convert(log, rotors=3)
    assert table[["throttle_1", "throttle_2", "throttle_3"]].iloc[0].tolist() == pytest.approx([0.5, 0.5, 0.0])
    assert kinds(found) == ["range"]


def test_px4_motors_are_found_by_the_function_of_an_output() -> None:
    parameters = {"PWM_MAIN_FUNC1": 102, "PWM_MAIN_FUNC2": 101, "PWM_MAIN_MIN": 1000, "PWM_MAIN_MAX": 2000}
    log = px4(parameters, sensor_combined=gyro(), actuator_outputs=outputs(1250.0, 1750.0))
    table = px4_ulog.convert(log, rotors=2)[0]
    assert table[["throttle_1", "throttle_2"]].iloc[0].tolist() == [0.75, 0.25]
    twice = px4(
        parameters | {"PWM_MAIN_FUNC3": 101}, sensor_combined=gyro(), actuator_outputs=outputs(1250, 1750, 1900)
    )
    table, found, *_ = px4_ulog.convert(twice, rotors=2)
    assert table["throttle_1"].iloc[0] == 0.75 and "2 outputs of PWM_MAIN are motor 1" in found[0].found
    silent = px4({"PWM_MAIN_FUNC1": 201}, sensor_combined=gyro(), actuator_outputs=outputs(1250.0, 1750.0))
    assert kinds(px4_ulog.convert(silent, rotors=2)[1]) == ["no_command"]


def test_px4_takes_the_instance_whose_outputs_move() -> None:
    moving = outputs(1500.0, 1500.0)
    moving["output[0]"], moving["output[1]"] = np.linspace(1000, 2000, 5), np.linspace(2000, 1000, 5)
    log = px4(sensor_combined=gyro(), actuator_outputs=[outputs(1000.0, 1500.0), moving])
    made, found, *_ = px4_ulog.convert(log, rotors=2)
    assert made["throttle_1"].tolist() == pytest.approx([0, 0.25, 0.5, 0.75, 1])
    assert "instances" in kinds(found)


def test_px4_thrusts_become_signals_by_the_thrust_model() -> None:
    motors = {"timestamp": np.arange(5) * 1000, "control[0]": np.full(5, 0.3 * 0.5**2 + 0.7 * 0.5)}
    table = px4_ulog.convert(px4({"THR_MDL_FAC": 0.3}, sensor_combined=gyro(), actuator_motors=motors), 1)[0]
    assert table["throttle_1"].tolist() == pytest.approx([0.5] * 5)


def test_px4_speeds_follow_their_function_and_an_offline_controller_is_missing() -> None:
    esc = {
        "timestamp": np.arange(5) * 1000, "esc_online_flags": np.array([3, 3, 1, 3, 3]),
        "esc[0].esc_rpm": np.full(5, -6000), "esc[0].actuator_function": np.full(5, 102),
        "esc[1].esc_rpm": np.full(5, 3000), "esc[1].actuator_function": np.full(5, 101),
    }  # fmt: skip
    table = px4_ulog.convert(px4(sensor_combined=gyro(), esc_status=esc), 2)[0]
    assert table["rotor_speed_2_rad_s"].iloc[0] == pytest.approx(200 * np.pi)
    assert table["rotor_speed_1_rad_s"].isna().tolist() == [False, False, True, False, False]


@pytest.mark.parametrize(("rpm", "taken"), [((0, 3000), 3000), ((3000, 0), 3000), ((3000, 6000), 3000)])
def test_px4_speeds_are_those_of_the_instance_that_turns(rpm, taken: int) -> None:
    instances = [{"timestamp": np.arange(5) * 1000, "esc[0].esc_rpm": np.full(5, own)} for own in rpm]
    made, found, *_ = px4_ulog.convert(px4(sensor_combined=gyro(), esc_status=instances), 1)
    assert made["rotor_speed_1_rad_s"].tolist() == pytest.approx([taken * np.pi / 30] * 5)
    assert ("instances" in kinds(found)) == all(rpm)


@pytest.mark.parametrize(("first", "taken"), [(20, 0.0), (19, 0.0), (10, 1.0), (2, 1.0)])
def test_px4_of_several_instances_the_first_that_goes_on_is_read(first: int, taken: float) -> None:
    """The second instance has 1 at each place where the first has 0."""
    instances = [
        {"timestamp": np.arange(count) * 1000, **{f"q[{k}]": np.full(count, float(k == own)) for k in range(4)}}
        for own, count in enumerate((first, 20))
    ]
    table = px4_ulog.convert(px4(sensor_combined=gyro(20), vehicle_attitude=instances), 1)[0]
    assert table["quaternion_x"].iloc[0] == taken


def test_px4_of_several_sensors_the_one_that_goes_on_is_read_whatever_its_rate() -> None:
    """The gyroscope of 1000 Hz stands still from half on, its controllers do, too, and an attitude is not stated."""
    fast, slow = np.arange(20_000), np.arange(0, 20_000, 5)
    still = np.minimum(fast, 10_000) * 1e-3

    def gyroscope(values: np.ndarray, kind: str) -> dict:
        return {f"{kind}[{k}]": values for k in range(3)}

    esc = [
        {"timestamp": at * 1000, "esc[0].esc_rpm": 3000.0 + extra + np.minimum(at, last)}
        for at, last, extra in ((fast, 10_000, 0.0), (slow, 20_000, 500.0))
    ]
    turns = np.tile([1.0, 0.0, 0.0, 0.0], (len(slow), 1)) * (slow > 50)[:, None]
    log = px4(
        sensor_combined={"timestamp": fast * 1000, **gyroscope(still, "gyro_rad")},
        vehicle_angular_velocity={"timestamp": slow * 1000, **gyroscope(slow * 1e-3, "xyz")},
        vehicle_attitude={"timestamp": slow * 1000, **{f"q[{k}]": turns[:, k] for k in range(4)}},
        esc_status=esc,
    )
    table, *_ = px4_ulog.convert(log, 1)
    assert table["angular_velocity_x_rad_s"].iloc[-1] == pytest.approx(slow[-1] * 1e-3)
    assert table["rotor_speed_1_rad_s"].iloc[0] == pytest.approx(3500 * np.pi / 30)
    assert table["quaternion_w"].isna().sum() == 11


def test_px4_invalid_positions_heights_and_currents_are_missing() -> None:
    place = {
        "timestamp": np.arange(5) * 1000,
        **{name: np.arange(5.0) for name in ("x", "y", "z", "vx", "vy", "vz", "dist_bottom")},
        "xy_valid": np.array([0, 0, 1, 1, 1]), "z_valid": np.ones(5), "v_xy_valid": np.zeros(5),
        "v_z_valid": np.ones(5), "dist_bottom_valid": np.ones(5), "dist_bottom_sensor_bitfield": np.zeros(5),
    }  # fmt: skip
    battery = {"timestamp": np.arange(5) * 1000, "voltage_v": np.full(5, 16.0), "current_a": np.full(5, -1.0)}
    second = {**battery, "voltage_v": np.full(5, 24.0), "current_a": np.full(5, 3.0)}
    log = px4(sensor_combined=gyro(), vehicle_local_position=place, battery_status=[battery, second])
    table, found, *_ = px4_ulog.convert(log, 1)
    assert table["position_x_m"].isna().tolist() == [True, True, False, False, False]
    assert table["position_z_m"].tolist() == [0, 1, 2, 3, 4]
    assert not {"velocity_x_m_s", "velocity_y_m_s", "height_m", "battery_current_a"} & set(table.columns)
    assert table["battery_2_voltage_v"].tolist() == [24.0] * 5
    assert {"invalid", "not_measured", "instances"} <= set(kinds(found))


def px4_flight(**more) -> px4_ulog.Px4Log:
    """A log of 20 s that is in the air from 5 to 15 s."""
    count = 2001
    land = {"timestamp": np.array([0, 5, 15]) * 10**6, "landed": np.array([1, 0, 1])}
    status = {"timestamp": np.array([0]), "arming_state": np.array([2])}
    return px4(sensor_combined=gyro(count, 10_000), vehicle_land_detected=land, vehicle_status=status, **more)


def test_px4_only_the_part_in_the_air_is_flown_and_a_jump_of_the_estimator_ends_it() -> None:
    _, _, flying, _ = px4_ulog.convert(px4_flight(), 1)
    time_s = np.arange(2001) * 0.01
    assert (time_s[flying].min(), time_s[flying].max()) == (5.0, pytest.approx(14.99))


@pytest.mark.parametrize(("topic", "counter", "fields", "small"), px4_ulog.RESETS)
@pytest.mark.parametrize("wraps", [False, True])
def test_px4_each_jump_of_the_estimator_ends_a_run(topic: str, counter: str, fields, small: float, wraps: bool) -> None:
    """At 10 s; one that the estimate's own noise exceeds ends nothing. Counters are of eight bits."""
    count = 2001
    after = np.arange(count) >= 1000
    data = {"timestamp": np.arange(count) * 10_000, counter: (after + 255 * wraps).astype(np.uint8)}
    data |= {name: np.zeros(count) for name in ("x", "y", "z", "vx", "vy", "vz")}
    data |= {f"q[{i}]": np.full(count, float(i == 0)) for i in range(4)}
    for by, runs in ((None, 2), (2 * small, 2), (0.5 * small, 1)):
        stated = {} if by is None else {f: after * (by if f == fields[0] else 0.0) for f in fields}
        log = px4(sensor_combined=gyro(count, 10_000), **{topic: data | stated})
        made, found, flying, jumps = px4_ulog.convert(log, 1)
        assert len(flights(made, flying, "run", "log", jumps)[0]) == runs, by
        assert ("estimator_reset" in kinds(found)) == (runs > 1)


def test_px4_rotors_and_torque_come_from_control_allocation() -> None:
    parameters = {"CA_ROTOR_COUNT": 2, "MAV_TYPE": 2}
    for i, (x, y, km) in enumerate([(0.1, 0.2, 0.05), (-0.1, -0.2, -0.03)]):
        parameters |= {f"CA_ROTOR{i}_PX": x, f"CA_ROTOR{i}_PY": y, f"CA_ROTOR{i}_PZ": 0.0, f"CA_ROTOR{i}_KM": km}
    assert px4_ulog.rotor_count(px4(parameters)) == 2
    found, faults = px4_ulog.px4_vehicle(parameters, 2)
    assert [(r.x_m, r.y_m, r.spin) for r in found.rotors] == [(0.1, 0.2, "ccw"), (-0.1, -0.2, "cw")]
    assert found.torque_over_thrust_m == pytest.approx(0.04)
    assert kinds(faults) == ["unequal_rotors"]
    assert px4_ulog.px4_vehicle({}, 4)[0].rotors is None


@pytest.mark.parametrize(
    ("values", "name"),
    [
        *(({"MAV_TYPE": kind}, f"{name}.*MAV_TYPE {kind}") for kind, name in px4_ulog.OTHER_TYPES.items()),
        *(({"CA_AIRFRAME": kind}, f"{name}.*CA_AIRFRAME {kind}") for kind, name in px4_ulog.OTHER_AIRFRAMES.items()),
        ({"MAV_TYPE": 99}, "not known here.*MAV_TYPE 99"),
    ],
)
def test_px4_what_is_no_multirotor_of_fixed_rotors_is_refused_by_its_name(values, name: str) -> None:
    refused(f"{name}.*only multirotors", px4_ulog.rotor_count, px4(values, sensor_combined=gyro()))


@pytest.mark.parametrize(("kind", "rotors"), [(2, 4), (13, 6), (14, 8), (29, 12), (35, 10), (0, 6), (43, 6), (None, 6)])
def test_px4_the_type_says_how_many_rotors_and_else_the_motors_that_are_driven(kind, rotors: int) -> None:
    motors = {"timestamp": np.arange(5) * 1000, **{f"control[{i}]": np.full(5, 0.5) for i in range(6)}}
    motors |= {f"control[{i}]": np.full(5, np.nan) for i in range(6, 12)}
    log = px4({} if kind is None else {"MAV_TYPE": kind}, sensor_combined=gyro(), actuator_motors=motors)
    assert px4_ulog.rotor_count(log) == rotors
    assert px4_ulog.rotor_count(px4({"CA_ROTOR_COUNT": 3}, actuator_motors=motors)) == 3
    faults = px4_ulog.convert(log, rotors)[1]
    assert any("drives 6 motors" in f.found for f in faults) == (rotors < 6)


def test_px4_speeds_and_outputs_of_more_motors_than_stated_are_named() -> None:
    """The signals of a hexarotor follow from any four of them; that of a gimbal does not."""
    rng = np.random.default_rng(0)
    demand = rng.normal(0, 30, (400, 4))
    mix = rng.choice([-1.0, 1.0], (6, 4)) + 0.1 * rng.normal(size=(6, 4))
    pulses = np.column_stack([1500 + demand @ mix.T, 1500 + 100 * rng.normal(size=400)])
    time = np.arange(400) * 1000
    esc = {"timestamp": time, **{f"esc[{i}].esc_rpm": np.full(400, 5000) for i in range(6)}}
    esc |= {f"esc[{i}].esc_rpm": np.zeros(400) for i in (6, 7)}
    outputs_ = {"timestamp": time, **{f"output[{i}]": p for i, p in enumerate(pulses.T)}}
    log = px4(sensor_combined=gyro(400), actuator_outputs=outputs_, esc_status=esc)
    for rotors, named in ((4, True), (6, False)):
        found = [f.found for f in px4_ulog.convert(log, rotors)[1] if f.kind == "order"]
        assert [f.split()[:3] for f in found] == [
            [t, "drives", "6"] for t in ("actuator_outputs", "esc_status")
        ] * named


AXES = [
    ({"AX": 0.2}, True), ({"AY": -0.2}, True), ({"AX": -0.05, "AY": 0.05}, True), ({"AZ": 1.0}, True),
    ({"AX": 0.9, "AZ": -0.9}, True), ({"AX": 1.0, "AZ": 0.0}, True), ({"AZ": 0.0}, True),
    ({"AZ": -0.9}, False), ({"AZ": -2.0}, False), ({"AX": 1e-3}, False), ({}, False),
]  # fmt: skip


@pytest.mark.parametrize(("axis", "tilted"), AXES)
@pytest.mark.parametrize("places", [True, False])
def test_px4_a_tilted_rotor_is_named_by_its_whole_axis(axis: dict[str, float], tilted: bool, places: bool) -> None:
    values = {f"CA_ROTOR2_{k}": v for k, v in axis.items()}
    if places:
        values |= {f"CA_ROTOR{i}_{k}": 0.1 for i in range(4) for k in ("PX", "PY", "PZ", "KM")}
    _, faults = px4_ulog.px4_vehicle(values, 4)
    assert kinds(faults) == ["tilted_rotor"] * tilted
    assert all("rotor 3 tilted" in f.found for f in faults)


@pytest.mark.parametrize(
    ("values", "kind", "said"),
    [
        ({"CA_ROTOR0_TILT": 1, "CA_ROTOR3_TILT": 2}, "tilted_rotor", "rotors 1, 4"),
        ({"CA_ROTOR1_KM": -0.03}, "unequal_rotors", "KM of rotor 2"),
        ({"CA_ROTOR1_CT": 5.0}, "unequal_rotors", "CT of rotor 2"),
        ({"CA_SV_CS_COUNT": 2}, "servo", "CA_SV_CS_COUNT"),
        ({"CA_SV_TL_COUNT": 1}, "servo", "CA_SV_TL_COUNT"),
    ],
)
def test_px4_what_a_vehicle_file_cannot_hold_is_named(values: dict[str, float], kind: str, said: str) -> None:
    _, faults = px4_ulog.px4_vehicle(values, 4)
    assert kinds(faults) == [kind] and said in faults[0].found
    assert (
        not px4_ulog.px4_vehicle(dict.fromkeys(values, 0.0) | {k: 0.05 for k in values if "KM" in k}, 4)[1]
        or "CT" in said
    )


@pytest.mark.parametrize("apart_m", [0.0, 0.05])
def test_coaxial_rotors_make_a_vehicle_and_are_named_where_no_distance_is_stated(apart_m: float) -> None:
    values = {}
    for i in range(6):
        own = {"PX": np.cos(i // 2), "PY": np.sin(i // 2), "PZ": apart_m * (i % 2), "KM": 0.05 * (-1) ** i}
        values |= {f"CA_ROTOR{i}_{name}": value for name, value in own.items()}
    vehicle, faults = px4_ulog.px4_vehicle(values, 6)
    said = [f.found for f in faults if f.kind == "coaxial"]
    assert len(said) == (not apart_m) and all("rotors 1 and 2, 3 and 4, 5 and 6 are on one spot" in s for s in said)
    check_belief(templates.read("x500").model_copy(update={"rotors": vehicle.rotors}), "vehicle.yaml")


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_px4_a_motor_that_is_reversed_for_a_time_has_empty_cells_there(sign: float) -> None:
    """A speed's sign is a turning sense where it stays; a command's is reverse thrust always."""
    time = np.arange(10) * 1000
    flips = np.where(np.arange(10) < 3, -1.0, 1.0)
    motors = {"timestamp": time, "control[0]": 0.5 * flips, "control[1]": np.full(10, 0.5)}
    esc = {"timestamp": time, "esc[0].esc_rpm": sign * 6000 * flips, "esc[1].esc_rpm": np.full(10, sign * 6000.0)}
    made, found, *_ = px4_ulog.convert(px4(sensor_combined=gyro(10), actuator_motors=motors, esc_status=esc), 2)
    for name, size in (("throttle_{}", 0.5), ("rotor_speed_{}_rad_s", 200 * np.pi)):
        assert made[name.format(1)].isna().tolist() == [True] * 3 + [False] * 7
        assert made[name.format(1)].dropna().to_numpy() == pytest.approx(size)
        assert made[name.format(2)].to_numpy() == pytest.approx(size)
    assert [f.column for f in found if f.kind == "reversed"] == ["throttle_1", "rotor_speed_1_rad_s"]


def test_px4_a_control_of_nan_stops_a_motor_and_one_without_any_is_none() -> None:
    asked = np.full((10, 4), [0.5, 0.5, 0.5, np.nan])
    asked[4:, 2], asked[:2] = np.nan, np.nan  # PX4 is disarmed in the first two, and stops motor 3 later
    motors = {"timestamp": np.arange(10) * 1000} | {f"control[{i}]": own for i, own in enumerate(asked.T)}
    made, found, *_ = px4_ulog.convert(px4(sensor_combined=gyro(10), actuator_motors=motors), 4)
    assert made["throttle_3"].tolist() == [0.0] * 2 + [0.5] * 2 + [0.0] * 6 and "throttle_4" not in made
    assert [f.column for f in found if f.kind == "stopped"] == ["throttle_3"]


@pytest.mark.parametrize(
    ("values", "sent", "share"),
    [
        ({"DSHOT_CONFIG": 600}, (1.0, 1000.0, 1999.0), (0, 0.5, 1)),
        ({"DSHOT_CONFIG": 600}, (800.0, 1000.0, 1900.0), (799 / 1998, 0.5, 1899 / 1998)),
        ({"DSHOT_CONFIG": 0}, (1000.0, 1500.0, 2000.0), (0, 0.5, 1)),
        ({"PWM_MAIN_TIM0": -4, "PWM_MAIN_FUNC1": 101}, (1.0, 1000.0, 1999.0), (0, 0.5, 1)),
        ({"PWM_MAIN_TIM0": 400, "PWM_MAIN_FUNC1": 101}, (1000.0, 1500.0, 2000.0), (0, 0.5, 1)),
        ({"UAVCAN_ENABLE": 3}, (1.0, 4096.0, 8191.0), (0, 0.5, 1)),
        ({"UAVCAN_EC_FUNC1": 101, "UAVCAN_EC_MAX1": 4096}, (1.0, 2048.5, 4096.0), (0, 0.5, 1)),
        ({"SIM_GZ_EC_FUNC1": 101, "SIM_GZ_EC_MIN1": 200}, (200.0, 600.0, 1000.0), (0, 0.5, 1)),
        ({}, (1.0, 1000.0, 1999.0), None),
        ({"UAVCAN_EC_FUNC1": 101, "UAVCAN_EC_MAX1": 100}, (1.0, 4096.0, 8191.0), None),
    ],
)
def test_px4_outputs_are_in_the_unit_that_a_parameter_states(values, sent, share) -> None:
    given = {"timestamp": np.arange(3) * 1000, "output[0]": np.array(sent)}
    table, found, *_ = px4_ulog.convert(px4(values, sensor_combined=gyro(3), actuator_outputs=given), 1)
    if share is None:
        assert "throttle_1" not in table and any("no throttle columns" in f.action for f in found)
    else:
        assert table["throttle_1"].tolist() == pytest.approx(list(share), abs=1e-4)


@pytest.mark.parametrize("port", ["MAIN", "AUX"])
def test_px4_rotors_are_found_by_function_on_either_port(port: str) -> None:
    """Between servos, in another order, one with its range reversed, one that turns both ways."""
    values = {f"PWM_{port}_FUNC{k}": f for k, f in ((1, 201), (2, 102), (4, 101), (5, 103), (6, 0))}
    values |= {f"PWM_{port}_MIN{k}": 1000 for k in (2, 4, 5)} | {f"PWM_{port}_MAX{k}": 2000 for k in (2, 4, 5)}
    values |= {f"PWM_{port}_REV": 1 << 1, "CA_R_REV": 1 << 2}
    if port == "AUX":
        values["PWM_MAIN_FUNC1"] = 201
    log = px4(values, sensor_combined=gyro(), actuator_outputs=outputs(1900.0, 1700.0, 1111.0, 1250.0, 1800.0, 1900.0))
    table = px4_ulog.convert(log, 3)[0]
    assert table[["throttle_1", "throttle_2", "throttle_3"]].iloc[0].tolist() == pytest.approx([0.25, 0.3, 0.6])
    (said,) = [f.found for f in px4_ulog.convert(log, 4)[1] if f.kind == "no_command"]
    assert "motor 4" in said


@pytest.mark.parametrize(
    ("change", "before", "after"),
    [
        (("PWM_MAIN_MIN1", 1250.0), 0.5, 1 / 3),
        (("PWM_MAIN_MAX1", 3000.0), 0.5, 0.25),
        (("PWM_MAIN_REV", 1), 0.5, 0.5),
        (("THR_MDL_FAC", 0.5), 0.5, 0.5),  # turns thrusts into signals, and these are signals
    ],
)
def test_px4_a_pulse_is_read_by_the_parameters_that_held_then(change, before: float, after: float) -> None:
    stated = {"PWM_MAIN_FUNC1": 101, "PWM_MAIN_MIN1": 1000, "PWM_MAIN_MAX1": 2000, "PWM_MAIN_REV": 0, "THR_MDL_FAC": 0}
    topics = {"sensor_combined": [gyro(10)], "actuator_outputs": [outputs(1500.0, count=10)]}
    log = px4_ulog.Px4Log(topics, Parameters.of([(3000.0, "PWM_MAIN_MIN1", 1000), (5000.0, *change)], stated))
    made, found, *_ = px4_ulog.convert(log, 1)
    assert made["throttle_1"].tolist() == pytest.approx([before] * 5 + [after] * 5)
    (said,) = [f.sentence for f in found if f.kind == "parameter_changed"]
    assert f"{change[0]} was set from" in said and f"to {change[1]:g} at 0.01 s" in said


def test_px4_a_thrust_curve_set_in_the_air_holds_from_then_on() -> None:
    motors = {"timestamp": np.arange(10) * 1000, "control[0]": np.full(10, 0.3 * 0.5**2 + 0.7 * 0.5)}
    changes = [(5000.0, "THR_MDL_FAC", 0.3), (8000.0, "THR_MDL_FAC", 0.0)]
    topics = {"sensor_combined": [gyro(10)], "actuator_motors": [motors]}
    made, found, *_ = px4_ulog.convert(px4_ulog.Px4Log(topics, Parameters.of(changes, {"THR_MDL_FAC": 0.0})), 1)
    assert made["throttle_1"].tolist() == pytest.approx([0.425] * 5 + [0.5] * 3 + [0.425] * 2)
    (said,) = [f.found for f in found if f.kind == "parameter_changed"]
    assert said == "THR_MDL_FAC was set from 0 to 0.3 at 0.01 s, to 0 at 0.01 s of the log"


@pytest.mark.parametrize("name", ["CA_ROTOR0_PX", "CA_ROTOR_COUNT", "MAV_TYPE", "MPC_THR_HOVER", "EKF2_BCOEF_X"])
def test_px4_a_change_of_what_else_is_compared_is_stated_and_the_value_of_most_of_the_flight_taken(name: str) -> None:
    for at, value in ((4000.0, 3.0), (16000.0, 2.0)):
        log = px4_ulog.Px4Log(
            {"sensor_combined": [gyro(20)]}, Parameters.of([(at, name, 3.0), (at, "MC_ROLL_P", 5)], {name: 2.0})
        )
        assert px4_ulog.in_flight(log)[name] == value
        changed = [f.found.split()[0] for f in px4_ulog.convert(log, 1)[1] if f.kind == "parameter_changed"]
        assert changed == [name]


@pytest.mark.parametrize("number", [0, 7], ids=["by its number", "by another"])
def test_px4_a_topic_subscribed_twice_keeps_its_first_half(tmp_path: Path, number: int) -> None:
    data = ULOG + ulog_message("B", bytes(40))
    data += ulog_message("F", b"vehicle_angular_velocity:uint64_t timestamp;float[3] xyz;")
    for half, own in ((0, 0), (1, number)):
        data += ulog_message("A", struct.pack("<BH", 0, own) + b"vehicle_angular_velocity")
        for k in range(50 * half, 50 * half + 50):
            data += ulog_message("D", struct.pack("<HQfff", own, 1_000_000 + 4000 * k, k, 0, 0))
    (tmp_path / "log.ulg").write_bytes(data)
    table = px4_ulog.convert(px4_ulog.open_log(tmp_path / "log.ulg"), 4)[0]
    assert table["angular_velocity_x_rad_s"].tolist() == list(range(100))


def test_px4_a_log_cut_off_anywhere_keeps_every_whole_message(tmp_path: Path) -> None:
    rates = ulog_rows(40, 1_000_000, 4000, xyz=("3<f4", 0))
    data = ulog_bytes({"vehicle_angular_velocity": ("uint64_t timestamp;float[3] xyz;", rates)})[:-5]
    size = 3 + 2 + rates.itemsize
    for lost in range(2 * size + 1):
        (tmp_path / "log.ulg").write_bytes(data[: len(data) - lost])
        made, found, *_ = px4_ulog.convert(px4_ulog.open_log(tmp_path / "log.ulg"), 4)
        assert len(made) == 40 - -(-lost // size)
        assert ("cut_off" in kinds(found)) == (lost % size > 0)
    refused("VTOL", px4_ulog.rotor_count, px4({"MAV_TYPE": 22}))


# What all importers share -------------------------------------------------------------------------


def test_of_several_readings_for_one_row_the_nearest_is_taken_and_none_across_a_hole() -> None:
    grid = np.array([0.0, 1.0, 2.0, 10.0, 11.0])
    made = on_grid(grid, np.array([0.9, 1.0, 1.4, 5.0, 10.6]), np.arange(5.0))
    assert made[:, 0] == pytest.approx([np.nan, 1.0, np.nan, np.nan, 4.0], nan_ok=True)


@pytest.mark.parametrize("first", [[-11.1], [95.0], [-30.0, -29.99, -29.98]])
def test_samples_apart_from_a_flight_are_left_out_at_either_end(first: list[float]) -> None:
    flight = np.arange(0, 12, 0.01)
    for time_s in (np.array([*first, *flight]), np.array([*flight, *np.add(first, 200)])):
        keep, faults = moving_on(time_s)
        assert time_s[keep].tolist() == flight.tolist()
        assert [f.kind for f in faults] == ["apart"] and f"{len(first)} samples" in faults[0].found


def test_what_a_logger_loses_and_parts_of_a_second_are_no_samples_apart() -> None:
    time_s = np.arange(0, 12, 0.01)
    for gone in ((time_s % 3 > 1.5) & (time_s % 3 < 2.6), time_s % 1 < 0.7):
        keep, faults = moving_on(time_s[~gone])
        assert keep.all() and not faults
