"""What the importers share: faults of a recording and the report of them, repairs, and the part of a log in the air.

Each message has its own clock; a run is laid out on the times of the inertial sensor and each other value stands in the
row nearest in time, so that nothing is interpolated.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.io.text.files import LARGEST_METADATA, read_text
from rotorid.recordings import columns as c
from rotorid.recordings.importers.endings import ending
from rotorid.recordings.mended import by_sense
from rotorid.recordings.run import stretches

_SHORTEST_FLIGHT_S = 4.0
_AFTER_TAKE_OFF_S = 1.0
_BEFORE_LANDING_S = 0.5
_LONGEST_PAUSE_S = 1.0
"""A dip of the throttle shorter than this does not end a flight."""
_DRIVEN = 0.05
"""Mean throttle below which nothing flies."""
_NEAR_WEIGHT = 0.85
"""Share of the throttle of flight below which the rotors do not carry the weight."""
_LIFTS = 0.95
"""Share of the throttle of flight that a stretch begins and ends with: less is spool-up or a vehicle that settles."""
_SMOOTHED_S = 1.0
GOES_ON = 0.9
"""Share of the time that others of its kind go on which a sensor has at least, unless it stands still or ends early."""
_SHUFFLED, LATE_STEPS = 0.05, 100.0
"""Share of steps back from which rows are in no order, and how many usual steps late a row in order may come."""
_TURNS = {
    scale * length: length not in (2.0**16, 2.0**24, 2.0**31, 2.0**32)
    for length in (3600.0, 43200.0, 86400.0, 604800.0, 2.0**16, 2.0**24, 2.0**31, 2.0**32)
    for scale in (1.0, 1e-9, 1e-6, 1e-3, 1e3, 1e6, 1e9)
}
"""After how much of its units a clock may begin anew: an hour, half a day, a day, a week, counters of 16 to 32 bits;
and whether it is a time of day or of the week, which never is below 0."""
_FEW_STEPS = 5.0
"""Usual steps back, and rows after them, below which no clock was set."""
_AROUND_RESET_S = 0.2
_OUTSIDE = 0.01
"""Share of the range by which a throttle may lie outside of it unnoticed."""


_WILD = 1e9
"""No quantity of a vehicle in SI units is larger."""
SET_BACK = "clock_set_back"
ENDING = "ending"


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


def cut_off(found: str, samples: int = 0) -> ImportFault:
    """The fault of a log that ends early."""
    return ImportFault("cut_off", "", found, "what came before is kept; the log stopped before its end", samples)


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

    def after(self, folder: Path) -> ImportReport:
        """The report of a set that holds what was imported now and, as the report in its folder says, before.

        InputError where that is no report.
        """
        path = folder / FILE_NAME
        if not path.exists():
            return self
        try:
            earlier = json.loads(read_text(path, LARGEST_METADATA))
            faults = [ImportFault(**{f.name: own[f.name] for f in fields(ImportFault)}) for own in earlier["faults"]]
            files = {**earlier["files"], **self.files}
            return replace(
                self,
                source=", ".join(files),
                files=files,
                faults=tuple(dict.fromkeys((*faults, *self.faults))),
                notes=tuple(dict.fromkeys((*earlier["notes"], *self.notes))),
            )
        except InputError:
            raise
        except (ValueError, KeyError, TypeError):
            raise InputError(f"{path}: is no report of an import; move it away") from None

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


def endings_of(folder: Path) -> tuple[str, ...]:
    """What the import saw in the last seconds of a set's flights; empty where there is no report of it."""
    try:
        return tuple(str(fault["sentence"]) for fault in read_report(folder)["faults"] if fault["kind"] == ENDING)
    except (OSError, ValueError, KeyError, TypeError):
        return ()


def drop_repeated_times(table: pd.DataFrame) -> tuple[pd.DataFrame, list[ImportFault]]:
    """The table without the rows that `moving_on` leaves out, and what these were."""
    keep, faults = moving_on(table[c.TIME].to_numpy(float))
    return (table if keep.all() else table[keep].reset_index(drop=True)), faults


