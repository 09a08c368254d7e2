"""How large an error is in units that a pilot knows: shares of the weight, of the rotors' moment, metres after half a
second; and what each finding adds to each channel.

Errors in units of a sensor's noise order a verdict by what is surest: on a vehicle of 20 N, 0.015 N sideways would lead
before half a newton metre of pitch.

Where an error leads: metres that it alone carries a vehicle off within half a second of simulation.

The simulation run forward drifts by all errors together, and needs a recorded position. Here the residual of one
channel acts for half a second on a vehicle that is right otherwise: a force moves it, a roll or pitch moment tilts it
and gravity does the rest. To first order in the tilt,

    x(T) = ∫ (T − t) f / m dt,    x(T) = g ∫ (T − t)³ / 6 · M / J dt.

A yaw moment moves nothing.

What each finding adds to each channel, on the instants of the traces.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from rotorid.effects.contract import Form
from rotorid.effects.loading import Loading
from rotorid.mismatch.decide.findings import Analysis, ChannelTrace, Finding, rms
from rotorid.mismatch.decide.words import channel_words, number
from rotorid.mismatch.evidence.motion import HIGHEST_CUTOFF_HZ, Segment, analysis_rate_hz, build_segments, full_speed
from rotorid.mismatch.evidence.rows import GROUPS, form_reading, project
from rotorid.mismatch.evidence.split import training_rule
from rotorid.recordings import Vehicle

WINDOW_S = 0.5
_AXES = {"moment_x": "xx", "moment_y": "yy"}


@dataclass(frozen=True)
class _ChannelScale:
    """What a channel's errors are stated as a share of: a number in the channel's unit, and its name."""

    value: float
    words: str


def scales(analysis: Analysis) -> dict[str, _ChannelScale]:
    """To every compared channel its scale; channels of which none is known are not among them."""
    if analysis.instrument is not None:
        return _of_reading(analysis)
    return _of_flight(analysis.believed)


def _of_flight(vehicle: Vehicle) -> dict[str, _ChannelScale]:
    """Weight for forces, and for moments what the rotors can make by differing while they carry the vehicle.

    Half of the rotors at twice the hover's thrust and the others at none: Σ |y_i| F_i, Σ |x_i| F_i and Σ Q_i at hover.
    """
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    coefficients = vehicle.thrust_coefficients_n_s2()
    hover = float(np.sqrt(weight / coefficients.sum()))
    thrust = coefficients * hover**2
    x, y, _ = np.abs(vehicle.rotor_positions_m()).T
    moments = (y @ thrust, x @ thrust, vehicle.torque_coefficients_n_m_s2().sum() * hover**2)
    out = {f"force_{axis}": _ChannelScale(weight, "of the weight") for axis in "xyz"}
    for axis, moment in zip("xyz", moments, strict=True):
        if moment > 0:
            out[f"moment_{axis}"] = _ChannelScale(float(moment), f"of the available {channel_words(f'moment_{axis}')}")
    out |= {f"rotor_speed_{i + 1}": _ChannelScale(hover, "of the hover speed") for i in range(vehicle.rotor_count)}
    out |= {f"accelerometer_{axis}": _ChannelScale(vehicle.gravity_m_s2, "of gravity") for axis in "xyz"}
    return out | {f"gyroscope_{axis}": _ChannelScale(1.0, "of 1 rad/s") for axis in "xyz"}


def _of_reading(analysis: Analysis) -> dict[str, _ChannelScale]:
    """The largest load of the recordings, of forces and of moments."""
    out: dict[str, _ChannelScale] = {}
    for group, columns in (("force", slice(0, 3)), ("moment", slice(3, 6))):
        largest = max((float(np.abs(x.load[:, columns]).max()) for x in analysis.loadings if x.size), default=0.0)
        if largest > 0:
            out |= {f"{group}_{axis}": _ChannelScale(largest, f"of the largest {group}") for axis in "xyz"}
    if analysis.believed.rotors:
        speeds = [x.motion.rotor_speed for x in analysis.loadings if x.motion.rotor_speed is not None]
        top = max((float(np.nanmax(s)) for s in speeds if s.size), default=0.0)
        if top > 0:
            count = analysis.believed.rotor_count
            out |= {f"rotor_speed_{i + 1}": _ChannelScale(top, "of the largest speed") for i in range(count)}
    return out


@dataclass(frozen=True)
class Size:
    """Root mean square of what an effect does to the channel in which it does most."""

    channel: str
    rms: float
    unit: str
    share: float
    """Of the channel's scale."""
    words: str
    """What it is a share of: `of the weight`."""
    metres: float | None = None
    """How far off it alone leads within half a second of simulation; None where it moves nothing."""


