"""Readings mended before any analysis: spikes emptied, sensors that are read at random on an even grid of their own.

Spikes (bits lost on a serial line, a telemetry frame that reads 0 or double, lost pulses) are few, alone or in pairs,
and far from the readings before and after. What a fast motion or a vibration gives changes with its neighbours: there
is no gap between usual and far. The points of a rotor test whose speed sensor lost pulses are found by their thrust.

Where cells are empty by chance (a radio link, loggers merged by time), steps of three or five rows are as usual as
those of one, and a rule in usual steps cuts the flight at each longer one. Such a sensor is taken at its own rate: a
cubic spline with even knots is fitted to all its readings by least squares, which keeps the band below half the rate of
the knots and averages the noise above it. Its values at the knots are the new readings. Speeds and commands of rotors,
which jump, are joined by straight lines. What this costs is stated: the rate, its band, and the noise there. Where
packets are lost several at a time, hardly a stretch is left in which every sensor has readings; there a sensor that is
faster than the analysis needs has the rate that the analysis needs, whose periods bridge such gaps. A sensor that comes
evenly stays as it is, and so does a hole of several of its own periods.

But rotors that come evenly and seldom (telemetry of 4 or 10 Hz) are joined by a curve of their own band: straight lines
take a tenth off a motion at a fifth of their rate, which the other sensors keep, and the difference gets names.

Jumps of attitude, position and velocity that no motion makes (a tracker that takes a pattern of markers for another of
its poses, an estimator set anew) and the signs of rotor speeds are seen to before all this.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace

import numpy as np
import pandas as pd
import scipy

from rotorid.io.text.wording import listed
from rotorid.recordings import columns as c
from rotorid.recordings.run import RecordingSet, Run, means_of, stretches

_FAR = 10.0
"""Standard deviations of the readings about their neighbours from which one is a spike."""
_NEAR = 4.0
"""Fewer readings than spikes lie between this and `_FAR`, or the sensor's noise is what makes them."""
_MOST = 0.1
"""A sensor with a larger share of far readings is no sensor with spikes."""
_LEAST_OF_SPIKES = 60
_LEAST_SPIKES = 3
"""Fewer in all runs may be what a vehicle does once: a bump, a touch of the ground."""
_REPEATED = 0.1
"""Share of the spikes that one value must have to be named."""
_MEASURED = {c.QUATERNION: 1e3, c.POSITION: 1e7, c.VELOCITY: 1e4}
"""Largest size of a reading that is one."""
_HOLE_PERIODS = 6.0
"""Where a sensor gives nothing for longer than so many of its own periods, the flight is cut in two."""
_LONGEST_USUAL = 10.0
"""Steps longer than so many usual ones are holes, and count for no rate."""
_COVERED = 0.95
"""Share of the steps between readings that a step of the new grid is as long as."""
_LONG_STEP, _SCATTERED = 1.5, 0.15
"""A sensor is scattered where more than such a share of its steps is longer than so many usual ones."""
LEAST_STRETCH_S, LEAST_SINGLE_S = 3.0, 9.0
"""A stretch that can be used lasts so long; of a single run, a third of which is held out."""
_RATE_ENOUGH_HZ = 50.0
"""What the analysis needs: its highest cutoff, 20 Hz, over USED_BAND."""
_USED_BAND = 0.4
"""Highest frequency, over the rate, that the analysis uses of a sensor."""
_MOSTLY_FRESH, _EVEN = 0.5, 0.2
"""Share of the rows that bring a new reading, below which a sensor is repeated; and how far from the usual step one is
even."""
_LINES_A_PERIOD = 4.0
"""Values a period on straight lines between readings: few would cut the corners off."""
_LEAST_READINGS = 20
LEAST_VALUES = 4
"""Complete readings from which a sensor counts as recorded."""


