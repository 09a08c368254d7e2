"""The commands as a person types them: what they write, what they say of bad input, and their exit codes."""

import json
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rotorid.cli.modelling import fly
from rotorid.errors import InputError
from rotorid.recordings import read_set, read_vehicle, templates
from rotorid.report.deliver import deliver
from tests.command_line import answer, invoke, refusal


@pytest.fixture(scope="module")
def flights(tmp_path_factory) -> Path:
    """Two short flights of a thesis quadrotor as a recording set."""
    return fly(templates.read("thesis"), tmp_path_factory.mktemp("sets") / "flights", 6.0, 2, 1)


def test_version_and_help_teach() -> None:
    assert invoke("--version").output.startswith("rotorid ")
    assert "rotorid import flight.ulg" in invoke("--help").output
    assert invoke("verdit").exit_code == 2


@pytest.mark.parametrize("name", templates.names())
def test_every_template_is_a_vehicle_and_init_writes_it(tmp_path: Path, name: str) -> None:
    answer("init", tmp_path / "set", "--like", name, "--mass-kg", "0.9", "--name", "mine")
    vehicle = read_vehicle(tmp_path / "set" / "vehicle.yaml")
    assert (vehicle.mass_kg, vehicle.name) == (0.9, "mine")
    assert "is there already" in refusal("init", tmp_path / "set", "--like", name)


NAMES = [
    *('a "b" c', "a: b", "a\\b", "line\nline", "tab\t", "é 四 🚁", "0652", "1:30", "yes", "null", "~", "# no", "- a"),
    *("'x'", "{a: 1}", "[a]", "&a", "*a", "!x", "%y", "a #b", " a ", "\\1", "\\g<0>", "\u2028\ufeff\x7f\x85"),
    *("x" * 5000, "a " * 999),
]


def name_as_read(folder: Path, name: str) -> str:
    """The name that `check` will see after `rotorid init --name`."""
    answer("init", folder, "--like", "thesis", f"--name={name}")
    return read_vehicle(folder / "vehicle.yaml").name


@pytest.mark.parametrize("name", NAMES, ids=lambda name: ascii(name)[:20])
def test_init_writes_any_name_so_that_it_is_read_back(tmp_path: Path, name: str) -> None:
    assert name_as_read(tmp_path, name) == name


@settings(max_examples=30, deadline=None)
@given(st.text(min_size=1).filter(str.strip))
def test_init_writes_every_text_so_that_it_is_read_back(name: str) -> None:
    with TemporaryDirectory() as folder:
        try:
            name.encode()
        except UnicodeEncodeError:
            assert "expected UTF-8 text" in refusal("init", folder, "--like", "thesis", f"--name={name}")
        else:
            assert name_as_read(Path(folder), name) == name


@pytest.mark.parametrize(
    ("option", "said"),
    [
        ("--name=", "--name is '', expected text"),
        ("--name= ", "--name is ' ', expected text"),
        ("--name=\udcff", "--name is '\\udcff', expected UTF-8 text"),
        ("--mass-kg=inf", "--mass-kg is inf, expected a finite number of more than 0"),
        ("--mass-kg=1e-9", "mass_kg: found 1e-09, expected a number of 1e-06 or more"),
    ],
)
def test_init_refuses_in_one_sentence_and_writes_nothing(tmp_path: Path, option: str, said: str) -> None:
    assert said in refusal("init", tmp_path / "set", "--like", "thesis", option)
    assert not (tmp_path / "set").exists()


@pytest.mark.parametrize("mass_kg", [2e-5, 0.71234567, 3e4])
def test_init_writes_a_mass_in_full(tmp_path: Path, mass_kg: float) -> None:
    answer("init", tmp_path, "--like", "thesis", "--mass-kg", mass_kg)
    assert read_vehicle(tmp_path / "vehicle.yaml").mass_kg == mass_kg


def test_the_thesis_template_is_the_file_of_the_project() -> None:
    own = Path(__file__).parents[3] / "raw" / "vehicle" / "thesis.yaml"
    assert templates.text("thesis") == own.read_text()


def test_a_misspelt_template_or_effect_names_the_nearest(tmp_path: Path) -> None:
    assert "did you mean x500?" in refusal("init", tmp_path, "--like", "x5000")
    assert "did you mean rotor_drag?" in refusal("effects", "rotor_drog")


def test_effects_as_json() -> None:
    assert json.loads(invoke("effects", "--json").output)["rotor_drag"]["name"] == "rotor drag"


