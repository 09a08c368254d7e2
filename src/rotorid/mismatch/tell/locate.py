"""Where a mismatch shows: which channel of which run, from when to when, in which regime.

Three sources, in this order of trust:

1. Findings that state their own windows (a gust, a sensor that drops out) are taken as they are; on their channels
   nothing else is listed that findings explain.
2. What a finding adds to a channel carries almost no noise. An interval is where its local size matters relative to
   the channel's noise; it is kept if the energy of the residual `before` is above what the coloured noise of
   `after` allows. Findings at work for most of the flight are listed only where nothing is confined in time:
   their place is a regime, not a time.
3. What the findings leave, `after`, is whitened, evened out (noise that grows with how hard it is flown is no
   mismatch) and scanned over windows of 0.5 to 4 s for energy (of what moves: the same noise with a higher variance is
   a sensor's matter) and for a mean other than zero. The threshold is
   Bonferroni's over every window of every channel of every run; the spread of both statistics is measured on the
   blocks of the residual themselves, so that colour that whitening left, or noise that comes in bouts, raises the
   threshold. Edges are those of the most likely segment. A force that the accelerometer reads and the velocity does
   not show is none: a vibration seen through a low sampling rate stands still for a second where the rotors turn at
   a multiple of that rate.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls
from scipy.stats import chi2, f

from rotorid.mismatch.decide.findings import Analysis, ChannelTrace, by_channel, rms, with_status
from rotorid.mismatch.decide.sizes import effort, segments_of, shares
from rotorid.mismatch.decide.status import CLAIMED
from rotorid.mismatch.evidence.comparison import apart
from rotorid.mismatch.evidence.motion import Segment, stretches
from rotorid.mismatch.evidence.regression import autoregression
from rotorid.mismatch.mistakes.signals import channel_of
from rotorid.mismatch.tell.verdict import Location, Regime
from rotorid.recordings.signal.kernels import causal

_CONFINED = 0.4
"""Being at work for less than this share of the flight counts as acting in part of it."""
_SHIFTED = 0.4
"""Mean of a window relative to the residual's usual size, below which a shift does not matter."""
REGIME_BLOCK_S = 0.5
_EITHER_SIGN = 0.1
"""Share of the flight that a variable must be on the rarer side of zero for its magnitude to be tried."""


@dataclass(frozen=True)
class _Interval:
    """A stretch of one trace: samples start to stop (exclusive)."""

    trace: ChannelTrace
    start: int
    stop: int
    p_value: float
    explained: bool
    of_the_run: bool = False
    """Whether it is the run that matters, and no regime."""


def locate(analysis: Analysis) -> list[Location]:
    """Locations of the mismatch, in the order of channels, runs and time; empty where there is none."""
    segments = segments_of(analysis)
    stated = _stated(analysis)
    found: list[_Interval] = []
    if with_status(analysis, *CLAIMED, "absorbed") or analysis.wrong_values:
        partial, throughout = _explained(analysis, segments)
        spoken_for = {loc.channel for loc in stated}
        found += [i for i in partial if i.trace.channel not in spoken_for]
        if not found and not stated:
            found += throughout
    found += _unexplained(analysis, segments)
    order = {key: k for k, key in enumerate(dict.fromkeys((t.channel, t.run) for t in analysis.traces))}
    located = stated + _worded(analysis, _disjoint(found, order))
    return sorted(located, key=lambda loc: (order.get((loc.channel, loc.run), -1), loc.run, loc.start_s))


def _worded(analysis: Analysis, intervals: Sequence[_Interval]) -> list[Location]:
    regimes: dict[tuple[str, bool], Regime | None] = {}
    out = []
    for i in intervals:
        key = (i.trace.channel, i.explained)
        if key not in regimes and not i.of_the_run:
            regimes[key] = _regime_of(analysis, *key)
        start_s, stop_s = _edge(analysis, i, i.start, 0), _edge(analysis, i, i.stop - 1, -1)
        share = _energy_share(_mismatch_of(i.trace, i.explained), slice(i.start, i.stop))
        regime = None if i.of_the_run else regimes[key]
        out.append(Location.filled(i.trace.run, i.trace.channel, start_s, stop_s, i.p_value, share, regime))
    return out