def on_own_rates(recordings: RecordingSet) -> RecordingSet:
    """Flights whose scattered sensors have an even grid, the same in every run; a sentence for each in `left_out`.

    A set that the rule of usual steps cuts at holes alone stays as it is, unless they are everywhere.
    """
    torn = 0.8  # Share of a flight in long stretches in which every sensor has readings: below it, gaps are bridged.
    if recordings.vehicle.kind != "flight":
        return recordings
    rotors = list(recordings.vehicle.rotor_groups().values())
    recordings = _with_slow_joined(recordings, rotors)
    sensors = (*rotors, c.POSITION, c.VELOCITY, c.QUATERNION, c.ANGULAR_VELOCITY, c.SPECIFIC_FORCE, (c.HEIGHT,))
    there = {names: [run for run in recordings.runs if _is_read(run, names)] for names in sensors}
    scattered = [names for names, runs in there.items() if any(is_scattered(run, names) for run in runs)]
    by_chance = any(_cut_by_chance(run, names) for names in scattered for run in there[names])
    own = {n: max(own_period_s(run, n) for run in there[n]) for n in (scattered if by_chance else ())}
    even = _with_grids(recordings, own, rotors)
    read = [names for names, runs in there.items() if runs]
    long_s = LEAST_SINGLE_S if len(even.runs) == 1 else LEAST_STRETCH_S
    if any(_whole_share(run, read, long_s) < torn for run in even.runs):
        gaps = [n for n in read if n in own or any(_cuts(_whole_steps_s(run, n)) for run in there[n])]
        wide = {n: max(1.0 / _RATE_ENOUGH_HZ, *(own_period_s(run, n) for run in there[n])) for n in gaps}
        bridged = _with_grids(recordings, wide, rotors)
        before, after = (sum(_whole_share(run, read, long_s) for run in made.runs) for made in (even, bridged))
        even, own = (bridged, wide) if after > before else (even, own)
    if not own:
        return recordings
    said = [_sentence(there[n], n, period, n in rotors) for n, period in own.items()]
    return recordings.mended(even.runs, said)


def _with_slow_joined(recordings: RecordingSet, rotors: Collection[tuple[str, ...]]) -> RecordingSet:
    """The set with rotors' readings that come evenly and too seldom to be joined by lines joined by a curve of their
    band; a sentence for each kind of them."""
    # Of the curve through readings that come seldom: its gain is 0.997 at a third of their rate, a cubic's 0.95.
    smooth_degree = 7
    runs, said = list(recordings.runs), []
    for names in rotors:
        rates = []
        for k, run in enumerate(runs):
            if not _is_read(run, names):
                continue
            values = run.array(names)
            rows = np.flatnonzero(np.isfinite(values).all(axis=1))
            fresh = np.diff(values[rows], axis=0, prepend=np.nan).any(axis=1)
            if names[0].startswith("rotor_speed") and fresh.mean() < _MOSTLY_FRESH:
                rows = rows[fresh]  # a logger that is faster than the sensor repeats its last reading
            steps = np.diff(run.time_s[rows])
            period = float(np.median(steps)) if len(steps) > _LEAST_READINGS else 0.0
            even = (np.abs(steps / period - 1) < _EVEN).mean() > _COVERED if period else False
            if not even or not 2 * np.median(np.diff(run.time_s)) < period or period <= 1.0 / _RATE_ENOUGH_HZ:
                continue
            out = np.full(values.shape, np.nan)
            for start, stop in stretches(np.append(True, steps <= _HOLE_PERIODS * period)):
                # A stretch begins with the reading before it: the first step of the mask is from that.
                own = rows[max(start - 1, 0) : stop]
                if len(own) > smooth_degree:
                    inside = np.arange(own[0], own[-1] + 1)
                    curve = scipy.interpolate.make_interp_spline(run.time_s[own], values[own], smooth_degree)
                    out[inside] = curve(run.time_s[inside])
            lowest = 0.0 if np.nanmin(values) >= 0 else -np.inf
            joined = run.holding(dict(zip(names, np.maximum(out, lowest).T, strict=True)))
            runs[k] = replace(joined, joined_hz={**run.joined_hz, **dict.fromkeys(names, 1 / period)})
            rates.append(1 / period)
        if rates:
            rate = min(rates)
            said.append(
                f"{names[0]} to {names[-1]} come {rate:.3g} times a second: joined by a curve of their band; what is "
                f"faster than {_USED_BAND * rate:.2g} Hz is not in them, and a lag of the motors shorter than "
                f"{1 / rate:.2g} s cannot be distinguished from a delay."
            )
    return recordings.mended(runs, said) if said else recordings


def _with_grids(
    recordings: RecordingSet, periods: Mapping[tuple[str, ...], float], rotors: Collection[tuple[str, ...]]
) -> RecordingSet:
    """The set with every sensor of `periods` on an even grid of so many seconds a step."""
    runs = []
    for run in recordings.runs:
        new = {}
        for names, period in periods.items():
            if _is_read(run, names):
                values = evenly(run, names, period, jumps=names in rotors)
                new |= dict(zip(names, values.T, strict=True))
        runs.append(run.holding(new))
    return replace(recordings, runs=tuple(runs))


