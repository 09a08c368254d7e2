"""Changes of a recording set that leave what it says of the vehicle as it was.

Each change takes a set and the names of the runs held out of it, and gives the changed set with what turns a verdict on
it back into one on the set itself.
"""

import gzip
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.recordings import RecordingSet, Run, read_set, write_set
from rotorid.recordings import columns as c

SHIFT_S = 86_400.125
TURN_RAD = np.radians(50.0)


@dataclass(frozen=True)
class Changed:
    """A changed set and the way back: what its runs were called, which rotor was which, how the world was turned."""

    recordings: RecordingSet
    runs: Mapping[str, str] = field(default_factory=dict)
    """To the name of a run the one it had."""
    rotors: Mapping[int, int] = field(default_factory=dict)
    """To the number of a rotor the one it had, from 1."""
    turn_rad: float = 0.0
    """About the vertical, from north to east."""


Change = Callable[[RecordingSet, tuple[str, ...]], Changed | None]
"""None where a set has not what the change needs."""


def _each(recordings: RecordingSet, change: Callable[[pd.DataFrame], pd.DataFrame]) -> RecordingSet:
    runs = (replace(run, table=change(run.table).reset_index(drop=True)) for run in recordings.runs)
    return replace(recordings, runs=tuple(runs))


def _called(recordings: RecordingSet, names: Mapping[str, str], held_out: tuple[str, ...] | None) -> Changed:
    """The set with runs called anew; the set's order is that of the names."""
    runs = sorted((replace(run, name=names[run.name]) for run in recordings.runs), key=lambda run: run.name)
    held = None if held_out is None else tuple(names[name] for name in held_out)
    return Changed(
        replace(recordings, name="another", runs=tuple(runs), held_out=held), {new: old for old, new in names.items()}
    )


def renamed(recordings: RecordingSet, held_out: tuple[str, ...]) -> Changed:
    """Other names of the set, the vehicle and the runs, in the same order."""
    names = {run.name: f"flight {k:03d} µ" for k, run in enumerate(recordings.runs, 7)}
    changed = _called(recordings, names, recordings.held_out)
    vehicle = recordings.vehicle.model_copy(update={"name": "Überflieger"})
    return replace(changed, recordings=replace(changed.recordings, vehicle=vehicle))


def reordered(recordings: RecordingSet, held_out: tuple[str, ...]) -> Changed | None:
    """Names that turn the order of the runs round; the same ones held out. Of flights: what instruments do between
    runs (creep, drift) has an order in time."""
    if len(recordings.runs) < 2 or recordings.vehicle.kind != "flight":
        return None
    names = {run.name: f"{90 - k:02d}" for k, run in enumerate(recordings.runs)}
    return _called(recordings, names, held_out)


def shifted(recordings: RecordingSet, held_out: tuple[str, ...]) -> Changed:
    """Another zero of the clock."""
    return Changed(_each(recordings, lambda t: t.assign(time_s=t[c.TIME] + SHIFT_S)))


def turned(recordings: RecordingSet, held_out: tuple[str, ...]) -> Changed | None:
    """A world turned about the vertical: what was north is elsewhere."""
    world = [names for names in (c.POSITION, c.VELOCITY) if recordings.runs[0].has(*names)]
    if recordings.vehicle.kind != "flight" or not recordings.runs[0].has(*c.QUATERNION):
        return None
    cos, sin = np.cos(TURN_RAD), np.sin(TURN_RAD)
    half_cos, half_sin = np.cos(TURN_RAD / 2), np.sin(TURN_RAD / 2)

    def turn(table: pd.DataFrame) -> pd.DataFrame:
        new = {}
        for x, y, _ in world:
            new |= {x: cos * table[x] - sin * table[y], y: sin * table[x] + cos * table[y]}
        w, i, j, k = (table[name] for name in c.QUATERNION)
        new |= dict(
            zip(
                c.QUATERNION,
                (
                    half_cos * w - half_sin * k,
                    half_cos * i - half_sin * j,
                    half_cos * j + half_sin * i,
                    half_cos * k + half_sin * w,
                ),
                strict=True,
            )
        )
        return table.assign(**new)

    return Changed(_each(recordings, turn), turn_rad=float(TURN_RAD))


