"""Whether a recording set holds enough to be compared with its vehicle, before any analysis, and what it offers.

A fault that a person mends in a minute (a misspelled column, a rotor without its column) ends with one sentence. A run
that cannot be used (too short, empty, numbers that nothing measures) is left out and named where the others suffice.
What a verdict then rests on: time in the air, share of the recordings on the ground, what was not recorded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from rotorid.errors import InputError
from rotorid.io.text.wording import listed, nearest, plain
from rotorid.recordings import columns as c
from rotorid.recordings.mended import (
    LEAST_SINGLE_S,
    LEAST_STRETCH_S,
    LEAST_VALUES,
    on_own_rates,
    whole_stretches,
    with_sizes_of_speeds,
    without_jumps,
    without_spikes,
)
from rotorid.recordings.run import RecordingSet, Run, stretches
from rotorid.recordings.tables import clock_jump, place
from rotorid.recordings.vehicle import Vehicle

_PAUSE_S, _PAUSE_STEPS = 5.0, 20
"""A stand's or bench's samples that are further apart than both are of two recordings, and nothing between them."""
_MOST_NAMES = 12
_LEAST_FLIGHT_HZ = 2.0
"""Slower flights show no motion of their own: between two samples a quadrotor has turned and come back."""
_LARGEST = {
    c.POSITION: 1e7,
    c.VELOCITY: 1e4,
    c.ANGULAR_VELOCITY: 1e5,
    c.SPECIFIC_FORCE: 1e5,
    c.FORCE: 1e7,
    c.MOMENT: 1e7,
    c.REFERENCE_FORCE: 1e7,
    c.MOUNT: 1e4,
    (c.HEIGHT,): 1e7,
    (c.BATTERY_VOLTAGE, c.BATTERY_CURRENT, c.TEMPERATURE): 1e6,
}
"""Largest size of a number in the column's unit, loose enough for values in a wrong unit (which is a finding)."""
_LARGEST_OF_ROTOR = 1e7
_LARGEST_UNKNOWN = 1e30
_QUATERNION_NORM = (0.5, 2.0)
SENSORS = (c.POSITION, c.VELOCITY, c.QUATERNION, c.ANGULAR_VELOCITY, c.SPECIFIC_FORCE)
_SURELY_MEANT = 0.85
"""Likeness from which an unknown column is taken for the missing one of a sensor whose other columns are there."""


def sufficient(recordings: RecordingSet) -> RecordingSet:
    """The set as the analysis can use it: runs that cannot be used left out, each with a sentence in `left_out`.

    InputError with file and column, where a column is misspelled or what is left does not suffice.
    """
    vehicle = recordings.vehicle
    if vehicle.kind == "bench" and vehicle.rotors and not any(driven_by(r, vehicle) for r in recordings.runs):
        # A bench compares readings with known loads: rotors that are listed but not recorded play no part.
        without = {"rotors": (), "thrust_coefficient_n_s2": None, "torque_coefficient_n_m_s2": None}
        recordings = replace(recordings, vehicle=vehicle.model_copy(update=without))
    recordings = mended(recordings)
    for run in recordings.runs:
        _check_spelling(run, recordings.vehicle)
    usable, reasons = [], []
    for run in recordings.runs:
        reason = next((why for look in _LOOKS if (why := look(run, recordings.vehicle))), None)
        if reason is None:
            usable.append(run)
        else:
            reasons.append(reason)
    if not usable:
        raise InputError(reasons[0] + (f" (and {len(reasons) - 1} more runs likewise)" if len(reasons) > 1 else ""))
    left_out = (*recordings.left_out, *(f"Left out: {reason}." for reason in reasons))
    kept = replace(recordings, runs=tuple(usable), left_out=left_out)
    kept = _with_alike_runs(kept)
    _check_not_constant(kept)
    if len(kept.runs) == 1:
        _check_single(kept)
    _check_common(kept)
    return _with_split_of_the_rest(kept)


def mended(recordings: RecordingSet, dead: Iterable[tuple[str, ...]] = ()) -> RecordingSet:
    """The set with what logs do to readings mended, as every command that looks at them needs it; what was done stands
    in `left_out`. Sensors that are `dead` elsewhere are left out as well."""
    known = _without_dead_sensors(with_sizes_of_speeds(recordings), dead)
    return on_own_rates(without_spikes(without_jumps(known)))