def whole_stretches(run: Run, groups: Iterable[tuple[str, ...]]) -> tuple[list[tuple[float, float]], float]:
    """Start and stop, s, of every stretch in which every sensor gives readings without a hole, and the slowest sensor's
    period, s."""
    time_s, holes, slowest = run.time_s, [], 0.0
    for names in groups:
        known = time_s[run.complete(names)]
        if len(known) < LEAST_VALUES:
            return [], float("inf")
        steps = np.diff(known)
        period = float(np.median(steps))
        slowest = max(slowest, period)
        holes += [(known[k], known[k + 1]) for k in np.flatnonzero(steps > _HOLE_PERIODS * period)]
        holes += [(-np.inf, known[0]), (known[-1], np.inf)]
    found, reached = [], float(time_s[0])
    for start, stop in [*sorted(holes), (float(time_s[-1]), np.inf)]:
        if start > reached:
            found.append((reached, float(min(start, time_s[-1]))))
        reached = max(reached, float(stop))
    return found, slowest


def _whole_share(run: Run, sensors: Iterable[tuple[str, ...]], long_s: float) -> float:
    """Share of a flight's time that lies in stretches of `long_s`, s, in which no sensor of it has a hole."""
    lasting = [stop - start for start, stop in whole_stretches(run, [n for n in sensors if _is_read(run, n)])[0]]
    return sum(s for s in lasting if s >= long_s) / max(float(run.time_s[-1] - run.time_s[0]), 1e-9)


def _sentence(runs: list[Run], names: tuple[str, ...], period_s: float, jumps: bool) -> str:
    """What was done to a sensor and what it costs."""
    share = float(np.mean([np.isfinite(run.array(names)).mean() for run in runs]))
    through = f"{names[0]} to {names[-1]} come" if len(names) > 1 else f"{names[0]} comes"
    return (
        f"{through} at random ({1 - share:.0%} of the cells are empty): brought to an even {1 / period_s:.0f} Hz, "
        f"whose band to {_USED_BAND / period_s:.0f} Hz can be used; there the noise is "
        f"{noise_gain(runs[0], names, period_s, jumps):.2g} times that of full columns."
    )


def noise_gain(run: Run, names: tuple[str, ...], period_s: float, jumps: bool) -> float:
    """Noise in the band of what `evenly` makes of white noise, over that of columns without an empty cell."""
    rng = np.random.default_rng(1)
    white = {n: np.where(np.isfinite(run.column(n)), rng.standard_normal(len(run.time_s)), np.nan) for n in names}
    made = evenly(Run("", pd.DataFrame({c.TIME: run.time_s} | white)), names, period_s, jumps)
    step = float(run.time_s[-1] - run.time_s[0]) / (len(run.time_s) - 1)
    between = period_s / _LINES_A_PERIOD if jumps else period_s
    return float(np.sqrt(np.nanvar(made) * between / step))


def _is_read(run: Run, names: tuple[str, ...]) -> bool:
    """Whether each column of a sensor has enough readings to show how they come."""
    return bool(names) and all(np.isfinite(run.column(name)).sum() > _LEAST_READINGS for name in names)


def _steps_s(run: Run, names: tuple[str, ...]) -> list[np.ndarray]:
    """Steps between the readings of each column, s, without holes."""
    steps = [np.diff(run.time_s[np.isfinite(run.column(name))]) for name in names]
    return [s[s <= _LONGEST_USUAL * np.median(s)] for s in steps]


def _whole_steps_s(run: Run, names: tuple[str, ...]) -> np.ndarray:
    """Steps between the rows in which every column has a reading, s."""
    return np.diff(run.time_s[run.complete(names)])


def _cuts(steps_s: np.ndarray) -> int:
    """Number of steps that the rule of usual steps takes for holes."""
    return int((steps_s > _HOLE_PERIODS * np.median(steps_s)).sum()) if len(steps_s) else 0


def _cut_by_chance(run: Run, names: tuple[str, ...]) -> bool:
    """Whether a rule in usual steps cuts a sensor where no column of it has a hole of several of its own periods."""
    whole, mean = _whole_steps_s(run, names), max(float(s.mean()) for s in _steps_s(run, names))
    every = (np.diff(run.time_s[np.isfinite(run.column(name))]) for name in names)
    holes = sum(int((s > _HOLE_PERIODS * mean).sum()) for s in every)
    return (_cuts(whole) if len(whole) else len(run.time_s)) > holes