def effect_sizes(analysis: Analysis, held: list[np.ndarray]) -> dict[str, Size]:
    """To every stated effect its size on masked rows of the compared traces: the model with it less that without it."""
    known, units = scales(analysis), {t.channel: t.unit for t in analysis.compared}
    out: dict[str, Size] = {}
    for effect_id, without in analysis.without.items():
        moved = [(t, left - t.named, mask) for t, left, mask in zip(analysis.compared, without, held, strict=True)]
        parts: dict[str, list[np.ndarray]] = {}
        for trace, added, mask in moved:
            parts.setdefault(trace.channel, []).append(added[mask])
        found = {c: rms(own) for c, own in parts.items() if c in known}
        sizes = [Size(c, r, units[c], r / known[c].value, known[c].words) for c, r in found.items() if r > 0]
        if sizes:
            most = max(sizes, key=lambda s: s.share)
            out[effect_id] = replace(most, metres=_metres(analysis, most.channel, moved))
    return out


def channel_metres(analysis: Analysis, channel: str, stage: Literal["before", "named"]) -> float | None:
    """How far off a channel's error leads within half a second, on the runs held out where there are any."""
    part = fitted_part(analysis)
    own = [(t, getattr(t, stage), part(t.run, t.time_s)) for t in analysis.traces if t.channel == channel]
    held = any((sign < 0).any() for _, _, sign in own)
    return _metres(analysis, channel, [(t, error, sign < 0 if held else sign > 0) for t, error, sign in own])


def _metres(
    analysis: Analysis, channel: str, errors: Iterable[tuple[ChannelTrace, np.ndarray, np.ndarray]]
) -> float | None:
    """Drift of one channel's errors, each with its trace and the mask of the rows that count."""
    if analysis.instrument is not None:
        return None
    own = [(t.time_s, np.where(mask, error, np.nan)) for t, error, mask in errors if t.channel == channel]
    return drift_m(analysis.believed, channel, own)


def channel_size(analysis: Analysis, channel: str, rms: float, stage: Literal["before", "named"]) -> Size | None:
    """The size of a channel's error; None where the channel has no scale."""
    known, units = scales(analysis), {t.channel: t.unit for t in analysis.traces}
    if channel not in known or channel not in units:
        return None
    scale = known[channel]
    return Size(channel, rms, units[channel], rms / scale.value, scale.words, channel_metres(analysis, channel, stage))


def share_words(size: Size) -> str:
    """`6 % of the weight`."""
    share = 100 * size.share
    return f"{share:.0f} % {size.words}" if share >= 1 else f"{share:.1g} % {size.words}"


def metres_words(size: Size) -> str:
    """`0.060 m after 0.5 s simulated`; empty where it moves nothing."""
    return "" if size.metres is None else f"{number(size.metres)} m after 0.5 s simulated"


def drift_m(vehicle: Vehicle, channel: str, stretches: Iterable[tuple[np.ndarray, np.ndarray]]) -> float | None:
    """Root mean square, over windows of half a second, of the metres off at their ends.

    `stretches` are instants (n,), s, evenly spaced, and errors (n,), N or N m; what is missing or left out is NaN, and
    no window holds any. None for a channel that moves nothing, and where no window is whole.
    """
    if channel.startswith("force_"):
        power, scale = 1, 1.0 / vehicle.mass_kg
    elif channel in _AXES:
        inertia = getattr(vehicle.inertia_kg_m2, _AXES[channel])
        power, scale = 3, vehicle.gravity_m_s2 / (6.0 * inertia)
    else:
        return None
    found = rms(scale * _ends(time_s, error, power) for time_s, error in stretches)
    return None if np.isnan(found) else found


def _ends(time_s: np.ndarray, error: np.ndarray, power: int) -> np.ndarray:
    """∫ (T − t)^power · error dt over every window of a stretch, by the rule of midpoints; NaN where any is missing."""
    if len(time_s) < 2:
        return np.zeros(0)
    step = float(np.median(np.diff(time_s)))
    per = max(round(WINDOW_S / step), 1)
    count = len(error) // per
    windows = error[: count * per].reshape(count, per)
    left = WINDOW_S * (1.0 - (np.arange(per) + 0.5) / per)
    return windows @ left**power * (WINDOW_S / per)


def segments_of(analysis: Analysis) -> list[Segment] | list[Loading]:
    """Evenly sampled stretches of every run, as the analysis sees them; loadings of a stand or bench."""
    if analysis.instrument is not None:
        return list(analysis.loadings)
    runs, vehicle = analysis.recordings.runs, analysis.believed
    rate_hz, cutoff_hz = analysis_rate_hz(runs, vehicle, HIGHEST_CUTOFF_HZ)
    full = full_speed(runs, vehicle)
    return [s for run in runs for s in build_segments(run, vehicle, rate_hz, cutoff_hz, full_speed_rad_s=full)]


