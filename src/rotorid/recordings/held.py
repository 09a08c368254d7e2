"""Stretches in which a sensor repeats one reading: looked for by `check`, and before any analysis."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence

import numpy as np

from rotorid.recordings import columns as c
from rotorid.recordings.run import Run, stretches
from rotorid.recordings.sufficient import driven_by
from rotorid.recordings.vehicle import Vehicle

OTHERS_GO_ON = 0.5
"""Share of the readings in which every other rotor's column changes while one stands still."""
SHORTEST_GAP_S = 0.3
"""A held stretch counts from this length on; two that are closer are one."""
SHORTEST_GAP_PERIODS = 12
"""It counts from this many of the sensor's own periods on, a missing one as well."""
SHORTEST_FREEZE_PERIODS = 8
SHORTEST_FREEZE_S = 0.04
"""Where all columns of a sensor stand still at once, a shorter stretch is no chance."""
_SMOOTH = 0.3
"""Second differences of a reading without noise are this share of its first ones at most; white noise has 1.7."""
_LEAST_JUMP = 5.0
"""A jump is this many of the usual steps of a reading: what was held jumps back at its end."""

_LONG_S = 2.0
"""Readings without noise that repeat for so long did not stand truly where what they must follow moves."""
_ON_GRID = 0.99
_OFF_GRID = 0.02
"""Distance to the grid, as a share of a step, that still counts as on it."""
_BLOCK_S = 0.2
_BEYOND_NOISE = 3.0
"""Times the scatter of means over `_BLOCK_S` by noise alone from which a column moves."""
_ROUNDING = 1e-9
_DRIVEN = 0.5
"""Share of what rotors are usually given from which on a vehicle flies."""
_FOLLOWED = {
    c.QUATERNION: c.ANGULAR_VELOCITY,
    c.ANGULAR_VELOCITY: c.QUATERNION,
    c.VELOCITY: c.SPECIFIC_FORCE,
    c.POSITION: c.VELOCITY,
}
"""To the columns of a sensor those without whose changes it cannot change, nor stand where they do."""


def held(
    time_s: np.ndarray,
    values: np.ndarray,
    shortest_s: float = SHORTEST_GAP_S,
    periods: int = SHORTEST_GAP_PERIODS,
    noisy: bool = False,
    contradicted: Callable[[np.ndarray], bool] | None = None,
) -> list[tuple[np.ndarray, float]]:
    """Stretches in which changing columns (n, k) all repeat one reading far longer than chance and habit allow.

    At least `shortest_s` seconds and `periods` of the sensor's own periods long. Each as a mask (n,) with its p-value.
    `noisy` says that other runs show noise of the sensor's own; `contradicted`, whether other columns say of a mask
    (n,) that the readings cannot have stood.
    """
    by_chance = 1e-9  # p-value above which repeated readings may be chance.
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
        if p > by_chance or length < 8 * habit:
            continue
        mask = np.zeros(len(values), bool)
        # The first of the repeated readings is a true one, but where it is a jump (to zero) by itself.
        usual, _ = _steps_and_bends([v[: a + 1]])
        jumps = a > 0 and np.abs(v[a] - v[a - 1]).max() > _LEAST_JUMP * usual > 0
        mask[index[a] + int(not jumps) : index[b - 1] + 1] = True
        if _may_stand(v, a, b, noisy) and not (duration >= _LONG_S and contradicted is not None and contradicted(mask)):
            continue
        out.append((mask, p))
    return out


def held_in(run: Run, vehicle: Vehicle, names: Sequence[str], noisy: Collection[str]) -> list[tuple[np.ndarray, float]]:
    """Stretches in which all columns of a sensor of a flight repeat one reading, as `held` has them.

    `noisy` columns show in some run noise of their own (`noisy_columns`).
    """
    shortest = (
        (SHORTEST_FREEZE_S, SHORTEST_FREEZE_PERIODS) if len(names) > 1 else (SHORTEST_GAP_S, SHORTEST_GAP_PERIODS)
    )
    alive, against = any(n in noisy for n in names), contradiction(run, vehicle, names)
    return held(run.time_s, run.array(tuple(names)), *shortest, alive, against)


def _may_stand(values: np.ndarray, start: int, stop: int, noisy: bool) -> bool:
    """Whether columns (n, k) that repeat one reading from `start` to `stop` may truly have stood still.

    A sensor's own noise never does; `noisy` says that other runs show it. A simulator without noise hovers, or flies in
    a plane, with readings that are exactly constant, and leaves them without a jump.
    """
    outside = [values[: start + 1], values[stop:]]
    usual, bend = _steps_and_bends(outside)
    if usual == 0.0:
        return not noisy
    if bend > _SMOOTH * usual:
        return False
    jump = float(np.abs(values[stop] - values[stop - 1]).max()) if stop < len(values) else 0.0
    return jump < _LEAST_JUMP * usual


def _steps_and_bends(parts: list[np.ndarray]) -> tuple[float, float]:
    """Median size of the first and second differences of columns (n, k), where they move; 0 where they never do."""
    step, bend = [np.zeros(0)], [np.zeros(0)]
    for part in (p for p in parts if len(p) > 2):
        first, second = (np.abs(np.diff(part, n=n, axis=0)).max(axis=1) for n in (1, 2))
        step.append(first[first > 0])
        bend.append(second[first[1:] > 0])
    return tuple(float(np.median(x)) if len(x) else 0.0 for x in map(np.concatenate, (step, bend)))