def _energy_share(signal: np.ndarray, part: slice) -> float:
    total = float(np.nansum(signal**2))
    return min(float(np.nansum(signal[part] ** 2)) / total, 1.0) if total > 0 else 0.0


def _edge(analysis: Analysis, interval: _Interval, sample: int, end: int) -> float:
    """Time of an interval's edge; at a trace's end that of the run, of which filtering cost a moment."""
    time_s, run_s = interval.trace.time_s, analysis.recordings.run(interval.trace.run).time_s
    lost_at_ends_s = 1.0
    if time_s[sample] == time_s[end] and abs(run_s[end] - time_s[end]) < lost_at_ends_s:
        return float(run_s[end])
    return float(time_s[sample])


def _mismatch_of(trace: ChannelTrace, explained: bool) -> np.ndarray:
    """The mismatch with as little noise as can be had: what the findings take away, else the residual itself."""
    return trace.before - trace.named if explained else trace.named


def _channel_noise(traces: Sequence[ChannelTrace]) -> float:
    """Usual size of the residual after the effects, robust against stretches in which it is larger."""
    parts = [_blocks(t.named, _period(t)) for t in traces]
    sizes = [np.sqrt(np.nanmean(blocks**2, axis=1)) for blocks in parts if len(blocks)]
    return float(np.nanmedian(np.concatenate(sizes))) if sizes else rms([t.named for t in traces])


def _blocks(values: np.ndarray, period_s: float) -> np.ndarray:
    """Values (n,) in whole blocks of half a second, (blocks, samples)."""
    per = max(2, int(round(REGIME_BLOCK_S / period_s)))
    count = len(values) // per
    return values[: count * per].reshape(count, per)


def _period(trace: ChannelTrace) -> float:
    return float(np.median(np.diff(trace.time_s)))


def _long_enough(analysis: Analysis) -> dict[str, list[ChannelTrace]]:
    """Channels to their traces of more than a few samples."""
    return by_channel(t for t in analysis.traces if len(t.time_s) > 8)


def _stated(analysis: Analysis) -> list[Location]:
    """Windows that findings state, on the channels they show in.

    Samples that a sensor lost are left out of the residuals, so that a channel may have no residual there: then the
    share of the channel's mismatch is that of the time stated in the run.
    """
    vehicle, regimes, out = analysis.recordings.vehicle, {}, []
    for finding in with_status(analysis, *CLAIMED):
        channels = dict.fromkeys(channel_of(name, vehicle) for name in finding.channels)
        for run, start_s, stop_s in finding.windows:
            stated_s = sum(b - a for r, a, b in finding.windows if r == run)
            for channel in channels:
                share = min((stop_s - start_s) / stated_s, 1.0) if stated_s > 0 else 1.0
                for trace in analysis.traces:
                    inside = slice(*np.searchsorted(trace.time_s, [start_s, stop_s]))
                    if (trace.run, trace.channel) == (run, channel) and inside.stop > inside.start:
                        share = _energy_share(_mismatch_of(trace, True), inside)
                if channel not in regimes:
                    regimes[channel] = _regime_of(analysis, channel, True)
                out.append(Location.filled(run, channel, start_s, stop_s, finding.p_value, share, regimes[channel]))
    return out


def _explained(analysis: Analysis, segments: list[Segment]) -> tuple[list[_Interval], list[_Interval]]:
    """Intervals of what acts in part of the flight, and of what acts for most of it.

    Each finding's own contribution says where it acts; for what lies between command and rotor speed all that was
    taken away from its channels does. A wrong value is wrong throughout.
    """
    channels = _long_enough(analysis)
    causes = list(shares(analysis, segments, channels).values())
    spoken_for = {channel for found in causes for channel in found}
    rest = {c: [_mismatch_of(t, True) for t in ts] for c, ts in channels.items() if c not in spoken_for}
    at_work = with_status(analysis, *CLAIMED)
    formless = {c for f in at_work if f.form is None and not f.windows for c in f.channels}
    causes.append({c: x for c, x in rest.items() if c in formless})
    partial, throughout = [], []
    if analysis.wrong_values:
        for channel in rest.keys() - formless:
            masks = _acting(channels[channel], rest[channel])
            if masks is not None:
                throughout += _tested(channels[channel], [np.ones(len(m), bool) for m in masks], len(analysis.traces))
    for cause in causes:
        masks = {c: m for c, series in cause.items() if (m := _acting(channels[c], series)) is not None}
        if not masks:
            continue
        confined = _share_at_work({c: (channels[c], cause[c]) for c in masks}) < _CONFINED
        for channel, parts in masks.items():
            here = _tested(channels[channel], parts, len(analysis.traces))
            (partial if confined else throughout).extend(here)
    return partial, throughout


