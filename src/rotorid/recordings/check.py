"""What a recording set contains and what it lacks, in words for a person.

For each run: samples, duration, rate, gaps and the share of empty cells; for the set: which columns are there, which
are not and what that means for testing; and what cannot be right:

- Runs that hold the same samples: a run held out proves nothing if a fitted one repeats it. Two recordings of the same
  manoeuvre agree in what was done and differ in the noise of every sensor. Samples whose readings are equal to the last
  digit, whatever their time stamps, are a copy. A copy that was rounded or scaled anew is found by the noise itself:
  second differences of short blocks, correlated with every place of the other run.
- Files in a set's folder that look like recordings and are not read.
- Readings that stand still while others go on: on a stand or bench one that keeps one value in every run, in flight a
  sensor that repeats one reading for a second or more.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd
import scipy

from rotorid.io.text.wording import listed
from rotorid.recordings import columns as c
from rotorid.recordings.files import RUN_SUFFIXES, read_set, run_name
from rotorid.recordings.held import (
    OTHERS_GO_ON,
    at_the_end,
    held_in,
    noisy_columns,
    standing_together,
    step_of,
    usual_change,
)
from rotorid.recordings.physics import gravity, impossible_values, near_names, physical_doubts, voltages
from rotorid.recordings.run import Doubt, RecordingSet, Run
from rotorid.recordings.sufficient import SENSORS, compared_readings, sufficient
from rotorid.recordings.vehicle import Vehicle

_STUCK_ROWS, _STUCK_TIMES = 8, 4.0
"""Readings from which a sensor of a stand stands still, and how many times as long as it ever does else."""
_SMALL_CHANGES = 0.2
"""Median change of a reading from row to row, as a share of its range, below which it is noise and no load."""
_GOES_ON = 0.2
"""Share of its range by which the middle half of a force changes while every reference stands still."""
_ROUNDING = 1e-3
"""Share of its range up to which a step of a reading is rounding that nobody notices."""
_HELD = 0.5
"""Share of rows that repeat the reading before, from which an inertial sensor comes more slowly than the rows."""
_APART = 0.1
"""Share of rows from which rotors have their values in different rows."""
_TABLES = ("csv", "tsv", "parquet", "feather", "xlsx", "xls", "ods", "h5", "hdf5", "mat", "npz")
_LOGS = ("ulg", "bin", "bbl", "bfl", "mcap", "db3", "bag", "tlog")
_PACKED = ("zip", "gz", "bz2", "xz", "zst", "7z", "tar", "tgz")
_LEFT_BEHIND = ("bak", "old", "orig", "part", "tmp", "copy", "crdownload")
_RECORDING = re.compile(
    rf"\.({'|'.join(_TABLES + _LOGS + _PACKED)})(\.({'|'.join(_PACKED + _LEFT_BEHIND)})|~)*$", re.IGNORECASE
)
_NOISY = (*c.SPECIFIC_FORCE, *c.ANGULAR_VELOCITY, *c.FORCE, *c.MOMENT)
"""Columns with white noise of their own; commands and loads may repeat truly, what a filter made is smooth."""
_LEAST_EQUAL, _LEAST_NOISY = 2, 3
"""Columns that must agree: to the last digit, or in their noise."""
_BLOCK, _BLOCKS, _JUMP = 256, 5, 4.0
_SAME_NOISE = 0.95
"""Correlation of second differences that independent noise does not reach in a block."""


@dataclass(frozen=True)
class _RunCheck:
    """Sampling of one run."""

    name: str
    samples: int
    duration_s: float
    rate_hz: float
    gaps: int
    longest_gap_s: float
    empty: dict[str, float]
    """Share of empty cells of each column that has any, 0 to 1."""
    value_rate_hz: dict[str, float]
    """How often a column with empty cells has a value."""


@dataclass(frozen=True)
class SetCheck:
    """Contents of a set."""

    name: str
    kind: str
    rotors: int
    runs: tuple[_RunCheck, ...]
    columns: tuple[str, ...]
    other_columns: tuple[str, ...]
    lacks: tuple[str, ...]
    """One sentence for each thing that is missing: what it is and what cannot be tested without it."""
    doubts: tuple[Doubt, ...] = ()
    """What cannot be right, with the numbers that raised it."""
    endings: tuple[str, ...] = ()
    """What happened in the last seconds of flights that did not end as a landing does, as the import saw it."""

    def as_dict(self) -> dict:
        return asdict(self)

    def __str__(self) -> str:
        return as_text(self)


def check_run(run: Run) -> _RunCheck:
    """Sampling of one run."""
    gap_factor = 3.0  # A step of the clock longer than this many median steps is a gap.
    steps = np.diff(run.time_s)
    median = float(np.median(steps))
    gaps = steps[steps > gap_factor * median]
    duration = float(run.time_s[-1] - run.time_s[0])
    empty = {n: float(run.table[n].isna().mean()) for n in run.table.columns if run.table[n].isna().any()}
    return _RunCheck(
        name=run.name,
        samples=len(run.table),
        duration_s=duration,
        rate_hz=1 / median,
        gaps=len(gaps),
        longest_gap_s=float(gaps.max()) if len(gaps) else 0.0,
        empty=empty,
        value_rate_hz={n: (1 - share) * len(run.table) / duration for n, share in empty.items()},
    )


def _lacks_of_flight(has, count: int) -> list[str]:
    lacks = []
    speeds = has(*c.rotor_columns("rotor_speed", count))
    commands = has(*c.rotor_columns("rotor_command", count))
    throttles = has(*c.rotor_columns("throttle", count))
    if not speeds and not commands and not throttles:
        lacks.append("No rotor speeds, commands or throttles: no thrust can be predicted.")
    elif not speeds:
        lacks.append(
            "No measured rotor speeds: a lag of the motors shows only through the forces, and battery sag, "
            "throttle curve and thrust curve can hardly be distinguished."
        )
    elif not commands and not throttles:
        lacks.append("No commands: motor lag, throttle curve, saturation and delays of the motors cannot be tested.")
    force = has(*c.SPECIFIC_FORCE)
    moving = has(*c.VELOCITY) or has(*c.POSITION)
    attitude = has(*c.QUATERNION)
    if not force and moving and attitude:
        lacks.append("No accelerometer: forces come from the derivative of the velocity, with its noise.")
    elif not force and not (moving and attitude):
        partly = [name for name in c.SPECIFIC_FORCE if has(name)]
        known = f" except {', '.join(partly)}" if partly else ""
        lacks.append(f"No accelerometer, no velocity with attitude: force channels are missing{known}.")
    if not has(*c.ANGULAR_VELOCITY):
        lacks.append(
            "No body rates: moments come from the second derivative of the attitude, with its noise."
            if attitude
            else "Neither body rates nor attitude: moment channels are missing."
        )
    if not attitude:
        lacks.append("No attitude: wind and forces in world axes cannot be distinguished from forces in body axes.")
    if not moving:
        lacks.append(
            "No velocity or position: rotor drag, frame drag, translational lift, axial inflow and wind "
            "cannot be tested."
        )
    if not has(c.HEIGHT) and not has("position_z_m"):
        lacks.append("No height: ground effect cannot be tested.")
    if not has(c.BATTERY_VOLTAGE):
        lacks.append("No battery voltage: battery sag shows only as a drift in time.")
    return lacks


def _slow_speeds(recordings: RecordingSet) -> list[str]:
    """A sentence where rotor speeds come too seldom to carry what is fast between command and speed."""
    # Rate of rotor speeds below which motors (time constants of some hundredths of a second) are faster than their log.
    slowest_speeds_hz = 20.0
    names = c.rotor_columns("rotor_speed", recordings.vehicle.rotor_count)
    runs = [run for run in recordings.runs if run.has(*names)]
    if not runs:
        return []
    rate = min(float(run.table[names[0]].notna().sum() / (run.time_s[-1] - run.time_s[0])) for run in runs)
    if rate >= slowest_speeds_hz:
        return []
    return [
        f"Rotor speeds come {rate:.2g} times a second only: a lag or delay of the motors shorter than "
        f"{1 / rate:.2g} s, and what the vehicle does within that time, cannot be distinguished from them."
    ]


def check_set(recordings: RecordingSet) -> SetCheck:
    """What a set contains, lacks, and what in it is in doubt."""
    return replace(_contents(recordings), doubts=doubts_of(recordings))


def _contents(recordings: RecordingSet) -> SetCheck:
    """What a set contains and lacks; what cannot be right is not looked for."""
    vehicle = recordings.vehicle

    def has(*names: str) -> bool:
        return any(run.has(*names) for run in recordings.runs)

    lacks: list[str] = []
    if vehicle.kind == "flight":
        lacks = _lacks_of_flight(has, vehicle.rotor_count)
        lacks += _slow_speeds(recordings)
        if vehicle.ground_z_m is None and not has(c.HEIGHT):
            lacks.append("vehicle.yaml has no ground_z_m and no run has height_m: height is unknown.")
    elif vehicle.kind == "stand":
        if not any(has(name) for name in c.FORCE + c.MOMENT):
            lacks.append("No force or moment: nothing can be compared.")
        if not has(*c.rotor_columns("rotor_speed", vehicle.rotor_count)):
            lacks.append("No rotor speeds: unequal rotors and a displaced sensor cannot be distinguished.")
        if not has(*c.MOUNT):
            lacks.append("No roll and pitch of the mount: it is taken as level.")
        if not has(c.BATTERY_VOLTAGE):
            lacks.append("No battery voltage: battery sag shows only as a drift in time.")
    else:
        for force, reference in c.REFERENCE_OF.items():
            if has(force) != has(reference):
                lacks.append(f"{force} and {reference} are not both there: that axis cannot be compared.")
    if len(recordings.runs) == 1:
        lacks.append("One run only: blocks of it are held out, and repeatability between runs is unknown.")
    columns = list(dict.fromkeys(name for run in recordings.runs for name in run.table.columns))
    return SetCheck(
        name=recordings.name,
        kind=vehicle.kind,
        rotors=vehicle.rotor_count,
        runs=tuple(check_run(run) for run in recordings.runs),
        columns=tuple(name for name in columns if c.is_known(name)),
        other_columns=tuple(name for name in columns if not c.is_known(name)),
        lacks=tuple(lacks),
    )


def doubts_of(recordings: RecordingSet) -> tuple[Doubt, ...]:
    """What cannot be right in a set, its vehicle and its runs together; empty where nothing is in doubt."""
    kind = recordings.vehicle.kind
    return tuple(doubt for look, kinds in _LOOKS if kind in kinds for doubt in look(recordings))


def as_text(check: SetCheck) -> str:
    """A page of plain text."""
    lines = [f"{check.name}: kind {check.kind}, {check.rotors} rotors, {len(check.runs)} runs", ""]
    width = max(len(run.name) for run in check.runs)
    for run in check.runs:
        gaps = f", {run.gaps} gaps (longest {run.longest_gap_s:.3g} s)" if run.gaps else ", no gaps"
        lines.append(
            f"  {run.name:<{width}}  {run.samples} samples, {run.duration_s:.2f} s at {run.rate_hz:.4g} Hz{gaps}"
        )
        groups: dict[tuple[float, float], list[str]] = {}
        for name, share in run.empty.items():
            groups.setdefault((round(share, 3), round(run.value_rate_hz[name], 1)), []).append(name)
        for (share, rate), names in groups.items():
            listed = names[0] if len(names) == 1 else f"{names[0]} and {len(names) - 1} like it"
            lines.append(f"  {'':<{width}}  {listed}: {share:.0%} empty, a value {rate:g} times a second")
    lines += ["", "Columns: " + ", ".join(check.columns)]
    if check.other_columns:
        lines.append("Kept as regime variables: " + ", ".join(check.other_columns))
    if check.doubts:
        lines += ["", "Looks wrong:", *(f"- {doubt}" for doubt in check.doubts)]
    if check.endings:
        lines += ["", "How it ended:", *(f"- {sentence}" for sentence in check.endings)]
    lines.append("")
    lines += [f"- {sentence}" for sentence in check.lacks] or ["Nothing that the contract knows is missing."]
    return "\n".join(lines) + "\n"


def check_recordings(recordings: RecordingSet) -> SetCheck:
    """What a set contains and lacks, useless runs named; InputError if nothing in it can be compared."""
    usable = sufficient(recordings)
    found = _contents(recordings)
    # A run that is left out would raise doubts about values that no verdict takes from it.
    doubts = *doubts_of(usable), *_held_sensors(recordings)  # a grid of its own hides that a sensor is held
    return replace(found, lacks=(*usable.left_out, *found.lacks), doubts=doubts)


def check_folder(folder: Path) -> SetCheck:
    """Read a set and check it; InputError if it does not fit the contract or nothing in it can be compared."""
    from rotorid.recordings.importers.faults import endings_of

    return replace(check_recordings(read_set(Path(folder))), endings=endings_of(Path(folder)))


def copies(recordings: RecordingSet) -> tuple[Doubt, ...]:
    """One doubt for each run that repeats samples of an earlier one."""
    most_correlated = 5_000_000  # Samples by runs to correlate with, which take some seconds.
    columns = dict.fromkeys(n for run in recordings.runs for n in run.table.columns if n != c.TIME)
    names = [n for n in columns if all(run.has(n) for run in recordings.runs)]
    if len(recordings.runs) < 2 or len(names) < _LEAST_EQUAL:
        return ()
    found: dict[str, tuple[str, str]] = {}
    for first, second, share, shift_s in _equal_samples(recordings.runs, names):
        later = f", {abs(shift_s):.4g} s {'later' if shift_s > 0 else 'earlier'}" if abs(shift_s) > 1e-6 else ""
        found.setdefault(second, (first, f"{share:.0%} of its samples are equal to the last digit{later}"))
    rest = [run for run in recordings.runs if run.name not in found]
    noisy = [name for name in names if name in _NOISY]
    work = sum(len(run.table) for run in rest) * len(rest)
    if len(noisy) >= _LEAST_NOISY and len(rest) > 1 and work <= most_correlated:
        noises = [(run.name, _noise(run, noisy)) for run in rest]
        for (first, own), (second, other) in combinations(noises, 2):
            # Short blocks spread over the first run.
            starts = np.unique(np.linspace(0, len(own) - _BLOCK, _BLOCKS).astype(int)) if len(own) >= _BLOCK else ()
            if any(_lies_in(own[start : start + _BLOCK], other) for start in starts):
                found.setdefault(second, (first, "even the noise of its sensors is the same"))
    return tuple(
        Doubt(
            second,
            f"Run {second} repeats run {first}: {how}; such a run confirms nothing that was fitted to the other, leave "
            "one of them out.",
        )
        for second, (first, how) in found.items()
    )


def _equal_samples(runs: tuple[Run, ...], names: list[str]) -> Iterator[tuple[str, str, float, float]]:
    """Pairs of runs with equal samples: names, share of the shorter run, and how much later in the second, s."""
    # Equal samples, and their share of the shorter run, from which two runs overlap.
    least_rows, least_share = 20, 0.05
    by_chance = 3.0  # So many times as often as within one run: readings in coarse steps repeat by themselves.
    tables, repeated = [], []
    for number, run in enumerate(runs):
        values = run.table[names]
        known = (values.notna().sum(axis=1) >= _LEAST_EQUAL).to_numpy()
        hashes = pd.util.hash_pandas_object(values[known], index=False).to_numpy()
        table = pd.DataFrame({"hash": hashes, "run": number, "time_s": run.time_s[known]})
        tables.append(table.drop_duplicates("hash"))
        repeated.append(1 - len(tables[-1]) / max(len(table), 1))
    together = pd.concat(tables)
    sizes = together.groupby("run").size()
    shared = together[together.duplicated("hash", keep=False)]
    first = shared.drop_duplicates("hash")
    pairs = shared.merge(first, on="hash", suffixes=("", "_first"))
    pairs = pairs[pairs["run"] != pairs["run_first"]]
    for (a, b), equal in pairs.groupby(["run_first", "run"]):
        share = len(equal) / min(sizes[a], sizes[b])
        least = max(least_share, by_chance * max(repeated[a], repeated[b]))
        if len(equal) >= least_rows and share >= least:
            yield runs[a].name, runs[b].name, share, float((equal["time_s"] - equal["time_s_first"]).median())


def _noise(run: Run, names: list[str]) -> np.ndarray:
    """Second differences of the rows that are whole, clipped to a few of their usual size, (n, k)."""
    noise = np.diff(run.array(tuple(names))[run.complete(names)], n=2, axis=0)
    if not len(noise):
        return noise
    # A single jump would correlate with every other jump.
    most = _JUMP * np.median(np.abs(noise), axis=0)
    return np.clip(noise, -most, most)


def _lies_in(block: np.ndarray, noise: np.ndarray) -> bool:
    """Whether at one place of `noise` enough columns of the block correlate as only a copy does."""
    if len(noise) < _BLOCK:
        return False
    alike = np.zeros(len(noise) - _BLOCK + 1, int)
    for own, other in zip(block.T, noise.T, strict=True):
        energy = float(own @ own)
        if energy == 0.0:
            continue
        total = np.concatenate([[0.0], np.cumsum(other**2)])
        there = total[_BLOCK:] - total[:-_BLOCK]
        product = scipy.signal.fftconvolve(other, own[::-1], mode="valid")
        # Where the other run stands still there is no noise to compare.
        alike += (there > 0.01 * energy) & (product > _SAME_NOISE * np.sqrt(energy * np.maximum(there, 0.0)))
    return bool((alike >= _LEAST_NOISY).any())


def _unread_files(recordings: RecordingSet) -> tuple[Doubt, ...]:
    """One doubt for each such file; none for a set that was never a folder."""
    if not recordings.path or not Path(recordings.path).is_dir():
        return ()
    names = sorted(path.name for path in Path(recordings.path).iterdir() if not path.name.startswith("."))
    return tuple(
        Doubt(
            name,
            f"{name} looks like a recording and is not read: runs end in {', '.join(RUN_SUFFIXES)}; unpack, import or "
            "rename it, or move it out of the set.",
        )
        for name in names
        if _RECORDING.search(name) and run_name(Path(name)) is None
    )


def still_sensors(recordings: RecordingSet) -> Iterator[Doubt]:
    """One doubt for each sensor of a flight that stands still for a time, with the first run and its seconds."""
    still_s = 1.0  # A sensor of a flight that repeats one reading for so long is named.
    runs, vehicle = recordings.runs, recordings.vehicle
    groups = (*SENSORS, *vehicle.rotor_groups().values())
    noisy = noisy_columns(runs, [n for names in groups for n in names])
    found: dict[tuple[str, ...], list[tuple[str, float, float]]] = {}
    for run in runs:
        for names in groups:
            if not names or not run.has(*names):
                continue
            rotors = names not in SENSORS
            whole = standing_together(run, vehicle, names) if rotors else held_in(run, vehicle, names, noisy)
            masks = {names: [mask for mask, _ in whole]}
            if rotors and not whole:
                masks = {(n,): _alone(run, vehicle, n, names, noisy) for n in names}
            for own, stands in masks.items():
                times = [(float(run.time_s[m][0]), float(run.time_s[m][-1])) for m in stands]
                for start, stop in times:
                    if stop - start >= still_s:
                        found.setdefault(own, []).append((run.name, start, stop))
    for names, where in found.items():
        run, start, stop = where[0]
        more = f" and in {len(where) - 1} more stretches" if len(where) > 1 else ""
        yield Doubt(
            names[0],
            f"{f'{names[0]} to {names[-1]} stand' if len(names) > 1 else f'{names[0]} stands'} still in {run} from "
            f"{start:.2f} to {stop:.2f} s{more} while the vehicle flies on, expected at least the noise of a sensor: "
            "its driver or its link stopped, and nothing was read there",
        )


def _alone(run: Run, vehicle: Vehicle, name: str, names: tuple[str, ...], noisy: set[str]) -> list[np.ndarray]:
    """Stretches in which one rotor stands still, not at the end of its range, while all others go on."""
    others = [run.column(n) for n in names if n != name]
    out = []
    for mask, _ in held_in(run, vehicle, (name,), noisy):
        read = [v[mask][np.isfinite(v[mask])] for v in others]
        go_on = [len(v) > 1 and float((np.diff(v) != 0).mean()) > OTHERS_GO_ON for v in read]
        if go_on and all(go_on) and not at_the_end(run.column(name), mask):
            out.append(mask)
    return out


def _still_readings(recordings: RecordingSet) -> Iterator[Doubt]:
    """One doubt for all such readings; it stops a verdict where no reading of the instrument changes."""
    runs, vehicle = recordings.runs, recordings.vehicle
    names = list(dict.fromkeys(name for run in runs for name in compared_readings(run, vehicle)))
    spans = {}
    for name in names:
        values = np.concatenate([run.column(name) for run in runs if run.has(name)])
        values = values[np.isfinite(values)]
        if len(values) > 1:
            spans[name] = float(np.ptp(values)), float(values[0])
    # A reference may be the weights that were put on, the same in every run.
    own = [name for name in spans if name not in c.REFERENCE_FORCE]
    still = [name for name in own if spans[name][0] == 0]
    moving = [name for name, (span, _) in spans.items() if span > 0]
    if still and moving:
        values = list(dict.fromkeys(f"{spans[name][1]:.4g}" for name in still))
        yield Doubt(
            still[0],
            f"{listed(still)} {'keeps' if len(still) == 1 else 'keep'} one value ({listed(values)}) in every run while "
            f"{listed(moving)} {'changes' if len(moving) == 1 else 'change'}, expected at least the noise of a sensor: "
            "not measured, or a sensor that stands still",
            stops=len(still) == len(own),
        )


def _stuck_readings(recordings: RecordingSet) -> Iterator[Doubt]:
    """One doubt for each column of a stand or bench that stands still for a time: a reading or a measured speed by its
    noise, a reference while the force that it states goes on."""
    vehicle = recordings.vehicle
    speeds = c.rotor_columns("rotor_speed", vehicle.rotor_count)
    found: dict[str, tuple[str, float, float]] = {}
    names = {run.name: [*filter(run.has, (*compared_readings(run, vehicle), *speeds))] for run in recordings.runs}
    noisy = {n for run in recordings.runs for n in names[run.name] if usual_change(run.column(n)) < _SMALL_CHANGES}
    for run in recordings.runs:
        for name in names[run.name]:
            values = run.column(name)
            rows, usual = _longest_stand(values)
            if name in c.REFERENCE_FORCE:
                # A load along another axis moves this one by crosstalk: no load, or one all the time, is stated so.
                alone = any(np.ptp(run.column(n)[rows]) > 0 for n in c.REFERENCE_FORCE if run.has(n))
                moved = values[rows[0]] != 0 and len(rows) < np.isfinite(values).sum()
                stuck = (moved or not alone) and _goes_on(run.column(c.FORCE[c.REFERENCE_FORCE.index(name)]), rows)
            else:
                stuck = len(rows) >= _STUCK_TIMES * usual and name in noisy and values[rows[0]] != 0
            if stuck and len(rows) >= _STUCK_ROWS:
                found.setdefault(name, (run.name, run.time_s[rows[0]], run.time_s[rows[-1]]))
    for name, (run, start, stop) in found.items():
        yield Doubt(
            name,
            f"{name} stands still in {run} from {start:.2f} to {stop:.2f} s while others go on: its driver or its link "
            "stopped, and nothing was read there",
        )


def _longest_stand(values: np.ndarray) -> tuple[np.ndarray, int]:
    """Rows of the longest stretch in which a column (n,) keeps one value, and how many the next long one has."""
    known = np.flatnonzero(np.isfinite(values))
    parts = sorted(np.split(known, np.flatnonzero(np.diff(values[known]) != 0) + 1), key=len)
    return parts[-1], len(parts[-2]) if len(parts) > 1 else 0


def _goes_on(values: np.ndarray, rows: np.ndarray) -> bool:
    """Whether a column (n,) changes in these rows by a fair share of what it does at all."""
    inside, every = values[rows][np.isfinite(values[rows])], values[np.isfinite(values)]
    return len(inside) > 0 and float(np.ptp(np.quantile(inside, [0.25, 0.75]))) > _GOES_ON * float(np.ptp(every)) > 0


def _coarse_readings(recordings: RecordingSet) -> Iterator[Doubt]:
    """One doubt for each reading of a stand or bench whose steps are larger than its noise."""
    vehicle = recordings.vehicle
    found: dict[str, float] = {}
    for run in recordings.runs:
        for name in (n for n in compared_readings(run, vehicle) if n in c.FORCE + c.MOMENT):
            values = run.column(name)[np.isfinite(run.column(name))]
            step = step_of(values) if (np.diff(values) == 0).sum() > 0.5 * len(values) else 0.0
            if step and step > _ROUNDING * float(np.ptp(values)):
                found[name] = max(found.get(name, 0.0), step)
    for name, step in found.items():
        yield Doubt(
            name,
            f"{name} comes in steps of {step:.3g}, larger than its noise: what is smaller than half of one is "
            "rounding, and no effect",
        )


def _scattered_rotors(recordings: RecordingSet) -> Iterator[Doubt]:
    """One doubt for each kind of columns of a flight's rotors that have their values in different rows."""
    for kind, names in recordings.vehicle.rotor_groups().items():
        known = [np.isfinite(run.array(names)) for run in recordings.runs if names and run.has(*names)]
        apart = [float((own.any(axis=1) & ~own.all(axis=1)).mean()) for own in known]
        if max(apart, default=0.0) > _APART:
            yield Doubt(
                names[0],
                f"{names[0]} to {names[-1]} have their values in different rows ({max(apart):.0%} of them lack some): "
                f"between its own each {kind.replace('_', ' ')} is a straight line, and a lag, a delay or a curve that "
                "is found may be that",
            )


