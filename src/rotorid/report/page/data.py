"""The numbers behind the page's figures and its replay, small enough to stand in the page.

Series are stored as 16-bit integers times a scale, base64: the page reads them without a library. A long run is thinned
to every k-th row, and the page says so.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rotorid.effects.loading import Loading
from rotorid.errors import InputError
from rotorid.mismatch.decide.findings import Analysis, ChannelTrace, Delivery, by_channel
from rotorid.mismatch.decide.sizes import fitted_part, segments_of
from rotorid.mismatch.decide.words import FORWARD_WORDS, channel_words, regime_words
from rotorid.mismatch.deliver.flown import Model
from rotorid.mismatch.evidence.motion import HIGHEST_CUTOFF_HZ, Segment, analysis_rate_hz
from rotorid.mismatch.evidence.rows import CHANNELS, Thinner, at_centre
from rotorid.mismatch.tell import forward
from rotorid.mismatch.tell.locate import REGIME_BLOCK_S
from rotorid.mismatch.tell.verdict import Verdict
from rotorid.vehicle.windows import Windows

_Pieces = list[tuple[np.ndarray, dict[str, np.ndarray]]]
"""Of each stretch of a run its instants (n,), s, and the channels' values (n,) by name."""
_LONGEST_S = 20.0
_FIRST_SHOWN_S = 10.0
"""Of the run that is shown first, the stretch in which the most error was removed."""
_FRAMES_PER_S = 25.0
_BUDGET = 800_000
"""Values that the page may hold of all traces together; 800 000 are 2.2 MB."""


def packed(values: np.ndarray) -> dict:
    """A series (n,) as 16-bit integers times a scale; NaN as the smallest integer."""
    missing = -32768
    values = np.asarray(values, float)
    top = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0
    scale = float(f"{top / 32767:.6e}") if top > 0 else 1.0
    whole = np.full(len(values), missing, "<i2")
    known = np.isfinite(values)
    whole[known] = np.clip(np.rint(values[known] / scale), -32767, 32767)
    return {"scale": scale, "data": base64.b64encode(whole.tobytes()).decode()}


def _packed_times(time_s: np.ndarray) -> str:
    """Instants as 32-bit floats."""
    return base64.b64encode(np.asarray(time_s, "<f4").tobytes()).decode()


def page_data(analysis: Analysis, verdict: Verdict, main: str) -> dict:
    """Everything that the page's script draws: traces by run and channel, locations, regimes, correlation."""
    channels = [c for c in verdict.channels if c not in FORWARD_WORDS]
    segments = segments_of(analysis)
    readings = measured(analysis, segments)
    by_pair: dict[tuple[str, str], list[ChannelTrace]] = {}
    read_by_pair: dict[tuple[str, str], list[np.ndarray]] = {}
    for trace, reading in zip(analysis.traces, readings, strict=True):
        if trace.channel in channels:
            by_pair.setdefault((trace.run, trace.channel), []).append(trace)
            read_by_pair.setdefault((trace.run, trace.channel), []).append(reading)
    series = 5 if analysis.delivery.derivatives else 4
    total = sum(series * len(t.time_s) for traces in by_pair.values() for t in traces)
    every = max(1, int(np.ceil(total / _BUDGET)))
    runs = list(dict.fromkeys(run for run, _ in by_pair))
    largest = _largest_run(analysis, verdict, main)
    return {
        "main": {"channel": main, "run": largest, "shown_s": _first_shown(by_pair.get((largest, main), []))},
        "every": every,
        "channels": {
            c: {"name": channel_words(c), "unit": verdict.channels[c].unit, "noise": verdict.channels[c].noise_floor}
            for c in channels
            if any(c == channel for _, channel in by_pair)
        },
        "runs": {r: {"held_out": r in verdict.runs.held_out and verdict.runs.held_out != verdict.runs.training}
                 for r in runs},
        "traces": [
            _series(*pair, traces, read_by_pair[pair], every, analysis.delivery) for pair, traces in by_pair.items()
        ],
        "fit_percent": {c: [round(v, 2) for v in fit] for c, fit in fit_percent(analysis, readings).items()},
        "replay": _replay(analysis, verdict, largest, segments),
        "locations": [
            {"run": loc.run, "channel": loc.channel, "start": loc.start_s, "stop": loc.stop_s}
            for loc in verdict.locations
        ],
        "regimes": _regimes(analysis, by_pair),
        "correlation": _correlations(analysis, by_pair, channels),
    }  # fmt: skip


def _largest_run(analysis: Analysis, verdict: Verdict, main: str) -> str:
    """The held-out run in which most of the main channel's error was removed, else any run."""
    traces = [t for t in analysis.traces if t.channel == main]
    if not traces:
        return ""
    part = fitted_part(analysis)
    held = [t for t in traces if np.any(part(t.run, t.time_s) < 0)] or traces
    return max(held, key=lambda t: float(np.nanmean(t.before**2) - np.nanmean(t.after**2))).run


