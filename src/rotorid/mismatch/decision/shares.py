"""What each finding adds to each channel, on the instants of the traces."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from rotorid.effects.contract import Form
from rotorid.effects.loading import Loading
from rotorid.mismatch.decision.findings import Analysis, Finding
from rotorid.mismatch.plant.motion import HIGHEST_CUTOFF_HZ, Segment, analysis_rate_hz, build_segments, full_speed
from rotorid.mismatch.plant.readings import form_reading
from rotorid.mismatch.plant.rows import GROUPS, project
from rotorid.mismatch.plant.split import training_rule


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


def shares(analysis: Analysis, segments: list[Segment]) -> dict[int, dict[str, list[np.ndarray]]]:
    """Number of a finding to channel to its contribution on each of that channel's traces, in their order.

    Only findings at work whose form adds a wrench or a reading; others are left out.
    """
    out: dict[int, dict[str, list[np.ndarray]]] = {}
    by_run: dict[str, list[Segment]] = {}
    for segment in segments:
        by_run.setdefault(segment.run, []).append(segment)
    for number, finding in enumerate(analysis.findings):
        at_work = finding.status in ("established", "ambiguous", "suggested")
        if not at_work or finding.windows or not isinstance(finding.form, Form):
            continue
        series = {run: _series(finding, parts, analysis.improved) for run, parts in by_run.items()}
        for trace in analysis.traces:
            group, _, axis = trace.channel.rpartition("_")
            if axis not in ("x", "y", "z") or group not in series.get(trace.run, {}):
                continue
            time_s, values = series[trace.run][group]
            on_trace = np.interp(trace.time_s, time_s, values[:, "xyz".index(axis)])
            out.setdefault(number, {}).setdefault(trace.channel, []).append(on_trace)
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