def moving_on(time_s: np.ndarray) -> tuple[np.ndarray, list[ImportFault]]:
    """Instants (n,), s, that are of the recording and later than every one before: their mask, and what is left out.

    A few rows behind or before a leap of the clock are of no flight: what stood in a buffer, a first line of zeros, the
    end of another log.
    """
    # A clock leaps where it goes on by more than so many seconds and usual steps, or back by so many seconds.
    leap_s, leap_steps = 0.5, 20.0
    # Rows between leaps are apart where they last less and are a smaller share of the longest part.
    few_s, few_rows = 0.3, 0.02
    known = np.flatnonzero(np.isfinite(time_s))
    time, keep = time_s[known], np.zeros(len(time_s), bool)
    if not len(time):
        return keep, []
    steps = np.diff(time)
    usual = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    leaps = np.flatnonzero((steps > max(leap_s, leap_steps * usual)) | (steps < -leap_s))
    parts = np.split(np.arange(len(time)), leaps + 1)
    long = max(map(len, parts))
    apart = [p for p in parts if len(p) <= few_rows * long and np.ptp(time[p]) < few_s] if len(leaps) else []
    alone = np.concatenate([np.zeros(0, int), *apart])
    stays = np.delete(np.arange(len(time)), alone)
    latest = np.maximum.accumulate(time[stays])
    keep[known[stays[np.concatenate([[True], time[stays][1:] > latest[:-1]])]]] = True
    lone = np.zeros(len(time_s), bool)
    lone[known[alone]] = True
    late = ~keep & ~lone
    faults = []
    if lone.any():
        where = "first of all" if lone[known[0]] else f"at {time_s[lone][0]:.6g} s"
        found = f"{lone.sum()} samples ({where}) are apart from all others by a leap of the clock: not of this flight"
        faults = fault_where(lone, "apart", c.TIME, found, "left out")
    found = f"{late.sum()} rows do not move the clock on" + (
        f" (first at {time_s[late][0]:.6g} s)" if late.any() else ""
    )
    return keep, faults + fault_where(late, "repeated_time", c.TIME, found, "left out")


def in_order(table: pd.DataFrame, time: str) -> tuple[pd.DataFrame, list[ImportFault]]:
    """Rows that come late sorted by their time, those after a clock that was set back moved on, and the faults.

    `time` names the clock's column, in any unit.
    """
    clock, faults = _unwrapped(table[time].to_numpy(float))
    if faults:
        attrs, table = table.attrs, table.assign(**{time: clock})
        table.attrs = attrs
    steps = np.diff(clock)
    back = steps < 0
    if not back.any():
        return table, faults
    usual = float(np.median(np.diff(np.unique(clock[np.isfinite(clock)]))))
    anew = (
        [] if back.mean() >= _SHUFFLED else [int(k) for k in np.flatnonzero(back) if _set_back(table, clock, k, usual)]
    )
    for row in anew:
        by = clock[row] - clock[row + 1]
        clock = np.append(clock[: row + 1], clock[row + 1 :] + by + LATE_STEPS * usual)
        found = f"the clock is set back by {by:.4g} of its units after row {row + 1}"
        faults.append(
            ImportFault(SET_BACK, c.TIME, found, "the rows after it follow after a gap", len(clock) - row - 1)
        )
    late = np.diff(clock) < 0
    ordered = table.assign(**{time: clock})
    if late.any():
        ordered = ordered.sort_values(time, kind="stable", ignore_index=True)
        found = f"{int(late.sum())} rows come later than their time"
        faults.append(ImportFault("order", c.TIME, found, "sorted by their time", int(late.sum())))
    ordered.attrs = table.attrs
    return ordered, faults