def _first_shown(traces: Sequence[ChannelTrace]) -> list[float] | None:
    """Start and stop, s, of the ten seconds of a run in which the most error was removed; None of a shorter run."""
    best = None
    for t in traces:
        stop = np.searchsorted(t.time_s, t.time_s + _FIRST_SHOWN_S)
        total = np.concatenate([[0.0], np.cumsum(np.nan_to_num(t.before**2 - t.after**2))])
        removed = np.where(stop < len(t.time_s), total[np.minimum(stop, len(t.time_s))] - total[:-1], -np.inf)
        k = int(np.argmax(removed)) if len(removed) else 0
        if len(removed) and np.isfinite(removed[k]) and (best is None or removed[k] > best[0]):
            best = float(removed[k]), [round(float(t.time_s[k]), 3), round(float(t.time_s[k]) + _FIRST_SHOWN_S, 3)]
    return None if best is None else best[1]


def _series(run: str, channel: str, traces, readings: Sequence[np.ndarray], every: int, delivery: Delivery) -> dict:
    """One channel of one run: what was measured, and what the believed and the improved model leave of it.

    Where derivatives are delivered, also what the same vehicle leaves without them.
    """

    def joined(series: Sequence[np.ndarray]) -> np.ndarray:
        parts = []
        for k, values in enumerate(series):
            if k:
                parts.append(np.array([np.nan]))
            parts.append(values[::every])
        return np.concatenate(parts)

    time = joined([t.time_s for t in traces])
    # A row between two stretches keeps their lines apart; it needs an instant of its own.
    holes = np.flatnonzero(np.isnan(time))
    time[holes] = (time[holes - 1] + time[holes + 1]) / 2
    out = {"run": run, "channel": channel, "time": _packed_times(time)}
    out |= {name: packed(joined([getattr(t, name) for t in traces])) for name in ("before", "after")}
    if delivery.derivatives and channel in CHANNELS[:6]:
        out["without"] = packed(joined([t.of_model(delivery.model) for t in traces]))
    reading = joined(readings)
    return out | ({"measured": packed(reading)} if np.isfinite(reading).any() else {})


def _regimes(analysis: Analysis, by_pair: dict[tuple[str, str], list[ChannelTrace]]) -> dict:
    """Size of the error by half seconds next to what was flown: variables and, by channel, before and after."""
    most_blocks = 4000
    variables = sorted({v for known in analysis.regimes.values() for v in known if v != "time_s"})
    if not variables:
        return {"variables": {}, "channels": {}}
    rows: dict[str, dict[str, list[np.ndarray]]] = {}
    for (run, channel), traces in by_pair.items():
        if run not in analysis.regimes:
            continue
        known = analysis.regimes[run]
        columns = rows.setdefault(channel, {v: [] for v in (*variables, "before", "after")})
        for trace in traces:
            per = max(2, int(round(REGIME_BLOCK_S / float(np.median(np.diff(trace.time_s))))))
            count = len(trace.time_s) // per
            for stage in ("before", "after"):
                columns[stage].append(np.sqrt(blocks(getattr(trace, stage) ** 2, per, count)))
            for v in variables:
                missing = np.full(len(trace.time_s), np.nan)
                line = np.interp(trace.time_s, known["time_s"], known[v]) if v in known else missing
                columns[v].append(blocks(line, per, count))
    out: dict[str, dict] = {}
    for channel in filter(rows.__contains__, dict.fromkeys(c for _, c in by_pair)):
        joined = {k: np.concatenate(v) for k, v in rows[channel].items()}
        every = max(1, int(np.ceil(len(joined["before"]) / most_blocks)))
        out[channel] = {k: packed(v[::every]) for k, v in joined.items() if np.isfinite(v).any()}
    words = {v: regime_words(v) for v in variables} if out else {}
    return {"variables": {v: f"{n} ({unit})" if unit else n for v, (n, unit) in words.items()}, "channels": out}


def blocks(values: np.ndarray, per: int, count: int) -> np.ndarray:
    """Means of `count` blocks of `per` samples."""
    return values[: count * per].reshape(count, per).mean(axis=1)