def _scattered_readings(recordings: RecordingSet) -> Iterator[Doubt]:
    """One doubt for all columns of a stand or bench that lack values now and then, in no order."""
    vehicle = recordings.vehicle
    found: dict[str, float] = {}
    for run in recordings.runs:
        for name in (*compared_readings(run, vehicle), *c.rotor_columns("rotor_speed", vehicle.rotor_count)):
            steps = np.diff(np.flatnonzero(np.isfinite(run.column(name)))) if run.has(name) else np.zeros(0)
            if len(steps) and (steps != np.median(steps)).mean() > _APART:
                found[name] = max(found.get(name, 0.0), 1.0 - len(steps) / len(run.table))
    if found:
        yield Doubt(
            next(iter(found)),
            f"{listed(list(found))}: up to {max(found.values()):.0%} of the values are missing, now and then; between "
            "others each is a straight line, and what is found may be that",
        )


def _held_sensors(recordings: RecordingSet) -> Iterator[Doubt]:
    """One doubt for a gyroscope or accelerometer of a flight that mostly repeats its last reading, the whole of it."""
    for names in (c.ANGULAR_VELOCITY, c.SPECIFIC_FORCE) if recordings.vehicle.kind == "flight" else ():
        for run in (r for r in recordings.runs if r.has(*names)):
            values = run.array(names)
            known = np.isfinite(values).all(axis=1)
            again = (np.diff(values[known], axis=0) == 0).all(axis=1)
            if len(again) and 1.0 > again.mean() > _HELD:
                rate = (~again).sum() / (run.time_s[-1] - run.time_s[0])
                yield Doubt(
                    names[0],
                    f"{names[0]} to {names[-1]} repeat their last reading in {again.mean():.0%} of the rows of "
                    f"{run.name}: they come {rate:.3g} times a second, and later than the rows say",
                )
                break


_LOOKS: tuple[tuple[Callable[[RecordingSet], Iterable[Doubt]], tuple[str, ...]], ...] = (
    (_unread_files, ("flight", "stand", "bench")),
    (near_names, ("flight", "stand", "bench")),
    (copies, ("flight", "stand", "bench")),
    (voltages, ("flight", "stand", "bench")),
    (gravity, ("flight", "stand")),
    (impossible_values, ("flight", "stand")),
    (physical_doubts, ("flight",)),
    (_still_readings, ("stand", "bench")),
    (_stuck_readings, ("stand", "bench")),
    (still_sensors, ("flight",)),
    (_coarse_readings, ("stand", "bench")),
    (_scattered_rotors, ("flight",)),
    (_scattered_readings, ("stand", "bench")),
)
"""Everything that is looked for in a set as it was given, and in which kinds of sets: by `check`, by the page before a
verdict, and by the verdict, which looks once more at the set that it corrected."""
