"""What `check` calls wrong: each mistake made in a sound flight is named; the sound flight raises nothing."""

from dataclasses import replace

import numpy as np
import pytest

from rotorid.cli.modelling import fly
from rotorid.recordings import RecordingSet, Run, read_set, templates
from rotorid.recordings import columns as c
from rotorid.recordings.check import as_text, check_set, doubts_of
from rotorid.recordings.physics import near_names
from rotorid.recordings.run import Doubt
from tests.unit.mismatch.flights import with_table

RPM = 60 / (2 * np.pi)


@pytest.fixture(scope="module")
def flown(tmp_path_factory) -> RecordingSet:
    return read_set(fly(templates.read("neurobem"), tmp_path_factory.mktemp("sets") / "sound", 24.0, 1, 3))


def test_a_sound_flight_raises_no_doubt(flown) -> None:
    assert doubts_of(flown) == ()


def test_commands_in_the_order_of_the_rotors_raise_no_doubt(flown) -> None:
    assert doubts_of(with_table(flown, with_commands((0, 1, 2, 3)))) == ()


def times(names, factor):
    def change(table):
        table[list(names)] = table[list(names)] * factor

    return change


def exchange(a: str, b: str):
    def change(table):
        table[[a, b]] = table[[b, a]].to_numpy()

    return change


SPEEDS = c.rotor_columns("rotor_speed", 4)


def joined(names, every: int):
    """Every so many readings joined by straight lines."""

    def change(table):
        kept = np.arange(0, len(table), every)
        for name in names:
            table[name] = np.interp(np.arange(len(table)), kept, table[name].to_numpy()[kept]).round(4)

    return change


def with_commands(order: tuple[int, ...]):
    """Commands that the speeds follow 40 ms later, their columns in another order."""

    def change(table):
        late = table[list(SPEEDS)].shift(-10).ffill().to_numpy()
        table[list(c.rotor_columns("rotor_command", 4))] = late[:, order]

    return change


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (times(c.SPECIFIC_FORCE[1:], -1), "forward-left-up"),
        (times(c.SPECIFIC_FORCE, 1 / 9.81), "multiples of g"),
        (times(SPEEDS, RPM), "revolutions per minute"),
        (times(c.ANGULAR_VELOCITY, 180 / np.pi), "degrees per second"),
        (times(c.ANGULAR_VELOCITY, 10), "times the derivative of the attitude"),
        (times(c.ANGULAR_VELOCITY[1:2], -1), "angular_velocity_y_rad_s turns against the attitude"),
        (exchange(*c.ANGULAR_VELOCITY[:2]), "axes are exchanged"),
        (exchange(SPEEDS[0], SPEEDS[1]), "order of the rotors"),
        (with_commands((1, 0, 2, 3)), "rotor 1 follows command 2, rotor 2 follows command 1"),
        (joined(SPEEDS, 20), "lie on straight lines between about"),
        (times(c.VELOCITY[1:2], -1), "velocity_y_m_s goes against the derivative of position_y_m"),
        (times(c.VELOCITY, 100), "100 times the derivative of position_x_m, expected 1: the velocity is in another"),
        (times(c.POSITION, 1000), "0.001 times the derivative of position_x_m, expected 1: the position is in another"),
        (times(c.SPECIFIC_FORCE, 1 / 0.3048), "ft/s² would fit"),
        (times(c.QUATERNION[1:], -1), "turns against the attitude"),
    ],
)
def test_each_mistake_is_named(flown, change, said) -> None:
    found = doubts_of(with_table(flown, change))
    assert any(said in doubt.sentence and doubt.stops for doubt in found), found


@pytest.mark.parametrize(("factor", "wrong"), [(1.0, False), (180 / np.pi, True), (1000.0, True)])
def test_rates_that_nothing_turns_at_are_named_without_an_attitude(flown, factor: float, wrong: bool) -> None:
    def change(table):
        times(c.ANGULAR_VELOCITY, factor)(table)
        for name in (*c.QUATERNION, *c.VELOCITY, *c.POSITION):
            del table[name]

    found = doubts_of(with_table(flown, change))
    assert any("rad/s in the median" in doubt.sentence and doubt.stops for doubt in found) == wrong, found


def test_what_every_run_repeats_is_one_doubt(flown) -> None:
    table = flown.runs[0].table
    half = len(table) // 2
    halves = replace(flown, runs=(Run("a", table.iloc[:half]), Run("b", table.iloc[half:])))
    found = doubts_of(with_table(halves, times(c.ANGULAR_VELOCITY, 180 / np.pi)))
    assert [doubt.what for doubt in found] == list(c.ANGULAR_VELOCITY)
    assert all(doubt.sentence.endswith("The same in 1 more.") for doubt in found)


def test_a_throttle_in_microseconds_and_a_rest_are_named(flown) -> None:
    def pulses(table):
        for i in range(1, 5):
            table[f"throttle_{i}"] = 1000 + table[f"rotor_speed_{i}_rad_s"] / 2.5
        table.loc[:500, list(SPEEDS)] = 0.0

    found = " ".join(map(str, doubts_of(with_table(flown, pulses))))
    assert "it is in µs" in found and "all rotors are at rest in 8% of the samples" in found


def test_rotors_whose_speeds_have_signs_are_not_at_rest(flown) -> None:
    def signed(table) -> None:
        table[list(c.rotor_columns("rotor_speed", 4))] *= [1, -1, 1, -1]

    assert not any("at rest" in doubt.sentence for doubt in doubts_of(with_table(flown, signed)))


def test_few_and_rare_samples_are_named(flown) -> None:
    def rare(table):
        table.loc[table.index % 100 != 0, list(SPEEDS)] = np.nan

    thin = with_table(flown, rare)
    found = doubts_of(with_table(thin, lambda t: t.iloc[:3000]))
    assert [(doubt.what, doubt.stops) for doubt in found] == [("time_s", False), (SPEEDS[0], False)]
    assert "Only 12 s are recorded" in found[0].sentence and "rotor speeds come at 2.5" in found[1].sentence

    def slow(table):
        table.loc[table.index % 100 != 0, list(c.SPECIFIC_FORCE)] = np.nan

    assert any("The accelerometer comes at 2.5" in doubt.sentence for doubt in doubts_of(with_table(flown, slow)))


def test_a_nearly_right_name_is_named(flown) -> None:
    misspelt = with_table(flown, lambda t: t.insert(1, "velocity_x_ms", t.pop("velocity_x_m_s")))
    sentence = "Column velocity_x_ms is not known; did you mean velocity_x_m_s?"
    assert near_names(misspelt) == (Doubt("velocity_x_ms", sentence, stops=False),)


def test_the_text_shows_doubts(flown) -> None:
    text = as_text(check_set(with_table(flown, times(c.SPECIFIC_FORCE, 1 / 9.81))))
    assert "Looks wrong:" in text and "multiples of g" in text