def _correlations(
    analysis: Analysis, by_pair: dict[tuple[str, str], list[ChannelTrace]], channels: Sequence[str]
) -> dict[str, dict]:
    """Correlation of each channel's error with itself some time later, before and after, on runs held out.

    `band` is what 99 % of correlations of white noise lie within (2.58 over the square root of the samples).
    """
    longest_lag_s = 1.0
    most_lags = 60
    part = fitted_part(analysis)
    out = {}
    for channel in channels:
        traces = [t for (_, name), all_of in by_pair.items() if name == channel for t in all_of]
        held = [t for t in traces if (part(t.run, t.time_s) < 0).mean() > 0.5] or traces
        if not held:
            continue
        period = float(np.median(np.diff(held[0].time_s)))
        step = max(1, int(round(longest_lag_s / period / most_lags)))
        lags = np.arange(0, int(longest_lag_s / period) + 1, step)
        samples = sum(len(t.time_s) for t in held)
        out[channel] = {
            "lag_s": [round(float(x), 5) for x in lags * period],
            "before": [round(x, 4) for x in _correlation([t.before for t in held], lags)],
            "after": [round(x, 4) for x in _correlation([t.after for t in held], lags)],
            "band": round(2.576 / np.sqrt(samples), 5),
        }
    return out


def _correlation(series: Sequence[np.ndarray], lags: np.ndarray) -> list[float]:
    centre = np.concatenate(series).mean()
    parts = [np.nan_to_num(s - centre) for s in series]
    power = sum(float(p @ p) for p in parts)
    return [sum(float(p[: len(p) - k] @ p[k:]) for p in parts if len(p) > k) / max(power, 1e-300) for k in lags]


def _replay(analysis: Analysis, verdict: Verdict, run: str, segments: Sequence[Segment]) -> dict | None:
    """Frames of up to LONGEST_S of a run, about where most was located; None where attitudes cannot be simulated.

    Returns
    -------
    `time` (n,), unit quaternions `recorded`, `before`, `after` (n, 4), body to world, scalar first; `force_before`,
    `force_after`, `moment_before`, `moment_after` (n, 3), N and N m, body axes, where the traces have them; `rotors`
    (k, 3), m, body axes. The simulations restart from the recording every half second.
    """
    if analysis.instrument is not None:
        return None
    usable = [s for s in segments if s.motion.has(("rotation", "rotor_speed", "angular_velocity"))]
    mine = [k for k, s in enumerate(usable) if s.run == run]
    if not mine:
        return None
    # Within the stretch that is nearest to the middle of the place with the most energy, else from the longest's start.
    here = [loc for loc in verdict.locations if loc.run == run and loc.start_s is not None and loc.stop_s is not None]
    if here:
        busiest = max(here, key=lambda loc: loc.energy_share)
        centre = 0.5 * (busiest.start_s + busiest.stop_s)
        ends = {k: usable[k].motion.time_s[[0, -1]] for k in mine}
        at = min(mine, key=lambda k: max(ends[k][0] - centre, centre - ends[k][1], 0.0))
        first = np.clip(centre - _LONGEST_S / 2, ends[at][0], max(ends[at][1] - _LONGEST_S, ends[at][0]))
    else:
        at = max(mine, key=lambda k: np.ptp(usable[k].motion.time_s))
        first = usable[at].motion.time_s[0]
    time_s, shown = usable[at].motion.time_s, None
    out: dict[str, np.ndarray] = {}
    for stage, model in (("before", Model(analysis.believed)), ("after", forward.delivered_model(analysis))):
        found = _windows(usable, at, model)
        if found is None:
            return None
        recorded, windows = found
        if recorded is None or windows.predicted.quaternion is None or not windows.sample.size:
            return None
        starts = time_s[windows.sample[:, 0]]
        chosen = np.flatnonzero((starts >= first) & (starts < first + _LONGEST_S))
        period = float(np.median(np.diff(time_s[windows.sample[0]]))) if windows.sample.shape[1] > 1 else 1.0
        every = max(1, round(1 / _FRAMES_PER_S / period))
        sample = windows.sample[chosen][:, ::every].ravel()
        if not len(sample) or (shown is not None and not np.array_equal(shown, time_s[sample])):
            return None
        shown = time_s[sample]
        out[stage] = windows.predicted.quaternion[chosen][:, ::every].reshape(-1, 4)
        out["recorded"] = recorded[sample]
    by_name = by_channel(t for t in analysis.traces if t.run == run)
    for group in ("force", "moment"):
        axes = [by_name.get(f"{group}_{axis}") for axis in "xyz"]
        for stage in ("before", "after") if all(axes) else ():
            columns = [np.interp(shown, *(np.concatenate([getattr(t, n) for t in own]) for n in ("time_s", stage)))
                       for own in axes]  # fmt: skip
            out[f"{group}_{stage}"] = np.stack(columns, axis=1)
    rotors = np.round(analysis.believed.rotor_positions_m(), 5).tolist()
    head = {"run": run, "time": _packed_times(shown), "rotors": rotors}
    return head | {name: packed(values.ravel()) for name, values in out.items()}