def _unwrapped(clock: np.ndarray) -> tuple[np.ndarray, list[ImportFault]]:
    """A clock (n,) that begins anew where its counter or its day ends goes on, and a fault where it does.

    It then has been through the whole of its range.
    """
    known = np.flatnonzero(np.isfinite(clock))
    steps, span = np.diff(clock[known]), np.ptp(clock[known]) if len(known) else 0.0
    if not (steps > 0).any():
        return clock, []
    usual = float(np.median(steps[steps > 0]))
    low, high = np.nanmin(clock), np.nanmax(clock)
    turn = next(
        (
            t
            for t, of_day in sorted(_TURNS.items())
            if 0.8 * t <= span <= t and t > 20 * usual and (not of_day or 0 <= low <= high <= t)
        ),
        None,
    )
    anew = np.flatnonzero((steps < 0) & (steps + (turn or 0.0) >= 0) & (steps + (turn or 0.0) <= _FEW_STEPS * usual))
    if turn is None or not len(anew):
        return clock, []
    out = clock.copy()
    for k in anew:
        out[known[k + 1] :] += turn
    found = f"the clock begins anew {len(anew)} times, after {turn:.10g} of its units"
    return out, [ImportFault("clock_turn", c.TIME, found, "goes on", len(anew))]


def _set_back(table: pd.DataFrame, clock: np.ndarray, row: int, usual: float) -> bool:
    """Whether a clock that steps back after a row was set: from there it goes on step by step, past where it had been.

    Stamps that jitter step back by less than a few steps; rows that only come late end with a jump ahead; rows that are
    sent twice are the same.
    """
    by = clock[row] - clock[row + 1]
    past = np.flatnonzero(clock[row + 1 :] > clock[row])
    stop = row + 1 + past[0] if len(past) else len(clock)
    ahead = clock[stop] - clock[stop - 1] if len(past) else 0.0
    count = stop - row - 1
    if min(by / usual, count) < _FEW_STEPS or ahead > 0.5 * by + usual:
        return False
    if count * usual < 0.5 * min(by, clock[stop - 1] - clock[row + 1]):
        return False
    again = table.iloc[row + 1 : stop].reset_index(drop=True)
    earlier = table.iloc[: row + 1].drop_duplicates()
    return len(again.merge(earlier, how="inner")) < 0.5 * len(again)


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
    """Sizes of signed speeds or commands (n, k) as `by_sense` has them, and a fault for each rotor that is reversed."""
    sizes, against = by_sense(values, sense)
    faults = []
    for name, lost in zip(names, against.T, strict=True):
        found = f"the rotor turns backwards (against its usual sign) in {lost.mean():.1%} of the samples"
        faults += fault_where(lost, "reversed", name, found, "made empty cells")
    return sizes, faults


def stops(values: np.ndarray, names: Sequence[str], how: str) -> tuple[np.ndarray, list[ImportFault]]:
    """Throttles (n, k) with 0 where a log says, by no number in a column that has some, that a motor is stopped.

    `how` the log says so, in words; a fault for each motor that is stopped while others turn.
    """
    given, faults = np.isfinite(values), []
    stopped = ~given & given.any(axis=0)
    for name, own in zip(names, (stopped & given.any(axis=1)[:, None]).T, strict=True):
        found = f"the motor is stopped ({how}) in {own.mean():.0%} of the messages while others turn"
        faults += fault_where(own, "stopped", name, found, "read as 0")
    return np.where(stopped, 0.0, values), faults


def jumps_at(grid_s: np.ndarray, times_s: np.ndarray, what: str) -> tuple[np.ndarray, list[ImportFault]]:
    """Rows (n,) of a grid, s, about instants at which an estimate jumps, which no run may hold, and the fault of it."""
    times_s = np.unique(times_s[(times_s >= grid_s[0]) & (times_s <= grid_s[-1])])
    rows = np.zeros(len(grid_s), bool)
    for at in times_s:
        rows |= np.abs(grid_s - at) <= _AROUND_RESET_S
    if not len(times_s):
        return rows, []
    count = len(times_s[np.diff(times_s, prepend=-np.inf) > _AROUND_RESET_S])
    found = f"{what} {count} times, first at {times_s[0]:.2f} s"
    return rows, [ImportFault("estimator_reset", "", found, "a run ends at each of them in the air", count)]


