"""A run that repeats another is named, however it was shifted; runs of the same manoeuvre are not."""

import numpy as np
import pandas as pd
import pytest

from rotorid.recordings import RecordingSet, Run, Vehicle
from rotorid.recordings import columns as c
from rotorid.recordings.check import copies

RATE_HZ = 100.0
BENCH = Vehicle(name="b", kind="bench", tared=True)


def flight(seed: int, seconds: float = 30.0) -> pd.DataFrame:
    """The same manoeuvre each time, in an accelerometer and a gyroscope with noise of their own."""
    rng = np.random.default_rng(seed)
    time_s = np.arange(0, seconds, 1 / RATE_HZ)
    table = {c.TIME: time_s}
    for k, name in enumerate((*c.SPECIFIC_FORCE, *c.ANGULAR_VELOCITY)):
        table[name] = np.sin((1 + k) * time_s) + 0.02 * rng.standard_normal(len(time_s))
    return pd.DataFrame(table)


def found(**tables: pd.DataFrame):
    return copies(RecordingSet("s", BENCH, tuple(Run(name, table) for name, table in tables.items())))


def later(table: pd.DataFrame, seconds: float) -> pd.DataFrame:
    return table.assign(time_s=table[c.TIME] + seconds)


def test_the_same_manoeuvre_flown_three_times_is_no_copy() -> None:
    assert found(a=flight(1), b=flight(2), c=flight(3)) == ()


@pytest.mark.parametrize(
    ("copy", "said"),
    [
        (flight(1), "100% of its samples are equal to the last digit;"),
        (later(flight(1), 12.5), "100% of its samples are equal to the last digit, 12.5 s later;"),
        (later(flight(1), -3.0), "3 s earlier;"),
        (flight(1).iloc[700:].reset_index(drop=True), "100% of its samples are equal"),
        (flight(1).round(3), "even the noise of its sensors is the same"),
        (flight(1).iloc[700:].reset_index(drop=True).round(3), "even the noise of its sensors is the same"),
    ],
    ids=["whole", "later", "earlier", "cut", "rounded", "cut and rounded"],
)
def test_a_copy_is_named_with_its_original(copy: pd.DataFrame, said: str) -> None:
    (doubt,) = found(a=flight(1), b=flight(2), c=copy)
    assert (doubt.what, doubt.stops) == ("c", False)
    assert doubt.sentence.startswith("Run c repeats run a: ")
    assert said in doubt.sentence


def test_overlapping_parts_of_one_log_are_named() -> None:
    log = flight(1, 60.0)
    (doubt,) = found(a=log.iloc[:3500], b=log.iloc[3000:])
    assert "Run b repeats run a: 17% of its samples are equal to the last digit;" in doubt.sentence


def test_coarse_steps_that_repeat_by_themselves_are_no_copy() -> None:
    coarse = {name: flight(seed).round(0).assign(time_s=flight(seed)[c.TIME]) for name, seed in (("a", 1), ("b", 2))}
    assert found(**coarse) == ()


def test_a_bench_of_one_axis_is_looked_at_too() -> None:
    def bench(seed: int) -> pd.DataFrame:
        rng = np.random.default_rng(seed)
        load = np.repeat([0.0, 5.0, 10.0], 50)
        reading = load + 0.05 * rng.standard_normal(len(load))
        return pd.DataFrame({c.TIME: np.arange(len(load)) / 25, c.FORCE[2]: reading, c.REFERENCE_FORCE[2]: load})

    assert found(a=bench(1), b=bench(2)) == ()
    (doubt,) = found(a=bench(1), b=later(bench(1), 1000.0))
    assert doubt.what == "b"


def test_jumps_of_two_runs_are_no_copy() -> None:
    """A filter that is corrected now and then jumps, and every jump looks like every other."""
    tables = {}
    for name, seed in (("a", 1), ("b", 2)):
        table = flight(seed)
        table.loc[1000 + seed :, list(c.SPECIFIC_FORCE)] += 50.0
        tables[name] = table
    assert found(**tables) == ()
