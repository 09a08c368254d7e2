"""Stretches in which a sensor gave nothing: missing, held or zero readings while the vehicle or the load went on."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from rotorid.errors import InputError
from rotorid.mismatch.decide.findings import Finding
from rotorid.mismatch.evidence.split import parts_of, split_runs
from rotorid.mismatch.mistakes.signals import COMMANDED, established, replace_columns, sensor_columns
from rotorid.recordings import RecordingSet, Run, Vehicle
from rotorid.recordings import columns as c
from rotorid.recordings.held import (
    OTHERS_GO_ON,
    SHORTEST_GAP_PERIODS,
    SHORTEST_GAP_S,
    at_the_end,
    contradiction,
    held,
    held_in,
    noisy_columns,
    standing_together,
    stretches,
)
from rotorid.recordings.sufficient import (
    LEAST_SINGLE_S,
    LEAST_STRETCH_S,
    channels_of,
    driven_by,
    longest_stretch_s,
    moving_sensors,
    whole_stretches,
)


@dataclass(frozen=True)
class _Dropout:
    """One dropout of one column."""

    run: str
    column: str
    kind: str
    """`missing`, `held` or `zero`."""
    start_s: float
    stop_s: float
    mask: np.ndarray
    p_value: float


def find(recordings: RecordingSet) -> tuple[RecordingSet, Finding | None]:
    """The set with dropouts blanked, and the finding."""
    names = [n for own in sensor_columns(recordings.vehicle).values() for n in own]
    noisy = noisy_columns(recordings.runs, names)
    found = [s for run in recordings.runs for s in _in_run(run, recordings.vehicle, noisy)]
    if not found:
        return recordings, None

    def change(run: Run):
        columns = {}
        for s in found:
            if s.run == run.name and s.kind != "missing":
                columns[s.column] = columns.get(s.column, run.table[s.column]).mask(s.mask)
        return columns

    windows = sorted({(s.run, round(s.start_s, 4), round(s.stop_s, 4)) for s in found})
    columns = tuple(dict.fromkeys(s.column for s in found))
    kinds = " and ".join(dict.fromkeys(s.kind for s in found))
    run, start_s, stop_s = windows[0]
    more = "" if len(windows) == 1 else f" and {len(windows) - 1} more stretch{'es' if len(windows) > 2 else ''}"
    sentence = (
        f"Readings of {', '.join(columns)} dropped out ({kinds}) in {run} from {start_s:.2f} s to {stop_s:.2f} s"
        f"{more}; these samples were left out."
    )
    p_value = max(s.p_value for s in found)
    finding = established("sensor_dropout", sentence, p_value, columns, windows=tuple(windows))
    return replace_columns(recordings, change), finding


def what_is_left(recordings: RecordingSet, before: RecordingSet, lost: Finding) -> tuple[RecordingSet, tuple[str, ...]]:
    """The flights as they can be analysed where a sensor was lost for so long that a side of the split lacks it.

    Of several runs the few that have next to nothing with every sensor are left out, else the sensor is left out of
    all. A single run is cut to its longest stretch with every sensor, where that is long enough; else it loses the
    sensor. With a sentence on what was done.

    Parameters
    ----------
    recordings, before
        The set with lost samples blanked, and as it was recorded.
    lost
        What was found.

    Raises
    ------
    InputError
        Nothing that can be compared is left.
    """
    vehicle = recordings.vehicle
    sensors = {run.name: _sensors(run, vehicle, len(before.runs) == 1) for run in before.runs}
    short = [run for run in recordings.runs if longest_stretch_s(run, sensors[run.name])[0] < LEAST_STRETCH_S]
    if len(recordings.runs) == 1:
        (run,) = recordings.runs
        found, _ = whole_stretches(run, sensors[run.name])
        sides = parts_of(recordings, split_runs(recordings))
        # Share of the fitted or held-out part of a single run in which every sensor must have readings.
        least_of_a_side = 0.5
        if all(_share(part, found) > least_of_a_side for side in sides for part in side.runs):
            return recordings, ()
        start, stop = max(found, key=lambda s: s[1] - s[0], default=(0.0, 0.0))
        if stop - start >= LEAST_SINGLE_S:
            inside = run.table[(run.time_s >= start) & (run.time_s <= stop)].reset_index(drop=True)
            note = f"Of {run.name} only {start:.2f} to {stop:.2f} s are analysed, where every sensor has readings."
            return replace(recordings, runs=(replace(run, table=inside),)), (note,)
    elif not short:
        return recordings, ()
    elif 2 * len(short) < len(recordings.runs):
        kept = tuple(run for run in recordings.runs if run not in short)
        names = {run.name for run in kept}
        held_out = tuple(n for n in recordings.held_out or () if n in names)
        whole = bool(held_out) and set(held_out) != names
        note = f"Left out: {', '.join(run.name for run in short)}, where a sensor was lost nearly throughout."
        rest, more = what_is_left(
            replace(recordings, runs=kept, held_out=held_out if whole else None),
            replace(before, runs=tuple(r for r in before.runs if r.name in names)),
            lost,
        )
        return rest, (note, *more)
    gone = {n for own in sensors.values() for names in own if set(names) & set(lost.channels) for n in names}
    rest = recordings.without(gone)
    if not all(driven_by(run, vehicle) and channels_of(run) for run in rest.runs):
        if len(rest.runs) > 1:
            return recordings, ()  # what the runs hold at other times may suffice
        raise InputError(
            f"set {recordings.name}: {lost.sentence.removesuffix('; these samples were left out.')}; without these "
            "readings nothing is left that can be compared"
        )
    return rest, (f"Left out of every run: {', '.join(sorted(gone))}, lost for too long.",)


def _sensors(run: Run, vehicle: Vehicle, alone: bool) -> list[tuple[str, ...]]:
    """Sensors that a run is compared by: of several runs one without rotor speeds is compared by its commands."""
    rotors = [names for names in vehicle.rotor_groups().values() if names and run.has(*names)]
    return [*(rotors if alone else rotors[-1:]), *moving_sensors(run)]


def _share(run: Run, stretches_s: list[tuple[float, float]]) -> float:
    """Share of a run's time that lies in stretches, s."""
    first, last = run.time_s[0], run.time_s[-1]
    return sum(max(min(stop, last) - max(start, first), 0.0) for start, stop in stretches_s) / (last - first)


