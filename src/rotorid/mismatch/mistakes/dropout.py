"""Stretches in which a sensor gave nothing: missing, held or zero readings while the vehicle or the load went on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rotorid.mismatch.decision.findings import Finding
from rotorid.mismatch.mistakes.signals import COMMANDED, P_LIMIT, replace_columns, sensor_columns
from rotorid.mismatch.plant.motion import stretches
from rotorid.recordings import RecordingSet, Run, Vehicle
from rotorid.recordings import columns as c

SHORTEST_GAP_S = 0.3
"""A held stretch counts from this length on; two that are closer are one."""
SHORTEST_GAP_PERIODS = 12
"""It counts from this many of the sensor's own periods on, a missing one as well."""
SHORTEST_EMPTY_S = 1.0
"""Empty cells say themselves that nothing was read: a link that loses half a second now and then is no lost sensor."""
SHORTEST_FREEZE_PERIODS = 8
SHORTEST_FREEZE_S = 0.04
"""Where all columns of a sensor stand still at once, a shorter stretch is no chance."""
SHORTEST_STAND_S = 0.15
STANDING = 0.2
"""A rotor below this share of what the others turn at, relative to its own habit, stands still."""
IMPLAUSIBLE_THRUST = 0.45
"""A rotor that at its fastest gives less than this share of its part of the others' thrust is not being read."""
LARGEST_UNTOUCHED_SHARE = 0.5
SMOOTH = 0.3
"""Second differences of a reading without noise are this share of its first ones at most; white noise has 1.7."""
PLAIN_CHANGE = 8.0
"""Times the noise by which a reading should have changed to be called held."""
PLAIN_STEPS = 2.0
"""The same in steps of a coarse reading, which stands still until the load has changed by one."""
OTHERS_GO_ON = 0.5
"""Share of the samples in which every other rotor's command changes while one stands still."""
LEAST_JUMP = 5.0
"""A jump is this many of the usual steps of a reading: what was held jumps back at its end."""


@dataclass(frozen=True)
class Dropout:
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
    noisy = noisy_columns(recordings)
    found = [s for run in recordings.runs for s in in_run(run, recordings.vehicle, noisy)]
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
    finding = Finding(
        id="sensor_dropout",
        status="established",
        sentence=(
            f"Readings of {', '.join(columns)} dropped out ({kinds}) in {run} from {start_s:.2f} s to {stop_s:.2f} s"
            f"{more}; these samples were left out."
        ),
        p_value=max(s.p_value for s in found),
        channels=columns,
        windows=tuple(windows),
    )
    return replace_columns(recordings, change), finding


def in_run(run: Run, vehicle: Vehicle, noisy: set[str]) -> list[Dropout]:
    """Every dropout of a run, column by column; `noisy` columns are known to have noise of their own."""
    found, flown = [], vehicle.kind == "flight"
    for sensor, names in sensor_columns(vehicle).items():
        present = [n for n in names if run.has(n)]
        if not present or (not flown and sensor in (*COMMANDED, "rotors")):
            continue  # on a stand rotors rest and turn evenly
        if sensor in COMMANDED:
            found += standing_commands(run, present, noisy) if len(present) > 1 else []
            continue
        zero = standing_rotors(run, vehicle, names) if sensor == "rotors" and len(present) == len(names) > 2 else {}
        frozen = []
        if len(present) > 1 and not zero and flown:
            alive = not noisy.isdisjoint(present)
            frozen = held(run.time_s, run.array(tuple(present)), SHORTEST_FREEZE_S, SHORTEST_FREEZE_PERIODS, alive)
        for name in present:
            values = run.column(name)
            blank = missing(run.time_s, values)
            stands = zero.get(name, np.zeros(len(values), bool))
            found += _as_dropouts(run, name, "zero", stands) + _as_dropouts(run, name, "missing", blank & ~stands)
            rest = np.where(stands, np.nan, values)
            for mask, p in [*held(run.time_s, rest[:, None], noisy=name in noisy), *frozen]:
                if flown or load_went_on(run, vehicle, values, mask):
                    found += _as_dropouts(run, name, "held", mask, p)
    return found


def standing_commands(run: Run, names: list[str], noisy: set[str]) -> list[Dropout]:
    """Stretches in which one rotor's command stands still while all others go on.

    A command at the end of its range may truly stand still: its motor gives all that it can. On the ground all commands
    stand still together.
    """
    found = []
    commands = run.array(tuple(names))
    moves = np.abs(np.diff(commands, axis=0, prepend=commands[:1])) > 0.0
    for k, name in enumerate(names):
        own = commands[:, k]
        ends = np.nanmin(own), np.nanmax(own)
        for mask, p in held(run.time_s, own[:, None], noisy=name in noisy):
            others = np.delete(moves[mask], k, axis=1).mean(axis=0)
            if own[mask][0] not in ends and others.min() > OTHERS_GO_ON:
                found += _as_dropouts(run, name, "held", mask, p)
    return found