def renumbered(recordings: RecordingSet, held_out: tuple[str, ...]) -> Changed | None:
    """Rotors in another order, in the vehicle and in the columns alike."""
    vehicle, count = recordings.vehicle, recordings.vehicle.rotor_count
    if count < 2:
        return None
    old_of = {new: (new % count) + 1 for new in range(1, count + 1)}
    new_of = {old: new for new, old in old_of.items()}

    def per_rotor(value):
        return tuple(value[old_of[k] - 1] for k in range(1, count + 1)) if isinstance(value, tuple) else value

    update = {
        "rotors": tuple(vehicle.rotors[old_of[k] - 1] for k in range(1, count + 1)),
        "thrust_coefficient_n_s2": per_rotor(vehicle.thrust_coefficient_n_s2),
        "torque_coefficient_n_m_s2": per_rotor(vehicle.torque_coefficient_n_m_s2),
    }

    def rename(table: pd.DataFrame) -> pd.DataFrame:
        names = {}
        for name in table.columns:
            kind = c.rotor_number(str(name))
            if kind is not None:
                names[name] = c.rotor_columns(kind[0], count)[new_of[kind[1]] - 1]
        return table.rename(columns=names)

    changed = replace(_each(recordings, rename), vehicle=vehicle.model_copy(update=update))
    return Changed(changed, rotors=old_of)


def columns_reordered(recordings: RecordingSet, held_out: tuple[str, ...]) -> Changed:
    """Columns from last to first."""
    return Changed(_each(recordings, lambda t: t[list(t.columns)[::-1]]))


def _as_files(recordings: RecordingSet, suffix: str, digits: int | None = None) -> Changed:
    with tempfile.TemporaryDirectory() as place:
        folder = write_set(recordings, Path(place), suffix)
        for run in recordings.runs:
            if digits is None:
                continue
            path = folder / f"{run.name}{suffix}"
            content = run.table.to_csv(index=False, float_format=f"%.{digits}g").encode()
            path.write_bytes(gzip.compress(content) if suffix.endswith(".gz") else content)
        return Changed(replace(read_set(folder), name=recordings.name, held_out=recordings.held_out))


def as_parquet(recordings: RecordingSet, held_out: tuple[str, ...]) -> Changed:
    """Written as Parquet and read back."""
    return _as_files(recordings, ".parquet")


def as_gzip(recordings: RecordingSet, held_out: tuple[str, ...]) -> Changed:
    """Written as gzipped CSV and read back."""
    return _as_files(recordings, ".csv.gz")


def seven_digits(recordings: RecordingSet, held_out: tuple[str, ...]) -> Changed:
    """Seven digits of every number."""
    return _as_files(recordings, ".csv", 7)


def column_added(recordings: RecordingSet, held_out: tuple[str, ...]) -> Changed:
    """A column that has nothing to do with the flight: noise that wanders."""
    rng = np.random.default_rng(20)

    def add(table: pd.DataFrame) -> pd.DataFrame:
        return table.assign(humidity_percent=50 + np.cumsum(0.05 * rng.standard_normal(len(table))))

    return Changed(_each(recordings, add))


def cut_in_two(recordings: RecordingSet, held_out: tuple[str, ...]) -> Changed | None:
    """The longest run that is fitted cut into two runs, the second's clock from zero; the same runs held out."""
    fitted = [run for run in recordings.runs if run.name not in held_out]
    if len(recordings.runs) < 2 or not fitted:
        return None
    longest = max(fitted, key=lambda run: run.time_s[-1] - run.time_s[0])
    middle = len(longest.table) // 2
    second = longest.table.iloc[middle:].reset_index(drop=True)
    pieces = {
        "a": longest.table.iloc[:middle].reset_index(drop=True),
        "b": second.assign(time_s=second[c.TIME] - second[c.TIME].iloc[0]),
    }
    runs = [run for run in recordings.runs if run.name != longest.name]
    runs += [Run(longest.name + letter, table, longest.path) for letter, table in pieces.items()]
    runs.sort(key=lambda run: run.name)
    return Changed(
        replace(recordings, runs=tuple(runs), held_out=held_out),
        {longest.name + letter: longest.name for letter in pieces},
    )


def half_the_rate(recordings: RecordingSet, held_out: tuple[str, ...]) -> Changed:
    """Every second sample."""
    return Changed(_each(recordings, lambda t: t.iloc[::2]))


CHANGES: dict[str, Change] = {
    change.__name__: change
    for change in (
        renamed,
        reordered,
        shifted,
        turned,
        renumbered,
        columns_reordered,
        as_parquet,
        as_gzip,
        seven_digits,
        column_added,
        cut_in_two,
        half_the_rate,
    )
}
LESS_IS_KNOWN = ("half_the_rate",)
"""Changes that leave samples out: intervals grow by the noise, and values move within them."""
