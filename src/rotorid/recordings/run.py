"""A run (one recording), a recording set (one vehicle with its runs), and what is doubtful in a set."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import pandas as pd

from rotorid.recordings import columns as c
from rotorid.recordings.vehicle import Vehicle


def stretches(mask: np.ndarray) -> list[tuple[int, int]]:
    """Start and stop (exclusive) of every run of True in a mask (n,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], np.asarray(mask, np.int8), [0]])))
    return list(zip(edges[::2], edges[1::2], strict=True))


def means_of(values: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Means (m, …) of the rows `first` to `last` (exclusive, (m,)) of values (n, …); 0 where there is none."""
    total = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values, axis=0)])
    count = np.maximum(last - first, 1).reshape(-1, *[1] * (values.ndim - 1))
    return (total[last] - total[first]) / count


@dataclass(frozen=True)
class Doubt:
    """One thing in a set that is probably not as stated."""

    what: str
    """Key of vehicle.yaml (`mass_kg`), column (`angular_velocity_x_rad_s`), file or run that is in doubt."""
    sentence: str
    """What was found, what was expected and, where one is known, what would explain it."""
    stops: bool = False
    """Whether a verdict would be about this mistake: a unit, an axis, an order, or mass or inertia by more than a
    factor of two."""

    def __str__(self) -> str:
        return self.sentence


@dataclass(frozen=True)
class Run:
    """One recording: a name and a table of float columns in the contract's names and units.

    `table` has `time_s` strictly increasing; empty cells are NaN. Treat it as read-only.
    """

    name: str
    table: pd.DataFrame
    path: str = ""
    """File that it was read from, for messages; empty where there is none."""
    joined_hz: Mapping[str, float] = field(default_factory=dict, compare=False)
    """Columns that came evenly and seldom and are joined by a curve of their band, each with its own rate."""

    @cached_property
    def time_s(self) -> np.ndarray:
        """Time stamps, shape (n,), s."""
        return self.table[c.TIME].to_numpy(float)

    @cached_property
    def _with_values(self) -> frozenset[str]:
        """Columns that hold at least one value; asked for so often that pandas would be a tenth of a short analysis."""
        return frozenset(self.table.columns[self.table.notna().any()])

    @cached_property
    def _arrays(self) -> dict[str, np.ndarray]:
        """Columns that were asked for: of hundreds of short runs pandas would be a sixth of the analysis."""
        return {}

    def has(self, *names: str) -> bool:
        """Whether every named column is there with at least one value."""
        return self._with_values.issuperset(names)

    def array(self, names: tuple[str, ...]) -> np.ndarray:
        """Named columns as an array, shape (n, len(names)); NaN where missing."""
        return np.array([self.column(name) for name in names]).reshape(len(names), len(self.table)).T

    def column(self, name: str) -> np.ndarray:
        """One column, shape (n,); NaN where missing."""
        if name not in self._arrays:
            if name not in self.table.columns:
                return np.full(len(self.table), np.nan)
            self._arrays[name] = self.table[name].to_numpy(float)
        return self._arrays[name].copy()

    def complete(self, names: Sequence[str]) -> np.ndarray:
        """Rows in which every named column has a value, shape (n,)."""
        return np.isfinite(self.array(tuple(names))).all(axis=1)

    def holding(self, columns: Mapping[str, np.ndarray | pd.Series]) -> Run:
        """The run with these columns, in place of its own of the same names; itself for none."""
        return replace(self, table=self.table.assign(**columns)) if columns else self

    @property
    def where(self) -> str:
        """The run's file, or its name where it was never one, for messages."""
        return self.path or f"run {self.name}"

    @property
    def unknown_columns(self) -> tuple[str, ...]:
        """Columns without a meaning in the contract, kept as candidate regime variables."""
        return tuple(n for n in self.table.columns if not c.is_known(n))


@dataclass(frozen=True)
class Split:
    """Names of the runs to fit and of the runs held out."""

    training: tuple[str, ...]
    held_out: tuple[str, ...]
    border_s: float | None = field(default=None, compare=False)
    """Of a single run, named on both sides: time at which the fitted part ends and the held-out part begins."""


@dataclass(frozen=True)
class RecordingSet:
    """One vehicle (or stand, or bench) with its runs in the order of time (of their names)."""

    name: str
    vehicle: Vehicle
    runs: tuple[Run, ...]
    held_out: tuple[str, ...] | None = None
    """Runs that `split.yaml` holds out; None where there is no such file."""
    path: str = ""
    """Folder that it was read from, for messages; empty where there is none."""
    left_out: tuple[str, ...] = ()
    """One sentence for each run that could not be used."""
    proposed: tuple[Doubt, ...] = ()
    """Values of the vehicle that nobody measured."""

    @property
    def where(self) -> str:
        """The set's folder, or its name where it was never one, for messages."""
        return self.path or self.name

    def without(self, names: Collection[str]) -> RecordingSet:
        """The set without these columns in any run."""
        tables = (run.table.drop(columns=[n for n in names if n in run.table]) for run in self.runs)
        return replace(self, runs=tuple(replace(r, table=t) for r, t in zip(self.runs, tables, strict=True)))

    def mended(self, runs: Iterable[Run], said: Iterable[str]) -> RecordingSet:
        """The set with these runs in place of its own, and with sentences on what was done to them."""
        return replace(self, runs=tuple(runs), left_out=(*self.left_out, *said))

    def run(self, name: str) -> Run:
        """The run of that name; KeyError if there is none."""
        return {run.name: run for run in self.runs}[name]