def load_went_on(run: Run, vehicle: Vehicle, reading: np.ndarray, held_mask: np.ndarray) -> bool:
    """Whether a reading (n,) of an instrument should have changed where it was held, or is not what the load makes.

    By its regression elsewhere on what drives it: the known load of a bench, on a stand thrusts and tilts.
    """
    families = (c.rotor_columns(f, vehicle.rotor_count) for f in ("rotor_speed", "rotor_command", "throttle"))
    rotors = next((n for n in families if n and run.has(*n)), ())
    drivers = [run.column(n) for n in c.REFERENCE_FORCE if run.has(n)]
    drivers += [run.column(n) ** 2 for n in rotors] + [np.sin(run.column(n)) for n in c.MOUNT if run.has(n)]
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
    return bool(max(np.ptp(expected), np.nanmedian(off)) > max(PLAIN_CHANGE * noise, PLAIN_STEPS * step))


def _as_dropouts(run: Run, name: str, kind: str, mask: np.ndarray, p_value: float = 0.0) -> list[Dropout]:
    """A mask as stretches, close ones merged."""
    t, pieces = run.time_s, []
    for start, stop in stretches(mask):
        if pieces and t[start] - t[pieces[-1][1] - 1] < SHORTEST_GAP_S:
            pieces[-1] = (pieces[-1][0], stop)
        else:
            pieces.append((start, stop))
    index = np.arange(len(t))
    return [
        Dropout(run.name, name, kind, float(t[a]), float(t[b - 1]), (index >= a) & (index < b), p_value)
        for a, b in pieces
    ]


