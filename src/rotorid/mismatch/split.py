"""Which runs are fitted and which are held out, where the set does not say.

About a third of the runs is held out. An effect can be shown on runs that excite it alone, so of all choices the one is
taken in which the runs held out and those fitted share what the flights do (speeds along each axis, turning, changes of
the rotors, nearness of the ground, voltage); where choices are alike, the runs held out are spread evenly in time. Only
what was flown decides, never how well a model describes it.
"""

from __future__ import annotations

from itertools import combinations
from math import comb

import numpy as np

from rotorid.recordings import RecordingSet, Run, Split
from rotorid.recordings import columns as c

HELD_OUT_SHARE = 1 / 3
MOST_CHOICES = 500
WORTH_MOVING = 0.05
"""Gain of a choice over the even one, as a share of the best possible score, from which it is taken."""
NEAR_GROUND_M = 0.3


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
        held = [names[k] for k in chosen_runs(recordings)]
    return Split(tuple(n for n in names if n not in held), tuple(held))


def chosen_runs(recordings: RecordingSet) -> tuple[int, ...]:
    """Numbers of the runs to hold out."""
    total = len(recordings.runs)
    count = max(1, round(total * HELD_OUT_SHARE))
    even = tuple(int((k + 0.5) * total / count) for k in range(count))
    if recordings.vehicle.kind != "flight" or total < 3 or comb(total, count) > MOST_CHOICES:
        return even
    table = activity(recordings)
    table = table[:, table.sum(axis=0) > 0]
    if not table.shape[1]:
        return even
    share = table / table.sum(axis=0)

    def score(choice: tuple[int, ...]) -> float:
        held = share[list(choice)].sum(axis=0)
        return float(np.mean(np.minimum(held / HELD_OUT_SHARE, 1) + np.minimum((1 - held) / (1 - HELD_OUT_SHARE), 1)))

    best = max(combinations(range(total), count), key=score)
    return best if score(best) > score(even) + 2 * WORTH_MOVING else even


def activity(recordings: RecordingSet) -> np.ndarray:
    """How much of everything that is flown each run holds, (runs, quantities): energies about the mean of all runs."""
    count = recordings.vehicle.rotor_count
    groups = [*c.VELOCITY, *c.ANGULAR_VELOCITY, "battery_voltage_v"]
    for family in ("rotor_speed", "rotor_command", "throttle"):
        names = c.rotor_columns(family, count)
        if names and all(run.has(*names) for run in recordings.runs):
            groups += names
            break
    columns = [[run.column(n) for run in recordings.runs] for n in groups if all(r.has(n) for r in recordings.runs)]
    out = [energies(parts, recordings.runs) for parts in columns]
    if all(run.has("height_m") for run in recordings.runs):
        near = [1.0 / (NEAR_GROUND_M + np.maximum(run.column("height_m"), 0.0)) ** 2 for run in recordings.runs]
        out.append(energies(near, recordings.runs))
    return np.array(out).T if out else np.zeros((len(recordings.runs), 0))


def energies(parts: list[np.ndarray], runs: tuple[Run, ...]) -> np.ndarray:
    """Of one quantity in each run its squares about the mean of all, times the run's length, (runs,)."""
    middle = np.nanmean(np.concatenate(parts))
    return np.array(
        [np.nanmean((x - middle) ** 2) * (r.time_s[-1] - r.time_s[0]) for x, r in zip(parts, runs, strict=True)]
    )
