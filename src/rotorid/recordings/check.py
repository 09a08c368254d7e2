"""What a recording set contains and what it lacks, in words for a person.

For each run: samples, duration, rate, gaps and the share of empty cells; for the set: which columns are
there, which are not and what that means for testing.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from rotorid.recordings import columns as c
from rotorid.recordings.copies import copies
from rotorid.recordings.doubts import Doubt
from rotorid.recordings.files import read_set
from rotorid.recordings.physics import gravity, impossible_values, near_names, physical_doubts, voltages
from rotorid.recordings.run import RecordingSet, Run
from rotorid.recordings.still import still_readings, still_sensors
from rotorid.recordings.sufficient import sufficient
from rotorid.recordings.unread import unread_files

GAP_FACTOR = 3.0
"""A step of the clock longer than this many median steps is a gap."""
SLOWEST_SPEEDS_HZ = 20.0
"""Rate of rotor speeds below which motors (time constants of some hundredths of a second) are faster than their log."""


@dataclass(frozen=True)
class RunCheck:
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
    runs: tuple[RunCheck, ...]
    columns: tuple[str, ...]
    other_columns: tuple[str, ...]
    lacks: tuple[str, ...]
    """One sentence for each thing that is missing: what it is and what cannot be tested without it."""
    doubts: tuple[Doubt, ...] = ()
    """What cannot be right, with the numbers that raised it."""

    def as_dict(self) -> dict:
        return asdict(self)

    def __str__(self) -> str:
        return as_text(self)


def check_run(run: Run) -> RunCheck:
    """Sampling of one run."""
    steps = np.diff(run.time_s)
    median = float(np.median(steps))
    gaps = steps[steps > GAP_FACTOR * median]
    duration = float(run.time_s[-1] - run.time_s[0])
    empty = {n: float(run.table[n].isna().mean()) for n in run.table.columns if run.table[n].isna().any()}
    return RunCheck(
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


def slow_speeds(recordings: RecordingSet) -> list[str]:
    """A sentence where rotor speeds come too seldom to carry what is fast between command and speed."""
    names = c.rotor_columns("rotor_speed", recordings.vehicle.rotor_count)
    runs = [run for run in recordings.runs if run.has(*names)]
    if not runs:
        return []
    rate = min(float(run.table[names[0]].notna().sum() / (run.time_s[-1] - run.time_s[0])) for run in runs)
    if rate >= SLOWEST_SPEEDS_HZ:
        return []
    return [
        f"Rotor speeds come {rate:.2g} times a second only: a lag or delay of the motors shorter than "
        f"{1 / rate:.2g} s, and what the vehicle does within that time, cannot be distinguished from them."
    ]


def check_set(recordings: RecordingSet) -> SetCheck:
    """What a set contains, lacks, and what in it is in doubt."""
    return replace(contents(recordings), doubts=doubts_of(recordings))


def contents(recordings: RecordingSet) -> SetCheck:
    """What a set contains and lacks; what cannot be right is not looked for."""
    vehicle = recordings.vehicle

    def has(*names: str) -> bool:
        return any(run.has(*names) for run in recordings.runs)

    lacks: list[str] = []
    if vehicle.kind == "flight":
        lacks = _lacks_of_flight(has, vehicle.rotor_count)
        lacks += slow_speeds(recordings)
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
        for force, reference in zip(c.FORCE, c.REFERENCE_FORCE, strict=True):
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
    found = [*unread_files(recordings), *near_names(recordings), *copies(recordings), *voltages(recordings)]
    if recordings.vehicle.kind != "bench":
        found += [*gravity(recordings.vehicle), *impossible_values(recordings)]
    if recordings.vehicle.kind == "flight":
        found += physical_doubts(recordings)
    found += [*still_readings(recordings), *still_sensors(recordings)]
    return tuple(found)


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
    lines.append("")
    lines += [f"- {sentence}" for sentence in check.lacks] or ["Nothing that the contract knows is missing."]
    return "\n".join(lines) + "\n"


def check_recordings(recordings: RecordingSet) -> SetCheck:
    """What a set contains and lacks, useless runs named; InputError if nothing in it can be compared."""
    usable = sufficient(recordings)
    found = contents(recordings)
    # A run that is left out would raise doubts about values that no verdict takes from it.
    return replace(found, lacks=(*usable.left_out, *found.lacks), doubts=doubts_of(usable))


def check_folder(folder: Path) -> SetCheck:
    """Read a set and check it; InputError if it does not fit the contract or nothing in it can be compared."""
    return check_recordings(read_set(Path(folder)))