def alive_s(time_s: np.ndarray, values: np.ndarray) -> float:
    """For how long readings (n, k) go on changing, s: one that stands still says no more, at whatever rate it comes."""
    changed_s = time_s[1:][(np.diff(values, axis=0) != 0).any(axis=1)]
    return float(np.clip(np.diff(changed_s), 0.0, _LONGEST_PAUSE_S).sum())


def goes_on(alive: Mapping[int, float], what: str) -> tuple[int, list[ImportFault]]:
    """The first instance of a sensor that goes on changing as long as any other, by `alive_s` of each, and a fault
    where that is not the first of all."""
    first, most = min(alive), max(alive.values())
    taken = next(number for number in sorted(alive) if alive[number] >= GOES_ON * most)
    if taken == first:
        return taken, []
    lasts = f"its readings change for {alive[first]:.1f} s, those of {what} {taken} for {alive[taken]:.1f} s"
    found = f"{what} {first} stands still or ends early ({lasts})"
    return taken, [ImportFault("stuck", "", found, f"{what} {taken} taken")]


def within(shares: np.ndarray, names: Sequence[str]) -> tuple[np.ndarray, list[ImportFault]]:
    """Throttles (n, k) cut off at 0 and 1, and a fault where some lie outside."""
    outside = (shares < -_OUTSIDE) | (shares > 1 + _OUTSIDE)
    found = f"{outside.any(axis=1).mean():.0%} of the rows lie outside the range (disarmed motors get less)"
    return np.clip(shares, 0, 1), fault_where(outside, "range", ", ".join(names), found, "cut off at 0 and 1")


def further_motors(outputs: np.ndarray, motors: int) -> list[int]:
    """Columns of outputs (n, k) beyond the first `motors` that are motors, too.

    A mixer makes the signals of all motors from four demands, so that four of them say the others; a gimbal or a switch
    they do not say.
    """
    unexplained = 0.2  # Share of its variance that the motors of a mixer may leave of another motor's signal.
    known = outputs[np.isfinite(outputs).all(axis=1)]
    if len(known) < 10 * (motors + 1):
        return []
    basis = np.column_stack([known[:, :motors], np.ones(len(known))])
    rest = known[:, motors:] - basis @ np.linalg.lstsq(basis, known[:, motors:], rcond=None)[0]
    moves, left = known[:, motors:].var(axis=0), rest.var(axis=0)
    return [motors + k for k in range(len(moves)) if moves[k] > 0 and left[k] < unexplained * moves[k]]


def report_gaps(table: pd.DataFrame) -> list[ImportFault]:
    """A fault where the clock steps by more than three times its median step; nothing is filled in."""
    steps = np.diff(table[c.TIME].to_numpy(float))
    long = steps > 3.0 * np.median(steps)
    found = f"{int(long.sum())} gaps longer than 3 samples, the longest {steps.max(initial=0.0):.3g} s"
    return fault_where(long, "gap", c.TIME, found, "left as a gap")


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
        columns = [n for n in columns if n in table.columns]
        if not columns:
            continue
        values = table[columns].to_numpy(float)
        same = np.zeros(len(table), bool)
        same[1:] = (values[1:] == values[:-1]).all(axis=1)
        if same.mean() <= share:
            continue
        table.loc[same, columns] = np.nan
        rate = (~same).sum() / (table[c.TIME].iloc[-1] - table[c.TIME].iloc[0])
        found = f"{name} repeats its last value in {same.mean():.0%} of the rows (new values at {rate:.3g} Hz)"
        faults.append(ImportFault("held", ", ".join(columns), found, "repeats made empty cells", int(same.sum())))
    empty = table.drop(columns=c.TIME).isna().all(axis=1)
    return table[~empty].reset_index(drop=True), faults