def _in_run(run: Run, vehicle: Vehicle, noisy: set[str]) -> list[_Dropout]:
    """Every dropout of a run, column by column; `noisy` columns are known to have noise of their own."""
    found, flown = [], vehicle.kind == "flight"
    for sensor, names in sensor_columns(vehicle).items():
        present = [n for n in names if run.has(n)]
        if not present or (not flown and sensor in (*COMMANDED, "rotors")):
            continue  # on a stand rotors rest and turn evenly
        if sensor in COMMANDED:
            found += _standing_commands(run, vehicle, present, noisy) if len(present) > 1 else []
            continue
        zero = standing_rotors(run, vehicle, names) if sensor == "rotors" and len(present) == len(names) > 2 else {}
        zero = {n: less for n, mask in zero.items() if (less := _not_asked_for(run, vehicle, n, mask)).any()}
        frozen = held_in(run, vehicle, present, noisy) if len(present) > 1 and not zero and flown else []
        for name in present:
            values = run.column(name)
            blank = missing(run.time_s, values)
            stands = zero.get(name, np.zeros(len(values), bool))
            found += _as_dropouts(run, name, "zero", stands) + _as_dropouts(run, name, "missing", blank & ~stands)
            rest = np.where(stands, np.nan, values)
            against = contradiction(run, vehicle, [name]) if flown and sensor == "rotors" else None
            for mask, p in [*held(run.time_s, rest[:, None], noisy=name in noisy, contradicted=against), *frozen]:
                if sensor == "rotors" and not _not_asked_for(run, vehicle, name, mask).any():
                    continue
                if flown or load_went_on(run, vehicle, values, mask):
                    found += _as_dropouts(run, name, "held", mask, p)
    return found