def usual_change(values: np.ndarray) -> float:
    """Median change of a column (n,) from one reading to another one, as a share of its range: small for noise, large
    for the steps of a load. Infinite where it never changes."""
    known = values[np.isfinite(values)]
    changes = np.abs(np.diff(known))
    changes = changes[changes > 0]
    return float(np.median(changes) / np.ptp(known)) if len(changes) else np.inf


def step_of(values: np.ndarray) -> float:
    """Step of a grid that readings lie on, 0.0 if they lie on none.

    The step is the smallest difference between two different values that is not rounding; nearly every value must
    then lie on the grid.
    """
    values = values[np.isfinite(values)]
    levels = np.unique(np.round(values, 9))
    if len(levels) < 3 or len(levels) > 0.5 * len(values):
        return 0.0
    gaps = np.diff(levels)
    step = float(np.min(gaps[gaps > 1e-3 * np.median(gaps)]))
    # Refine: the mean of all gaps in units of the step.
    step = float(np.sum(gaps) / np.sum(np.round(gaps / step)))
    off = np.abs(gaps / step - np.round(gaps / step))
    return step if np.mean(off < _OFF_GRID) >= _ON_GRID else 0.0


def noisy_columns(runs: Iterable[Run], names: Iterable[str]) -> set[str]:
    """Those of the named columns that in some run show noise of their own."""

    def noisy(run: Run, name: str) -> bool:
        values = run.column(name)
        usual, bend = _steps_and_bends([values[np.isfinite(values)][:, None]])
        return bend > _SMOOTH * usual > 0

    return {n for n in names if any(run.has(n) and noisy(run, n) for run in runs)}


def contradiction(run: Run, vehicle: Vehicle, names: Sequence[str]) -> Callable[[np.ndarray], bool]:
    """Whether columns of a flight cannot have stood still where a mask says so, by what they must follow.

    Rotors follow what the inertial sensors show, one of them the others; at the end of its range a rotor may stand.
    """
    names = tuple(names)
    kind = c.rotor_number(names[0])
    if kind is None:
        others = driven_by(run, vehicle) if names == c.SPECIFIC_FORCE else _FOLLOWED.get(names, ())
    elif len(names) > 1:
        others = (*c.SPECIFIC_FORCE, *c.ANGULAR_VELOCITY)
    else:
        others = tuple(n for n in c.rotor_columns(kind[0], vehicle.rotor_count) if n != names[0])

    def contradicted(mask: np.ndarray) -> bool:
        at_end = kind is not None and all(at_the_end(run.column(n), mask) for n in names)
        return not at_end and any(moves(run.time_s[mask], run.column(n)[mask]) for n in others if run.has(n))

    return contradicted


def at_the_end(values: np.ndarray, mask: np.ndarray) -> bool:
    """Whether what a column (n,) repeats where a mask says so is the least or the most that it holds of several."""
    value = values[mask][np.isfinite(values[mask])][-1:]
    low, high = np.nanmin(values), np.nanmax(values)
    return bool(len(value)) and low < high and value[0] in (low, high)


def moves(time_s: np.ndarray, values: np.ndarray) -> bool:
    """Whether a column (n,) changes by more than its noise: by means over `_BLOCK_S`, against the scatter in them."""
    known = np.isfinite(values)
    time_s, values = time_s[known], values[known]
    if len(values) < 10:
        return False
    block = ((time_s - time_s[0]) / _BLOCK_S).astype(int)
    count = np.bincount(block)
    full = count > 0.5 * count.max()
    means = np.bincount(block, values)[full] / count[full]
    scatter = np.std(values - (np.bincount(block, values) / np.maximum(count, 1))[block])
    least = max(_BEYOND_NOISE * scatter / np.sqrt(np.median(count[full])), _ROUNDING * np.abs(values).max())
    return full.sum() > 4 and bool(np.std(means) > least)


def standing_together(run: Run, vehicle: Vehicle, names: tuple[str, ...]) -> list[tuple[np.ndarray, float]]:
    """Stretches of at least `_LONG_S` in which all commands of one kind stand still in flight: the log of them stopped.

    On the ground they stand still, too; as masks (n,) with their p-values.
    """
    contradicted, given = contradiction(run, vehicle, names), run.array(names).mean(axis=1)
    found = held(run.time_s, run.array(names), SHORTEST_FREEZE_S, SHORTEST_FREEZE_PERIODS, True, contradicted)

    def driven(mask: np.ndarray) -> bool:
        """Whether rotors are given in a mask (n,) at least half of what they usually are elsewhere, and something."""
        inside, outside = given[mask & np.isfinite(given)], given[~mask & np.isfinite(given)]
        usual = float(np.median(outside)) if len(outside) else 0.0
        return bool(len(inside)) and float(inside.mean()) > _DRIVEN * usual

    return [(m, p) for m, p in found if np.ptp(run.time_s[m]) >= _LONG_S and driven(m) and contradicted(m)]
