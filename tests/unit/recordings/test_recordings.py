"""Recording sets: the reader accepts what the contract allows and says in one sentence what it does not."""

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rotorid.recordings import RecordingSet, Run, list_sets, read_run, read_set, read_vehicle, write_set
from rotorid.recordings import columns as c
from tests.refusals import refused

VEHICLE = """\
name: example
kind: flight
mass_kg: 0.652
inertia_kg_m2: {xx: 2.489e-3, yy: 2.5743e-3, zz: 4.6838e-3}
rotors:
  - {x_m: 0.0884, y_m: 0.0884, spin: ccw}
  - {x_m: 0.0884, y_m: -0.0884, spin: cw}
thrust_coefficient_n_s2: 1.3877e-6
torque_coefficient_n_m_s2: [1.8e-8, 1.9e-8]
"""
RUN = """\
time_s,rotor_speed_1_rad_s,rotor_speed_2_rad_s,my_sensor
0.0,1000,1001,7
0.01,,1002,8
0.02,1003,1004,
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "example"
    made.mkdir()
    (made / "vehicle.yaml").write_text(VEHICLE)
    (made / "a.csv").write_text(RUN)
    return made


def message_of(folder: Path) -> str:
    text = refused(None, read_set, folder)
    assert "\n" not in text
    return text


def test_a_set_is_read_with_its_units_and_empty_cells(folder: Path) -> None:
    recordings = read_set(folder)
    assert recordings.name == "example" and recordings.held_out is None
    run = recordings.run("a")
    assert run.time_s.tolist() == [0.0, 0.01, 0.02]
    assert math.isnan(run.column("rotor_speed_1_rad_s")[1])
    assert run.has(*c.rotor_columns("rotor_speed", 2)) and not run.has("height_m")
    assert run.unknown_columns == ("my_sensor",)
    assert np.isnan(run.array(c.POSITION)).all()


def test_a_vehicle_gives_one_coefficient_per_rotor_and_the_sign_of_yaw(folder: Path) -> None:
    vehicle = read_vehicle(folder / "vehicle.yaml")
    assert vehicle.thrust_coefficients_n_s2().tolist() == [1.3877e-6, 1.3877e-6]
    assert vehicle.torque_coefficients_n_m_s2().tolist() == [1.8e-8, 1.9e-8]
    assert vehicle.yaw_signs().tolist() == [1.0, -1.0]
    assert vehicle.rotor_positions_m().tolist() == [[0.0884, 0.0884, 0.0], [0.0884, -0.0884, 0.0]]
    assert vehicle.inertia_kg_m2.matrix()[2, 2] == 4.6838e-3


def test_yaml_numbers_with_an_exponent_but_no_point_are_numbers(folder: Path) -> None:
    (folder / "vehicle.yaml").write_text(VEHICLE.replace("1.3877e-6", "1e-6"))
    assert read_vehicle(folder / "vehicle.yaml").thrust_coefficient_n_s2 == 1e-6


@pytest.mark.parametrize("suffix", [".csv", ".csv.gz", ".parquet"])
def test_a_written_set_is_read_back_the_same(folder: Path, tmp_path: Path, suffix: str) -> None:
    first = read_set(folder)
    two = RecordingSet("two", first.vehicle, (first.runs[0], Run("b", first.runs[0].table)), ("b",))
    again = read_set(write_set(two, tmp_path, suffix))
    assert again.vehicle == first.vehicle and again.held_out == ("b",)
    pd.testing.assert_frame_equal(again.run("a").table, first.run("a").table)
    assert list_sets(tmp_path) == ["example", "two"]


def test_writing_twice_gives_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    recordings = read_set(folder)
    for suffix in (".parquet", ".csv.gz"):
        (tmp_path / "one").mkdir(exist_ok=True)
        (tmp_path / "two").mkdir(exist_ok=True)
        paths = [write_set(recordings, tmp_path / where, suffix) / f"a{suffix}" for where in ("one", "two")]
        assert paths[0].read_bytes() == paths[1].read_bytes()


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("mass_kg: 0.652\n", ""), "kind flight needs mass_kg"),
        (("mass_kg: 0.652", "mass_kg: -1"), "mass_kg: found -1, expected a number of 1e-06 or more"),
        (("mass_kg: 0.652", "mass: 0.652"), "mass: no such key is known; did you mean mass_kg?"),
        (("name: example\n", ""), "name: is missing"),
        (("kind: flight", "kind: fly"), "kind: found 'fly', expected 'flight', 'stand' or 'bench'"),
        (("spin: cw", "spin: left"), "rotors.1.spin: found 'left', expected 'ccw' or 'cw'"),
        (("[1.8e-8, 1.9e-8]", "[1.8e-8]"), "torque_coefficient_n_m_s2 has 1 values for 2 rotors"),
        (("1.3877e-6", "-1.0e-6"), "thrust_coefficient_n_s2 must be positive"),
        (("xx: 2.489e-3,", "xx: 2.489e-3, xy: 3e-3,"), "inertia_kg_m2 is not a positive definite matrix"),
        (("kind: flight", "kind: [flight"), "not valid YAML"),
        (("name: ", "rotor_speed_limits_rad_s: [2500, 0]\nname: "), "[low, high] with 0 <= low < high"),
        (
            ("name: ", "trust: {mass_kg: -0.1}\nname: "),
            "trust of mass_kg is -0.1, expected a relative one-sigma of 0 to 100",
        ),
    ],
)
def test_a_wrong_vehicle_is_one_sentence(folder: Path, change: tuple[str, str], said: str) -> None:
    (folder / "vehicle.yaml").write_text(VEHICLE.replace(*change))
    text = message_of(folder)
    assert text.startswith(str(folder / "vehicle.yaml")) and said in text


def test_a_vehicle_that_is_no_mapping_or_not_there(folder: Path) -> None:
    (folder / "vehicle.yaml").write_text("- a\n")
    assert "expected keys with values, found a list" in message_of(folder)
    (folder / "vehicle.yaml").unlink()
    assert message_of(folder) == f"{folder / 'vehicle.yaml'}: file is missing"
    assert message_of(folder / "none") == f"{folder / 'none'}: no such recording set (folder)"


def test_a_stand_needs_rotors_and_a_bench_does_not(tmp_path: Path) -> None:
    (tmp_path / "vehicle.yaml").write_text("name: s\nkind: stand\n")
    refused("kind stand needs rotors and thrust_coefficient_n_s2", read_vehicle, tmp_path / "vehicle.yaml")
    (tmp_path / "vehicle.yaml").write_text("name: b\nkind: bench\ntared: true\n")
    assert read_vehicle(tmp_path / "vehicle.yaml").tared is True


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("t,x\n0,1\n1,2\n", "column time_s is missing"),
        ("time_s,x\n0,1\n", "expected at least two samples, found 1"),
        ("time_s,x\n0,1\n,2\n2,3\n", "line 3: time_s is empty"),
        ("time_s,x\n0,1\n0.5,2\n0.5,3\n", "line 4: time_s must increase strictly, found 0.5 after 0.5"),
        ("time_s,x\n0,1\n1,oops\n", "line 3, column x: expected a number, found 'oops'"),
        ("time_s,throttle_3\n0,0.1\n1,0.2\n", "column throttle_3: vehicle.yaml lists 2 rotors only"),
    ],
)
def test_a_wrong_run_names_file_line_and_column(folder: Path, text: str, said: str) -> None:
    (folder / "a.csv").write_text(text)
    found = message_of(folder)
    assert found.startswith(str(folder / "a.csv")) and said in found


def test_a_byte_order_mark_and_blanks_after_commas_are_no_fault(folder: Path) -> None:
    (folder / "a.csv").write_bytes(b"\xef\xbb\xbftime_s, height_m\n0, 1\n1, 2\n")
    assert read_set(folder).runs[0].column("height_m").tolist() == [1.0, 2.0]


def test_a_parquet_with_one_column_twice_is_told(tmp_path: Path) -> None:
    from rotorid.recordings.tables import numbers

    table = pd.DataFrame([[0.0, 1.0, 2.0], [1.0, 1.0, 2.0]], columns=["time_s", "x", "x"])
    refused("r.parquet: column x is there twice", numbers, table, "r.parquet")


def test_files_that_are_no_tables_are_told(folder: Path) -> None:
    (folder / "a.parquet").write_bytes(b"not parquet")
    (folder / "a.csv").unlink()
    assert "a.parquet: cannot be read as a table" in message_of(folder)
    refused("expected one of .csv, .csv.gz, .parquet", read_run, folder / "vehicle.yaml")
    refused("file is missing", read_run, folder / "none.csv")


def test_a_parquet_with_words_in_it_is_told(folder: Path) -> None:
    pd.DataFrame({"time_s": [0.0, 1.0], "x": ["a", "b"]}).to_parquet(folder / "a.parquet")
    (folder / "a.csv").unlink()
    assert message_of(folder) == f"{folder / 'a.parquet'}, row 1, column x: expected a number, found 'a'"


def test_a_set_without_runs_or_with_one_twice(folder: Path) -> None:
    (folder / "a.csv.gz").write_bytes(b"")
    assert "run a is there twice (a.csv, a.csv.gz)" in message_of(folder)
    (folder / "a.csv").unlink()
    (folder / "a.csv.gz").unlink()
    assert "no run found, expected files ending in .csv, .csv.gz, .parquet" in message_of(folder)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("held_out: [b]\n", "held_out names run b, which is not in the set"),
        ("held_out: [a]\n", "every run is held out, none is left to fit"),
        ("training: [a]\n", "training: no such key is known"),
    ],
)
def test_a_wrong_split_is_told(folder: Path, text: str, said: str) -> None:
    (folder / "split.yaml").write_text(text)
    assert said in message_of(folder)


def test_runs_come_in_the_order_of_their_names(folder: Path) -> None:
    for name in ("c", "b"):
        (folder / f"{name}.csv").write_text(RUN)
    assert [run.name for run in read_set(folder).runs] == ["a", "b", "c"]


def test_a_run_that_is_not_there_is_a_key_error(folder: Path) -> None:
    with pytest.raises(KeyError):
        read_set(folder).run("z")


@pytest.mark.parametrize(
    ("column", "unit"),
    [
        ("velocity_x_m_s", "m/s"), ("specific_force_z_m_s2", "m/s²"), ("moment_x_n_m", "N m"), ("force_x_n", "N"),
        ("temperature_c", "°C"), ("throttle_1", ""),
    ],
)  # fmt: skip
def test_the_unit_is_read_from_the_name(column: str, unit: str) -> None:
    assert c.unit_of(column) == unit


def test_without_pyarrow_runs_are_packed_csv_and_parquet_is_refused_by_name(tmp_path, monkeypatch):
    from rotorid.cli import examples
    from rotorid.recordings import tables

    folder = tmp_path / "example"
    examples.write(folder)
    found = read_set(folder)
    write_set(found, tmp_path / "with", ".parquet")
    monkeypatch.setattr(tables, "find_spec", lambda name: None)
    packed = write_set(found, tmp_path / "without")
    assert sorted(p.name for p in packed.glob("flight*")) == ["flight_1.csv.gz", "flight_2.csv.gz"]
    for one, other in zip(found.runs, read_set(packed).runs, strict=True):
        pd.testing.assert_frame_equal(one.table, other.table)
    assert "flight_1.parquet: Parquet files need pyarrow" in message_of(tmp_path / "with" / "example")
    refused("pip install 'rotorid.parquet.'", write_set, found, tmp_path / "wished", ".parquet")