def _share_at_work(contributions: Mapping[str, tuple[Sequence[ChannelTrace], Sequence[np.ndarray]]]) -> float:
    """Share of the flight in which a cause's contribution to any channel (traces and their series) is more than nil."""
    by_run: dict[tuple[str, float], list[np.ndarray]] = {}
    # Local size relative to its peak above which a contribution is at work: drag is small when slow, ground effect nil.
    at_work = 0.03
    for traces, series in contributions.values():
        levels = [_local_size(x, _period(t)) for x, t in zip(series, traces, strict=True)]
        nil = at_work * float(np.quantile(np.concatenate(levels), 0.99))
        for trace, level in zip(traces, levels, strict=True):
            by_run.setdefault((trace.run, float(trace.time_s[0])), []).append(level > nil)
    return float(np.concatenate([np.any(m, axis=0) for m in by_run.values()]).mean())


def _acting(traces: Sequence[ChannelTrace], series: Sequence[np.ndarray]) -> list[np.ndarray] | None:
    """Masks of where a contribution to a channel matters relative to its noise; None where it never does."""
    matters = 0.3  # Local size relative to the channel's noise from which an explained mismatch matters at all.
    noise = _channel_noise(traces)
    levels = [_local_size(x, _period(t)) for x, t in zip(series, traces, strict=True)]
    peak = float(np.quantile(np.concatenate(levels), 0.99))
    if not peak > matters * noise:
        return None
    on_share_of_peak = 0.2
    on_share_of_noise = 0.15
    threshold = max(on_share_of_peak * peak, on_share_of_noise * noise)
    masks = [_closed(level > threshold, _period(t)) for level, t in zip(levels, traces, strict=True)]
    throughout = 0.7  # Covering more than this share of the flight counts as being there throughout.
    if np.concatenate(masks).mean() > throughout:
        return [np.ones(len(m), bool) for m in masks]
    return masks


def _tested(traces: Sequence[ChannelTrace], masks: Sequence[np.ndarray], count: int) -> list[_Interval]:
    """Intervals of the masks in which the residual before is larger than coloured noise allows."""
    family_error = 0.002  # Chance of any false interval in a whole set.
    noise, freedom = _channel_noise(traces), _freedom_per_sample(traces)
    found = []
    smallest_share = 0.03  # Share of a run's mismatch energy below which an interval is not worth a line.
    for trace, mask in zip(traces, masks, strict=True):
        energy = np.concatenate([[0.0], np.cumsum(np.nan_to_num(_mismatch_of(trace, True)) ** 2)])
        spans = [(a, b) for a, b in stretches(mask) if energy[b] - energy[a] >= smallest_share * energy[-1]]
        for start, stop in spans:
            p = _energy_p(trace.before[start:stop], noise, freedom)
            if p < family_error / max(len(spans) * count, 1):
                found.append(_Interval(trace, start, stop, p, True))
    return found


def _local_size(values: np.ndarray, period_s: float) -> np.ndarray:
    """Local root mean square, (n,)."""
    local_s = 0.1  # Length over which the local size of an explained mismatch is taken.
    return np.sqrt(_moving_mean(np.nan_to_num(values) ** 2, local_s / period_s))