def _not_asked_for(run: Run, vehicle: Vehicle, name: str, mask: np.ndarray) -> np.ndarray:
    """A mask less its stretches in which the rotor's own command stands still too: it turned as it was asked to, or the
    reading is a copy of the command."""
    kind, number = c.rotor_number(name)
    commands = [c.rotor_columns(f, vehicle.rotor_count)[number - 1] for f in ("rotor_command", "throttle") if f != kind]
    command = next((run.column(n) for n in commands if run.has(n)), None)
    out = mask.copy()
    if command is None:
        return out
    for start, stop in stretches(mask):
        own = command[start:stop][np.isfinite(command[start:stop])]
        if len(own) > 1 and np.ptp(own) == 0.0:
            out[start:stop] = False
    return out


def _standing_commands(run: Run, vehicle: Vehicle, names: list[str], noisy: set[str]) -> list[_Dropout]:
    """Stretches in which one rotor's command stands still while all others go on, or all of them do in flight.

    A command at the end of its range may truly stand still: its motor gives all that it can. On the ground all commands
    stand still together.
    """
    together = standing_together(run, vehicle, tuple(names))
    found = [s for mask, p in together for name in names for s in _as_dropouts(run, name, "held", mask, p)]
    commands = run.array(tuple(names))
    moves = np.abs(np.diff(commands, axis=0, prepend=commands[:1])) > 0.0
    for k, name in enumerate(names):
        for mask, p in held_in(run, vehicle, (name,), noisy):
            others = np.delete(moves[mask], k, axis=1).mean(axis=0)
            if not at_the_end(commands[:, k], mask) and others.min() > OTHERS_GO_ON:
                found += _as_dropouts(run, name, "held", mask, p)
    return found


def load_went_on(run: Run, vehicle: Vehicle, reading: np.ndarray, held_mask: np.ndarray) -> bool:
    """Whether a reading (n,) of an instrument should have changed where it was held, or is not what the load makes.

    By its regression elsewhere on what drives it: the known load of a bench, on a stand thrusts and tilts.
    """
    plain_change = 8.0  # Times the noise by which a reading should have changed to be called held.
    plain_steps = 2.0  # The same in steps of a coarse reading, which stands still until the load has changed by one.
    drivers = [run.column(n) for n in c.REFERENCE_FORCE if run.has(n)]
    drivers += [run.column(n) ** 2 for n in driven_by(run, vehicle)]
    drivers += [np.sin(run.column(n)) for n in c.MOUNT if run.has(n)]
    if not drivers:
        return False
    x = np.column_stack([np.ones(len(reading)), *drivers])
    known = np.isfinite(x).all(axis=1)
    outside, inside = known & ~held_mask & np.isfinite(reading), known & held_mask
    if outside.sum() < 10 * x.shape[1] or not inside.any():
        return False
    x = x / np.maximum(np.abs(x[known]).max(axis=0), 1e-300)
    slopes = np.linalg.lstsq(x[outside], reading[outside], rcond=1e-9)[0]
    noise = float((reading[outside] - x[outside] @ slopes).std())
    steps = np.abs(np.diff(reading[outside]))
    step = float(steps[steps > 0].min()) if steps.any() else 0.0
    expected = x[inside] @ slopes
    off = np.abs(expected - reading[inside])
    return bool(max(np.ptp(expected), np.nanmedian(off)) > max(plain_change * noise, plain_steps * step))


def _as_dropouts(run: Run, name: str, kind: str, mask: np.ndarray, p_value: float = 0.0) -> list[_Dropout]:
    """A mask as stretches, close ones merged."""
    t, pieces = run.time_s, []
    for start, stop in stretches(mask):
        if pieces and t[start] - t[pieces[-1][1] - 1] < SHORTEST_GAP_S:
            pieces[-1] = (pieces[-1][0], stop)
        else:
            pieces.append((start, stop))
    index = np.arange(len(t))
    return [
        _Dropout(run.name, name, kind, float(t[a]), float(t[b - 1]), (index >= a) & (index < b), p_value)
        for a, b in pieces
    ]


