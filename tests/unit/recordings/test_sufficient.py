"""Sets in which nothing, or not enough, can be compared: one sentence with file, column and the nearest right name."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from rotorid.recordings import RecordingSet, Run, Vehicle, read_set, write_set
from rotorid.recordings import columns as c
from rotorid.recordings.sufficient import sufficient
from rotorid.report.deliver import deliver, judge
from tests.command_line import answer, invoke
from tests.refusals import refused
from tests.unit.mismatch.flights import QUAD

SPEEDS = c.rotor_columns("rotor_speed", 4)
COMMANDS = c.rotor_columns("rotor_command", 4)
RATE_HZ = 50.0
NEEDED_OF_A_STAND = ("name", "mass_kg", "rotors", "thrust_coefficient_n_s2", "torque_coefficient_n_m_s2")


def flight_table(seconds: float = 12.0, seed: int = 0) -> pd.DataFrame:
    """A hover with noise in every sensor."""
    rng = np.random.default_rng(seed)
    count = int(seconds * RATE_HZ)
    hover = float(np.sqrt(0.652 * 9.81 / (4 * 1.3877e-6)))

    def around(value: float, spread: float) -> np.ndarray:
        return value + spread * rng.standard_normal(count)

    columns = {"time_s": np.arange(count) / RATE_HZ}
    columns |= {name: around(hover, 20.0) for name in SPEEDS}
    columns |= {name: around(1.0 if name.endswith("w") else 0.0, 0.01) for name in c.QUATERNION}
    columns |= {name: around(0.0, 0.1) for name in (*c.ANGULAR_VELOCITY, *c.VELOCITY)}
    columns |= {name: around(-9.81 if name.endswith("z_m_s2") else 0.0, 0.2) for name in c.SPECIFIC_FORCE}
    return pd.DataFrame(columns)


def flight(*tables: pd.DataFrame, **vehicle: Any) -> RecordingSet:
    runs = tuple(Run(f"run{k}", table) for k, table in enumerate(tables, 1))
    return RecordingSet("example", Vehicle.model_validate(QUAD | vehicle), runs)


def stand(force_z_n: float, **vehicle: Any) -> RecordingSet:
    rng = np.random.default_rng(0)
    count = 500
    content = {k: v for k, v in QUAD.items() if k in NEEDED_OF_A_STAND}
    table = pd.DataFrame({"time_s": np.arange(count) / RATE_HZ})
    for name in SPEEDS:
        table[name] = 0.0
    for name in (*c.FORCE, *c.MOMENT):
        table[name] = 0.02 * rng.standard_normal(count) + (force_z_n if name == "force_z_n" else 0.0)
    return RecordingSet(
        "example", Vehicle.model_validate(content | {"kind": "stand", "tared": True} | vehicle), (Run("run1", table),)
    )


def bench(**columns: str) -> RecordingSet:
    """A bench whose vehicle lists rotors and whose run has none; `columns` renames."""
    rng = np.random.default_rng(0)
    time = np.arange(600) / RATE_HZ
    load = np.interp(time, np.linspace(0, time[-1], 7), [0, 4, 4, 8, 8, 3, 0])
    table = pd.DataFrame({"time_s": time})
    for k, axis in enumerate("xyz"):
        table[f"reference_force_{axis}_n"] = load * (k == 2)
        table[f"force_{axis}_n"] = load * (k == 2) + 0.01 * rng.standard_normal(len(time))
    vehicle = Vehicle.model_validate(QUAD | {"kind": "bench", "tared": True, "torque_coefficient_n_m_s2": [1e-8] * 4})
    return RecordingSet("example", vehicle, (Run("run1", table.rename(columns=columns)),))


SIX = [{"x_m": 0.1 * np.cos(a), "y_m": 0.1 * np.sin(a), "spin": "ccw"} for a in np.arange(6.0)]
WHOLE = flight_table()
INSUFFICIENT = {
    "misspelled": (
        flight(WHOLE.rename(columns={SPEEDS[0]: "rotor_speed1_rad_s"})),
        ["run1.csv", "column rotor_speed1_rad_s is not known", "did you mean rotor_speed_1_rad_s?"],
    ),
    "one missing": (
        flight(WHOLE.drop(columns=SPEEDS[2])),
        ["run1.csv", "column rotor_speed_3_rad_s is missing", "lists 4 rotors", "the rotor speed of 3"],
    ),
    "one empty": (flight(WHOLE.assign(**{SPEEDS[2]: np.nan})), ["run1.csv", "column rotor_speed_3_rad_s is empty"]),
    "one missing, another unit": (
        flight(WHOLE.rename(columns={SPEEDS[2]: "rotor_speed_3_rpm"})),
        ["column rotor_speed_3_rad_s is missing", "is rotor_speed_3_rpm meant to be rotor_speed_3_rad_s?"],
    ),
    "no rotors": (
        flight(WHOLE.drop(columns=list(SPEEDS))),
        ["run1.csv", "rotor_speed_1_rad_s to rotor_speed_4_rad_s", "rotor_command_1_rad_s", "throttle_1"],
    ),
    "rotors by another name": (
        flight(WHOLE.rename(columns={n: n.replace("rotor", "motor") for n in SPEEDS})),
        ["run1.csv", "is motor_speed_1_rad_s meant to be rotor_speed_1_rad_s?"],
    ),
    "six of four": (
        flight(WHOLE, rotors=SIX),
        ["run1.csv", "columns rotor_speed_5_rad_s and rotor_speed_6_rad_s are missing", "lists 6 rotors"],
    ),
    "quaternions zero": (
        flight(WHOLE.assign(**{n: 0.0 for n in c.QUATERNION})),
        ["run1.csv, line 2", "quaternion_w", "norm 0, expected 1", "600 of 600"],
    ),
    "one quaternion zero": (
        flight(WHOLE.assign(**{n: WHOLE[n].where(WHOLE.index != 57, 0.0) for n in c.QUATERNION})),
        ["run1.csv, line 59", "norm 0, expected 1"],
    ),
    "nothing to compare": (
        flight(WHOLE[["time_s", *SPEEDS]]),
        ["run1.csv", "nothing can be compared without specific_force_x_m_s2"],
    ),
    "rotors never turn": (
        flight(WHOLE.assign(**{n: 0.0 for n in SPEEDS})),
        ["run1.csv", "rotor_speed_1_rad_s to rotor_speed_4_rad_s are 0 throughout"],
    ),
    "stand with still rotors": (
        stand(-9.0),
        ["run1.csv", "rotor_speed_1_rad_s to rotor_speed_4_rad_s are 0 throughout although the sensor reads 9"],
    ),
    "too little for one run": (
        flight(flight_table(5.0)),
        ["run1.csv", "too little data", "at least 9 s", "found 4.98 s"],
    ),
    "too little in each run": (
        flight(flight_table(1.0), flight_table(1.0)),
        ["run1.csv", "too little data", "lasts 0.98 s, expected at least 3 s", "1 more runs likewise"],
    ),
    "too slow": (
        flight(WHOLE.assign(time_s=np.arange(len(WHOLE)) * 1.0)),
        ["run1.csv", "usual step of 1 s, expected at most 0.5 s"],
    ),
    "microseconds": (
        flight(WHOLE.assign(time_s=WHOLE["time_s"] * 1e6)),
        ["run1.csv", "usual step of 20000 s", "is it in microseconds?"],
    ),
    "clock set in the midst": (
        flight(WHOLE.assign(time_s=WHOLE["time_s"] + 1.7e9 * (WHOLE.index >= 300))),
        ["run1.csv, line 302", "time_s jumps by 1.7e+09 s where its usual step is 0.02 s"],
    ),
    "an infinite cell": (
        flight(WHOLE.assign(velocity_y_m_s=WHOLE["velocity_y_m_s"].where(WHOLE.index != 9, np.inf))),
        ["run1.csv, line 11, column velocity_y_m_s", "found inf"],
    ),
    "an absurd cell": (
        flight(WHOLE.assign(my_sensor=np.where(WHOLE.index == 9, 1e300, 1.0))),
        ["run1.csv, line 11, column my_sensor", "found 1e+300"],
    ),
    "bench without its reference": (
        bench(reference_force_z_n="z", reference_force_x_n="x", reference_force_y_n="y"),
        ["run1.csv", "column reference_force_x_n is missing where force_x_n is there"],
    ),
}


@pytest.fixture(params=INSUFFICIENT, ids=lambda name: name.replace(" ", "-"))
def insufficient(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[Path, list[str]]:
    recordings, said = INSUFFICIENT[request.param]
    return write_set(recordings, tmp_path, ".csv"), said


def test_the_library_says_what_is_missing_and_writes_nothing(insufficient: tuple[Path, list[str]]) -> None:
    folder, said = insufficient
    out = folder.parent / "out"
    text = refused(str(folder), lambda: deliver(read_set(folder), out))
    assert text.startswith(str(folder)) and "\n" not in text and all(words in text for words in said)
    assert not out.exists()


def test_the_command_says_the_same_and_fails(insufficient: tuple[Path, list[str]]) -> None:
    folder, said = insufficient
    done = invoke("check", folder)
    assert done.exit_code == 1 and len(done.stderr.strip().splitlines()) == 1
    assert all(words in done.stderr for words in said), done.stderr


def test_a_bench_may_list_rotors_that_play_no_part(tmp_path: Path) -> None:
    folder = write_set(bench(), tmp_path)
    answer("check", folder)
    out = tmp_path / "out"
    verdict = deliver(read_set(folder), out)
    assert "force_z" in verdict.channels


def test_rotors_that_truly_stand_still_are_no_fault() -> None:
    weight = 0.652 * 9.81
    assert sufficient(stand(weight, tared=False)).left_out == ()
    assert sufficient(stand(0.0)).left_out == ()
    before_take_off = flight(WHOLE.assign(**{n: WHOLE[n].where(WHOLE.index > 150, 0.0) for n in SPEEDS}))
    assert sufficient(before_take_off).left_out == ()


def test_commands_take_the_place_of_a_missing_speed() -> None:
    commanded = WHOLE.assign(**{n: WHOLE[s] for n, s in zip(COMMANDS, SPEEDS, strict=True)})
    assert sufficient(flight(commanded.drop(columns=SPEEDS[2]))).left_out == ()


def test_unknown_columns_that_are_like_no_missing_one_stay() -> None:
    named = WHOLE.assign(motor_temperature_c=1.0, velocity_u_m_s=1.0, temperature_k=300.0, heading_deg=3.0)
    assert sufficient(flight(named)).runs[0].unknown_columns[0] == "motor_temperature_c"


def test_one_bad_run_is_left_out_and_named() -> None:
    usable = sufficient(flight(WHOLE, WHOLE.assign(velocity_y_m_s=np.inf), flight_table(seed=1)))
    assert [run.name for run in usable.runs] == ["run1", "run3"]
    assert len(usable.left_out) == 1
    assert usable.left_out[0].startswith("Left out: run run2, line 2, column velocity_y_m_s: found inf")


def test_a_sensor_that_never_moves_counts_as_not_recorded() -> None:
    usable = sufficient(flight(WHOLE.assign(**dict.fromkeys(c.POSITION, 0.0))))
    assert not set(c.POSITION) & set(usable.runs[0].table.columns)
    assert usable.left_out[0].startswith("Left out: position_x_m to position_z_m hold one value in every run")


def test_runs_are_compared_in_the_same_channels() -> None:
    poor = WHOLE.drop(columns=list(c.SPECIFIC_FORCE))
    few = sufficient(flight(WHOLE, poor, flight_table(seed=1)))
    assert [run.name for run in few.runs] == ["run1", "run3"]
    assert few.left_out == ("Left out: run run2: lacks sensors that the other runs have (for accelerometer).",)
    half = sufficient(flight(WHOLE, poor))
    assert [run.has(*c.SPECIFIC_FORCE) for run in half.runs] == [False, False]
    assert half.left_out == ("Left out: specific_force_x_m_s2 to specific_force_z_m_s2 are not recorded in every run.",)


def test_commands_of_nothing_count_as_not_recorded() -> None:
    usable = sufficient(flight(WHOLE.assign(**dict.fromkeys(COMMANDS, 0.0))))
    assert not set(COMMANDS) & set(usable.runs[0].table.columns)


def test_a_verdict_names_the_run_that_was_left_out() -> None:
    verdict = judge(flight(flight_table(4.0, seed=1), flight_table(1.0), flight_table(4.0, seed=2)))
    assert "Left out: run run2: too little data" in " ".join(verdict.details)
    assert "run2" not in (*verdict.runs.training, *verdict.runs.held_out)


def test_a_split_without_its_held_out_run_is_refused() -> None:
    made = flight(WHOLE, WHOLE.assign(velocity_y_m_s=np.inf))
    made = RecordingSet(made.name, made.vehicle, made.runs, ("run2",))
    refused("without it no run is held out", sufficient, made)


def test_a_run_with_a_heading_only_is_left_out(tmp_path: Path) -> None:
    folder = write_set(flight(WHOLE, flight_table(seed=1)), tmp_path, ".csv")
    (folder / "run0.csv").write_text("time_s,height_m\n")
    assert "run0.csv: too little data" in sufficient(read_set(folder)).left_out[0]
