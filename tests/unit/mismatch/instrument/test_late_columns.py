"""Columns of a stand or bench that come late, seldom, at times of their own or not at all: the answer stays, or `check`
doubts it."""

import numpy as np
import pandas as pd
import pytest

from rotorid.recordings import RecordingSet, Run
from rotorid.recordings.check import doubts_of
from rotorid.report.deliver import judge
from tests.fuzz.variations import stand
from tests.refusals import refused

SPEEDS = [f"rotor_speed_{i}_rad_s" for i in range(1, 5)]


def changed(kind: str, change, seed: int = 3) -> RecordingSet:
    made = stand(seed, kind)
    runs = tuple(Run(run.name, change(run.table.copy())) for run in made.runs)
    return RecordingSet(kind, made.vehicle, runs)


def seldom(names: list[str], every: int):
    def change(table: pd.DataFrame) -> pd.DataFrame:
        table.loc[np.arange(len(table)) % every != 0, names] = np.nan
        return table

    return change


def held(names: list[str], every: int):
    def change(table: pd.DataFrame) -> pd.DataFrame:
        table[names] = table[names].to_numpy()[np.arange(len(table)) // every * every]
        return table

    return change


def scattered(names: list[str]):
    def change(table: pd.DataFrame) -> pd.DataFrame:
        for number, name in enumerate(names):
            table.loc[np.random.default_rng(number).random(len(table)) < 0.5, name] = np.nan
        return table

    return change


def jittered(table: pd.DataFrame) -> pd.DataFrame:
    late = np.random.default_rng(1).uniform(0.0, 0.9 * table["time_s"][1], len(table))
    return table.assign(time_s=table["time_s"] + late)


@pytest.mark.parametrize(
    ("kind", "change"),
    [
        ("stand", seldom(SPEEDS, 10)),
        ("stand", held(["force_z_n", "moment_x_n_m"], 7)),
        ("stand", scattered(SPEEDS)),
        ("stand", jittered),
        ("bench", seldom(["reference_force_x_n", "reference_force_z_n"], 5)),
        ("bench", held(["force_x_n", "force_z_n"], 7)),
        ("bench", scattered(["reference_force_x_n", "force_z_n"])),
    ],
)
def test_the_answer_is_that_of_the_whole_columns(kind: str, change) -> None:
    """Steps of the load that fall between two readings were lines between them, and held readings were late."""
    assert judge(changed(kind, change)).verdict == "no_mismatch"


def stuck(name: str):
    def change(table: pd.DataFrame) -> pd.DataFrame:
        table.loc[len(table) // 3 :, name] = table[name][len(table) // 3]
        return table

    return change


@pytest.mark.parametrize(
    ("kind", "change", "name", "words"),
    [
        ("stand", stuck("force_z_n"), "force_z_n", "stands still in r0"),
        ("stand", stuck(SPEEDS[1]), SPEEDS[1], "stands still in r0"),
        ("bench", stuck("reference_force_x_n"), "reference_force_x_n", "stands still in r0"),
        ("stand", lambda table: table.round({"force_z_n": 0}), "force_z_n", "in steps of 1"),
        ("stand", scattered(["force_z_n"]), "force_z_n", "of the values are missing"),
    ],
)
def test_what_stands_still_is_rounded_or_scattered_is_doubted(kind: str, change, name: str, words: str) -> None:
    assert doubts_of(changed(kind, lambda table: table)) == ()
    (doubt,) = doubts_of(changed(kind, change))
    assert doubt.what == name and words in doubt.sentence and not doubt.stops


def test_readings_that_hardly_come_together_are_refused_in_a_sentence() -> None:
    def change(table: pd.DataFrame) -> pd.DataFrame:
        table.loc[np.arange(len(table)) % 10 > 2, "force_z_n"] = np.nan
        return table

    refused("no run has 4 samples in a row", judge, changed("stand", change))