def fitted_part(analysis: Analysis) -> Callable[[str, np.ndarray], np.ndarray]:
    """Function of a run and instants that gives +1 where fitted, -1 where held out, 0 in the gap between.

    Whole runs where there are several; of a single run the stretches that the analysis chose.
    """
    rule = training_rule(analysis.split, [])
    code = {True: 1, False: -1, None: 0}

    def part(run: str, time_s: np.ndarray) -> np.ndarray:
        return np.array([code[rule(run, t)] for t in np.ravel(time_s)], int).reshape(np.shape(time_s))

    return part


def shares(
    analysis: Analysis, segments: list[Segment], channels: Mapping[str, Sequence[ChannelTrace]]
) -> dict[int, dict[str, list[np.ndarray]]]:
    """Number of a finding to channel to its contribution on each of that channel's traces, in the order of `channels`.

    Only findings at work whose form adds a wrench or a reading; others are left out. In a run in which a finding
    shows nowhere it contributes nothing to the channels that it has in others.
    """
    out: dict[int, dict[str, list[np.ndarray]]] = {}
    by_run: dict[str, list[Segment]] = {}
    for segment in segments:
        by_run.setdefault(segment.run, []).append(segment)
    for at, finding in enumerate(analysis.findings):
        at_work = finding.status in ("established", "ambiguous", "suggested")
        if not at_work or finding.windows or not isinstance(finding.form, Form):
            continue
        series = {run: _series(finding, parts, analysis.improved) for run, parts in by_run.items()}
        for channel, traces in channels.items():
            group, _, axis = channel.rpartition("_")
            own = [series.get(trace.run, {}).get(group) for trace in traces]
            if axis not in ("x", "y", "z") or all(found is None for found in own):
                continue
            out.setdefault(at, {})[channel] = [
                np.zeros(len(t.time_s)) if o is None else np.interp(t.time_s, o[0], o[1][:, "xyz".index(axis)])
                for t, o in zip(traces, own, strict=True)
            ]
    return out


def effort(segments: list[Segment]) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """How hard each run is flown: instants (n,) and squares (n, 4) of rotor speed changes, rates and accelerations.

    Readings that are late by part of a sample, or coarse, leave errors that grow with these.
    """
    parts: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    for segment in segments:
        if isinstance(segment, Loading):
            parts.setdefault(segment.run, []).append((segment.time_s, _changes(segment)))
            continue
        motion = segment.motion
        given = [motion.rotor_acceleration, motion.angular_velocity, motion.angular_acceleration, motion.specific_force]
        squares = [np.zeros(motion.size) if g is None else (np.nan_to_num(g) ** 2).sum(axis=1) for g in given]
        squares[3] = (squares[3] - np.median(squares[3])) ** 2
        parts.setdefault(segment.run, []).append((motion.time_s, np.stack(squares, axis=1)))
    return {run: (np.concatenate([t for t, _ in p]), np.concatenate([e for _, e in p])) for run, p in parts.items()}


def _changes(loading: Loading) -> np.ndarray:
    """Squares of the rates of the loads, of the loads themselves and of the rotors' speeds, (n, 5).

    A speed sensor's noise is a share of the speed: its square grows with the thrust, not with the thrust's square.
    """
    rate = np.gradient(loading.load, loading.dt_s, axis=0) ** 2
    size = (loading.load - loading.rest) ** 2
    speed = loading.motion.rotor_speed
    turning = np.zeros(loading.size) if speed is None else (speed**2).mean(axis=1)
    return np.stack([rate[:, :3].sum(1), rate[:, 3:].sum(1), size[:, :3].sum(1), size[:, 3:].sum(1), turning], axis=1)


def _series(finding: Finding, segments: list[Segment], vehicle) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Channel group to instants (n,) and contribution (n, 3) over all stretches of a run."""
    parts: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
    for segment in segments:
        if isinstance(segment, Loading):
            added = np.nan_to_num(form_reading(finding.form, finding.values, segment, vehicle))
            for group, values in (("force", added[:, :3]), ("moment", added[:, 3:])):
                parts.setdefault(group, []).append((segment.time_s, values))
            continue
        added = finding.form.contribution(segment.motion, vehicle, np.asarray(finding.values, float))
        for group, values in project(added, segment, vehicle, GROUPS).items():
            parts.setdefault(group, []).append((segment.motion.time_s, np.nan_to_num(values)))
    return {g: (np.concatenate([t for t, _ in p]), np.concatenate([v for _, v in p])) for g, p in parts.items()}