def missing(time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Mask of holes inside a column that are far longer than its own period."""
    index = np.flatnonzero(np.isfinite(values))
    mask = np.zeros(len(values), bool)
    if len(index) < 10:
        return mask
    gap = np.diff(time_s[index])
    # The second shortest tenth of the recording's habit: a sensor with many holes keeps its own period.
    longest = max(SHORTEST_EMPTY_S, SHORTEST_GAP_PERIODS * float(np.median(gap)), 3 * float(np.quantile(gap, 0.98)))
    for k in np.flatnonzero(gap > longest):
        mask[index[k] + 1 : index[k + 1]] = True
    return mask


def held(
    time_s: np.ndarray,
    values: np.ndarray,
    shortest_s: float = SHORTEST_GAP_S,
    periods: int = SHORTEST_GAP_PERIODS,
    noisy: bool = False,
) -> list[tuple[np.ndarray, float]]:
    """Stretches in which changing columns (n, k) all repeat one reading far longer than chance and habit allow.

    At least `shortest_s` seconds and `periods` of the sensor's own periods long. Each as a mask (n,) with its p-value.
    `noisy` says that other runs show noise of the sensor's own.
    """
    index = np.flatnonzero(np.isfinite(values).all(axis=1))
    if len(index) < 100:
        return []
    v, t = values[index], time_s[index]
    same = np.concatenate([[False], (np.diff(v, axis=0) == 0.0).all(axis=1)])
    runs = [(a - 1, b) for a, b in stretches(same)]
    if not runs:
        return []
    lengths = np.array([b - a for a, b in runs])
    read = t[~same] if same.mean() > 0.4 else t
    period = float(np.median(np.diff(read if len(read) > 1 else t)))
    out = []
    for (a, b), length in zip(runs, lengths, strict=True):
        duration = t[b - 1] - t[a]
        if duration < max(shortest_s, periods * period):
            continue
        # Stretches half as long or longer are of its own kind; the shorter ones show what chance and habit do.
        others = lengths[lengths < length / 2]
        habit = np.quantile(others, 0.99) if len(others) > 20 else 1
        repeat = (others - 1).sum() / len(v)
        p = float(min(1.0, len(v) * max(repeat, 1.0 / len(v)) ** (length / max(habit, 1))))
        if p > P_LIMIT or length < 8 * habit or may_stand(v, a, b, noisy):
            continue
        mask = np.zeros(len(values), bool)
        # The first of the repeated readings is a true one, but where it is a jump (to zero) by itself.
        mask[index[a] + int(not jumps_to(v, a)) : index[b - 1] + 1] = True
        out.append((mask, p))
    return out


def may_stand(values: np.ndarray, start: int, stop: int, noisy: bool) -> bool:
    """Whether columns (n, k) that repeat one reading from `start` to `stop` may truly have stood still.

    A sensor's own noise never does; `noisy` says that other runs show it. A simulator without noise hovers, or flies in
    a plane, with readings that are exactly constant, and leaves them without a jump.
    """
    outside = [values[: start + 1], values[stop:]]
    usual, bend = steps_and_bends(outside)
    if usual == 0.0:
        return not noisy
    if bend > SMOOTH * usual:
        return False
    jump = float(np.abs(values[stop] - values[stop - 1]).max()) if stop < len(values) else 0.0
    return jump < LEAST_JUMP * usual


def jumps_to(values: np.ndarray, start: int) -> bool:
    """Whether columns (n, k) come to the reading at `start` by a step far beyond their usual ones."""
    usual, _ = steps_and_bends([values[: start + 1]])
    return start > 0 and bool(np.abs(values[start] - values[start - 1]).max() > LEAST_JUMP * usual > 0)


def steps_and_bends(parts: list[np.ndarray]) -> tuple[float, float]:
    """Median size of the first and second differences of columns (n, k), where they move; 0 where they never do."""
    step, bend = [np.zeros(0)], [np.zeros(0)]
    for part in (p for p in parts if len(p) > 2):
        first, second = (np.abs(np.diff(part, n=n, axis=0)).max(axis=1) for n in (1, 2))
        step.append(first[first > 0])
        bend.append(second[first[1:] > 0])
    return tuple(float(np.median(x)) if len(x) else 0.0 for x in map(np.concatenate, (step, bend)))


def noisy_columns(recordings: RecordingSet) -> set[str]:
    """Columns that in some run show noise of their own."""

    def noisy(run: Run, name: str) -> bool:
        values = run.column(name)
        usual, bend = steps_and_bends([values[np.isfinite(values)][:, None]])
        return bend > SMOOTH * usual > 0

    names = [n for own in sensor_columns(recordings.vehicle).values() for n in own]
    return {n for n in names if any(run.has(n) and noisy(run, n) for run in recordings.runs)}


def standing_rotors(run: Run, vehicle: Vehicle, names: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Column to mask of samples in which a rotor reads (near) zero while the others carry the vehicle."""
    speed = run.array(names)
    out = {}
    usual = np.array([np.quantile(v[v > 0], 0.75) if (v > 0).any() else np.nan for v in speed.T])
    if not np.isfinite(usual).any():
        return out
    usual = np.where(np.isfinite(usual), usual, np.nanmedian(usual))
    top = float(np.median(usual))
    for i, name in enumerate(names):
        others = np.delete(speed / usual, i, axis=1)
        # Half of the others at work, and none of them standing: then the vehicle flies.
        flying = np.isfinite(others).any(axis=1)
        flying[flying] = (np.nanmedian(others[flying], axis=1) > 0.6) & (np.nanmin(others[flying], axis=1) > 0.3)
        if not np.isfinite(speed[flying, i]).any():
            continue
        read = speed[flying][:, np.isfinite(speed[flying]).any(axis=0)]
        thrust = np.nanquantile(speed[flying, i], 0.98) ** 2 / max(np.nanmedian(read, axis=0).max() ** 2, 1e-9)
        if thrust < IMPLAUSIBLE_THRUST and _balanced(vehicle, i):
            out[name] = np.isfinite(speed[:, i])
            continue
        zero = flying & (speed[:, i] < STANDING * top)
        sudden = np.zeros(len(zero), bool)
        for start, stop in stretches(zero):
            # A saturated motor may truly stand for a moment.
            if run.time_s[stop - 1] - run.time_s[start] < SHORTEST_STAND_S:
                continue
            # A rotor cannot stop and start within a sample or two: look at its readings just outside.
            near = np.concatenate([speed[max(start - 2, 0) : start, i], speed[stop : stop + 2, i]])
            low = np.nanmax(speed[start:stop, i])
            if low == 0.0 or (len(near) and np.nanmin(near) > 3 * max(low, 1e-9)):
                sudden[start:stop] = True
        if sudden.any():
            # Readings strewn between zeros are no better than the zeros.
            share = sudden[flying].mean()
            out[name] = np.isfinite(speed[:, i]) if share > LARGEST_UNTOUCHED_SHARE else sudden
    return out


def _balanced(vehicle: Vehicle, rotor: int) -> bool:
    """Whether hovering asks of this rotor a thrust that is not far below the largest."""
    positions = vehicle.rotor_positions_m()
    rows = np.stack([np.ones(len(positions)), positions[:, 0], positions[:, 1]])
    share = np.linalg.pinv(rows) @ np.array([1.0, 0.0, 0.0])
    return bool(share[rotor] > 0.8 * share.max())
