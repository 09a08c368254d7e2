"""Harmless variations of small sets: what logs do to columns, drawn anew from a seed. None is a fault of rotorid."""

from collections.abc import Callable

import numpy as np
import pandas as pd

from rotorid.recordings import RecordingSet, Run, templates
from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle.control import swings

_G = 9.81
Change = Callable[[pd.DataFrame, np.random.Generator], pd.DataFrame]


def _some(table: pd.DataFrame, rng: np.random.Generator, without: str = "time_s") -> list[str]:
    """A sensor's columns, or a few chosen by chance."""
    names = [n for n in table.columns if n != "time_s" and not n.startswith(without)]
    stem = str(rng.choice(names)).split("_")[0]
    own = [n for n in names if n.startswith(stem)]
    return own if rng.random() < 0.7 else [str(n) for n in rng.choice(names, min(3, len(names)), replace=False)]


def hole(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    start, length = rng.random(), rng.choice([0.01, 0.05, 0.2, 0.5])
    rows = slice(int(start * len(table)), int((start + length) * len(table)))
    table.loc[table.index[rows], _some(table, rng)] = np.nan
    return table


def scattered(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    for name in _some(table, rng):
        table.loc[rng.random(len(table)) < rng.uniform(0.05, 0.9), name] = np.nan
    return table


def slow(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    every, first = int(rng.integers(2, 21)), int(rng.integers(0, 5))
    table.loc[(np.arange(len(table)) % every) != first % every, _some(table, rng)] = np.nan
    return table


def held(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Not a reference: its steps would be late, which nothing could show."""
    names, every = _some(table, rng, "reference"), int(rng.integers(2, 21))
    table[names] = table[names].to_numpy()[np.arange(len(table)) // every * every]
    return table


def standing(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    start = int(rng.choice([0, 0.3, 0.7]) * len(table))
    for name in _some(table, rng):
        table.loc[table.index[start:], name] = table[name].iloc[start]
    return table


def rounded(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    """Not a reference: another load would be stated."""
    for name in _some(table, rng, "reference"):
        table[name] = table[name].round(int(rng.integers(0, 4)))
    return table


def uneven(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    return table[rng.random(len(table)) < rng.uniform(0.3, 0.98)].reset_index(drop=True)


def jittered(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    step = float(np.median(np.diff(table["time_s"])))
    return table.assign(time_s=table["time_s"] + rng.uniform(0, rng.choice([0.1, 0.5, 0.9]) * step, len(table)))


def thinned(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    return table.iloc[:: int(rng.integers(2, 26))].reset_index(drop=True)


def short(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    return table.iloc[: int(rng.integers(2, max(3, len(table) // 2)))].reset_index(drop=True)


def later(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    return table.assign(time_s=table["time_s"] + rng.choice([0.27, 12.34, 1.7e9]))


def without(table: pd.DataFrame, rng: np.random.Generator) -> pd.DataFrame:
    return table.drop(columns=_some(table, rng))


CHANGES: tuple[Change, ...] = (
    thinned, short, uneven, jittered, later, held, hole, scattered, slow, standing, rounded, without,
)  # fmt: skip
"""In the order in which they are made: what was held and is thinned then is late by as much as nobody knows."""


def stand(seed: int, kind: str) -> RecordingSet:
    """Steps of four rotors on a six-axis sensor, or of a known load on a bench."""
    rng, thesis, runs = np.random.default_rng(seed), templates.read("thesis"), []
    rate, seconds = float(rng.choice([10.0, 50.0, 100.0])), float(rng.choice([6.0, 15.0]))
    time_s = np.arange(0.0, seconds, 1.0 / rate)
    for number in range(int(rng.integers(1, 4))):
        steps = rng.uniform(0.0, 1.0, (8, 4))[np.minimum((time_s / seconds * 8).astype(int), 7)]
        speed, table = 600.0 + 900.0 * steps, {"time_s": time_s}
        if kind == "stand":
            thrust = thesis.thrust_coefficients_n_s2() * speed**2
            counted = speed + rng.standard_normal(speed.shape)
            table |= {f"rotor_speed_{i + 1}_rad_s": counted[:, i] for i in range(4)}
            places, torque = thesis.rotor_positions_m(), thesis.torque_coefficients_n_m_s2() * speed**2
            read = {
                "force_z_n": -thrust.sum(axis=1),
                "moment_x_n_m": -thrust @ places[:, 1],
                "moment_y_n_m": thrust @ places[:, 0],
                "moment_z_n_m": torque @ thesis.yaw_signs(),
            }
        else:
            table |= {f"reference_force_{a}_n": 5.0 * steps[:, k] for k, a in enumerate("xz")}
            read = {f"force_{a}_n": 5.0 * steps[:, k] for k, a in enumerate("xz")}
        noisy = {n: v + 0.01 * (0.1 if "moment" in n else 1.0) * rng.standard_normal(len(v)) for n, v in read.items()}
        runs.append(Run(f"r{number}", pd.DataFrame(table | noisy)))
    if kind == "bench":
        return RecordingSet("bench", Vehicle(name="bench", kind="bench", tared=True), tuple(runs))
    believed = thesis.model_copy(update={"kind": "stand", "tared": True})
    return RecordingSet("stand", believed, tuple(runs))


def varied(seed: int) -> tuple[RecordingSet, RecordingSet, str]:
    """A set, the same with up to three changes of each run, and what these were."""
    rng = np.random.default_rng([seed, 7])
    kind = ("bench", "stand", "flight")[seed % 3]
    if kind == "flight":
        made = swings(templates.read("thesis"), "flight", float(rng.choice([4.0, 7.0, 11.0])), 2, seed)
    else:
        made = stand(seed, kind)
    chosen = [CHANGES[k] for k in sorted(rng.choice(len(CHANGES), int(rng.integers(1, 4)), replace=False))]
    runs = []
    for run in made.runs:
        table = run.table.copy()
        for change in chosen if rng.random() < 0.8 else ():
            if len(table) > 1 and len(table.columns) > 1:
                table = change(table, rng)
        runs.append((run.name, table))
    said = f"seed {seed}: {kind}, {', '.join(change.__name__ for change in chosen)}"
    return made, RecordingSet(kind, made.vehicle, tuple(Run(name, table) for name, table in runs)), said