@pytest.mark.slow
def test_a_verdict_has_the_bytes_of_the_workflow_and_a_mismatch_is_no_error(flights: Path, tmp_path: Path) -> None:
    done = invoke("verdict", flights, "-o", tmp_path / "out", "--json", "-q")
    assert done.exit_code == 0, done.output
    names = ("verdict.json", "report.html", "improved_vehicle.yaml")
    deliver(read_set(flights), tmp_path / "flow")
    for name in names:
        assert (tmp_path / "out" / name).read_bytes() == (tmp_path / "flow" / name).read_bytes()
    assert json.loads(done.stdout)["set"] == "flights"


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda p: None, "file is missing"),
        (lambda p: p.mkdir(), "no vehicle.yaml and no log in it"),
        (lambda p: p.write_bytes(b""), "the file is empty"),
        (lambda p: p.write_bytes(b"\x7fELF\0\0\0\0" * 8), "not a log that rotorid knows"),
        (lambda p: p.write_bytes(b"\xa3\x95" * 80), "DataFlash log"),
        (lambda p: p.write_bytes(b"ULog\x01\x12\x35\x01" + bytes(8)), "to take the clock from"),
        (lambda p: p.write_text("a,b\n1,2\n3,4\n"), "--write-mapping"),
    ],
)
def test_a_wrong_file_gets_one_sentence(tmp_path: Path, make, said: str) -> None:
    path = tmp_path / "thing"
    make(path)
    assert said in refusal("verdict", path, "-o", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_folder_with_a_misnamed_vehicle_says_so(tmp_path: Path) -> None:
    (tmp_path / "Vehicle.yml").write_text("name: x\n")
    assert "is Vehicle.yml meant to be it?" in invoke("verdict", tmp_path).output


def own_csv(tmp_path: Path, flights: Path) -> Path:
    """The first flight in other units, axes and names: g, degrees, FLU, ENU, xyzw, rpm."""
    table = read_set(flights).runs[0].table
    flu = np.array([1.0, -1.0, -1.0])
    from scipy.spatial.transform import Rotation

    turn = Rotation.from_quat(table[[f"quaternion_{a}" for a in "xyzw"]].to_numpy())
    enu = Rotation.from_matrix([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
    quaternion = (enu * turn * Rotation.from_matrix(np.diag(flu))).as_quat()
    force = table[[f"specific_force_{a}_m_s2" for a in "xyz"]].to_numpy() * flu / 9.80665
    rates = np.degrees(table[[f"angular_velocity_{a}_rad_s" for a in "xyz"]].to_numpy() * flu)
    velocity = table[[f"velocity_{a}_m_s" for a in "xyz"]].to_numpy() @ enu.as_matrix().T
    speeds = table[[f"rotor_speed_{i}_rad_s" for i in range(1, 5)]].to_numpy() * 60 / (2 * np.pi)
    columns = {"timestamp_us": (table["time_s"] * 1e6 + 5e9).round()}
    for names, values in (
        ("acc_x acc_y acc_z", force), ("gyro_x_deg_s gyro_y_deg_s gyro_z_deg_s", rates), ("qx qy qz qw", quaternion),
        ("vx vy vz", velocity), ("rpm1 rpm2 rpm3 rpm4", speeds),
    ):  # fmt: skip
        columns |= dict(zip(names.split(), values.T, strict=True))
    path = tmp_path / "own.csv"
    pd.DataFrame({**columns, "sunshine": 1.0}).to_csv(path, index=False)
    return path


def test_a_csv_of_ones_own_comes_back_by_the_proposed_mapping(tmp_path: Path, flights: Path) -> None:
    path, mapping = own_csv(tmp_path, flights), tmp_path / "mapping.yaml"
    answer("import", path, "--write-mapping", mapping)
    assert "body: flu" in mapping.read_text() and "world: enu" in mapping.read_text()
    answer("import", path, "--mapping", mapping, "--like", "thesis", "--mass-kg", "0.652", "-o", tmp_path / "set")
    made, sound = read_set(tmp_path / "set").runs[0].table, read_set(flights).runs[0].table
    for name in sound.columns.intersection(made.columns).drop("time_s"):
        values = made[name] * np.sign(made["quaternion_w"] * sound["quaternion_w"]) if "quat" in name else made[name]
        np.testing.assert_allclose(values, sound[name], atol=1e-4, rtol=1e-4, err_msg=name)
    assert {"rotor_speed_4_rad_s", "velocity_z_m_s", "sunshine"} <= set(made.columns)
    vehicle = read_vehicle(tmp_path / "set" / "vehicle.yaml")
    # The flights were made with C_F = 1.3877e-6: hover finds it again.
    assert vehicle.thrust_coefficient_n_s2 == pytest.approx(1.3877e-6, rel=0.01)


def test_a_mapping_that_does_not_fit_is_told(tmp_path: Path, flights: Path) -> None:
    path, mapping = own_csv(tmp_path, flights), tmp_path / "mapping.yaml"
    invoke("import", path, "--write-mapping", mapping)
    text = mapping.read_text()
    for old, new, said in (
        ("acc_x", "acx", "wants column 'acx', which is not there; did you mean acc_x?"),
        ("specific_force:", "specific_fource:", "no such channel; did you mean specific_force?"),
        ("unit: rpm", "unit: rps", "unit 'rps', expected one of rad/s, rpm, hz"),
        ("body: flu", "body: lfu", "body"),
    ):
        mapping.write_text(text.replace(old, new, 1) if old != "acc_x" else text.replace("acc_x", "acx"))
        assert said in refusal("import", path, "--mapping", mapping, "--like", "thesis", "-o", tmp_path / "set")
        assert not (tmp_path / "set").exists()


def test_import_keeps_a_vehicle_that_is_there(tmp_path: Path, flights: Path) -> None:
    source = tmp_path / "flight.csv"
    read_set(flights).runs[0].table.to_csv(source, index=False)
    out = tmp_path / "set"
    answer("init", out, "--like", "thesis", "--name", "mine")
    assert "stays as it is" in answer("import", source, "-o", out)
    assert read_vehicle(out / "vehicle.yaml").name == "mine"
    assert "would change" in refusal("import", source, "-o", out, "--like", "x500", "--mass-kg", "2")
    assert read_vehicle(out / "vehicle.yaml").name == "mine"


def test_simulate_refuses_to_overwrite(tmp_path: Path, flights: Path) -> None:
    assert "is there already" in refusal("simulate", flights / "vehicle.yaml", "-o", flights)


def test_the_bundled_example_is_a_set_and_nothing_is_overwritten(tmp_path: Path) -> None:
    from rotorid.cli import examples

    answer("init", tmp_path / "flights", "--example")
    found = read_set(tmp_path / "flights")
    assert [r.name for r in found.runs] == ["flight_1", "flight_2"]
    assert found.runs[0].time_s[-1] == examples.SECONDS and not found.vehicle.effects
    assert "is there already" in refusal("init", tmp_path / "flights", "--example")


@pytest.mark.slow
def test_the_bundled_example_is_what_its_module_makes_and_the_verdict_finds_what_is_concealed(tmp_path: Path) -> None:
    from rotorid.cli import examples
    from rotorid.cli.examples.__main__ import main

    main(tmp_path)
    for path in examples.write(tmp_path / "shipped"):
        if path.suffix == ".yaml":
            assert (tmp_path / path.name).read_text() == path.read_text()
        else:
            made, shipped = pd.read_csv(tmp_path / path.name), pd.read_csv(path)
            pd.testing.assert_frame_equal(made, shipped, rtol=1e-5, atol=1e-6)
    done = invoke("verdict", tmp_path / "shipped", "-o", tmp_path / "answer", "--json", "--series", "-q")
    verdict = json.loads(done.stdout)
    (drag,) = [e for e in verdict["effects"] if e["status"] == "established"]
    low, high = drag["parameters"][0]["interval_95"]
    assert drag["id"] == "rotor_drag" and low < examples.CONCEALED[0]["parameters"]["k_d"] < high
    series = pd.read_parquet(tmp_path / "answer" / "series.parquet")
    assert {"run", "time_s", "force_x_before", "force_x_after"} <= set(series.columns)


def test_a_template_that_hovers_as_the_flight_did_is_named() -> None:
    from rotorid.recordings.importers.known import closer_template

    brushed, brushless = templates.read("crazyflie-2.1"), templates.read("crazyflie-2.1-brushless")
    lift = brushless.thrust_coefficient_n_s2 / brushless.mass_kg
    assert closer_template(lift, brushed, "crazyflie-2.1") == "crazyflie-2.1-brushless"
    assert closer_template(lift, brushless, "crazyflie-2.1-brushless") is None
    assert closer_template(10 * lift, brushed, "crazyflie-2.1") is None


def test_names_of_times_and_commands_are_recognised_and_a_lacking_time_is_told() -> None:
    from rotorid.recordings.importers.guessing import guess

    rpm = np.linspace(8000, 9000, 50)
    names = {f"cmd_rpm{i}": rpm for i in range(1, 5)} | {f"motor_speed_{i}": rpm / 10 for i in range(1, 5)}
    for time, unit, scale in (("t_ms", "ms", 1e3), ("t [s]", "s", 1.0), ("t_us", "us", 1e6), ("time", "s", 1.0)):
        mapping = guess(pd.DataFrame({time: np.arange(50) * 0.01 * scale} | names)).mapping
        assert mapping.channels["time"].columns == (time,) and mapping.channels["time"].unit == unit
        assert mapping.channels["rotor_command"].columns == tuple(f"cmd_rpm{i}" for i in range(1, 5))
        assert mapping.channels["rotor_command"].unit == "rpm" and mapping.channels["rotor_speed"].unit == "rad/s"
    lacking = guess(pd.DataFrame(names))
    assert lacking.mapping.channels["time"].columns == ("?",) and "no column is named as a time" in lacking.open["time"]


def test_help_by_its_short_name_and_by_python(tmp_path: Path) -> None:
    for words in (["-h"], ["verdict", "-h"], ["import", "-h"]):
        assert "Usage: " in answer(*words)
    done = subprocess.run([sys.executable, "-m", "rotorid", "-h"], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0 and "Usage: rotorid " in done.stdout, done.stderr


@pytest.mark.parametrize("word", ["verdict", "import", "check", "plan"])
def test_a_misspelt_path_gets_a_suggestion(tmp_path: Path, monkeypatch, word: str) -> None:
    (tmp_path / "flights").mkdir()
    monkeypatch.chdir(tmp_path)
    assert refusal(word, "flihgts").endswith("; did you mean flights?\n")


@pytest.mark.parametrize(
    ("words", "meant"), [(["verdit"], "verdict"), (["verdict", "x", "--mas-kg", "1"], "--mass-kg")]
)
def test_a_misspelt_command_or_option_gets_a_suggestion(words, meant) -> None:
    done = invoke(*words)
    assert done.exit_code == 2 and meant in done.output


def test_a_verdict_says_which_options_play_no_part_for_a_set(flights: Path, tmp_path: Path, monkeypatch) -> None:
    def stop(*_):
        raise InputError("judged")

    monkeypatch.setattr("rotorid.cli.verdicts.write_verdict", stop)
    done = invoke("verdict", flights, "-o", tmp_path / "out", "--mass-kg", "3", "--like", "x500")
    assert "--mass-kg and --like play no part" in done.stderr and str(flights / "vehicle.yaml") in done.stderr
    assert invoke("verdict", flights, "-o", tmp_path / "out").stderr == "rotorid: judged\n"


def test_check_of_a_log_says_import_first(tmp_path: Path, flights: Path) -> None:
    log, bag = tmp_path / "flight.csv", tmp_path / "bag"
    log.write_text("a,b\n1,2\n")
    bag.mkdir()
    (bag / "metadata.yaml").write_text("rosbag2_bagfile_information: {}\n")
    for path in (log, bag):
        first = f"make a set of it first: `rotorid import {path}`"
        assert refusal("check", path) == f"rotorid: {path}: is a log, not a recording set; {first}\n"
    assert f"check the set: `rotorid check {flights}`" in invoke("check", flights / "vehicle.yaml").output


def test_import_says_what_the_verdict_would_refuse(tmp_path: Path, flights: Path) -> None:
    """One flight of 6 s is too short to hold out a part of it; a second one settles it."""
    for number, one in enumerate(read_set(flights).runs, 1):
        one.table.to_csv(tmp_path / f"flight_{number}.csv", index=False)
    out = tmp_path / "set"
    said = answer("import", tmp_path / "flight_1.csv", "-o", out, "--like", "thesis", "--mass-kg", "0.652")
    *_, refused, following = said.splitlines()
    assert refused.startswith(f"`rotorid verdict {out}` will refuse the set: ") and "at least 9 s" in refused
    assert following == f"Next: add another flight of this vehicle: `rotorid import LOG -o {out}`"
    judged = refusal("verdict", out, "-o", tmp_path / "answer", "-q")
    assert judged == f"rotorid: {refused.split('refuse the set: ')[1]}\n"
    assert f"then `rotorid verdict {out}`" in answer("import", tmp_path / "flight_2.csv", "-o", out).splitlines()[-1]


def test_import_as_json(tmp_path: Path, flights: Path) -> None:
    path, mapping = own_csv(tmp_path, flights), tmp_path / "mapping.yaml"
    proposed = json.loads(invoke("import", path, "--write-mapping", mapping, "--json").stdout)
    assert proposed["mapping"] == str(mapping) and "specific_force" in proposed["channels"]
    words = ("--mapping", mapping, "--like", "thesis", "--mass-kg", "0.652", "-o", tmp_path / "set")
    said = json.loads(invoke("import", path, *words, "--json").stdout)
    assert list(said) == ["set", "runs", "found", "proposed", "kept_vehicle", "verdict_refuses"]
    assert said["set"] == str(tmp_path / "set") and not said["kept_vehicle"] and said["proposed"]
    assert [r["name"] for r in said["runs"]] == ["own"] and said["runs"][0]["duration_s"] == pytest.approx(6.0, abs=0.1)
    assert "at least 9 s" in said["verdict_refuses"]