def without_wild(table: pd.DataFrame) -> tuple[pd.DataFrame, list[ImportFault]]:
    """The table of a log without readings that are none, infinite or absurd by damage, and the fault of them."""
    wild = {n: table[n].abs() > _WILD for n in table if n != c.TIME and table[n].abs().max() > _WILD}
    if not wild:
        return table, []
    cells = pd.DataFrame(wild).to_numpy()
    found = fault_where(cells, "wild", ", ".join(wild), f"infinite, or beyond {_WILD:g}", "made empty cells")
    return table.assign(**{n: table[n].mask(own) for n, own in wild.items()}), found


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
    time = table[c.TIME]
    part = table[(time >= start_s) & (time <= stop_s)].reset_index(drop=True)
    return part.assign(**{c.TIME: part[c.TIME] - part[c.TIME].min()})


def on_grid(grid: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values (n, k) put into the row of the grid nearest in time, of several for one row the nearest; NaN elsewhere.

    Both times in one unit, as floats or whole numbers. What is more than two usual steps from any row is in a hole of
    the grid and has no row.
    """
    values = np.asarray(values, float).reshape(len(time), -1)
    out = np.full((len(grid), values.shape[1]), np.nan)
    row = np.searchsorted((grid[1:] + grid[:-1]) / 2, time)
    far = np.abs(time - grid[row])
    kept = np.flatnonzero((time >= grid[0]) & (time <= grid[-1]) & (far <= 2 * np.median(np.diff(grid))))
    kept = kept[np.argsort(-far[kept], kind="stable")]  # of several for one row the nearest is written last
    out[row[kept]] = values[kept]
    return out


def held_on(grid: np.ndarray, time: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values (m,) on a grid (n,), held until the next one; 0 in rows before the first."""
    index = np.searchsorted(time, grid, side="right") - 1
    return np.where(index >= 0, np.asarray(values, float)[np.maximum(index, 0)], 0.0)


def table_on(
    grid: np.ndarray, parts: Iterable[tuple[Sequence[str], np.ndarray, np.ndarray]], unit_s: float = 1.0
) -> pd.DataFrame:
    """A table on a grid (n,) of parts: names, times (m,), and values (m, k); empty columns are left out.

    Times are in units of `unit_s`, the table's in seconds from the first row on.
    """
    columns = {c.TIME: (grid - grid[0]) * unit_s}
    for names, time, values in parts:
        columns.update(zip(names, on_grid(grid, time, values).T, strict=True))
    return pd.DataFrame({k: v for k, v in columns.items() if k == c.TIME or np.isfinite(v).any()})


def airborne(table: pd.DataFrame, stated: np.ndarray | None = None) -> tuple[np.ndarray, list[ImportFault]]:
    """Rows of a table in contract columns in which the vehicle flies, (n,), and what of a stated flight is ground.

    `stated` is what the log itself calls flight, (n,); None where it says nothing. It holds where no rotors are
    recorded, or no accelerometer.
    """
    time_s = table[c.TIME].to_numpy(float)
    flying = np.ones(len(table), bool) if stated is None else stated
    # What drives the rotors (n, k): throttles, else measured, else commanded speeds.
    order = ("throttle", "rotor_speed", "rotor_command")
    kinds = ([n for n in table if c.rotor_number(n) and n.startswith(kind)] for kind in order)
    drive = next((table[n].to_numpy(float) for n in kinds if n and table[n].notna().any().all()), None)
    felt = set(c.SPECIFIC_FORCE) <= set(table)
    if drive is None or len(table) < 2 or not flying.any() or (not felt and stated is not None):
        return flying, []
    found = _off_the_ground(table, flying, drive)
    lost = int((flying & ~found).sum())
    if stated is None or not lost:
        return found, []
    lasts = np.minimum(np.diff(time_s, append=time_s[-1]), _LONGEST_PAUSE_S)  # the clock stops between flights
    seen = (
        f"{lasts[flying & ~found].sum():.0f} s of {lasts[flying].sum():.0f} s that the log calls flight are on the "
        f"ground (rotors below {_NEAR_WEIGHT:g} of those of flight, specific force of 1 g, no turning)"
    )
    return found, [ImportFault("on_ground", c.TIME, seen, "left out", lost)]


def _off_the_ground(table: pd.DataFrame, flying: np.ndarray, drive: np.ndarray) -> np.ndarray:
    """Rows of a mask (n,) of possible flight in which thrust carries the vehicle, or it falls, turns, or is up.

    On the ground the rotors turn below what flight takes while the specific force stays at 1 g and nothing turns. What
    flight takes is the median of the rows above half of what is mostly given. A log of the ground alone shows no flight
    and is not recognised. A stretch begins and ends with rotors that lift, unless the log begins or ends in it.

    `drive` holds throttles or speeds of the rotors (n, k), NaN where there is no value. Of the table are read the
    specific force, the body rates, and what a range finder or a motion capture says of the height above ground.
    """
    # Share of the usual specific force, or of 1 g where that is more, below which a vehicle falls: on the ground it
    # stays at 1 g, and lively flights take more.
    falling = 0.9
    one_g_m_s2 = 9.81
    near_weight_alone = 0.7  # The same where no accelerometer distinguishes a fall from the ground.
    # Root mean square of slow body rates above which a vehicle whose rotors turn is in the air. A public log has one
    # that rocks on the ground at 0.3 to 0.8 with rotors at two thirds of what flight takes.
    turns_rad_s = 1.0
    ground_m, clear_m = 0.05, 0.5  # Heights below which a vehicle is on the ground, and above which it is in the air.
    time_s = table[c.TIME].to_numpy(float)
    step_s = max(float(np.median(np.diff(time_s))), 1e-4)
    rows = max(int(_SMOOTHED_S / step_s), 1)
    force, rates, height = (
        table[list(names)].to_numpy(float) if set(names) <= set(table) else np.full((len(table), 1), np.nan)
        for names in (c.SPECIFIC_FORCE, c.ANGULAR_VELOCITY, (c.HEIGHT,))
    )

    def smooth(values: np.ndarray) -> np.ndarray:
        known = pd.Series(values).interpolate(limit_direction="both")
        return known.rolling(rows, center=True, min_periods=1).median().to_numpy()

    throttle = smooth(pd.DataFrame(drive).mean(axis=1).to_numpy())
    given = throttle[flying & np.isfinite(throttle)]
    full = float(np.quantile(given, 0.9)) if len(given) else 0.0
    if full <= _DRIVEN:
        return flying
    of_flight = np.median(given[given > 0.5 * full])
    turning, up = _turning(rates, step_s) > turns_rad_s, np.zeros(len(throttle), bool)
    if np.isfinite(force).any():
        pull = smooth(np.linalg.norm(force, axis=1))
        flown = (throttle >= _NEAR_WEIGHT * of_flight) | (pull < falling * min(np.nanmedian(pull[flying]), one_g_m_s2))
    else:
        flown = throttle >= near_weight_alone * of_flight
    if np.isfinite(height).any():
        above = smooth(height[:, 0])
        up = above > clear_m
        flown &= ~(above < ground_m)
    flown |= (turning | up) & (throttle >= 0.5 * of_flight)
    flown = flying & without_pauses(flown, time_s)
    lifts, out = (throttle >= _LIFTS * of_flight) | turning | up, np.zeros(len(flying), bool)
    for start, stop in stretches(flown):
        lifting = np.flatnonzero(lifts[start:stop])
        if len(lifting):
            first = start if start == 0 else start + lifting[0]
            last = stop if stop == len(flown) else start + lifting[-1] + 1
            out[first:last] = True
    return out


def _turning(rates: np.ndarray, step_s: float) -> np.ndarray:
    """Root mean square over `_SMOOTHED_S` of body rates (n, 3) that are averaged over a tenth of it, rad/s, (n,)."""
    known = pd.DataFrame(rates).interpolate(limit_direction="both")
    few, many = max(int(0.1 * _SMOOTHED_S / step_s), 1), max(int(_SMOOTHED_S / step_s), 1)
    slow = known.rolling(few, center=True, min_periods=1).mean()
    return np.sqrt((slow**2).sum(axis=1).rolling(many, center=True, min_periods=1).mean()).to_numpy()


def without_pauses(up: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    """The mask with pauses inside it that are shorter than `_LONGEST_PAUSE_S` filled."""
    up = up.copy()
    for (_, stop), (start, _) in pairwise(stretches(up)):
        if time_s[start] - time_s[stop - 1] < _LONGEST_PAUSE_S:
            up[stop:start] = True
    return up


def flights(
    table: pd.DataFrame, flying: np.ndarray, name: str, where: object, jumps: np.ndarray | None = None
) -> tuple[dict[str, pd.DataFrame], list[ImportFault]]:
    """Every flight of a table by name, take-off and landing left out, its clock at zero; InputError where none is.

    Where the table begins or ends in the air nothing is left out there. No run holds a row of `jumps` (n,), however
    few these are.
    """
    time_s = table[c.TIME].to_numpy(float)
    table, wild = without_wild(table)
    flying = without_pauses(flying, time_s)
    if jumps is not None:
        flying &= ~jumps
    found = _long_enough(flying, time_s)
    if not found:
        longest = max((b - a for a, b in true_stretches(flying, time_s, 0.0)), default=0.0)
        throttles = [n for n in table if n.startswith("throttle_") and c.rotor_number(n)]
        why = f"the vehicle never flies in this log of {time_s[-1]:.0f} s"
        if longest > 0:
            why = (
                f"the longest stretch in the air is {longest:.1f} s, at least {_SHORTEST_FLIGHT_S:g} s beyond take-off "
                "and landing are needed"
            )
        elif throttles and not (table[throttles] > _DRIVEN).any().any():
            why += ": no motor is ever driven"
        raise InputError(f"{where}: {why}")
    runs, cuts = {}, wild
    for number, (start, stop) in enumerate(found, 1):
        run = name if len(found) == 1 else f"{name}_{number}"
        first, last = _inside(start, stop, time_s)
        part = cut(table, first, last)
        if len(part) < 2:
            continue
        runs[run] = part.dropna(axis=1, how="all")
        seen = f"in the air from {start:.2f} to {stop:.2f} s of {time_s[-1]:.0f} s"
        cuts.append(ImportFault("cut", c.TIME, seen, f"{first:.2f} to {last:.2f} s kept", len(table) - len(part), run))
        if happened := ending(table, start, stop):
            cuts.append(ImportFault(ENDING, "", *happened, 0, run))
    if not runs:
        raise InputError(f"{where}: next to no samples of its {len(found)} flights are there")
    return runs, cuts


def stretches_of(time_s: np.ndarray, flying: np.ndarray) -> list[tuple[float, float]]:
    """Start and stop, s, of every flight of a mask (n,) that is long enough, without take-off and landing."""
    return [_inside(start, stop, time_s) for start, stop in _long_enough(without_pauses(flying, time_s), time_s)]


def _long_enough(flying: np.ndarray, time_s: np.ndarray) -> list[tuple[float, float]]:
    every = true_stretches(flying, time_s, _SHORTEST_FLIGHT_S)
    return [s for s in every if np.diff(_inside(*s, time_s))[0] >= _SHORTEST_FLIGHT_S]


def _inside(start_s: float, stop_s: float, time_s: np.ndarray) -> tuple[float, float]:
    """A stretch in the air without take-off and landing, as far as these are in the table."""
    first = start_s if start_s <= time_s[0] else start_s + _AFTER_TAKE_OFF_S
    return first, stop_s if stop_s >= time_s[-1] else stop_s - _BEFORE_LANDING_S
