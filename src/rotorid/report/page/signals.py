"""What was measured in each channel, on the instants of the traces: a trace holds only what a model leaves of it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rotorid.effects.loading import Loading
from rotorid.mismatch.decision.findings import Analysis, Trace
from rotorid.mismatch.decision.shares import fitted_part
from rotorid.mismatch.instrument.setup import averaged
from rotorid.mismatch.plant.motion import HIGHEST_CUTOFF_HZ, Segment, analysis_rate_hz
from rotorid.mismatch.plant.rows import Thinner, at_centre

Pieces = list[tuple[np.ndarray, dict[str, np.ndarray]]]
"""Of each stretch of a run its instants (n,), s, and the channels' values (n,) by name."""


def measured(analysis: Analysis, segments: Sequence[Segment] | Sequence[Loading]) -> list[np.ndarray]:
    """The measured side of every trace, in the trace's unit, (n,) each; NaN where it is not known.

    Of a flight the believed mass times the specific force, what the believed inertia makes of the rates, and the
    rotors' speeds; of a stand or bench the reading. `segments` are those of `shares.segments_of`.
    """
    by_run: dict[str, Pieces] = {}
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
    names = [f"{group}_{axis}" for group in ("force", "moment") for axis in "xyz"]
    out = dict(zip(names, averaged(loading.reading, count).T, strict=True))
    speed = loading.speed_read if loading.speed_read is not None else loading.motion.rotor_speed
    if speed is not None and loading.measured:
        out |= {f"rotor_speed_{i}": column for i, column in enumerate(averaged(speed, count).T, 1)}
    return averaged(loading.time_s, count), out


def _on(trace: Trace, pieces: Pieces) -> np.ndarray:
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
    by_channel: dict[str, list[tuple[Trace, np.ndarray]]] = {}
    for trace, reading in zip(analysis.traces, readings, strict=True):
        by_channel.setdefault(trace.channel, []).append((trace, reading))
    out = {}
    for channel, pairs in by_channel.items():
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
