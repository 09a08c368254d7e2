"""What the page's replay shows: attitude as recorded and as simulated, and the force and moment that a model leaves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rotorid.errors import InputError
from rotorid.mismatch.decision.findings import Analysis
from rotorid.mismatch.delivery.model import Model
from rotorid.mismatch.plant.motion import Segment
from rotorid.mismatch.tell import forward
from rotorid.mismatch.tell.verdict import Verdict
from rotorid.vehicle.windows import Windows

LONGEST_S = 20.0
FRAMES_PER_S = 25.0


def replay(analysis: Analysis, verdict: Verdict, run: str, segments: Sequence[Segment]) -> dict[str, np.ndarray] | None:
    """Frames of up to LONGEST_S of a run, about where most was located; None where attitudes cannot be simulated.

    Returns
    -------
    `time_s` (n,), unit quaternions `recorded`, `before`, `after` (n, 4), body to world, scalar first; `force_before`,
    `force_after`, `moment_before`, `moment_after` (n, 3), N and N m, body axes, where the traces have them; `rotors`
    (k, 3), m, body axes. The simulations restart from the recording every half second.
    """
    if analysis.instrument is not None:
        return None
    usable = [
        s
        for s in segments
        if s.motion.rotation is not None and s.motion.rotor_speed is not None and s.motion.angular_velocity is not None
    ]
    mine = [k for k, s in enumerate(usable) if s.run == run]
    if not mine:
        return None
    centre = _busiest_s(verdict, run)
    at = min(mine, key=lambda k: _distance(usable[k].motion.time_s, centre))
    time_s = usable[at].motion.time_s
    first = (
        time_s[0]
        if centre is None
        else np.clip(centre - LONGEST_S / 2, time_s[0], max(time_s[-1] - LONGEST_S, time_s[0]))
    )
    out: dict[str, np.ndarray] = {}
    for stage, model in (("before", Model(analysis.believed)), ("after", forward.delivered_model(analysis))):
        found = _windows(usable, at, model)
        if found is None:
            return None
        recorded, windows = found
        if recorded is None or windows.predicted.quaternion is None or not windows.sample.size:
            return None
        starts = time_s[windows.sample[:, 0]]
        chosen = np.flatnonzero((starts >= first) & (starts < first + LONGEST_S))
        period = float(np.median(np.diff(time_s[windows.sample[0]]))) if windows.sample.shape[1] > 1 else 1.0
        every = max(1, round(1 / FRAMES_PER_S / period))
        sample = windows.sample[chosen][:, ::every].ravel()
        if not len(sample) or ("time_s" in out and not np.array_equal(out["time_s"], time_s[sample])):
            return None
        out["time_s"] = time_s[sample]
        out[stage] = windows.predicted.quaternion[chosen][:, ::every].reshape(-1, 4)
        out["recorded"] = recorded[sample]
    for group in ("force", "moment"):
        for stage in ("before", "after"):
            columns = [_trace(analysis, run, f"{group}_{axis}", stage, out["time_s"]) for axis in "xyz"]
            if all(c is not None for c in columns):
                out[f"{group}_{stage}"] = np.stack(columns, axis=1)
    out["rotors"] = analysis.believed.rotor_positions_m()
    return out


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


def _busiest_s(verdict: Verdict, run: str) -> float | None:
    here = [loc for loc in verdict.locations if loc.run == run and loc.start_s is not None and loc.stop_s is not None]
    if not here:
        return None
    best = max(here, key=lambda loc: loc.energy_share)
    return 0.5 * (best.start_s + best.stop_s)


def _distance(time_s: np.ndarray, centre: float | None) -> float:
    """How far an instant lies outside a stretch; without one, long stretches first."""
    if centre is None:
        return -float(time_s[-1] - time_s[0])
    return max(time_s[0] - centre, centre - time_s[-1], 0.0)


def _trace(analysis: Analysis, run: str, channel: str, stage: str, time_s: np.ndarray) -> np.ndarray | None:
    mine = [t for t in analysis.traces if t.run == run and t.channel == channel]
    if not mine:
        return None
    known = np.concatenate([t.time_s for t in mine])
    return np.interp(time_s, known, np.concatenate([getattr(t, stage) for t in mine]))
