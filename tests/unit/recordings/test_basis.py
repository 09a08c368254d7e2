"""What a verdict rests on: seconds in the air, the share on the ground, and columns that are missing."""

import numpy as np
import pandas as pd
import pytest

from rotorid.recordings import RecordingSet, Run
from rotorid.recordings.sufficient import basis_of, missing, on_the_ground_s
from tests.unit.vehicle.thesis import thesis_vehicle

HOVER = 1073.0


def flight(name: str = "a", idle_s: float = 0.0, force_m_s2: float = 9.81, seconds: float = 40.0, **columns) -> Run:
    """Hover at 100 Hz after rotors that idle, with an accelerometer."""
    time = np.arange(int(seconds * 100) + 1) / 100
    speed = np.where(time < idle_s, 0.2 * HOVER, HOVER)
    table = {"time_s": time, **{f"rotor_speed_{i}_rad_s": speed for i in range(1, 5)}}
    table |= {f"specific_force_{axis}_m_s2": np.zeros(len(time)) for axis in "xy"}
    table["specific_force_z_m_s2"] = np.where(time < idle_s, -force_m_s2, -9.81)
    return Run(name, pd.DataFrame(table | {k: np.full(len(time), v) for k, v in columns.items()}))


def set_of(*runs: Run, **vehicle) -> RecordingSet:
    return RecordingSet("made", thesis_vehicle().model_copy(update=vehicle), runs)


def test_time_on_the_ground_is_no_time_in_the_air():
    found = basis_of(set_of(flight("a", idle_s=10.0), flight("b")))
    assert (found.recorded_s, found.in_the_air_s) == (pytest.approx(80.0), pytest.approx(70.0, abs=0.1))
    assert found.ground_share == pytest.approx(0.125, abs=0.002)
    assert found.sentence.startswith(
        "The verdict rests on 70 s in the air; 12 % of the recordings are on the ground; not"
    )


def test_a_flight_that_never_lands_has_no_share_on_the_ground():
    assert "40 s in the air; none of it is on the ground" in basis_of(set_of(flight())).sentence


@pytest.mark.parametrize(("idle_s", "force"), [(0.5, 9.81), (3.0, 0.1)])
def test_short_pauses_of_the_rotors_and_a_fall_are_in_the_air(idle_s, force):
    assert on_the_ground_s(flight(idle_s=idle_s, force_m_s2=force), thesis_vehicle()) == 0.0


def test_throttles_say_it_where_no_speed_is_recorded():
    made = flight(idle_s=10.0)
    names = {f"rotor_speed_{i}_rad_s": f"throttle_{i}" for i in range(1, 5)}
    table = made.table.rename(columns=names)
    table[list(names.values())] /= 2 * HOVER
    assert on_the_ground_s(Run("a", table), thesis_vehicle()) == pytest.approx(10.0, abs=0.1)


def test_without_rotors_the_time_alone_is_said():
    found = basis_of(set_of(Run("a", flight().table.filter(regex="time|force"))))
    assert found.in_the_air_s is None and found.ground_share is None
    assert found.sentence.startswith("The verdict rests on 40 s of recordings; not recorded: rotor speeds, commands,")


def test_what_is_missing_is_named_and_what_some_runs_have_is_counted():
    high = flight("b", height_m=2.0, battery_voltage_v=11.0)
    names = list(missing(set_of(flight("a"), high, ground_z_m=None)))
    assert names == [
        *("commands", "body rates", "attitude", "position and velocity"),
        *("height above ground in 1 of 2 runs", "battery voltage in 1 of 2 runs"),
    ]


def test_a_stand_says_how_long_it_was_read_and_what_is_missing():
    time = np.arange(2001) / 100
    table = pd.DataFrame({"time_s": time, **{f"force_{axis}_n": np.sin(time) for axis in "xyz"}})
    found = basis_of(set_of(Run("a", table), kind="stand"))
    assert found.sentence == (
        "The verdict rests on 20 s of recordings; not recorded: moments, rotor speeds, commands, attitude of the mount "
        "and battery voltage."
    )


def test_a_stand_that_reads_one_axis_lacks_the_others():
    time = np.arange(2001) / 100
    table = pd.DataFrame({"time_s": time, "force_z_n": np.sin(time)})
    names = list(missing(set_of(Run("a", table), kind="stand")))
    assert names[:2] == ["force along x and y", "moments"]


def test_a_bench_lacks_the_reference_of_an_axis_alone():
    time = np.arange(2001) / 100
    table = pd.DataFrame({"time_s": time, "force_x_n": time, "force_y_n": time, "reference_force_x_n": time})
    assert list(missing(set_of(Run("a", table), kind="bench"))) == ["reference_force_y_n"]


def test_pauses_between_the_readings_of_a_bench_are_no_recordings():
    """Ten readings of 3 s an hour; before, the hour counted."""
    time = np.concatenate([360 * k + np.arange(151) / 50 for k in range(10)])
    run = Run("a", pd.DataFrame({"time_s": time, "force_z_n": 0.0, "reference_force_z_n": 0.0}))
    assert basis_of(set_of(run, kind="bench")).sentence.startswith("The verdict rests on 30 s of recordings;")
    slow = Run("b", pd.DataFrame({"time_s": 2.0 * np.arange(16), "force_z_n": 0.0, "reference_force_z_n": 0.0}))
    assert basis_of(set_of(slow, kind="bench")).recorded_s == 30.0