def is_scattered(run: Run, names: tuple[str, ...]) -> bool:
    """Whether the readings of a sensor come unevenly, or its columns not in the same rows."""
    steps = _steps_s(run, names)
    uneven = max(float((s > _LONG_STEP * np.median(s)).mean()) for s in steps)
    return uneven > _SCATTERED or len(_whole_steps_s(run, names)) < (1 - _SCATTERED) * min(map(len, steps))


def own_period_s(run: Run, names: tuple[str, ...]) -> float:
    """The step that covers nearly all steps between readings that come at random, s: what such a sensor resolves.

    One that then has less than the analysis needs has as many knots as readings: a spline's stiffness leads over the
    longer steps, and half of its band would be lost with one reading in ten.
    """
    steps = _steps_s(run, names)
    mean = max(float(s.mean()) for s in steps)
    covering = max(mean, *(float(np.quantile(s, _COVERED)) for s in steps))
    return min(covering, max(1.0 / _RATE_ENOUGH_HZ, mean))


def evenly(run: Run, names: tuple[str, ...], period_s: float, jumps: bool) -> np.ndarray:
    """Values of a sensor in the rows nearest to an even grid, (n, len(names)); NaN in the others and inside holes."""
    time_s = run.time_s
    step = period_s / _LINES_A_PERIOD if jumps else period_s
    grid = np.arange(time_s[0], time_s[-1] + 1e-9, step)
    rows = np.unique(np.searchsorted((time_s[1:] + time_s[:-1]) / 2, grid))
    at = time_s[rows]
    values = run.array(names)
    if names == c.QUATERNION:
        values = on_one_side(values)
    out = np.full(values.shape, np.nan)
    for k in range(values.shape[1]):
        known = np.isfinite(values[:, k])
        read_s, read = time_s[known], values[known, k]
        made = _on_lines(read_s, read, at, step) if jumps else _spline(read_s, read, period_s)(at)
        after = np.searchsorted(read_s, at).clip(1, len(read_s) - 1)
        inside = (at >= read_s[0]) & (at <= read_s[-1])
        inside &= read_s[after] - read_s[after - 1] <= _HOLE_PERIODS * period_s
        out[rows[inside], k] = made[inside]
    return out


def _on_lines(time_s: np.ndarray, values: np.ndarray, at_s: np.ndarray, step_s: float) -> np.ndarray:
    """Readings (n,) at instants (m,): the mean of those within half a step, on straight lines where there is no more
    than one. What changes faster than the grid would else be taken for something slow."""
    first, last = (np.searchsorted(time_s, at_s + side * step_s / 2) for side in (-1, 1))
    return np.where(last - first > 1, means_of(values, first, last), np.interp(at_s, time_s, values))


def _spline(time_s: np.ndarray, values: np.ndarray, period_s: float) -> scipy.interpolate.BSpline:
    """The cubic least-squares spline through readings (n,) whose knots are a period apart."""
    cubic = 3
    # Weight of the third differences of the spline: a smooth line where there are no readings. With half the cells
    # empty by chance noise then is as even over the band as of an even sensor, and the gain at 0.3 of the rate is right
    # to 2 %.
    stiffness = 5e-4
    count = int(np.ceil((time_s[-1] - time_s[0]) / period_s)) + 1
    knots = time_s[0] + period_s * np.arange(-cubic, count + cubic)
    # A whole number of periods may end, by rounding, a hair before the last reading.
    design = scipy.interpolate.BSpline.design_matrix(np.minimum(time_s, knots[-cubic - 1]), knots, cubic)
    size = design.shape[1]
    difference = scipy.sparse.eye_array(size, format="csr")
    for n in range(cubic):
        difference = scipy.sparse.diags([-1.0, 1.0], [0, 1], shape=(size - n - 1, size - n)) @ difference
    normal = design.T @ design
    weight = stiffness * normal.diagonal().mean()
    found = scipy.sparse.linalg.spsolve(
        (normal + weight * difference.T @ difference).tocsc(), design.T @ (values - values.mean())
    )
    return scipy.interpolate.BSpline(knots, found + values.mean(), cubic)