def mended_alike(sets: Sequence[RecordingSet]) -> tuple[RecordingSet, ...]:
    """Sets that are to be compared, mended, with the same sensors: one that is dead in a set shows no change."""
    dead = [names for own in sets for names in dead_sensors(own)]
    return tuple(mended(own, dict.fromkeys(dead)) for own in sets)


def dead_sensors(recordings: RecordingSet) -> list[tuple[str, ...]]:
    """Sensors of flights that hold one value throughout every run: nothing was read from them."""
    if recordings.vehicle.kind != "flight":
        return []
    dead = [names for names in SENSORS if _holds_one_value(recordings.runs, names)]
    speeds, *ordered = recordings.vehicle.rotor_groups().values()
    turn = any(run.has(*speeds) and np.nanmax(run.array(speeds)) > 0 for run in recordings.runs)
    dead += [names for names in ordered if turn and _holds_one_value(recordings.runs, names, 0.0)]
    if c.QUATERNION in dead and any(_no_attitude(run, recordings.vehicle) for run in recordings.runs):
        dead.remove(c.QUATERNION)
    return dead


def _without_dead_sensors(recordings: RecordingSet, elsewhere: Iterable[tuple[str, ...]]) -> RecordingSet:
    """The flights without their dead sensors, and those that are dead in sets that they are compared with."""
    own = dead_sensors(recordings)
    others = [names for names in elsewhere if names not in own and any(run.has(names[0]) for run in recordings.runs)]
    if not own and not others:
        return recordings
    kept = recordings.without([name for names in (*own, *others) for name in names])
    said = [
        f"Left out: {names[0]} to {names[-1]} hold one value in every run, so nothing was read from that sensor."
        for names in own
    ]
    said += [f"Left out: {names[0]} to {names[-1]}, which hold one value in another set." for names in others]
    return recordings.mended(kept.runs, said)


def _holds_one_value(runs: Iterable[Run], names: tuple[str, ...], value: float | None = None) -> bool:
    """Whether a sensor is there in some run and in every such run each of its columns keeps one value (this one)."""
    there = [run.array(names) for run in runs if run.has(*names)]
    there = [values[np.isfinite(values).all(axis=1)] for values in there]
    return any(len(v) > 1 for v in there) and all((v == (v[:1] if value is None else value)).all() for v in there)


def _with_alike_runs(recordings: RecordingSet) -> RecordingSet:
    """The flights with the same channels in every run: what is compared is compared in all of them.

    A few runs that lack a channel are left out; where half of them or more do, the sensor is left out of the others.
    """
    if recordings.vehicle.kind != "flight":
        return recordings
    channels = {run.name: channels_of(run) for run in recordings.runs}
    every = set.union(*channels.values())
    poor = [run for run in recordings.runs if channels[run.name] != every]
    if not poor:
        return recordings
    if 2 * len(poor) < len(recordings.runs):
        lost = [(run.where, listed(sorted(every - channels[run.name]))) for run in poor]
        said = [f"Left out: {run}: lacks sensors that the other runs have (for {names})." for run, names in lost]
        return recordings.mended((run for run in recordings.runs if run not in poor), said)
    partly = [names for names in SENSORS if not all(_reads(run, names) for run in recordings.runs)]
    if all(_reads(run, c.VELOCITY) or _reads(run, c.POSITION) for run in recordings.runs):
        partly = [names for names in partly if names not in (c.VELOCITY, c.POSITION)]
    dropped = [names for names in partly if any(_reads(run, names) for run in recordings.runs)]
    said = [f"Left out: {names[0]} to {names[-1]} are not recorded in every run." for names in dropped]
    return recordings.mended(recordings.without([name for names in partly for name in names]).runs, said)


def _reads(run: Run, names: tuple[str, ...]) -> bool:
    """Whether a sensor has enough complete readings in a run to count as recorded."""
    return run.has(*names) and int(run.complete(names).sum()) >= LEAST_VALUES


def channels_of(run: Run) -> set[str]:
    """Channels of a flight that a run can be compared in, besides those of its rotors."""
    force, turning, attitude = (_reads(run, n) for n in (c.SPECIFIC_FORCE, c.ANGULAR_VELOCITY, c.QUATERNION))
    moving = attitude and (_reads(run, c.VELOCITY) or _reads(run, c.POSITION))
    found = {
        "force": force or moving,
        "moment": turning or attitude,
        "accelerometer": force and moving,
        "gyroscope": turning and attitude,
    }
    return {name for name, there in found.items() if there}


