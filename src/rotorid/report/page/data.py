"""The numbers behind the page's figures, small enough to stand in the page.

Series are stored as 16-bit integers times a scale, base64: the page reads them without a library. A long run is thinned
to every k-th row, and the page says so.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence

import numpy as np

from rotorid.mismatch.decision.findings import Analysis, Trace
from rotorid.mismatch.decision.shares import fitted_part, segments_of
from rotorid.mismatch.decision.words import FORWARD_WORDS, channel_words, regime_words
from rotorid.mismatch.tell.locate import REGIME_BLOCK_S
from rotorid.mismatch.tell.verdict import Verdict
from rotorid.report.page.replay import replay
from rotorid.report.page.signals import fit_percent, measured

BUDGET = 800_000
"""Values that the page may hold of all traces together; 800 000 are 2.2 MB."""
MOST_BLOCKS = 4000
LONGEST_LAG_S = 1.0
MOST_LAGS = 60
MISSING = -32768


def packed(values: np.ndarray) -> dict:
    """A series (n,) as 16-bit integers times a scale; NaN as the smallest integer."""
    values = np.asarray(values, float)
    top = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 0.0
    scale = float(f"{top / 32767:.6e}") if top > 0 else 1.0
    whole = np.full(len(values), MISSING, "<i2")
    known = np.isfinite(values)
    whole[known] = np.clip(np.rint(values[known] / scale), -32767, 32767)
    return {"scale": scale, "data": base64.b64encode(whole.tobytes()).decode()}


def packed_times(time_s: np.ndarray) -> str:
    """Instants as 32-bit floats."""
    return base64.b64encode(np.asarray(time_s, "<f4").tobytes()).decode()


def page_data(analysis: Analysis, verdict: Verdict, main: str) -> dict:
    """Everything that the page's script draws: traces by run and channel, locations, regimes, correlation."""
    channels = [c for c in verdict.channels if c not in FORWARD_WORDS]
    segments = segments_of(analysis)
    readings = measured(analysis, segments)
    by_pair: dict[tuple[str, str], list[Trace]] = {}
    read_by_pair: dict[tuple[str, str], list[np.ndarray]] = {}
    for trace, reading in zip(analysis.traces, readings, strict=True):
        if trace.channel in channels:
            by_pair.setdefault((trace.run, trace.channel), []).append(trace)
            read_by_pair.setdefault((trace.run, trace.channel), []).append(reading)
    total = sum(4 * len(t.time_s) for traces in by_pair.values() for t in traces)
    every = max(1, int(np.ceil(total / BUDGET)))
    runs = list(dict.fromkeys(run for run, _ in by_pair))
    largest = _largest_run(analysis, verdict, main)
    flown = replay(analysis, verdict, largest, segments)
    return {
        "main": {"channel": main, "run": largest},
        "every": every,
        "channels": {
            c: {"name": channel_words(c), "unit": verdict.channels[c].unit, "noise": verdict.channels[c].noise_floor}
            for c in channels
            if any(c == channel for _, channel in by_pair)
        },
        "runs": {r: {"held_out": r in verdict.runs.held_out and verdict.runs.held_out != verdict.runs.training}
                 for r in runs},
        "traces": [_series(*pair, traces, read_by_pair[pair], every) for pair, traces in by_pair.items()],
        "fit_percent": {c: [round(v, 2) for v in fit] for c, fit in fit_percent(analysis, readings).items()},
        "replay": None if flown is None else _frames(largest, flown),
        "locations": [
            {"run": loc.run, "channel": loc.channel, "start": loc.start_s, "stop": loc.stop_s}
            for loc in verdict.locations
        ],
        "regimes": regimes(analysis, by_pair),
        "correlation": correlations(analysis, by_pair, channels),
    }  # fmt: skip


def _largest_run(analysis: Analysis, verdict: Verdict, main: str) -> str:
    """The held-out run in which most of the main channel's error was removed, else any run."""
    traces = [t for t in analysis.traces if t.channel == main]
    if not traces:
        return ""
    part = fitted_part(analysis)
    held = [t for t in traces if np.any(part(t.run, t.time_s) < 0)] or traces
    return max(held, key=lambda t: float(np.nanmean(t.before**2) - np.nanmean(t.after**2))).run


