"""Single wrong readings of a sensor: bits lost on a serial line, a telemetry frame that reads 0 or double, lost pulses.

Spikes are few, alone or in pairs, and far from the readings before and after. What a fast motion or a vibration gives
changes with its neighbours and differs from spikes in that there is no gap between usual and far. The points of a rotor
test whose speed sensor lost pulses are found by their thrust.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from rotorid.recordings import columns as c
from rotorid.recordings.run import RecordingSet, Run

_FAR = 10.0
"""Standard deviations of the readings about their neighbours from which one is a spike."""
_NEAR = 4.0
"""Fewer readings than spikes lie between this and `_FAR`, or the sensor's noise is what makes them."""
_MOST = 0.1
"""A sensor with a larger share of far readings is no sensor with spikes."""
_NEIGHBOURS = 3
"""Readings on each side whose medians a spike is far from: two of three may be spikes themselves."""
_AROUND = 31
"""Readings over which the scatter is local: a burst of vibration is none of spikes."""
_FINEST = 1e-3
"""Share of a sensor's usual span below which its scatter is not believed."""
_LEAST_READINGS = 60
_LEAST_SPIKES = 3
"""Fewer in all runs may be what a vehicle does once: a bump, a touch of the ground."""
_REPEATED = 0.1
"""Share of the spikes that one value must have to be named."""
_TOO_SLOW = 1.35
"""A point whose F/ω² exceeds the run's median by this factor has lost part of its speed pulses.

An offset of the balance or a curve that bends makes the low points' F/ω² smaller, not larger, in these data,
so the rule is one-sided: it must not remove what the offset explains.
"""


def without_spikes(recordings: RecordingSet) -> RecordingSet:
    """The set with spikes of its sensors made empty cells; a sentence in `left_out` for each column that had some."""
    speeds = c.rotor_columns("rotor_speed", recordings.vehicle.rotor_count)
    names = (*c.FORCE, *c.MOMENT, *c.SPECIFIC_FORCE, *c.ANGULAR_VELOCITY, *c.POSITION, *c.VELOCITY, *speeds, c.HEIGHT)
    masks = {(run.name, n): spikes(run.column(n)) for run in recordings.runs for n in names if run.has(n)}
    counts = {n: sum(int(mask.sum()) for (_, column), mask in masks.items() if column == n) for n in names}
    masks = {(run, n): mask for (run, n), mask in masks.items() if mask.any() and counts[n] >= _LEAST_SPIKES}
    if not masks:
        return recordings
    runs = []
    for run in recordings.runs:
        clean = {n: np.where(masks[run.name, n], np.nan, run.column(n)) for n in names if (run.name, n) in masks}
        runs.append(replace(run, table=run.table.assign(**clean)) if clean else run)
    said = [_sentence(recordings.runs, n, masks) for n in names if any(column == n for _, column in masks)]
    return replace(recordings, runs=tuple(runs), left_out=(*recordings.left_out, *said))


def spikes(values: np.ndarray) -> np.ndarray:
    """Mask of the spikes among the readings of one sensor (n,); NaN where there is no reading."""
    found = np.zeros(len(values), bool)
    known = np.flatnonzero(np.isfinite(values))
    if len(known) < _LEAST_READINGS:
        return found
    x = values[known]
    windows = np.lib.stride_tricks.sliding_window_view(x, _NEIGHBOURS)
    medians = np.median(windows, axis=1)
    inner = slice(_NEIGHBOURS, len(x) - _NEIGHBOURS)
    rise, fall = x[inner] - medians[: len(x) - 2 * _NEIGHBOURS], x[inner] - medians[_NEIGHBOURS + 1 :]
    size = np.where(np.sign(rise) == np.sign(fall), np.minimum(np.abs(rise), np.abs(fall)), 0.0)
    scatter = _around(np.abs(rise + fall) / 2) * 1.4826
    scatter = np.maximum(scatter, _FINEST * float(np.subtract(*np.quantile(x, [0.95, 0.05]))))
    size -= 2 * _around(np.maximum(np.abs(rise), np.abs(fall)))  # what moves fast turns round fast
    far = _alone(size > _FAR * scatter, size, x[inner])
    between = (size > _NEAR * scatter) & (size <= _FAR * scatter)
    if scatter.min() > 0 and between.sum() < far.sum() <= _MOST * len(x):
        found[known[inner][far]] = True
    return found


def _around(sizes: np.ndarray) -> np.ndarray:
    """The median of sizes (n,) around each of them, or of all where that is more."""
    local = pd.Series(sizes).rolling(_AROUND, center=True, min_periods=_AROUND // 2).median()
    return np.fmax(local.to_numpy(), np.median(sizes))


def _alone(far: np.ndarray, size: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Far readings (n,) that are far from the nearest others on both sides, too: no tops of pulses."""
    near = np.flatnonzero(~far)
    place = np.searchsorted(near, np.flatnonzero(far))
    nearest = x[near[np.maximum(place - 1, 0)]], x[near[np.minimum(place, len(near) - 1)]]
    out = far.copy()
    out[far] = np.minimum(*(np.abs(x[far] - b) for b in nearest)) > size[far] / 2
    return out


def _sentence(runs: tuple[Run, ...], name: str, masks: dict[tuple[str, str], np.ndarray]) -> str:
    """How many readings of a column are spikes, and which values they repeat."""
    there = [run for run in runs if run.has(name)]
    read = sum(int(np.isfinite(run.column(name)).sum()) for run in there)
    values = np.concatenate([run.column(name)[masks[run.name, name]] for run in there if (run.name, name) in masks])
    often = pd.Series([f"{v:.3g}" for v in values]).value_counts()
    often = [value for value, count in often.items() if count >= max(_REPEATED * len(values), 3)]
    repeated = f", most of them at {', '.join(sorted(often, key=float))}" if often else ""
    return (
        f"{name}: {len(values)} readings ({100 * len(values) / read:.2g} %) are spikes, single readings far from "
        f"those before and after them{repeated}: left out."
    )


def lost_speed(speed_rad_s: np.ndarray, thrust_n: np.ndarray) -> np.ndarray:
    """Points that turn but whose speed is too low for their thrust, shape (n,), bool."""
    turning = speed_rad_s > 0
    if not turning.any():
        return turning
    ratio = np.where(turning, thrust_n, 0.0) / np.where(turning, speed_rad_s, 1.0) ** 2
    return turning & (ratio > _TOO_SLOW * np.median(ratio[turning]))
