"""What of a reading is no error of an instrument: steps of a converter, moments after a load put on by hand, and
noise of measured rotor speeds.

Steps are noise where they are coarse relative to it. A bench's reference jumps from nothing to the weight; the weight
swings. The moments after a jump are left out where readings differ from jump to jump by more than their noise: an
instrument's own dynamics would repeat themselves.

On a stand measured rotor speeds are the load: their noise is an error of the regressor, of which a play or a filter of
the load takes away what is small or quick, and so looks like one. A rotor's inertia keeps its speed smooth, the noise
of a counter is white: on a plateau every instant gets the longest window whose parabola agrees with those of all
shorter ones (intersection of confidence intervals; A. Goldenshluger and A. Nemirovski, 1997); at a step the reading
stays. What is quick may also be the rotors' own: the reading shows which, for it follows rotors but not their counters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.ndimage import median_filter
from scipy.signal import savgol_coeffs, savgol_filter, welch

from rotorid.effects.catalogue import catalogue
from rotorid.effects.loading import CHANNELS, UNITS, Loading
from rotorid.mismatch.decide.findings import Finding
from rotorid.mismatch.decide.status import Estimate
from rotorid.mismatch.mistakes.signals import replace_columns
from rotorid.recordings import RecordingSet, Run, columns
from rotorid.recordings.held import step_of, usual_change

WIDTHS = (5, 9, 17, 33, 65, 129, 257)
"""Samples of the windows."""
_CALM_S, _LOOK_S = 0.8, 3.0
"""Time before and after a step without another, and time after it that is looked at."""
_SMOOTH = 5
"""Samples over which the scatter is smoothed."""
_SLACK_S = 0.1
"""Time left out before a step, and after the readings have settled."""


def without_repeats(recordings: RecordingSet) -> RecordingSet:
    """A stand or bench without readings and speeds that only repeat the one before, where a column with noise of its
    own often does so: it comes more slowly than the rows."""

    def change(run: Run) -> dict:
        names = (*columns.FORCE, *columns.MOMENT, *columns.rotor_columns("rotor_speed", recordings.vehicle.rotor_count))
        own = {n: run.table[n].ffill().diff() for n in names if run.has(n)}
        return {n: run.table[n].mask(steps == 0) for n, steps in own.items() if _is_held(run.column(n), steps)}

    return replace_columns(recordings, change)


def _is_held(values: np.ndarray, steps: np.ndarray) -> bool:
    """Whether a column (n,) with these steps from row to row is held, on no grid, and most of its changes are noise."""
    held_share = 0.3  # Share of readings that repeat the one before, from which a column is held between readings.
    # How often it changes at least, and the median of its changes as a share of its range: other steps are the load's.
    least_changes, small_changes = 20, 0.05
    often = (steps == 0).mean() > held_share and (steps != 0).sum() >= least_changes
    return bool(often) and not step_of(values) and usual_change(values) < small_changes


def quantisation(setup, noise: np.ndarray) -> tuple[Finding | None, str | None]:
    """Finding where steps make a good part of the noise; or the reason why it cannot be tested."""
    coarse_share = 0.25  # Share of the noise's variance that the steps must make, q²/12 relative to σ².
    effect = catalogue()["quantisation"]
    names = columns.FORCE + columns.MOMENT
    total = sum(len(r.table) for r in setup.recordings.runs)
    least_samples = 200
    if total < least_samples:
        return None, "too few samples to see the steps of the reading"
    found = []
    for k in setup.instrument.channels:
        values = np.concatenate([r.column(names[k]) for r in setup.recordings.runs])
        step = step_of(values)
        sigma = _noise_of_samples(setup.loadings, k)
        if step and step**2 / 12 > coarse_share * max(sigma**2, 1e-300) and step < 1e3 * max(sigma, step / 12):
            found.append((k, step, sigma))
    if not found:
        return None, None
    return (
        Finding(
            id="quantisation",
            status="established",
            equation="y = q round(F/q)",
            sentence=effect.sentence,
            parameters=tuple(
                Estimate(f"q_{CHANNELS[k]}", step, UNITS[k], step * (1 - 1e-3), step * (1 + 1e-3))
                for k, step, _ in found
            ),
            p_value=1e-12,
            channels=tuple(CHANNELS[k] for k, _, _ in found),
        ),
        None,
    )


def _noise_of_samples(loadings, channel: int) -> float:
    """One sigma of a sample's noise by second differences of reading less load, robust against sudden changes."""
    parts = [np.diff((x.reading - x.load)[:, channel], 2) for x in loadings if x.size > 4]
    if not parts:
        return 0.0
    second = np.concatenate(parts)
    # A coarse reading often does not change at all, so that a median would be zero: rms of the calmer nine tenths.
    calm = np.sort(np.abs(second))[: max(1, int(0.9 * len(second)))]
    return float(np.sqrt(np.mean(calm**2) / 6.0) * 1.25)