def _windows(segments: Sequence[Segment], at: int, model: Model) -> tuple[np.ndarray | None, Windows] | None:
    """Recorded attitudes of a segment, and its half seconds as a model predicts them.

    Without the model's effects where they cannot be simulated; None where nothing can.
    """
    for tried in (model, replace(model, forms=(), chain=(), chain_values=())):
        try:
            inputs, states = forward.driven_by(segments, tried)
            return states[at].quaternion, forward.predict(segments[at], tried, inputs[at], states[at])
        except InputError:
            continue
    return None


def measured(analysis: Analysis, segments: Sequence[Segment] | Sequence[Loading]) -> list[np.ndarray]:
    """The measured side of every trace, in the trace's unit, (n,) each; NaN where it is not known.

    Of a flight the believed mass times the specific force, what the believed inertia makes of the rates, and the
    rotors' speeds; of a stand or bench the reading. `segments` are those of `shares.segments_of`.
    """
    by_run: dict[str, _Pieces] = {}
    if analysis.instrument is None:
        thinner = Thinner(*analysis_rate_hz(analysis.recordings.runs, analysis.believed, HIGHEST_CUTOFF_HZ))
    for segment in segments:
        if isinstance(segment, Loading):
            piece = _of_loading(segment, analysis.samples_per_row)
        else:
            piece = _of_flight(segment, analysis, thinner)
        by_run.setdefault(segment.run, []).append(piece)
    return [_on(trace, by_run.get(trace.run, [])) for trace in analysis.traces]


def _of_flight(segment: Segment, analysis: Analysis, thinner: Thinner) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    motion, vehicle = segment.motion, analysis.believed
    groups: dict[str, np.ndarray] = {}
    if motion.specific_force is not None:
        groups["accelerometer"] = at_centre(segment, vehicle)
        groups["force"] = vehicle.mass_kg * groups["accelerometer"]
    if motion.angular_velocity is not None:
        groups["gyroscope"] = rate = motion.angular_velocity
        if motion.angular_acceleration is not None:
            inertia = vehicle.inertia_kg_m2.matrix()
            groups["moment"] = motion.angular_acceleration @ inertia + np.cross(rate, rate @ inertia)
    out = {}
    for group, values in groups.items():
        out |= {f"{group}_{axis}": column for axis, column in zip("xyz", thinner(values).T, strict=True)}
    if motion.rotor_speed is not None and segment.measured_speed:
        out |= {f"rotor_speed_{i}": column for i, column in enumerate(thinner(motion.rotor_speed).T, 1)}
    return thinner.times(motion.time_s), out


def _of_loading(loading: Loading, count: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    from rotorid.mismatch.instrument.setup import averaged

    names = [f"{group}_{axis}" for group in ("force", "moment") for axis in "xyz"]
    out = dict(zip(names, averaged(loading.reading, count).T, strict=True))
    speed = loading.speed_read if loading.speed_read is not None else loading.motion.rotor_speed
    if speed is not None and loading.measured:
        out |= {f"rotor_speed_{i}": column for i, column in enumerate(averaged(speed, count).T, 1)}
    return averaged(loading.time_s, count), out


def _on(trace: ChannelTrace, pieces: _Pieces) -> np.ndarray:
    """One channel on the instants of its trace, by linear interpolation within each stretch."""
    out = np.full(len(trace.time_s), np.nan)
    for time_s, channels in pieces:
        if trace.channel in channels and len(time_s) > 1:
            inside = (trace.time_s >= time_s[0] - 1e-6) & (trace.time_s <= time_s[-1] + 1e-6)
            out[inside] = np.interp(trace.time_s[inside], time_s, channels[trace.channel])
    return out


def fit_percent(analysis: Analysis, readings: Sequence[np.ndarray]) -> dict[str, tuple[float, float]]:
    """Channel to its fit as believed and improved, in per cent, on the runs held out (else on all).

    One hundred times one less the error's root mean square over that of the measured signal about its mean: 100 is
    perfect, 0 no better than the mean, negative worse.
    """
    part = fitted_part(analysis)
    own: dict[str, list[tuple[ChannelTrace, np.ndarray]]] = {}
    for trace, reading in zip(analysis.traces, readings, strict=True):
        own.setdefault(trace.channel, []).append((trace, reading))
    out = {}
    for channel, pairs in own.items():
        chosen = [p for p in pairs if (part(p[0].run, p[0].time_s) < 0).mean() > 0.5] or pairs
        signal = np.concatenate([reading for _, reading in chosen])
        known = np.isfinite(signal)
        spread = float(np.std(signal[known])) if known.sum() > 1 else 0.0
        # What does not move by more than its noise has no fit.
        if spread > analysis.noise_floor.get(channel, 0.0):
            errors = [np.concatenate([getattr(t, name) for t, _ in chosen])[known] for name in ("before", "after")]
            before, after = (100 * (1 - float(np.sqrt(np.mean(e**2))) / spread) for e in errors)
            out[channel] = before, after
    return out
