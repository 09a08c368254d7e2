"""Faults of a recording: what an importer finds wrong in a file, what it does about it, and the report of both.

Repairs that every importer needs stand here: repeated clock values, held samples, the part of a log in the air.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.recordings.columns import TIME
from rotorid.recordings.run import stretches

GOES_ON = 0.9
"""Share of the readings of others of its kind that a sensor has at least, if it neither stands still nor ends early."""
_REVERSED = 0.02
"""Share of the largest value that a value of the other sign must exceed to be one: less is noise about zero."""
_SHUFFLED, _LATE_STEPS = 0.05, 100.0
"""Share of steps back from which rows are in no order, and how many usual steps late a row in order may come."""
_UNEXPLAINED = 0.2
"""Share of its variance that the motors of a mixer may leave of another motor's signal."""


@dataclass(frozen=True)
class ImportFault:
    """One fault of a recording: its kind and column, what was seen and done, how many samples it touches."""

    kind: str
    column: str
    found: str
    action: str
    samples: int = 0
    run: str = ""

    def in_run(self, run: str) -> ImportFault:
        return replace(self, run=run)

    @property
    def sentence(self) -> str:
        place = ", ".join(part for part in (self.run, self.column) if part)
        return f"{place + ': ' if place else ''}{self.found}; {self.action}."


FILE_NAME = "import_report.json"


@dataclass(frozen=True)
class ImportReport:
    """Where a contract set comes from and every fault met on the way; or why it is not there."""

    set: str
    available: bool
    source: str
    licence: str
    citation: str
    reason: str = ""
    files: dict[str, str] = field(default_factory=dict)
    """SHA-256 of each file read."""
    axes: str = ""
    faults: tuple[ImportFault, ...] = ()
    notes: tuple[str, ...] = ()

    def after(self, earlier: dict) -> ImportReport:
        """The report of a set that holds what was imported now and, as its earlier report says, before."""
        faults = tuple(
            ImportFault(**{f.name: fault[f.name] for f in fields(ImportFault)}) for fault in earlier["faults"]
        )
        files = {**earlier["files"], **self.files}
        return replace(
            self,
            source=", ".join(files),
            files=files,
            faults=tuple(dict.fromkeys((*faults, *self.faults))),
            notes=tuple(dict.fromkeys((*earlier["notes"], *self.notes))),
        )

    def write(self, folder: Path) -> Path:
        """Write `import_report.json` into a set's folder, the same bytes for the same content."""
        content = asdict(self)
        for entry, fault in zip(content["faults"], self.faults, strict=True):
            entry["sentence"] = fault.sentence
        path = Path(folder) / FILE_NAME
        path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        return path


def read_report(folder: Path) -> dict:
    """The import report of a set's folder."""
    return json.loads((Path(folder) / FILE_NAME).read_text(encoding="utf-8"))


def drop_repeated_times(table: pd.DataFrame) -> tuple[pd.DataFrame, list[ImportFault]]:
    """Rows whose time is not later than every row before are left out and reported."""
    time = table[TIME].to_numpy(float)
    latest = np.maximum.accumulate(np.where(np.isnan(time), -np.inf, time))
    keep = ~np.isnan(time) & (np.concatenate([[-np.inf], latest[:-1]]) < time)
    if keep.all():
        return table, []
    found = f"{(~keep).sum()} rows do not move the clock on (first at {time[~keep][0]:.6g} s)"
    return table[keep].reset_index(drop=True), fault_where(~keep, "repeated_time", TIME, found, "left out")


def in_order(table: pd.DataFrame, time: str) -> tuple[pd.DataFrame, list[ImportFault]]:
    """Rows that come late sorted by their time, and a fault; a clock that begins anew stays as it is.

    `time` names the clock's column, in any unit.
    """
    clock = table[time].to_numpy(float)
    steps = np.diff(clock)
    back = steps < 0
    if not back.any():
        return table, []
    known = np.unique(clock[np.isfinite(clock)])
    latest = min(_LATE_STEPS * float(np.median(np.diff(known))), 0.5 * np.ptp(known))
    if back.mean() < _SHUFFLED and (steps < -latest).any():
        return table, []
    found = f"{int(back.sum())} rows come later than their time"
    sorted_ = table.sort_values(time, kind="stable", ignore_index=True)
    sorted_.attrs = table.attrs
    return sorted_, [ImportFault("order", TIME, found, "sorted by their time", int(back.sum()))]


def join_rows(table: pd.DataFrame, time: str) -> pd.DataFrame:
    """Rows of one instant as one row where each holds cells that the others lack: messages that have a row each.

    `time` names the clock's column. Rows of one instant that hold the same cells stay as they are.
    """
    clock = table[time].to_numpy(float)
    group = np.cumsum(np.diff(clock, prepend=np.nan) != 0)
    if len(table) < 2 or group[-1] == len(table):
        return table
    given = table.drop(columns=time).notna()
    alone = (given.groupby(group).sum().max(axis=1) <= 1).to_numpy()[group - 1]
    group = np.where(alone, group, -np.arange(1, len(table) + 1))
    joined = table.groupby(pd.factorize(group)[0]).first()
    joined.attrs = table.attrs
    return joined.reset_index(drop=True)