def missing(time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Mask of holes inside a column that are far longer than its own period."""
    # Empty cells say themselves that nothing was read: a link that loses half a second now and then is no lost sensor.
    shortest_empty_s = 1.0
    index = np.flatnonzero(np.isfinite(values))
    mask = np.zeros(len(values), bool)
    if len(index) < 10:
        return mask
    gap = np.diff(time_s[index])
    # The second shortest tenth of the recording's habit: a sensor with many holes keeps its own period.
    longest = max(shortest_empty_s, SHORTEST_GAP_PERIODS * float(np.median(gap)), 3 * float(np.quantile(gap, 0.98)))
    for k in np.flatnonzero(gap > longest):
        mask[index[k] + 1 : index[k + 1]] = True
    return mask


def standing_rotors(run: Run, vehicle: Vehicle, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Column to mask of samples in which a rotor reads (near) zero while the others carry the vehicle."""
    shortest_stand_s = 0.15
    standing = 0.2  # A rotor below this share of what the others turn at, relative to its own habit, stands still.
    # A rotor that at its fastest gives less than this share of its part of the others' thrust is not being read.
    implausible_thrust = 0.45
    speed = run.array(names)
    out = {}
    usual = np.array([np.quantile(v[v > 0], 0.75) if (v > 0).any() else np.nan for v in speed.T])
    if not np.isfinite(usual).any():
        return out
    usual = np.where(np.isfinite(usual), usual, np.nanmedian(usual))
    top = float(np.median(usual))
    largest_untouched_share = 0.5
    for i, name in enumerate(names):
        others = np.delete(speed / usual, i, axis=1)
        # Half of the others at work, and none of them standing: then the vehicle flies.
        flying = np.isfinite(others).any(axis=1)
        flying[flying] = (np.nanmedian(others[flying], axis=1) > 0.6) & (np.nanmin(others[flying], axis=1) > 0.3)
        if not np.isfinite(speed[flying, i]).any():
            continue
        read = speed[flying][:, np.isfinite(speed[flying]).any(axis=0)]
        thrust = np.nanquantile(speed[flying, i], 0.98) ** 2 / max(np.nanmedian(read, axis=0).max() ** 2, 1e-9)
        if thrust < implausible_thrust and _balanced(vehicle, i):
            out[name] = np.isfinite(speed[:, i])
            continue
        zero = flying & (speed[:, i] < standing * top)
        sudden = np.zeros(len(zero), bool)
        for start, stop in stretches(zero):
            # A saturated motor may truly stand for a moment.
            if run.time_s[stop - 1] - run.time_s[start] < shortest_stand_s:
                continue
            # A rotor cannot stop and start within a sample or two: look at its readings just outside.
            near = np.concatenate([speed[max(start - 2, 0) : start, i], speed[stop : stop + 2, i]])
            low = np.nanmax(speed[start:stop, i])
            if low == 0.0 or (len(near) and np.nanmin(near) > 3 * max(low, 1e-9)):
                sudden[start:stop] = True
        if sudden.any():
            # Readings strewn between zeros are no better than the zeros.
            share = sudden[flying].mean()
            out[name] = np.isfinite(speed[:, i]) if share > largest_untouched_share else sudden
    return out


def _balanced(vehicle: Vehicle, rotor: int) -> bool:
    """Whether hovering asks of this rotor a thrust that is not far below the largest."""
    positions = vehicle.rotor_positions_m()
    rows = np.stack([np.ones(len(positions)), positions[:, 0], positions[:, 1]])
    share = np.linalg.pinv(rows) @ np.array([1.0, 0.0, 0.0])
    return bool(share[rotor] > 0.8 * share.max())