def on_one_side(quaternion: np.ndarray) -> np.ndarray:
    """Quaternions (n, 4) with empty cells, signs flipped so that successive ones stay on one side."""
    out = quaternion.copy()
    last = np.zeros(4)
    for row in out:
        known = np.isfinite(row)
        if known.any():
            if float(row[known] @ last[known]) < 0:
                row[known] *= -1.0
            last[known] = row[known]
    return out


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
        spoilt = [n for n in names if (run.name, n) in masks]
        runs.append(run.holding({n: np.where(masks[run.name, n], np.nan, run.column(n)) for n in spoilt}))
    said = [_of_spikes(recordings.runs, n, masks) for n in names if any(column == n for _, column in masks)]
    return recordings.mended(runs, said)


def spikes(values: np.ndarray) -> np.ndarray:
    """Mask of the spikes among the readings of one sensor (n,); NaN where there is no reading."""
    neighbours = 3  # Readings on each side whose medians a spike is far from: two of three may be spikes themselves.
    finest = 1e-3  # Share of a sensor's usual span below which its scatter is not believed.
    found = np.zeros(len(values), bool)
    known = np.flatnonzero(np.isfinite(values))
    if len(known) < _LEAST_OF_SPIKES:
        return found
    x = values[known]
    windows = np.lib.stride_tricks.sliding_window_view(x, neighbours)
    medians = np.median(windows, axis=1)
    inner = slice(neighbours, len(x) - neighbours)
    rise, fall = x[inner] - medians[: len(x) - 2 * neighbours], x[inner] - medians[neighbours + 1 :]
    size = np.where(np.sign(rise) == np.sign(fall), np.minimum(np.abs(rise), np.abs(fall)), 0.0)
    apart, moved = np.abs(rise + fall) / 2, np.maximum(np.abs(rise), np.abs(fall))
    least = finest * float(np.subtract(*np.quantile(x, [0.95, 0.05])))
    if not (size - 2 * np.median(moved) > _FAR * max(1.4826 * np.median(apart), least)).any():
        return found  # medians around each are no smaller
    scatter = np.maximum(_around(apart) * 1.4826, least)
    size -= 2 * _around(moved)  # what moves fast turns round fast
    far = _alone(size > _FAR * scatter, size, x[inner])
    between = (size > _NEAR * scatter) & (size <= _FAR * scatter)
    if scatter.min() > 0 and between.sum() < far.sum() <= _MOST * len(x):
        found[known[inner][far]] = True
    return found


def without_jumps(recordings: RecordingSet) -> RecordingSet:
    """Flights without readings of attitude, position or velocity to which they jump, faster than anything moves, and
    from which they jump back; a sentence in `left_out` for each sensor that has some.

    A tracker takes a marker pattern for another of its poses, bodies are exchanged. What jumps and stays was set anew:
    there the flight is cut by a hole.
    """
    if recordings.vehicle.kind != "flight":
        return recordings
    runs, said = list(recordings.runs), []
    for names, what in ((c.QUATERNION, "attitude"), (c.POSITION, "position"), (c.VELOCITY, "velocity")):
        lost, anew, read, largest = 0, 0, 0, 0.0
        for k, run in enumerate(runs):
            if not _is_read(run, names):
                continue
            out, size, count = _jumps(run, names)
            read += int(run.complete(names).sum())
            if out.any():
                lost, anew, largest = lost + int(out.sum()), anew + count, max(largest, size)
                values = np.where(out[:, None], np.nan, run.array(names))
                runs[k] = run.holding(dict(zip(names, values.T, strict=True)))
        if lost:
            far = (
                f"{np.degrees(largest):.0f} degrees"
                if names == c.QUATERNION
                else f"{largest:.3g} {c.unit_of(names[0])}"
            )
            stays = f" ({anew} of the jumps stay: it was set anew, and the flight is cut there)" if anew else ""
            said.append(
                f"{names[0]} to {names[-1]}: the {what} jumps by up to {far} from one reading to the next, as no "
                f"motion does: {lost} readings ({100 * lost / read:.2g} %) are left out{stays}."
            )
    return recordings.mended(runs, said) if said else recordings