def one_sense(
    values: np.ndarray, names: Sequence[str], sense: float | None = None
) -> tuple[np.ndarray, list[ImportFault]]:
    """Magnitudes of signed speeds or commands (n, k) and a fault for each column that is reversed for a time.

    A sign is a turning sense where a rotor keeps it. A cell against the usual sense of its column, or against `sense`
    where it is given, is a rotor that pushes the other way, for which the contract has no column: it becomes empty.
    """
    values = np.asarray(values, float)
    signs = np.sign(np.nansum(np.sign(values), axis=0)) if sense is None else np.full(values.shape[1], sense)
    own = values * np.where(signs == 0, 1.0, signs)
    largest = np.nanmax(np.abs(own), axis=0, initial=0.0, where=np.isfinite(own))
    against = own < -_REVERSED * largest
    faults = []
    for name, lost in zip(names, against.T, strict=True):
        found = f"against its usual sign in {lost.mean():.1%} of the samples"
        faults += fault_where(lost, "reversed", name, found, "made empty cells")
    return np.where(against, np.nan, np.abs(own) if sense is None else np.clip(own, 0, None)), faults


def further_motors(outputs: np.ndarray, motors: int) -> list[int]:
    """Columns of outputs (n, k) beyond the first `motors` that are motors, too.

    A mixer makes the signals of all motors from four demands, so that four of them say the others; a gimbal or a switch
    they do not say.
    """
    known = outputs[np.isfinite(outputs).all(axis=1)]
    if len(known) < 10 * (motors + 1):
        return []
    basis = np.column_stack([known[:, :motors], np.ones(len(known))])
    rest = known[:, motors:] - basis @ np.linalg.lstsq(basis, known[:, motors:], rcond=None)[0]
    moves, left = known[:, motors:].var(axis=0), rest.var(axis=0)
    return [motors + k for k in range(len(moves)) if moves[k] > 0 and left[k] < _UNEXPLAINED * moves[k]]


def report_gaps(table: pd.DataFrame, factor: float = 3.0) -> list[ImportFault]:
    """A fault where the clock steps by more than `factor` times its median step; nothing is filled in."""
    steps = np.diff(table[TIME].to_numpy(float))
    long = steps > factor * np.median(steps)
    found = f"{int(long.sum())} gaps longer than {factor:g} samples, the longest {steps.max(initial=0.0):.3g} s"
    return fault_where(long, "gap", TIME, found, "left as a gap")


def blank_held(
    table: pd.DataFrame, groups: dict[str, list[str]], share: float = 0.1
) -> tuple[pd.DataFrame, list[ImportFault]]:
    """Empty the repeats of sample-and-hold groups of columns.

    A logger that runs faster than a sensor writes the last reading again and again. Where more than `share`
    of the rows repeat every column of a group, those repeats are not measurements: they become empty cells,
    which the contract calls missing samples. Rows that hold nothing but the time then go.
    """
    table, faults = table.copy(), []
    for name, columns in groups.items():
        columns = [c for c in columns if c in table.columns]
        if not columns:
            continue
        values = table[columns].to_numpy(float)
        same = np.zeros(len(table), bool)
        same[1:] = (values[1:] == values[:-1]).all(axis=1)
        if same.mean() <= share:
            continue
        table.loc[same, columns] = np.nan
        rate = (~same).sum() / (table[TIME].iloc[-1] - table[TIME].iloc[0])
        found = f"{name} repeats its last value in {same.mean():.0%} of the rows (new values at {rate:.3g} Hz)"
        faults.append(ImportFault("held", ", ".join(columns), found, "repeats made empty cells", int(same.sum())))
    empty = table.drop(columns=TIME).isna().all(axis=1)
    return table[~empty].reset_index(drop=True), faults


def true_stretches(mask: np.ndarray, time_s: np.ndarray, shortest_s: float) -> list[tuple[float, float]]:
    """Start and stop times of every stretch of True that lasts at least `shortest_s`."""
    ends = ((float(time_s[start]), float(time_s[stop - 1])) for start, stop in stretches(mask))
    return [(start_s, stop_s) for start_s, stop_s in ends if stop_s - start_s >= shortest_s]


def fault_where(mask: np.ndarray, kind: str, column: str, found: str, action: str) -> list[ImportFault]:
    """A fault of the samples that a mask (n,) or (n, k) holds, for a row once; none where it holds none."""
    rows = np.asarray(mask).reshape(len(mask), -1).any(axis=1)
    return [ImportFault(kind, column, found, action, int(rows.sum()))] if rows.any() else []


def cut(table: pd.DataFrame, start_s: float, stop_s: float) -> pd.DataFrame:
    """Rows from start to stop, the clock set to zero at the first of them."""
    time = table[TIME]
    part = table[(time >= start_s) & (time <= stop_s)].reset_index(drop=True)
    return part.assign(**{TIME: part[TIME] - part[TIME].min()})