def driven_by(run: Run, vehicle: Vehicle) -> tuple[str, ...]:
    """Columns that the rotors' speeds are known from; empty where no kind of them is whole."""
    return next((names for names in vehicle.rotor_groups().values() if names and run.has(*names)), ())


def _check_spelling(run: Run, vehicle: Vehicle) -> None:
    """InputError where an unknown column can only be a known one that is missing."""
    there = set(run.table.columns)
    known = sorted(c.FIXED) + [name for names in vehicle.rotor_groups().values() for name in names]
    missing = [name for name in known if name not in there]
    # Columns of a sensor whose columns only make sense together, where others of it are there.
    groups = {
        "flight": (*vehicle.rotor_groups().values(), *SENSORS),
        "stand": (*vehicle.rotor_groups().values(), c.MOUNT),
    }
    begun = (names for names in groups.get(vehicle.kind, ()) if any(n in there for n in names))
    halved = {name for names in begun for name in names if name not in there}
    for column in run.unknown_columns:
        meant = next((name for name in missing if plain(name) == plain(column)), None)
        meant = meant or nearest(column, halved, _SURELY_MEANT)
        if meant:
            raise InputError(f"{run.where}: column {column} is not known and {meant} is missing; did you mean {meant}?")


def _absurd(run: Run, vehicle: Vehicle) -> str | None:
    """The first cell that no sensor can have written: infinite, or far beyond what its unit allows."""
    limits = {name: most for names, most in _LARGEST.items() for name in names}
    for column in run.table.columns:
        values = run.column(column)
        most = limits.get(column, _LARGEST_OF_ROTOR if c.rotor_number(column) else _LARGEST_UNKNOWN)
        if column in c.QUATERNION or column == c.TIME:
            most = _LARGEST_UNKNOWN
        with np.errstate(invalid="ignore"):
            bad = np.flatnonzero(np.abs(values) > most)
        if len(bad):
            unit = c.unit_of(column)
            return (
                f"{run.where}, {place(run.path, bad[0])}, column {column}: found {values[bad[0]]:g}, expected a "
                f"number of at most {most:g}{' ' + unit if unit else ''} (an empty cell where nothing was measured)"
            )
    return None


def _no_attitude(run: Run, vehicle: Vehicle) -> str | None:
    """The first quaternion that is no attitude."""
    if vehicle.kind != "flight" or not run.has(*c.QUATERNION):
        return None
    norm = np.linalg.norm(run.array(c.QUATERNION), axis=1)
    low, high = _QUATERNION_NORM
    bad = np.flatnonzero((norm < low) | (norm > high))
    if not len(bad):
        return None
    many = f" ({len(bad)} of {len(norm)} samples are like it)" if len(bad) > 1 else ""
    return (
        f"{run.where}, {place(run.path, bad[0])}, columns quaternion_w to quaternion_z: found the norm "
        f"{norm[bad[0]]:.3g}, expected 1{many}; leave the cells empty where the attitude is not known"
    )


