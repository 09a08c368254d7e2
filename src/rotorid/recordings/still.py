"""Readings that stand still while others go on: nothing was read there.

On a stand or bench a reading that keeps one value in every run; in flight a sensor that repeats one reading for a
second or more.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rotorid.io.text.names import listed
from rotorid.recordings import columns as c
from rotorid.recordings.doubts import Doubt
from rotorid.recordings.held import (
    SHORTEST_FREEZE_PERIODS,
    SHORTEST_FREEZE_S,
    SHORTEST_GAP_PERIODS,
    SHORTEST_GAP_S,
    at_the_end,
    contradiction,
    held,
    noisy_columns,
    standing_together,
)
from rotorid.recordings.run import RecordingSet, Run
from rotorid.recordings.sufficient import SENSORS, compared_readings, rotor_groups
from rotorid.recordings.vehicle import Vehicle

STILL_S = 1.0
"""A sensor of a flight that repeats one reading for so long is named."""
GO_ON = 0.5
"""Share of the readings in which the other rotors' columns change while one stands still."""


def still_sensors(recordings: RecordingSet) -> Iterator[Doubt]:
    """One doubt for each sensor of a flight that stands still for a time, with the first run and its seconds."""
    runs, vehicle = recordings.runs, recordings.vehicle
    if vehicle.kind != "flight":
        return
    groups = (*SENSORS, *rotor_groups(vehicle).values())
    noisy = noisy_columns(runs, [n for names in groups for n in names])
    found: dict[tuple[str, ...], list[tuple[str, float, float]]] = {}
    for run in runs:
        for names in groups:
            if not names or not run.has(*names):
                continue
            rotors = names not in SENSORS
            whole = standing_together(run, vehicle, names) if rotors else _held(run, vehicle, names, noisy)
            masks = {names: [mask for mask, _ in whole]}
            if rotors and not whole:
                masks = {(n,): _alone(run, vehicle, n, names, noisy) for n in names}
            for own, stands in masks.items():
                times = [(float(run.time_s[m][0]), float(run.time_s[m][-1])) for m in stands]
                for start, stop in times:
                    if stop - start >= STILL_S:
                        found.setdefault(own, []).append((run.name, start, stop))
    for names, where in found.items():
        run, start, stop = where[0]
        more = f" and in {len(where) - 1} more stretches" if len(where) > 1 else ""
        yield Doubt(
            names[0],
            f"{f'{names[0]} to {names[-1]} stand' if len(names) > 1 else f'{names[0]} stands'} still in {run} from "
            f"{start:.2f} to {stop:.2f} s{more} while the vehicle flies on, expected at least the noise of a sensor: "
            "its driver or its link stopped, and nothing was read there",
            stops=False,
        )


def _held(run: Run, vehicle: Vehicle, names: tuple[str, ...], noisy: set[str]) -> list[tuple[np.ndarray, float]]:
    """Stretches in which all columns of a sensor repeat one reading."""
    shortest = (
        (SHORTEST_FREEZE_S, SHORTEST_FREEZE_PERIODS) if len(names) > 1 else (SHORTEST_GAP_S, SHORTEST_GAP_PERIODS)
    )
    alive = not noisy.isdisjoint(names)
    return held(run.time_s, run.array(names), *shortest, alive, contradiction(run, vehicle, names))


def _alone(run: Run, vehicle: Vehicle, name: str, names: tuple[str, ...], noisy: set[str]) -> list[np.ndarray]:
    """Stretches in which one rotor stands still, not at the end of its range, while all others go on."""
    others = [run.column(n) for n in names if n != name]
    out = []
    for mask, _ in _held(run, vehicle, (name,), noisy):
        read = [v[mask][np.isfinite(v[mask])] for v in others]
        go_on = [len(v) > 1 and float((np.diff(v) != 0).mean()) > GO_ON for v in read]
        if go_on and all(go_on) and not at_the_end(run.column(name), mask):
            out.append(mask)
    return out


def still_readings(recordings: RecordingSet) -> Iterator[Doubt]:
    """One doubt for all such readings; it stops a verdict where no reading of the instrument changes."""
    runs, vehicle = recordings.runs, recordings.vehicle
    if vehicle.kind == "flight":
        return
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