def _steps_of(loading: Loading, channel: int, largest: float) -> np.ndarray:
    """Samples at which a load jumps from one sample to the next and does not before and after."""
    step_share = 0.02  # Change from sample to sample, as a share of the largest load, from which a load jumps.
    jumps = np.abs(np.diff(loading.load[:, channel])) > step_share * largest
    calm = max(2, int(_CALM_S / loading.dt_s))
    at = np.flatnonzero(jumps) + 1
    alone = [not jumps[max(0, k - 1 - calm) : k - 1].any() and not jumps[k : k + calm].any() for k in at]
    return at[np.array(alone, bool) & (at + calm < loading.size)]


def _scatter(loadings: Sequence[Loading], channel: int, largest: float, dt_s: float) -> np.ndarray | None:
    """Scatter between steps of (reading − settled reading) by time after the step, own unit; None for few steps."""
    look = int(_LOOK_S / dt_s)
    shapes, jumps = [], []
    for x in loadings:
        at = _steps_of(x, channel, largest)
        for start, stop in zip(at, np.append(at, x.size)[1:], strict=True):
            if stop - start < look // 2 + 4:
                continue
            part = x.reading[start : min(stop, start + look), channel]
            jumps.append(x.load[start, channel] - x.load[start - 1, channel])
            settled = np.median(x.reading[start + (stop - start) // 2 : stop, channel])
            shapes.append((part - settled) / jumps[-1])
    least_steps = 4
    if len(shapes) < least_steps:
        return None
    normal = np.array([s[: min(map(len, shapes))] for s in shapes])
    usual = np.median(normal, axis=0)
    return np.median(np.abs((normal - usual) * np.array(jumps)[:, None]), axis=0) * 1.4826


def settling_s(loadings: Sequence[Loading], channels, largest, dt_s: float) -> float:
    """How long after a step the stated load cannot be relied on, s; 0 where it can."""
    longest = 0.0
    # Scatter relative to the later scatter, in the first moments, from which loads count as put on by hand, and from
    # which a reading has not settled.
    by_hand, settled = 1.5, 1.35
    for c in channels:
        spread = _scatter(loadings, c, largest[c], dt_s)
        if spread is None:
            continue
        smooth = np.sqrt(np.convolve(spread**2, np.ones(_SMOOTH) / _SMOOTH, mode="same"))
        late = float(np.median(spread[2 * len(spread) // 3 :]))
        early = float(np.sqrt(np.mean(spread[: max(3, int(_CALM_S / dt_s))] ** 2)))
        if early < by_hand * late:
            continue
        above = np.flatnonzero(smooth[:-_SMOOTH] > settled * late)
        longest = max(longest, (above[-1] + 1) * dt_s + _SLACK_S if len(above) else 0.0)
    return longest


def without_settling(loadings: Sequence[Loading], channels, largest, wait_s: float) -> tuple[Loading, ...]:
    """Stretches with the samples from just before a step until it has settled marked as not to be used."""
    out = []
    for x in loadings:
        keep = np.ones(x.size, bool) if x.keep is None else x.keep.copy()
        for c in channels:
            for at in _steps_of(x, c, largest[c]):
                t = x.time_s[at]
                keep &= ~((x.time_s > t - _SLACK_S) & (x.time_s < t + wait_s))
        out.append(replace(x, keep=keep))
    return tuple(out)


def without_noise(speed: np.ndarray, rate_hz: float) -> np.ndarray:
    """Rotor speeds (n, k), rad/s, at even instants, less their white noise; a short stretch as it is."""
    if len(speed) < 2 * WIDTHS[-1]:
        return speed
    return np.stack([_smoothed(x, rate_hz) if _noisy(x) else x for x in speed.T], axis=1)


def noise_of(speed: np.ndarray, rate_hz: float) -> np.ndarray:
    """One-sigma of the white noise of rotor speeds (n, k), rad/s, at every instant; 0 where it is no noise."""
    if len(speed) < 2 * WIDTHS[-1]:
        return np.zeros_like(speed)
    return np.stack([_spread(x, rate_hz) if _noisy(x) else np.zeros(len(x)) for x in speed.T], axis=1)


def quieter(as_read: list[Loading], smoothed: list[Loading]) -> list[Loading]:
    """Of stretches with loads from the speeds as read and from smoothed ones those whose loads the readings follow.

    Compared by the squares of the steps from sample to sample, in which effects of the instrument are small.
    """
    # Smoothed speeds are the better ones where they lower the quick errors of some load to this share, and raise none.
    smaller, larger = 0.98, 1.01
    ratio = _steps(smoothed) / np.maximum(_steps(as_read), 1e-300)
    better = len(ratio) > 0 and np.nanmin(ratio) < smaller and np.nanmax(ratio) < larger
    return smoothed if better else as_read


def _steps(loadings: list[Loading]) -> np.ndarray:
    """Squares of the steps of reading less load, (6,), channels that are not read being NaN."""
    parts = [np.diff(x.reading - x.load, axis=0) ** 2 for x in loadings]
    return np.concatenate(parts).sum(axis=0) if parts else np.zeros(0)


def _noisy(speed: np.ndarray) -> bool:
    """Whether the upper end of the spectrum is white."""
    level = 2.0  # Ratio of the power in the two halves beyond which there is signal up there, and nothing is done.
    band = (0.5, 0.75, 1.0)  # Shares of the highest frequency in which the noise must be white, in two halves.
    frequency, power = welch(speed, nperseg=WIDTHS[-1] - 1, detrend="linear")
    share = frequency / frequency[-1]
    lower, upper = (float(np.median(power[(share >= a) & (share < b)])) for a, b in zip(band, band[1:], strict=False))
    return upper > 0 and 1 / level < lower / upper < level


def _spread(speed: np.ndarray, rate_hz: float) -> np.ndarray:
    """Local one-sigma of white noise, (n,)."""
    local_s = 1.0  # Time over which the size of the noise is read off: it may grow with the speed.
    quick = np.abs(speed - savgol_filter(speed, WIDTHS[0], 2))
    # Of white noise a parabola over five samples leaves 1 − 17/35 of the variance at its middle.
    spread = 1.4826 / np.sqrt(1.0 - savgol_coeffs(WIDTHS[0], 2)[WIDTHS[0] // 2])
    return spread * median_filter(quick, int(local_s * rate_hz) | 1, mode="nearest")


def _smoothed(speed: np.ndarray, rate_hz: float) -> np.ndarray:
    # Samples that must agree for a reading to be replaced: near a step a window bends what it smooths.
    steady_width = 33
    gamma = 2.6  # Half-width of the confidence intervals, in standard errors.
    weights = [savgol_coeffs(width, 2) for width in WIDTHS]
    sd = _spread(speed, rate_hz)
    best, low, high = speed.copy(), speed - gamma * sd, speed + gamma * sd
    agrees = np.ones(len(speed), bool)
    for width, weight in zip(WIDTHS, weights, strict=True):
        value, doubt = savgol_filter(speed, width, 2), gamma * sd * np.sqrt(weight @ weight)
        low, high = np.maximum(low, value - doubt), np.minimum(high, value + doubt)
        agrees &= low <= high
        if width >= steady_width:
            best = np.where(agrees, value, best)
    return best