def _uneven_clock(run: Run, vehicle: Vehicle) -> str | None:
    """A clock that jumps so far, or counts in such a unit, that no even grid can hold the run."""
    if jumped := clock_jump(run.time_s, run.where):
        return jumped
    median = float(np.median(np.diff(run.time_s)))
    if vehicle.kind == "flight" and median * _LEAST_FLIGHT_HZ > 1:
        unit = next((u for factor, u in ((1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds"))
                     if 1e-4 < median / factor < 0.2), None)  # fmt: skip
        return (
            f"{run.where}: {c.TIME} has a usual step of {median:.6g} s, expected at most {1 / _LEAST_FLIGHT_HZ:g} s "
            f"({_LEAST_FLIGHT_HZ:g} samples a second)" + (f"; is it in {unit}?" if unit else "")
        )
    return None


def _no_rotors(run: Run, vehicle: Vehicle) -> str | None:
    """Rotor columns that are missing where a thrust has to be predicted."""
    if vehicle.kind == "bench" or driven_by(run, vehicle):
        return None
    there = run.table.columns
    partly = {k: names for k, names in vehicle.rotor_groups().items() if any(run.has(n) for n in names)}
    if partly:
        kind, names = max(partly.items(), key=lambda item: sum(run.has(n) for n in item[1]))
        lost = [n for n in names if not run.has(n)]
        empty = [n for n in lost if n in there]
        state = "empty" if len(empty) == len(lost) else "missing"
        found = len(names) - len(lost)
        return (
            f"{run.where}: {'columns' if len(lost) > 1 else 'column'} {listed(lost)} "
            f"{'are' if len(lost) > 1 else 'is'} {state}: vehicle.yaml lists {len(names)} rotors, the run has "
            f"the {kind.replace('_', ' ')} of {found}, and no other kind of rotor column is whole{_likely(run, lost)}"
        )
    speeds, commands, throttles = vehicle.rotor_groups().values()
    empty = [n for n in (*speeds, *commands, *throttles) if n in there]
    found = f" ({listed(empty)} {'are' if len(empty) > 1 else 'is'} empty)" if empty else ""
    return (
        f"{run.where}: no thrust can be predicted without {speeds[0]} to {speeds[-1]}, {commands[0]} … or "
        f"{throttles[0]} …: none of these columns has a value{found}{_likely(run, (*speeds, *commands, *throttles))}"
    )


def _likely(run: Run, missing: Iterable[str]) -> str:
    """Which unknown column of the run may be one of those that are missing, to end a sentence with."""
    for column in run.unknown_columns:
        meant = nearest(column, missing)
        if meant:
            return f"; is {column} meant to be {meant}?"
    return ""


def _still_rotors(run: Run, vehicle: Vehicle) -> str | None:
    """Rotor speeds that are zero throughout although something lifts: they were not measured."""
    # Share of the weight, and force, by which a stand's reading beyond the weight shows that its rotors turned.
    lifting = 0.25
    least_lift_n = 1.0
    if vehicle.kind == "bench":
        return None
    names = driven_by(run, vehicle)
    turning = np.nan_to_num(run.array(names))
    if np.any(turning != 0):
        return None
    because = ""
    if vehicle.kind == "stand":
        # Rotors may truly stand still: what is read is then the weight, or what tilting the mount changes of it.
        weight = (vehicle.mass_kg or 0.0) * vehicle.gravity_m_s2
        tilt = float(np.nanmax(np.abs(run.array(c.MOUNT)).sum(axis=1))) if run.has(*c.MOUNT) else 0.0
        supported = 2 * weight * np.sin(min(tilt, np.pi) / 2) if vehicle.tared else weight
        force = np.linalg.norm(np.nan_to_num(run.array(c.FORCE)), axis=1)
        largest = float(np.quantile(force, 0.9))
        ordered = [n for k, g in vehicle.rotor_groups().items() if k != "rotor_speed" and run.has(*g) for n in g]
        commanded = bool(ordered) and np.nanmax(np.abs(run.array(tuple(ordered)))) > 0
        if largest <= supported + max(lifting * weight, least_lift_n) and not commanded:
            return None
        because = f" although the sensor reads {largest:.3g} N" + (" and commands are given" if commanded else "")
    return (
        f"{run.where}: columns {names[0]} to {names[-1]} are 0 throughout{because}, expected the speeds that the "
        "rotors turned at (leave the columns out where nothing was measured)"
    )


def moving_sensors(run: Run) -> list[tuple[str, ...]]:
    """Sensors of a flight that have readings in all their columns."""
    return [names for names in SENSORS if _reads(run, names)]


def _nothing_compared(run: Run, vehicle: Vehicle) -> str | None:
    """Sensors that are missing where a force, a moment or a reading has to be compared."""
    if vehicle.kind == "flight":
        if channels_of(run):
            return None
        wanted = (*c.SPECIFIC_FORCE, *c.ANGULAR_VELOCITY, *c.QUATERNION)
        return (
            f"{run.where}: nothing can be compared without {c.SPECIFIC_FORCE[0]} …, {c.ANGULAR_VELOCITY[0]} … or "
            f"quaternion_w …: no such sensor has values in all its columns{_likely(run, wanted)}"
        )
    if vehicle.kind == "stand":
        names = c.FORCE + c.MOMENT
        if any(run.has(n) for n in names):
            return None
        return (
            f"{run.where}: nothing can be compared without {names[0]} … or {c.MOMENT[0]} …: none of these columns "
            f"has a value{_likely(run, names)}"
        )
    pairs = c.REFERENCE_OF.items()
    if any(run.has(*pair) for pair in pairs):
        return None
    half = next(((b if run.has(a) else a, a if run.has(a) else b) for a, b in pairs if run.has(a) or run.has(b)), None)
    what = f"column {half[0]} is missing where {half[1]} is there" if half else "there is no such pair of columns"
    return (
        f"{run.where}: nothing can be compared without a force_x_n … and its reference_force_x_n …: {what}"
        f"{_likely(run, (*c.FORCE, *c.REFERENCE_FORCE))}"
    )


def longest_stretch_s(run: Run, groups: list[tuple[str, ...]]) -> tuple[float, float]:
    """Longest time in which every sensor gives readings without a hole, s, and the slowest sensor's period, s."""
    found, slowest = whole_stretches(run, groups)
    return max((stop - start for start, stop in found), default=0.0), slowest


def compared_readings(run: Run, vehicle: Vehicle) -> list[str]:
    """Columns of a stand or bench whose values are compared, on a bench with the loads that they are compared with."""
    names = [n for n in c.FORCE + c.MOMENT if run.has(n)]
    if vehicle.kind == "bench":
        names = [n for n in names if n in c.REFERENCE_OF and run.has(c.REFERENCE_OF[n])]
        names += [c.REFERENCE_OF[n] for n in names]
    return names


def _too_short(run: Run, vehicle: Vehicle) -> str | None:
    """A run without a stretch that is long enough to be compared."""
    least_readings = 10  # Readings of a stand or a bench that are there in every compared channel at once, in a run.
    # A stretch of flight without a hole must last LEAST_STRETCH_S, and so many samples of its slowest sensor. Of a
    # single run (LEAST_SINGLE_S) a third is held out, after a gap of two seconds; both parts need two seconds.
    least_stretch_samples = 30
    if vehicle.kind == "flight":
        longest, period = longest_stretch_s(run, [driven_by(run, vehicle), *moving_sensors(run)])
        needed = max(LEAST_STRETCH_S, least_stretch_samples * period) if np.isfinite(period) else LEAST_STRETCH_S
        if longest >= needed:
            return None
        return (
            f"{run.where}: too little data: the longest stretch in which every sensor has readings lasts "
            f"{longest:.3g} s, expected at least {needed:.3g} s"
        )
    names = compared_readings(run, vehicle)
    count = int(run.complete(names).sum())
    if count >= least_readings:
        return None
    return (
        f"{run.where}: too little data: {count} samples have a value in {listed(names)} at once, expected at least "
        f"{least_readings}"
    )


def _hardly_sampled(run: Run, vehicle: Vehicle) -> str | None:
    """A run of next to no samples."""
    count = len(run.table)
    said = f"{run.where}: too little data: found {count} samples, expected some seconds of them"
    return said if count < LEAST_VALUES else None


_LOOKS: tuple[Callable[[Run, Vehicle], str | None], ...] = (
    _hardly_sampled,
    _absurd,
    _uneven_clock,
    _no_rotors,
    _nothing_compared,
    _no_attitude,
    _still_rotors,
    _too_short,
)
"""What is looked at in each run, the cause before its consequences."""


def _check_not_constant(recordings: RecordingSet) -> None:
    """InputError where a stand or bench reads one value, and its load is one value, throughout every run; of flights
    where every rotor's command does."""
    vehicle, runs = recordings.vehicle, recordings.runs
    if vehicle.kind == "flight":
        names = driven_by(runs[0], vehicle)
        ordered = names in list(vehicle.rotor_groups().values())[1:]
        if ordered and all(driven_by(run, vehicle) == names for run in runs) and _holds_one_value(runs, names):
            held = np.nanmax(runs[0].array(names), axis=0)
            found = listed([f"{n} = {v:g}" for n, v in zip(names, held, strict=True)], most=6)
            raise InputError(
                f"{recordings.where}: nothing can be compared: the rotors' commands hold one value "
                f"in every run ({found}), expected the changes that keep a vehicle in the air; leave them out where "
                "nothing was recorded"
            )
        return
    read = list(dict.fromkeys(name for run in runs for name in compared_readings(run, vehicle)))
    values = {name: np.concatenate([run.column(name) for run in runs]) for name in read}
    if any(np.nanmin(v) < np.nanmax(v) for v in values.values()):
        return
    found = listed([f"{name} = {np.nanmax(v):g}" for name, v in values.items()], most=6)
    raise InputError(
        f"{recordings.where}: nothing can be compared: every reading holds one value in every run "
        f"({found}), expected the noise of a sensor and loads that differ"
    )


def _check_single(recordings: RecordingSet) -> None:
    """InputError where a single run is too short to hold out a part of it."""
    single_gap_s, held_out_share = 2.0, 1 / 3  # Of a single run this share is held out, after a gap.
    run, vehicle = recordings.runs[0], recordings.vehicle
    if vehicle.kind != "flight":
        # The last third, less half the gap before it, must be more than next to nothing.
        known = run.time_s[run.complete(compared_readings(run, vehicle))]
        needed = (single_gap_s / 2 + LEAST_VALUES * float(np.median(np.diff(known)))) / held_out_share
        lasts = float(known[-1] - known[0])
        if lasts < needed:
            raise InputError(
                f"{run.where}: too little data: a single run must last at least {needed:.3g} s, because its last "
                f"third is held out, after a gap; found {lasts:.3g} s"
            )
        return
    longest, _ = longest_stretch_s(run, [driven_by(run, vehicle), *moving_sensors(run)])
    if longest < LEAST_SINGLE_S:
        why = _first_reason(recordings)
        others = f", and the other runs cannot be used ({why})" if why else ""
        raise InputError(
            f"{run.where}: too little data: a single run must last at least {LEAST_SINGLE_S:g} s without a hole, "
            f"because its last third is held out; found {longest:.3g} s{others}"
        )


def _check_common(recordings: RecordingSet) -> None:
    """InputError where no channel is there in every run."""
    vehicle, runs = recordings.vehicle, recordings.runs
    if vehicle.kind == "flight":
        if not set.intersection(*(channels_of(r) for r in runs)):
            raise InputError(f"{recordings.where}: no force or moment is there in every run")
        return
    names = [n for n in c.FORCE + c.MOMENT if all(r.has(n) for r in runs)]
    if vehicle.kind == "bench":
        names = [n for n in names if n in c.REFERENCE_OF and any(r.has(c.REFERENCE_OF[n]) for r in runs)]
    if not names:
        raise InputError(f"{recordings.where}: no force or moment is compared in every run")


def _first_reason(recordings: RecordingSet) -> str:
    """Why the first of the runs left out cannot be used; empty where all are used."""
    said = (x.removeprefix("Left out: ").removesuffix(".") for x in recordings.left_out if x.startswith("Left out: "))
    return next((why for why in said if ": " in why), "")  # a run's file; a sensor has none


def _with_split_of_the_rest(recordings: RecordingSet) -> RecordingSet:
    """The set with `held_out` less the runs left out; InputError where one side of the split is then empty."""
    if not recordings.held_out or not _first_reason(recordings):
        return recordings
    names = {run.name for run in recordings.runs}
    held_out = tuple(name for name in recordings.held_out if name in names)
    if held_out and set(held_out) != names:
        return replace(recordings, held_out=held_out)
    side = "left to fit" if held_out else "held out"
    raise InputError(f"{_first_reason(recordings)}; without it no run is {side}")


@dataclass(frozen=True)
class _Basis:
    """Time and columns of a set, as they are used."""

    recorded_s: float
    """Length of all runs, of a stand or bench without the pauses in them."""
    in_the_air_s: float | None
    """None for a stand or bench, and where no rotors are recorded."""
    ground_share: float | None
    """Of `recorded_s`, on the ground with rotors that idle or stand still."""
    missing: tuple[str, ...]
    """What the contract knows and no run, or not every run, has."""

    @property
    def sentence(self) -> str:
        """`The verdict rests on 62 s in the air; 8 % of the recordings are on the ground; not recorded: height.`"""
        if self.in_the_air_s is None:
            said = f"{self.recorded_s:.0f} s of recordings"
        else:
            share = 100 * (self.ground_share or 0.0)
            ground = f"{share:.0f} % of the recordings {'is' if share < 1.5 else 'are'} on the ground"
            said = f"{self.in_the_air_s:.0f} s in the air; {ground if share >= 0.5 else 'none of it is on the ground'}"
        lacks = f"not recorded: {listed(self.missing, _MOST_NAMES)}" if self.missing else "no column is missing"
        return f"The verdict rests on {said}; {lacks}."


def basis_of(recordings: RecordingSet) -> _Basis:
    """What a set offers to a verdict."""
    flies, recorded = recordings.vehicle.kind == "flight", 0.0
    for run in recordings.runs:
        steps = np.diff(run.time_s)
        pause_s = max(_PAUSE_S, _PAUSE_STEPS * np.median(steps)) if len(steps) else 0.0
        recorded += float(np.ptp(run.time_s)) if flies else float(steps[steps <= pause_s].sum())
    grounded = [on_the_ground_s(run, recordings.vehicle) for run in recordings.runs]
    known = flies and any(g is not None for g in grounded)
    ground = sum(g for g in grounded if g is not None)
    return _Basis(
        recorded,
        recorded - ground if known else None,
        ground / recorded if known and recorded > 0 else None,
        tuple(missing(recordings)),
    )


def on_the_ground_s(run: Run, vehicle: Vehicle) -> float | None:
    """How long a run is on the ground, s; None where no rotors are recorded."""
    # Rotors idle below this share of nearly the largest thrust of their run, by the squares of their speeds.
    idle_share, largest_quantile = 0.2, 0.98
    # Rotors that idle so long leave a vehicle on the ground: in the air it would have fallen five metres.
    ground_s = 1.0
    # Specific force, over gravity, that the ground exerts on it at least; a vehicle that falls has next to none.
    resting_g = 0.5
    values = run.array(driven_by(run, vehicle))
    rows = np.flatnonzero(np.isfinite(values).all(axis=1))
    if not values.shape[1] or not len(rows):
        return None
    thrust = (values[rows] ** 2).sum(axis=1)
    time_s, force = run.time_s[rows], run.array(c.SPECIFIC_FORCE)[rows]
    idle = thrust < idle_share * np.quantile(thrust, largest_quantile)
    total = 0.0
    for start, stop in stretches(idle):
        lasted = float(time_s[min(stop, len(time_s) - 1)] - time_s[start])
        felt = np.linalg.norm(force[start:stop], axis=1)
        felt = felt[np.isfinite(felt)]
        rests = not len(felt) or float(np.median(felt)) > resting_g * vehicle.gravity_m_s2
        total += lasted if lasted >= ground_s and rests else 0.0
    return total


def missing(recordings: RecordingSet) -> Iterator[str]:
    """Names of what the contract knows for this kind of set and no run has; with a count where some runs have it."""
    runs = recordings.runs
    for name, ways in _wanted(recordings).items():
        having = sum(any(run.has(*way) for way in ways) for run in runs)
        if having == 0:
            yield name
        elif having < len(runs):
            yield f"{name} in {len(runs) - having} of {len(runs)} runs"


def _wanted(recordings: RecordingSet) -> dict[str, list[tuple[str, ...]]]:
    """Name of each thing that may be recorded to the columns, any of which in full are it."""
    vehicle, runs = recordings.vehicle, recordings.runs

    def rotors(kind: str) -> tuple[str, ...]:
        return c.rotor_columns(kind, vehicle.rotor_count)

    def there(name: str) -> bool:
        return any(run.has(name) for run in runs)

    turning = {"rotor speeds": [rotors("rotor_speed")], "commands": [rotors("rotor_command"), rotors("throttle")]}
    voltage = {"battery voltage": [(c.BATTERY_VOLTAGE,)]}
    if vehicle.kind == "flight":
        heights = [(c.HEIGHT,)] if vehicle.ground_z_m is None else [(c.HEIGHT,), (c.POSITION[2],)]
        return turning | {
            "accelerometer": [c.SPECIFIC_FORCE],
            "body rates": [c.ANGULAR_VELOCITY],
            "attitude": [c.QUATERNION],
            "position and velocity": [c.POSITION, c.VELOCITY],
            "height above ground": heights,
        } | voltage  # fmt: skip
    if vehicle.kind == "stand":
        wrench = {}
        for group, names in (("force", c.FORCE), ("moment", c.MOMENT)):
            axes = [axis for axis, name in zip("xyz", names, strict=True) if not there(name)]
            along = f"{group} along {listed(axes)}" if 0 < len(axes) < 3 else f"{group}s"
            wrench[along] = [tuple(name for name in names if not axes or not there(name))]
        return wrench | turning | {"attitude of the mount": [c.MOUNT]} | voltage
    return {name: [(name,)] for pair in c.REFERENCE_OF.items() if any(map(there, pair)) for name in pair}
