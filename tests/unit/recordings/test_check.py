"""What the check of a recording set says, and its command."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from rotorid.recordings import RecordingSet, Run, Vehicle, write_set
from rotorid.recordings import columns as c
from rotorid.recordings.check import as_text, check_recordings, check_set
from tests.command_line import answer, refusal

FLIGHT = Vehicle(
    name="x", kind="flight", mass_kg=1.0, inertia_kg_m2={"xx": 1e-3, "yy": 1e-3, "zz": 2e-3},
    rotors=[{"x_m": 0.1, "y_m": 0.1, "spin": "ccw"}], thrust_coefficient_n_s2=1e-6, torque_coefficient_n_m_s2=1e-8,
)  # fmt: skip


def flight(**columns: np.ndarray) -> RecordingSet:
    time = np.arange(len(next(iter(columns.values()), range(100)))) * 0.01
    time[50:] += 0.1
    return RecordingSet("flight", FLIGHT, (Run("a", pd.DataFrame({"time_s": time, **columns})),))


def test_rate_duration_gaps_and_empty_cells() -> None:
    voltage = np.full(100, np.nan)
    voltage[::10] = 12.0
    run = check_set(flight(battery_voltage_v=voltage)).runs[0]
    assert run.samples == 100 and run.rate_hz == pytest.approx(100.0)
    assert run.duration_s == pytest.approx(1.09) and run.gaps == 1
    assert run.longest_gap_s == pytest.approx(0.11)
    assert run.empty == {"battery_voltage_v": pytest.approx(0.9)}
    assert run.value_rate_hz["battery_voltage_v"] == pytest.approx(10 / 1.09)


def test_what_is_missing_is_said_with_what_it_means() -> None:
    lacks = " ".join(check_set(flight()).lacks)
    assert "No rotor speeds, commands or throttles" in lacks and "force channels are missing" in lacks
    assert "moment channels are missing" in lacks and "ground effect cannot be tested" in lacks
    assert "One run only" in lacks


def test_a_full_flight_lacks_only_a_second_run() -> None:
    ones = np.ones(100)
    names = [f"{kind}_{axis}_{unit}" for axis in "xyz" for kind, unit in
             (("specific_force", "m_s2"), ("angular_velocity", "rad_s"), ("velocity", "m_s"))]  # fmt: skip
    names += [f"quaternion_{axis}" for axis in "wxyz"]
    names += ["rotor_speed_1_rad_s", "rotor_command_1_rad_s", "height_m", "battery_voltage_v"]
    found = check_set(flight(**{name: ones for name in names}, odd=ones))
    assert found.lacks == ("One run only: blocks of it are held out, and repeatability between runs is unknown.",)
    assert found.other_columns == ("odd",)


def test_speeds_that_come_seldom_are_told_with_what_they_cannot_show() -> None:
    speed = np.full(100, np.nan)
    speed[::25] = 500.0
    lacks = " ".join(check_set(flight(rotor_speed_1_rad_s=speed)).lacks)
    assert "Rotor speeds come 3.7 times a second only: a lag or delay of the motors shorter than 0.27 s" in lacks
    assert "times a second only" not in " ".join(check_set(flight(rotor_speed_1_rad_s=np.full(100, 500.0))).lacks)


def test_a_bench_needs_force_and_reference_together() -> None:
    table = pd.DataFrame({"time_s": [0.0, 1.0], "force_x_n": [1.0, 2.0]})
    vehicle = Vehicle(name="b", kind="bench", tared=True)
    found = check_set(RecordingSet("b", vehicle, (Run("a", table), Run("b", table))))
    assert found.lacks == ("force_x_n and reference_force_x_n are not both there: that axis cannot be compared.",)


def test_the_text_names_runs_columns_and_gaps() -> None:
    text = as_text(check_set(flight(odd=np.ones(100))))
    assert "flight: kind flight, 1 rotors, 1 runs" in text
    assert "100 samples, 1.09 s at 100 Hz, 1 gaps (longest 0.11 s)" in text
    assert "Kept as regime variables: odd" in text


def sensed() -> dict[str, np.ndarray]:
    """Columns without which nothing can be compared."""
    names = [f"{kind}_{axis}_{unit}" for axis in "xyz" for kind, unit in
             (("specific_force", "m_s2"), ("angular_velocity", "rad_s"))]  # fmt: skip
    rng = np.random.default_rng(0)
    return {name: rng.standard_normal(1000) for name in [*names, "rotor_speed_1_rad_s"]}


def test_a_gyroscope_that_repeats_its_readings_is_doubted() -> None:
    rates = np.random.default_rng(1).standard_normal((1000, 3))[np.arange(1000) // 5 * 5]
    found = check_recordings(flight(**sensed() | dict(zip(c.ANGULAR_VELOCITY, rates.T, strict=True)))).doubts
    assert any("repeat their last reading in 80% of the rows" in doubt.sentence for doubt in found)


def test_the_command_checks_one_set_or_a_folder_of_them(tmp_path: Path) -> None:
    write_set(flight(**sensed()), tmp_path)
    assert answer("check", tmp_path) == answer("check", tmp_path / "flight")
    listed = json.loads(answer("check", "--json", tmp_path))
    assert listed[0]["runs"][0]["samples"] == 1000


def test_the_command_fails_with_the_sentence_of_the_fault(tmp_path: Path) -> None:
    folder = write_set(flight(), tmp_path)
    (folder / "vehicle.yaml").write_text("name: x\n")
    assert "kind: is missing" in refusal("check", folder)