def _series(run: str, channel: str, traces: Sequence[Trace], readings: Sequence[np.ndarray], every: int) -> dict:
    """One channel of one run: what was measured, and what the believed and the improved model leave of it."""

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
    out = {"run": run, "channel": channel, "time": packed_times(time)}
    out |= {name: packed(joined([getattr(t, name) for t in traces])) for name in ("before", "after")}
    reading = joined(readings)
    return out | ({"measured": packed(reading)} if np.isfinite(reading).any() else {})


def _frames(run: str, flown: dict[str, np.ndarray]) -> dict:
    """The replay's frames as the page's script reads them."""
    out = {"run": run, "time": packed_times(flown["time_s"]), "rotors": np.round(flown["rotors"], 5).tolist()}
    names = [n for n in flown if n not in ("time_s", "rotors")]
    return out | {name: packed(flown[name].ravel()) for name in names}


def regimes(analysis: Analysis, by_pair: dict[tuple[str, str], list[Trace]]) -> dict:
    """Size of the error by half seconds next to what was flown: variables and, by channel, before and after."""
    variables = sorted({v for known in analysis.regimes.values() for v in known if v != "time_s"})
    channels = list(dict.fromkeys(c for _, c in by_pair))
    rows: dict[str, dict[str, list[np.ndarray]]] = {}
    for channel in channels:
        columns: dict[str, list[np.ndarray]] = {v: [] for v in (*variables, "before", "after")}
        for (run, name), traces in by_pair.items():
            if name != channel or run not in analysis.regimes:
                continue
            known = analysis.regimes[run]
            for trace in traces:
                per = max(2, int(round(REGIME_BLOCK_S / float(np.median(np.diff(trace.time_s))))))
                count = len(trace.time_s) // per
                for stage in ("before", "after"):
                    columns[stage].append(np.sqrt(_blocks(getattr(trace, stage) ** 2, per, count)))
                for v in variables:
                    flown = known.get(v)
                    line = np.full(len(trace.time_s), np.nan)
                    if flown is not None:
                        line = np.interp(trace.time_s, known["time_s"], flown)
                    columns[v].append(_blocks(line, per, count))
        if columns["before"]:
            rows[channel] = columns
    if not rows or not variables:
        return {"variables": {}, "channels": {}}
    out: dict[str, dict] = {}
    for channel, columns in rows.items():
        joined = {k: np.concatenate(v) for k, v in columns.items()}
        every = max(1, int(np.ceil(len(joined["before"]) / MOST_BLOCKS)))
        out[channel] = {k: packed(v[::every]) for k, v in joined.items() if np.isfinite(v).any()}
    names = {v: " ".join(filter(None, (regime_words(v)[0], f"({regime_words(v)[1]})" if regime_words(v)[1] else "")))
             for v in variables}  # fmt: skip
    return {"variables": names, "channels": out}


def _blocks(values: np.ndarray, per: int, count: int) -> np.ndarray:
    return values[: count * per].reshape(count, per).mean(axis=1)


def correlations(
    analysis: Analysis, by_pair: dict[tuple[str, str], list[Trace]], channels: Sequence[str]
) -> dict[str, dict]:
    """Correlation of each channel's error with itself some time later, before and after, on runs held out.

    `band` is what 99 % of correlations of white noise lie within (2.58 over the square root of the samples).
    """
    part = fitted_part(analysis)
    out = {}
    for channel in channels:
        traces = [t for (_, name), all_of in by_pair.items() if name == channel for t in all_of]
        held = [t for t in traces if (part(t.run, t.time_s) < 0).mean() > 0.5] or traces
        if not held:
            continue
        period = float(np.median(np.diff(held[0].time_s)))
        step = max(1, int(round(LONGEST_LAG_S / period / MOST_LAGS)))
        lags = np.arange(0, int(LONGEST_LAG_S / period) + 1, step)
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