def _moving_mean(values: np.ndarray, width: float) -> np.ndarray:
    """Centred moving mean over about `width` samples, ends over what there is."""
    half = int(width // 2)
    total = np.concatenate([[0.0], np.cumsum(values)])
    index = np.arange(len(values))
    first, last = np.maximum(index - half, 0), np.minimum(index + half + 1, len(values))
    return np.maximum(total[last] - total[first], 0.0) / (last - first)


def _closed(mask: np.ndarray, period_s: float) -> np.ndarray:
    """The mask with gaps closed that are shorter than what surrounds them: a zero crossing is no end."""
    spans = stretches(mask)
    out = mask.copy()
    shortest_gap_s = 0.25
    longest_gap_s = 2.0
    for (a, b), (c, d) in zip(spans, spans[1:], strict=False):
        allowed = min(max(shortest_gap_s, min(b - a, d - c) * period_s), longest_gap_s)
        if (c - b) * period_s < allowed:
            out[b:c] = True
    return out


def _freedom_per_sample(traces: Sequence[ChannelTrace]) -> float:
    """Degrees of freedom that a sample's square adds in coloured noise: 1 / Σ ρ² over lags of up to 1 s (Bartlett)."""
    count = int(1.0 / _period(traces[0]))
    covariance = np.zeros(count + 1)
    for trace in traces:
        a = np.nan_to_num(trace.named - np.nanmean(trace.named))
        for lag in range(min(count + 1, len(a))):
            covariance[lag] += a[lag:] @ a[: len(a) - lag]
    rho = covariance / max(covariance[0], 1e-300)
    return float(np.clip(1.0 / (1.0 + 2.0 * np.sum(rho[1:] ** 2)), 0.0, 1.0))


def _energy_p(values: np.ndarray, noise: float, freedom: float) -> float:
    """p-value of the energy of a stretch against coloured noise of a given size."""
    values = values[np.isfinite(values)]
    degrees = max(len(values) * freedom, 1.0)
    return float(chi2.sf(degrees * np.mean(values**2) / max(noise, 1e-300) ** 2, degrees)) if len(values) else 1.0


def _unexplained(analysis: Analysis, segments: list[Segment]) -> list[_Interval]:
    """Stretches in which the residual after the effects is larger or shifted."""
    # The same for the scan of what is left; smaller, because the tails of real noise are heavier than assumed.
    scan_error = 1e-4
    wild = 4.0  # Whitened residual beyond which a single sample counts no more.
    channels = _long_enough(analysis)
    windows = sum(
        2 * len(_window_starts(len(t.named), length)) for ts in channels.values() for t in ts for length in _lengths(t)
    )
    limit = scan_error / max(windows, 1)
    found, hard = [], effort(segments)
    for traces in channels.values():
        parts = [np.nan_to_num(t.named) for t in traces]
        taps = autoregression(parts)
        white = [causal(taps, p) for p in parts]
        # One or two wild samples are a glitch; a mismatch lasts.
        white = [np.clip(w, -wild, wild) for w in _evened(traces, white, hard)]
        for w in white:
            w[: len(taps)] = 0.0
        found += _louder(traces, white, limit) + _shifted(traces, white, parts, limit)
        if "run" in analysis.unexplained_depends_on:
            found += _apart(traces, parts)
    sensors = _sensor_differences(analysis)
    return [i for i in found if not _of_one_sensor(i, sensors)]


def _sensor_differences(analysis: Analysis) -> dict[tuple[str, str, float], np.ndarray]:
    """To run, channel and first instant of a trace of forces (n,), N, that the accelerometer alone reads."""
    if analysis.force_source != "accelerometer":
        return {}
    return {
        (t.run, f"force_{t.channel[-1]}", float(t.time_s[0])): analysis.improved.mass_kg * t.named
        for t in analysis.between_sensors
        if t.channel.startswith("accelerometer") and len(t.time_s)
    }


def _of_one_sensor(interval: _Interval, differences: Mapping[tuple[str, str, float], np.ndarray]) -> bool:
    """Whether most of the residual there is a difference between the accelerometer and the velocity."""
    trace, part = interval.trace, slice(interval.start, interval.stop)
    difference = differences.get((trace.run, trace.channel, float(trace.time_s[0])), np.zeros(len(trace.named)))
    left, whole = (float(np.nansum(x[part] ** 2)) for x in (trace.named - difference, trace.named))
    return left < 0.5 * whole


def _apart(traces, parts) -> list[_Interval]:
    """Whole runs whose mean is off, where runs differ."""
    noise = _channel_noise(traces)
    between = apart([t.run for t in traces], parts, 1.0 / _period(traces[0]), noise)
    means = between.means if between else {}
    return [
        _Interval(t, 0, len(t.named), between.p_value, False, of_the_run=True)
        for t in traces
        if abs(means.get(t.run, 0.0)) > _SHIFTED * noise
    ]


def _evened(traces: Sequence[ChannelTrace], white: list[np.ndarray], hard) -> list[np.ndarray]:
    """Residuals divided by the size that noise has at that moment: a constant and a part that grows with effort.

    The energy of half-second blocks is fitted by non-negative least squares on the effort, twice, blocks far above
    the fit held back to it, so that a mismatch that comes and goes does not count as noise.
    """
    held_back = 3.0  # Energy of a block over the noise expected there, beyond which it does not count as noise in full.
    energies, efforts, lengths = [], [], []
    unknown = np.zeros(1), np.zeros((1, next((s.shape[1] for _, s in hard.values()), 0)))
    for trace, w in zip(traces, white, strict=True):
        width = REGIME_BLOCK_S / _period(trace)
        time_s, squares = hard.get(trace.run, unknown)  # of some runs commands alone are compared
        on_trace = [np.interp(trace.time_s, time_s, column) for column in squares.T]
        efforts.append(np.stack([np.ones(len(w)), *(_moving_mean(x, width) for x in on_trace)], axis=1))
        energies.append(_moving_mean(w**2, width))
        lengths.append(max(int(width), 1))
    x = np.concatenate([e[::n] for e, n in zip(efforts, lengths, strict=True)])
    y = np.concatenate([e[::n] for e, n in zip(energies, lengths, strict=True)])
    scale = np.maximum(x.mean(axis=0), 1e-300)
    usual, floor = np.full(len(y), max(float(np.median(y)), 1e-300)), 1e-3 * float(np.median(y)) + 1e-300
    for _ in range(3):
        weight = 1.0 / usual
        coefficients, _ = nnls(x / scale * weight[:, None], np.minimum(y, held_back * usual) * weight)
        usual = np.maximum(x / scale @ coefficients, floor)
    return [w / np.sqrt(np.maximum(e / scale @ coefficients, floor)) for w, e in zip(white, efforts, strict=True)]


def _lengths(trace: ChannelTrace) -> list[int]:
    scan_s = (0.5, 1.0, 2.0, 4.0)
    return [n for s in scan_s if 4 < (n := int(round(s / _period(trace)))) <= len(trace.named) // 2]


def _window_starts(size: int, length: int) -> np.ndarray:
    return np.arange(0, size - length + 1, max(1, length // 4))


def _window_sums(values: np.ndarray, length: int) -> np.ndarray:
    total = np.concatenate([[0.0], np.cumsum(values)])
    starts = _window_starts(len(values), length)
    return total[starts + length] - total[starts]


def _flagged(series: Sequence[np.ndarray], hits: Iterable[tuple[int, int, np.ndarray, np.ndarray]]):
    """Stretches of windows that stand out: number of the series, start, stop, and the smallest p-value in the series.

    `hits` are number of a series, length of its windows, p-values of all, and which of them stand out.
    """
    flagged = [np.zeros(len(x), bool) for x in series]
    lowest = [1.0] * len(series)
    for k, length, p, out in hits:
        for j in np.flatnonzero(out):
            start = _window_starts(len(series[k]), length)[j]
            flagged[k][start : start + length] = True
            lowest[k] = min(lowest[k], float(p[j]))
    return [(k, a, b, lowest[k]) for k, mask in enumerate(flagged) for a, b in stretches(mask)]


def _louder(traces, white, limit) -> list[_Interval]:
    """Windows with more energy than the spread of the windows' energies allows."""
    moves_s = 0.2  # Lags over which larger residuals may follow each other.
    hits = []
    larger = 4.0  # Energy of a window over the usual, below which noise of higher variance is not called a mismatch.
    for length in _lengths(min(traces, key=lambda t: len(t.named))):
        means = [_window_sums(w**2, length) / length for w in white]
        pooled = np.concatenate(means)
        usual = max(float(np.median(pooled)), 1e-300)  # of a rotor at rest next to nothing is left
        spread = max(float(np.quantile(pooled, 0.75) - np.quantile(pooled, 0.25)) / 1.349, 1e-12)
        degrees = max(min(2 * (usual / spread) ** 2, float(length)), 1.0)
        for k, mean in enumerate(means):
            p = chi2.sf(degrees * mean / usual, degrees)
            hits.append((k, length, p, (p < limit) & (mean > larger * usual)))
    out = []
    for k, start, stop, p in _flagged(white, hits):
        trace, w = traces[k], white[k]
        variance = max(float(np.mean(w[start:stop] ** 2)), 1.2)
        likelihood = -0.5 * np.log(variance) + 0.5 * w**2 * (1.0 - 1.0 / variance)
        first, last = _best_segment(trace, start, stop, likelihood)
        if _moves(w[first:last], w, int(moves_s / _period(trace))):
            out.append(_Interval(trace, first, last, p, False))
    return out


def _moves(part: np.ndarray, whole: np.ndarray, most: int) -> bool:
    """Whether a whitened residual moves in one part otherwise than in the whole, and is not the same noise with a
    higher variance.

    What bodies and air do lasts longer than a sample; a sensor that is shaken or badly received has a higher variance,
    no more. Decided by the correlations at one of the first lags, or at all up to `most` together.
    """
    first_lags = 4
    # Standard errors (Fisher's transform) by which larger residuals must follow each other otherwise than usual.
    moves_z = 4.0
    count = len(part)
    lags = np.arange(1, min(most, count - 5) + 1)
    usual, here = (np.array([_correlation(x, lag) for lag in lags]).clip(-0.999, 0.999) for x in (whole, part))
    sure = (np.arctanh(here) - np.arctanh(usual)) * np.sqrt(count - lags - 3)
    return len(lags) > 0 and max(np.abs(sure[:first_lags]).max(), abs(sure.sum()) / np.sqrt(len(lags))) > moves_z


def _correlation(values: np.ndarray, lag: int) -> float:
    """Autocorrelation at a lag, about nothing."""
    return float(values[lag:] @ values[:-lag] / max(values @ values, 1e-300))


def _shifted(traces, white, parts, limit) -> list[_Interval]:
    """Windows whose mean is further from zero than the windows' own spread allows, and far enough to matter."""
    noise, least, hits = _channel_noise(traces), 1.0, []
    for length in _lengths(min(traces, key=lambda t: len(t.named))):
        sums = [_window_sums(w, length) / np.sqrt(length) for w in white]
        local = [_window_sums(p, length) / length for p in parts]
        count = sum(len(w) // length for w in white)
        least = max(least, float(np.median(np.concatenate(sums) ** 2)) / 0.4549)
        for k, total in enumerate(sums):
            # Where noise has a higher variance for a while its means are, too.
            spread = (_window_sums(white[k] ** 2, length) - total**2) / (length - 1)
            p = f.sf(total**2 / (least * np.maximum(spread, 1.0)), 1, max(count - 1, 1))
            hits.append((k, length, p, (p < limit) & (np.abs(local[k]) > _SHIFTED * noise)))
    out = []
    for k, start, stop, p in _flagged(white, hits):
        level = float(np.mean(parts[k][start:stop]))
        first, last = _best_segment(traces[k], start, stop, level * parts[k] - 0.5 * level**2)
        out.append(_Interval(traces[k], first, last, p, False))
    return out


def _best_segment(trace: ChannelTrace, start: int, stop: int, gain: np.ndarray) -> tuple[int, int]:
    """Start and stop (exclusive) of the most likely segment, of the largest sum, within a second of a stretch."""
    reach = int(round(1.0 / _period(trace)))
    begin, end = max(start - reach, 0), min(stop + reach, len(trace.named))
    total = np.concatenate([[0.0], np.cumsum(gain[begin:end])])
    last = int(np.argmax(total - np.minimum.accumulate(total)))
    first = int(np.argmin(total[: last + 1]))
    return begin + first, begin + max(last, first + 1)


def _disjoint(intervals: Sequence[_Interval], order: Mapping[tuple[str, str], int]) -> list[_Interval]:
    """Intervals sorted by trace and start, overlaps on one trace merged."""
    out: list[_Interval] = []
    for i in sorted(intervals, key=lambda i: (order[i.trace.channel, i.trace.run], i.start)):
        last = out[-1] if out else None
        if last is not None and last.trace is i.trace and i.start <= last.stop:
            stop, p = max(last.stop, i.stop), min(last.p_value, i.p_value)
            out[-1] = _Interval(last.trace, last.start, stop, p, last.explained or i.explained)
        else:
            out.append(i)
    return out


def _regime_of(analysis: Analysis, channel: str, explained: bool) -> Regime | None:
    """The variable and its range that separate the mismatch's energy best; None if none does.

    Analysis of variance of the log energy of half-second blocks over bins of equal counts, each variable in
    turn; blocks, not samples, are the units, so that colour within a block does not count as evidence. A variable that
    goes to both sides of zero is tried by its magnitude, too: a drag errs flying forwards and backwards. Of the
    separation counts the part of the mismatch that the range holds, so that one side of zero does not stand for both.
    Time is chosen only where nothing else separates half as well.
    """
    better_by_magnitude = 1.1  # How much better than the variable itself its magnitude must separate.
    traces = [t for t in analysis.traces if t.channel == channel]
    if not traces:
        return None
    noise = max(_channel_noise(traces), 1e-300)

    def by_block(values: Iterable[np.ndarray]) -> np.ndarray:
        means = [_blocks(x, _period(t)).mean(axis=1) for t, x in zip(traces, values, strict=True)]
        return np.concatenate(means)

    energy = by_block(np.nan_to_num(_mismatch_of(t, explained)) ** 2 for t in traces) / noise**2
    flown = [analysis.regimes.get(t.run, {}) for t in traces]
    names, scored = set.intersection(*map(set, flown)), []
    regime_p = 1e-3
    for name in sorted(names):
        lines = [np.interp(t.time_s, r["time_s"], r[name]) for t, r in zip(traces, flown, strict=True)]
        value = by_block(lines)
        tried = [(value, False)]
        if min((value > 0).mean(), (value < 0).mean()) >= _EITHER_SIGN:
            tried.append((by_block(map(np.abs, lines)), True))
        for values, either_sign in tried:
            found = _separation(energy, values)
            if found is not None and found[1] < regime_p / len(names):
                share, _, low, high, held = found
                weight = 0.5 if name == "time_s" else 1.0 / better_by_magnitude if either_sign else 1.0
                scored.append((share * held * weight, name, low, high, either_sign))
    if not scored:
        return None
    _, name, low, high, either_sign = max(scored)
    return Regime(variable=name, low=low, high=high, either_sign=either_sign)


def _separation(energy: np.ndarray, value: np.ndarray) -> tuple[float, float, float, float, float] | None:
    """Share of variance between bins, its p-value, the range of the bins in which the energy lies, and the part of
    the energy above the quietest bin's that lies there.
    """
    contrast = 2.0  # Energy of the strongest bin over the weakest, below which a variable does not separate anything.
    excess_share = 0.25  # Bins with at least this share of the largest excess belong to the regime.
    good = np.isfinite(value) & np.isfinite(energy)
    energy, value = energy[good], value[good]
    # A load turned into other axes is 1e-17 where it should be nothing: two bins of nothing, and no words for either.
    value = np.where(np.abs(value) < 1e-9 * np.abs(value).max(initial=0.0), 0.0, value)
    regime_bins = 8
    edges = np.unique(np.quantile(value, np.linspace(0, 1, regime_bins + 1))) if len(value) else np.zeros(0)
    if len(edges) < 3 or len(value) < 3 * len(edges):
        return None
    which = np.clip(np.searchsorted(edges, value, side="right") - 1, 0, len(edges) - 2)
    bins = [b for b in range(len(edges) - 1) if np.any(which == b)]
    log = np.log(energy + 0.05)
    within = sum(float(((log[which == b] - log[which == b].mean()) ** 2).sum()) for b in bins)
    total = float(((log - log.mean()) ** 2).sum())
    if total <= 0 or len(bins) < 2:
        return None
    between = total - within
    between_free, within_free = len(bins) - 1, len(log) - len(bins)
    p = f.sf(between / between_free / max(within / within_free, 1e-300), between_free, within_free)
    means = np.array([energy[which == b].mean() for b in bins])
    floor = means.min()
    if means.max() <= contrast * floor:
        return None
    inside = means - floor >= excess_share * (means.max() - floor)
    first = last = int(np.argmax(means))
    while first > 0 and inside[first - 1]:
        first -= 1
    while last < len(bins) - 1 and inside[last + 1]:
        last += 1
    excess = np.array([(energy[which == b] - floor).sum() for b in bins])
    held = float(excess[first : last + 1].sum() / excess.sum())
    return between / total, float(p), float(edges[bins[first]]), float(edges[bins[last] + 1]), held
