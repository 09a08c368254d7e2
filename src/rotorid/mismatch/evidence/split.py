"""Which runs are fitted and which are held out, where the set does not say.

About a third of the runs is held out, up to a half where that shares better what is done (in flight speeds along each
axis, turning, changes of the rotors, nearness of the ground, voltage; on a stand or bench loads along each axis, tilts,
each rotor, warmth). Of all choices the one is taken with the least cross-entropy between the shares of what is done
that are held out and fitted and one and two thirds. What one run does alone is fitted: an effect can only be found
there. Where choices are alike, the runs held out are spread evenly in time. Only what was done decides, never how well
a model describes it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations
from math import comb

import numpy as np

from rotorid.mismatch.evidence.motion import Segment
from rotorid.recordings import RecordingSet, Run, Split
from rotorid.recordings import columns as c

HELD_OUT_SHARE = 1 / 3
GAP_S = 2.0
"""Gap between the fitted and the held-out part of a single run: longer than any memory tested."""


def split_runs(recordings: RecordingSet) -> Split:
    """Training and held-out runs: as `split.yaml` says, else about a third held out.

    A single run is named on both sides: its last third is held out.
    """
    names = [run.name for run in recordings.runs]
    if recordings.held_out is not None:
        held = [n for n in names if n in recordings.held_out]
    elif len(names) == 1:
        time_s = recordings.runs[0].time_s
        border_s = time_s[0] + (time_s[-1] - time_s[0]) * (1 - HELD_OUT_SHARE)
        return Split((names[0],), (names[0],), float(border_s))
    else:
        held = [names[k] for k in _chosen_runs(recordings)]
    return Split(tuple(n for n in names if n not in held), tuple(held))


def training_rule(split: Split, segments: list[Segment]) -> Callable[[str, float], bool | None]:
    """Whether a block is fitted (True), held out (False) or in the gap between (None).

    Whole runs where there are several; of a single run the last third, after a gap of GAP_S.
    """
    if split.held_out != split.training:
        return lambda run, time_s: run in split.training
    border = split.border_s
    if border is None:
        start = min(s.motion.time_s[0] for s in segments)
        stop = max(s.motion.time_s[-1] for s in segments)
        border = start + (stop - start) * (1 - HELD_OUT_SHARE)

    def rule(run: str, time_s: float) -> bool | None:
        if abs(time_s - border) < GAP_S / 2:
            return None
        return bool(time_s < border)

    return rule


def parts_of(recordings: RecordingSet, split: Split) -> tuple[RecordingSet, RecordingSet]:
    """The set with its fitted runs alone, and with the runs held out; of a single run its two parts, a gap between."""
    if split.held_out != split.training:
        fitted, held = ([r for r in recordings.runs if r.name in names] for names in (split.training, split.held_out))
    else:
        (run,) = recordings.runs
        early = run.time_s < split.border_s - GAP_S / 2
        late = run.time_s >= split.border_s + GAP_S / 2
        fitted, held = ([replace(run, table=run.table[mask].reset_index(drop=True))] for mask in (early, late))
    return tuple(replace(recordings, runs=tuple(runs), held_out=()) for runs in (fitted, held))


def _chosen_runs(recordings: RecordingSet) -> tuple[int, ...]:
    """Numbers of the runs to hold out."""
    total = len(recordings.runs)
    count = max(1, round(total * HELD_OUT_SHARE))
    even = tuple(int((k + 0.5) * total / count) for k in range(count))
    if total < 3:
        return even
    groups = [g / g.sum() for g in _activity(recordings) if g.sum() > 0]
    # Share of what is done of some kind from which a run does it alone: it cannot be shared, and is fitted.
    most_of_a_kind = 2 / 3
    alone = {int(np.argmax(g)) for g in groups if g.max() > most_of_a_kind}
    shared = [g for g in groups if g.max() <= most_of_a_kind]

    least_on_a_side = 0.05  # Share of what is done of which a side of the split has hardly any: less is no worse.

    def score(choice: tuple[int, ...]) -> float:
        if alone.intersection(choice):
            return -np.inf
        held = np.array([share[list(choice)].sum() for share in shared])
        logs = [np.log(np.maximum(x, least_on_a_side)) for x in (held, 1.0 - held)]
        return float(np.sum(HELD_OUT_SHARE * logs[0] + (1.0 - HELD_OUT_SHARE) * logs[1])) / max(len(groups), 1)

    chosen = even
    worth_moving = 0.05  # Gain of a choice over the even one, nats, from which it is taken.
    for number in range(count, max(count, total // 2) + 1):
        best = max(_choices(total, number), key=score)
        if score(best) > score(chosen) + worth_moving:
            chosen = best
    return chosen


def _choices(total: int, count: int) -> list[tuple[int, ...]]:
    """Ways to take `count` of `total` runs: all of them, or as many drawn at random as are looked at."""
    most_choices = 500
    if comb(total, count) <= most_choices:
        return list(combinations(range(total), count))
    draw = np.random.default_rng(0)
    return [tuple(sorted(int(k) for k in draw.permutation(total)[:count])) for _ in range(most_choices)]


def _kinds_of_activity(recordings: RecordingSet) -> list[tuple[str, ...]]:
    """Groups of columns that show what is done: in flight each group is one kind, on an instrument each column."""
    count, flight = recordings.vehicle.rotor_count, recordings.vehicle.kind == "flight"
    families = (c.rotor_columns(f, count) for f in ("rotor_speed", "rotor_command", "throttle"))
    rotors = next((n for n in families if n and all(run.has(*n) for run in recordings.runs)), ())
    if flight:
        groups = (c.VELOCITY[:2], c.VELOCITY[2:], c.ANGULAR_VELOCITY, (c.BATTERY_VOLTAGE,), rotors)
        return [g for g in groups if g]
    return [(name,) for name in (*c.REFERENCE_FORCE, *c.MOUNT, *rotors, c.BATTERY_VOLTAGE, c.TEMPERATURE)]


def _activity(recordings: RecordingSet) -> list[np.ndarray]:
    """How much of what is done each run holds, (runs,) of each kind: energies about the mean of all runs.

    In addition to `_kinds_of_activity` nearness of the ground, and time itself.
    """
    vehicle, kinds = recordings.vehicle, _kinds_of_activity(recordings)
    out = [np.array([r.time_s[-1] - r.time_s[0] for r in recordings.runs])]
    for names in kinds:
        if all(run.has(*names) for run in recordings.runs):
            shares = [_energies([run.column(n) for run in recordings.runs], recordings.runs) for n in names]
            out.append(
                np.mean([x / x.sum() for x in shares if x.sum() > 0] or [np.zeros(len(recordings.runs))], axis=0)
            )
    heights = [_height_of(run, vehicle.ground_z_m) for run in recordings.runs]
    if all(h is not None for h in heights):
        near_ground_m = 0.3
        out.append(_energies([1.0 / (near_ground_m + np.maximum(h, 0.0)) ** 2 for h in heights], recordings.runs))
    return out


def _height_of(run: Run, ground_z_m: float | None) -> np.ndarray | None:
    """Height above ground (n,), m, measured or from the position; None where neither is known."""
    if run.has("height_m"):
        return run.column("height_m")
    if ground_z_m is None or not run.has("position_z_m"):
        return None
    return ground_z_m - run.column("position_z_m")


def _energies(parts: list[np.ndarray], runs: tuple[Run, ...]) -> np.ndarray:
    """Of one quantity in each run its squares about the mean of all, times the run's length, (runs,)."""
    middle = np.nanmean(np.concatenate(parts))
    return np.array(
        [np.nanmean((x - middle) ** 2) * (r.time_s[-1] - r.time_s[0]) for x, r in zip(parts, runs, strict=True)]
    )
