"""A sensor that stands still for a part of a flight: named by `check`."""

import numpy as np
import pandas as pd
import pytest

from rotorid.recordings import RecordingSet, Run, templates
from rotorid.recordings import columns as c
from rotorid.recordings.check import still_sensors
from rotorid.recordings.held import moves

SPEEDS, THROTTLES = c.rotor_columns("rotor_speed", 4), c.rotor_columns("throttle", 4)
SENSORS = (c.ANGULAR_VELOCITY, c.SPECIFIC_FORCE, c.QUATERNION, c.VELOCITY, c.POSITION, SPEEDS, (SPEEDS[1],))
SENSORS += (THROTTLES, (THROTTLES[2],))
RATE_HZ, SECONDS = 100.0, 20.0
COUNT = int(RATE_HZ * SECONDS)


def flown(noise: float = 1.0, seed: int = 1) -> pd.DataFrame:
    """A flight whose columns all move; without `noise` those that a simulator computes are exact."""
    rng, t = np.random.default_rng(seed), np.arange(COUNT) / RATE_HZ
    table = {c.TIME: t}
    sizes = {
        c.ANGULAR_VELOCITY: 0.02, c.SPECIFIC_FORCE: 0.1, c.QUATERNION: 1e-4, c.VELOCITY: 0.01, c.POSITION: 0.005,
        SPEEDS: 3.0, THROTTLES: 0.003,
    }  # fmt: skip
    for number, (names, size) in enumerate(sizes.items()):
        for k, name in enumerate(names):
            wave = np.sin(2 * np.pi * (0.3 + 0.07 * number + 0.05 * k) * t + number + k)
            level = {SPEEDS: 700.0, THROTTLES: 0.5}.get(names, 1.0 if name == "quaternion_w" else 0.0)
            table[name] = level + 10 * size * wave + noise * size * rng.standard_normal(COUNT)
    return pd.DataFrame(table)


def frozen(table: pd.DataFrame, names: tuple[str, ...], part: slice) -> pd.DataFrame:
    table = table.copy()
    rows = table.index[part]
    table.loc[rows, list(names)] = table.loc[rows[0], list(names)].to_numpy()
    return table


def set_of(*tables: pd.DataFrame, held_out: tuple[str, ...] | None = None) -> RecordingSet:
    runs = tuple(Run(f"run{k}", table) for k, table in enumerate(tables, 1))
    return RecordingSet("set", templates.read("thesis"), runs, held_out)


FIRST, SECOND = slice(0, COUNT // 2), slice(COUNT // 2, None)


@pytest.mark.parametrize("names", SENSORS, ids=lambda names: names[0] + f"_{len(names)}")
@pytest.mark.parametrize("part", [FIRST, SECOND, slice(800, 1100)], ids=["first half", "second half", "3 s"])
@pytest.mark.parametrize("noise", [1.0, 0.0], ids=["noisy", "exact"])
def test_a_sensor_that_stands_still_is_named_with_its_seconds(names, part: slice, noise: float) -> None:
    clean, other = flown(noise), flown(noise, seed=2)
    assert list(still_sensors(set_of(clean, other))) == []
    (doubt,) = still_sensors(set_of(frozen(clean, names, part), other))
    start, stop, _ = part.indices(COUNT)
    assert doubt.what == names[0] and not doubt.stops
    assert f"still in run1 from {start / RATE_HZ:.2f}"[:-1] in doubt.sentence  # the first reading is a true one
    assert f"to {(stop - 1) / RATE_HZ:.2f} s" in doubt.sentence


def exact(**moving: np.ndarray) -> pd.DataFrame:
    """A simulator's flight without noise: ten seconds of turns and climbs, then what is given, all else constant."""
    table = flown(0.0)
    for name in table.columns.drop(c.TIME):
        values = table[name].to_numpy().copy()
        values[SECOND] = values[SECOND][0]
        table[name] = values
    half = np.arange(COUNT // 2) / RATE_HZ
    return table.assign(
        **{n: np.concatenate([table[n][FIRST], table[n][COUNT // 2] + v(half)]) for n, v in moving.items()}
    )


def test_a_simulator_without_noise_may_hover_and_climb() -> None:
    """Nothing turns, so that the attitude may stand; the velocity moves with the force and the rotors."""
    assert list(still_sensors(set_of(exact()))) == []
    waves = {n: lambda t: 0.1 * (1 - np.cos(t)) for n in ("velocity_z_m_s", "position_z_m", c.SPECIFIC_FORCE[2])}
    waves |= {n: lambda t: 5 * (1 - np.cos(t)) for n in SPEEDS} | {
        n: lambda t: 0.01 * (1 - np.cos(t)) for n in THROTTLES
    }
    assert list(still_sensors(set_of(exact(**waves)))) == []


def test_commands_may_stand_on_the_ground_and_at_their_end() -> None:
    idle, full = flown(), flown()
    idle.loc[SECOND, list(THROTTLES)] = 0.15
    assert list(still_sensors(set_of(idle, flown(seed=2)))) == []
    full.loc[800:1100, THROTTLES[1]] = 1.0
    assert list(still_sensors(set_of(full, flown(seed=2)))) == []


@pytest.mark.parametrize(("slow", "noise", "expected"), [(0.0, 1.0, False), (0.0, 0.0, False), (3.0, 1.0, True)])
def test_a_column_moves_by_more_than_its_noise(slow: float, noise: float, expected: bool) -> None:
    t = np.arange(500) / RATE_HZ
    values = slow * np.sin(3 * t) + noise * np.random.default_rng(0).standard_normal(500)
    assert moves(t, values) == expected
    values[::2] = np.nan
    assert moves(t, values) == expected
