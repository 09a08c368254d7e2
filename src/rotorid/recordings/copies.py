"""Runs that hold the same samples: a run held out proves nothing if a fitted one repeats it.

Two recordings of the same manoeuvre agree in what was done and differ in the noise of every sensor. Samples whose
readings are equal to the last digit, whatever their time stamps, are a copy. A copy that was rounded or scaled anew is
found by the noise itself: second differences of short blocks, correlated with every place of the other run.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd
from scipy.signal import fftconvolve

from rotorid.recordings import columns as c
from rotorid.recordings.doubts import Doubt
from rotorid.recordings.run import RecordingSet, Run

NOISY = (*c.SPECIFIC_FORCE, *c.ANGULAR_VELOCITY, *c.FORCE, *c.MOMENT)
"""Columns with white noise of their own; commands and loads may repeat truly, what a filter made is smooth."""
LEAST_EQUAL, LEAST_NOISY = 2, 3
"""Columns that must agree: to the last digit, or in their noise."""
LEAST_ROWS, LEAST_SHARE = 20, 0.05
"""Equal samples, and their share of the shorter run, from which two runs overlap."""
BY_CHANCE = 3.0
"""So many times as often as within one run: readings in coarse steps repeat by themselves."""
BLOCK, BLOCKS, JUMP = 256, 5, 4.0
SAME_NOISE = 0.95
"""Correlation of second differences that independent noise does not reach in a block."""
MOST_CORRELATED = 5_000_000
"""Samples by runs to correlate with, which take some seconds."""


def copies(recordings: RecordingSet) -> tuple[Doubt, ...]:
    """One doubt for each run that repeats samples of an earlier one."""
    columns = dict.fromkeys(n for run in recordings.runs for n in run.table.columns if n != c.TIME)
    names = [n for n in columns if all(run.has(n) for run in recordings.runs)]
    if len(recordings.runs) < 2 or len(names) < LEAST_EQUAL:
        return ()
    found: dict[str, tuple[str, str]] = {}
    for first, second, share, shift_s in equal_samples(recordings.runs, names):
        later = f", {abs(shift_s):.4g} s {'later' if shift_s > 0 else 'earlier'}" if abs(shift_s) > 1e-6 else ""
        found.setdefault(second, (first, f"{share:.0%} of its samples are equal to the last digit{later}"))
    rest = [run for run in recordings.runs if run.name not in found]
    noisy = [name for name in names if name in NOISY]
    if (
        len(noisy) >= LEAST_NOISY
        and len(rest) > 1
        and sum(len(run.table) for run in rest) * len(rest) <= MOST_CORRELATED
    ):
        for first, second in same_noise(rest, noisy):
            found.setdefault(second, (first, "even the noise of its sensors is the same"))
    return tuple(
        Doubt(
            second,
            f"Run {second} repeats run {first}: {how}; such a run confirms nothing that was fitted to the other, leave "
            "one of them out.",
            stops=False,
        )
        for second, (first, how) in found.items()
    )


def equal_samples(runs: tuple[Run, ...], names: list[str]) -> Iterator[tuple[str, str, float, float]]:
    """Pairs of runs with equal samples: names, share of the shorter run, and how much later in the second, s."""
    tables, repeated = [], []
    for number, run in enumerate(runs):
        values = run.table[names]
        known = (values.notna().sum(axis=1) >= LEAST_EQUAL).to_numpy()
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
        least = max(LEAST_SHARE, BY_CHANCE * max(repeated[a], repeated[b]))
        if len(equal) >= LEAST_ROWS and share >= least:
            yield runs[a].name, runs[b].name, share, float((equal["time_s"] - equal["time_s_first"]).median())


def same_noise(runs: list[Run], names: list[str]) -> Iterator[tuple[str, str]]:
    """Names of pairs of runs of which a block of the first lies somewhere in the second."""
    noises = [_noise(run, names) for run in runs]
    for i, first in enumerate(noises):
        for j in range(i + 1, len(noises)):
            if any(_lies_in(block, noises[j]) for block in _blocks(first)):
                yield runs[i].name, runs[j].name


def _noise(run: Run, names: list[str]) -> np.ndarray:
    """Second differences of the rows that are whole, clipped to a few of their usual size, (n, k)."""
    values = run.array(tuple(names))
    noise = np.diff(values[np.isfinite(values).all(axis=1)], n=2, axis=0)
    if not len(noise):
        return noise
    # A single jump would correlate with every other jump.
    most = JUMP * np.median(np.abs(noise), axis=0)
    return np.clip(noise, -most, most)


def _blocks(noise: np.ndarray) -> Iterator[np.ndarray]:
    """Short blocks spread over a run, (BLOCK, k)."""
    if len(noise) >= BLOCK:
        for start in np.unique(np.linspace(0, len(noise) - BLOCK, BLOCKS).astype(int)):
            yield noise[start : start + BLOCK]


def _lies_in(block: np.ndarray, noise: np.ndarray) -> bool:
    """Whether at one place of `noise` enough columns of the block correlate as only a copy does."""
    if len(noise) < BLOCK:
        return False
    alike = np.zeros(len(noise) - BLOCK + 1, int)
    for own, other in zip(block.T, noise.T, strict=True):
        energy = float(own @ own)
        if energy == 0.0:
            continue
        total = np.concatenate([[0.0], np.cumsum(other**2)])
        there = total[BLOCK:] - total[:-BLOCK]
        product = fftconvolve(other, own[::-1], mode="valid")
        # Where the other run stands still there is no noise to compare.
        alike += (there > 0.01 * energy) & (product > SAME_NOISE * np.sqrt(energy * np.maximum(there, 0.0)))
    return bool((alike >= LEAST_NOISY).any())