def _jumps(run: Run, names: tuple[str, ...]) -> tuple[np.ndarray, float, int]:
    """Rows (n,) whose reading of a sensor is to be emptied, the largest jump (rad, m, m/s), and how many stay."""
    most_jumped = 0.3  # Share of the readings that those may be that a sensor jumps to and back from.
    # Readings emptied about a jump that stays: a longer gap than the one that is bridged (`_HOLE_PERIODS`).
    cut_readings = 8
    out = np.zeros(len(run.time_s), bool)
    values = run.array(names)
    if names == c.QUATERNION:
        values[~(np.linalg.norm(np.nan_to_num(values), axis=1) > 0.1)] = np.nan
    rows = np.flatnonzero(np.isfinite(values).all(axis=1))
    if len(rows) < _LEAST_OF_SPIKES or np.abs(values[rows]).max() > _MEASURED[names]:
        return out, 0.0, 0  # numbers that nothing measures are refused, not mended
    time_s, values = run.time_s[rows], values[rows]
    dt = np.diff(time_s)
    steps, least, fastest, excess = _excess(run, names, time_s, values)
    size, step = np.linalg.norm(excess, axis=1), np.linalg.norm(steps, axis=1)
    usual = float(np.quantile(size, 0.9))
    jump = np.minimum(size, step) > np.maximum(np.maximum(least, _FAR * usual), fastest * dt)
    jump &= dt < _LONGEST_USUAL * np.median(dt)
    edges = np.flatnonzero(jump) + 1
    if not len(edges) or len(edges) > _MOST * len(rows):
        return out, 0.0, 0
    parts = np.split(np.arange(len(rows)), edges)
    # Where each part lies against the first, by all jumps before it; parts that lie alike belong together.
    places, group = _places(names, excess[edges - 1]), []
    for k in range(len(parts)):
        alike = (j for j in range(k) if _apart(names, places[k], places[j]) < 0.3 * size[edges - 1].min())
        group.append(group[j] if (j := next(alike, None)) is not None else k)
    counts = {g: sum(len(p) for p, own in zip(parts, group, strict=True) if own == g) for g in set(group)}
    usual_group, stays = max(counts, key=counts.get), 0
    for part, own in zip(parts, group, strict=True):
        if own != usual_group and counts[own] < most_jumped * len(rows):
            out[rows[part]] = True
    for edge in edges:
        if not out[rows[edge - 1]] and not out[rows[edge]]:
            stays += 1
            out[rows[max(edge - cut_readings // 2, 0) : edge + cut_readings // 2]] = True
    return out, float(size[edges - 1].max()), stays


def _excess(run: Run, names: tuple[str, ...], time_s: np.ndarray, values: np.ndarray):
    """Steps (n - 1, 3) of readings (n, k), the least jump and the fastest motion (rad, m, m/s, a second), and what of
    the steps no other sensor explains."""
    # An attitude jumps by at least so much; where no gyroscope says how far it turns, faster than any vehicle.
    least_jump_rad, fastest_rad_s = 0.25, 40.0
    # A position and a velocity jump by at least so much, and faster than any vehicle.
    least_jump_m, fastest_m_s, least_jump_m_s, fastest_m_s2 = 0.1, 60.0, 1.0, 200.0
    if names != c.QUATERNION:
        steps = np.diff(values, axis=0)
        least, fastest = (least_jump_m, fastest_m_s) if names == c.POSITION else (least_jump_m_s, fastest_m_s2)
        return steps, least, fastest, steps
    turn = scipy.spatial.transform.Rotation.from_quat(values[:, [1, 2, 3, 0]])
    steps = turn[:-1].inv() * turn[1:]
    if not _is_read(run, c.ANGULAR_VELOCITY):
        return steps.as_rotvec(), least_jump_rad, fastest_rad_s, steps.as_rotvec()
    rates = run.array(c.ANGULAR_VELOCITY)
    known = np.isfinite(rates).all(axis=1)
    total = _integrated(rates[known], run.time_s[known])
    turned = np.column_stack([np.interp(time_s, run.time_s[known], column) for column in total.T])
    excess = (scipy.spatial.transform.Rotation.from_rotvec(np.diff(turned, axis=0)).inv() * steps).as_rotvec()
    return steps.as_rotvec(), least_jump_rad, 0.0, excess


def _places(names: tuple[str, ...], jumps: np.ndarray) -> list:
    """Where each part between jumps (m, 3) lies against the first: rotations of the body, else vectors."""
    if names != c.QUATERNION:
        return [np.zeros(3), *np.cumsum(jumps, axis=0)]
    places = [scipy.spatial.transform.Rotation.identity()]
    for jump in jumps:
        places.append(places[-1] * scipy.spatial.transform.Rotation.from_rotvec(jump))
    return places


def _apart(names: tuple[str, ...], one, other) -> float:
    return float((one.inv() * other).magnitude() if names == c.QUATERNION else np.linalg.norm(one - other))


def by_sense(values: np.ndarray, sense: float | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Sizes of signed speeds or commands (n, k), and the cells (n, k) in which a rotor turns backwards: empty there.

    A sign is a turning sense where a rotor keeps it. A cell against the usual sign of its column, or against `sense`
    where it is given, is a rotor that pushes the other way, for which the contract has no column.
    """
    # Share of the largest value that a value of the other sign must exceed to be one: less is noise about zero.
    reversed_share = 0.02
    values = np.asarray(values, float)
    if sense in (None, 1.0) and not (values < 0).any():
        return values, np.zeros(values.shape, bool)
    signs = np.sign(np.nansum(np.sign(values), axis=0)) if sense is None else np.full(values.shape[1], sense)
    own = values * np.where(signs == 0, 1.0, signs)
    largest = np.nanmax(np.abs(own), axis=0, initial=0.0, where=np.isfinite(own))
    known = np.isfinite(own)
    against = known & (own < -reversed_share * largest)
    sizes = np.abs(own) if sense is None else np.clip(own, 0, None)
    return np.where(against, np.nan, np.where(known, sizes, values)), against


def with_sizes_of_speeds(recordings: RecordingSet) -> RecordingSet:
    """The set with sizes in place of signed rotor speeds; a sentence in `left_out` for what their signs say."""
    count = recordings.vehicle.rotor_count
    names = [n for kind in ("rotor_speed", "rotor_command") for n in c.rotor_columns(kind, count)]
    signed = [n for n in names if any(run.has(n) and np.nanmin(run.column(n)) < 0 for run in recordings.runs)]
    if not signed:
        return recordings
    runs, against = [], dict.fromkeys(signed, 0)
    for run in recordings.runs:
        own = [n for n in signed if run.has(n)]
        sizes, backwards = by_sense(run.array(tuple(own)))
        against |= {n: against[n] + int(lost.sum()) for n, lost in zip(own, backwards.T, strict=True)}
        runs.append(run.holding(dict(zip(own, sizes.T, strict=True))))
    said = [
        f"{listed(signed)}: negative readings; a sign that a rotor keeps is its turning sense, and its size is read."
    ]
    said += [f"{n}: the rotor turns backwards in {k} readings: left out." for n, k in against.items() if k]
    return recordings.mended(runs, said)


def _around(sizes: np.ndarray) -> np.ndarray:
    """The median of sizes (n,) around each of them, or of all where that is more."""
    around = 31  # Readings over which the scatter is local: a burst of vibration is none of spikes.
    local = pd.Series(sizes).rolling(around, center=True, min_periods=around // 2).median()
    return np.fmax(local.to_numpy(), np.median(sizes))


def _alone(far: np.ndarray, size: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Far readings (n,) that are far from the nearest others on both sides, too: no tops of pulses."""
    near = np.flatnonzero(~far)
    place = np.searchsorted(near, np.flatnonzero(far))
    nearest = x[near[np.maximum(place - 1, 0)]], x[near[np.minimum(place, len(near) - 1)]]
    out = far.copy()
    out[far] = np.minimum(*(np.abs(x[far] - b) for b in nearest)) > size[far] / 2
    return out


def _of_spikes(runs: tuple[Run, ...], name: str, masks: dict[tuple[str, str], np.ndarray]) -> str:
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
    # A point whose F/ω² exceeds the run's median by this factor has lost part of its speed pulses. An offset of the
    # balance or a curve that bends makes the low points' F/ω² smaller, not larger, in these data, so the rule is one-
    # sided: it must not remove what the offset explains.
    too_slow = 1.35
    turning = speed_rad_s > 0
    if not turning.any():
        return turning
    ratio = np.where(turning, thrust_n, 0.0) / np.where(turning, speed_rad_s, 1.0) ** 2
    return turning & (ratio > too_slow * np.median(ratio[turning]))


def _integrated(values: np.ndarray, time_s: np.ndarray) -> np.ndarray:
    """Integral over time of columns (n, k) from the first sample on, by trapezoids (scipy would take time to load)."""
    steps = np.diff(time_s)[:, None] * (values[1:] + values[:-1]) / 2.0
    return np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(steps, axis=0)])
