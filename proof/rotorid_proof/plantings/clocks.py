"""Stamps of one sensor late by a constant, or by more and more."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from rotorid.recordings import RecordingSet
from rotorid_proof.plantings.columns import command_of, dense, has, of_sensor, signed
from rotorid_proof.plantings.kinds import Kind, Size, both, named

POSE = ("position", "velocity", "attitude")
COMMANDED = ("commands", "throttle")
COMMANDS = frozenset(COMMANDED)
LEAST_DRIFT_PERIODS = 4.0
"""A clock that is off by less than this many samples at a run's end is not distinguished from a jitter of its
stamps."""


def _period_s(recordings: RecordingSet) -> float:
    return float(np.median([np.median(np.diff(run.time_s)) for run in recordings.runs]))


def _moved(values: np.ndarray, steps: int) -> np.ndarray:
    """Readings (n, m) written `steps` samples late; what was read before the run is missing."""
    out = np.full_like(values, np.nan)
    if steps > 0:
        out[steps:] = values[:-steps]
    elif steps < 0:
        out[:steps] = values[-steps:]
    else:
        out = values
    return out


def late(*sensors: str):
    """A planting that writes the sensors' readings late by a whole number of samples (their noise stays as it is)."""

    def plant(recordings: RecordingSet, late_s: float, rng: np.random.Generator):
        period = _period_s(recordings)
        steps = max(3, round(late_s / period))
        out = recordings
        for sensor in sensors:
            if has(out, sensor):
                out = of_sensor(out, sensor, lambda run, values: _moved(values, steps))
        sizes = tuple((Size("delay", symbol, steps * period, added=False),) for symbol in ("T_d", "T"))
        return out, named("delay", sizes=sizes)

    return plant


def skewed(*sensors: str):
    """A planting whose clock falls behind, or gains, by a constant share: value at t is that of t − e (t − t_0).

    Read between samples by a cubic spline, which is exact for all that moves slower than a third of the sampling.
    """

    def plant(recordings: RecordingSet, share: float, rng: np.random.Generator):
        skew = share * signed(rng)

        def change(run, values):
            t = run.time_s
            # A clock that gains is right at the end of the run instead, so that all its readings were recorded.
            asked = t - skew * (t - t[0]) if skew > 0 else t - skew * (t - t[-1])
            good = np.isfinite(values).all(axis=1)
            out = CubicSpline(t[good], values[good], axis=0, extrapolate=False)(asked)
            out[np.interp(asked, t, good.astype(float)) < 1.0] = np.nan
            return out

        out = recordings
        for sensor in sensors:
            if has(out, sensor):
                out = of_sensor(out, sensor, change)
        longest = max(run.time_s[-1] - run.time_s[0] for run in recordings.runs)
        drift = share * longest / _period_s(recordings)
        unseen = "" if drift > LEAST_DRIFT_PERIODS else f"the clock is off by {drift:.1f} samples at a run's end"
        sizes = tuple((Size("clock_skew", symbol, skew, added=False),) for symbol in ("skew", "e"))
        # A clock that gains was off at the start of the run: a delay is reported as well, and rightly.
        return out, named("clock_skew", fair=("delay",) if skew < 0 else (), sizes=sizes, unseen=unseen)

    return plant


def _fits(*sensors: str):
    return lambda recordings: (
        all(dense(recordings, s) for s in sensors)
        and (
            sensors[0] != "gyroscope"
            or has(recordings, "attitude")
            or any(has(recordings, s) for s in ("rotors", "throttle"))
        )
    )


def _commanded(recordings: RecordingSet) -> bool:
    """Whether commands alone say what the rotors do."""
    driver = command_of(recordings)
    return driver is not None and dense(recordings, driver) and not has(recordings, "rotors")


LATE_S, SKEW = both(0.020, 0.008), both(1.5e-3, 6e-4)
KINDS = (
    Kind("clocks", "rotors_late", frozenset({"rotors"}), LATE_S, _fits("rotors"), late("rotors")),
    Kind("clocks", "gyroscope_late", frozenset({"gyroscope"}), LATE_S, _fits("gyroscope"), late("gyroscope")),
    Kind(
        "clocks",
        "accelerometer_late",
        frozenset({"accelerometer"}),
        LATE_S,
        _fits("accelerometer"),
        late("accelerometer"),
    ),
    Kind("clocks", "pose_late", frozenset(POSE), LATE_S, _fits(*POSE), late(*POSE)),
    Kind("clocks", "rotors_skewed", frozenset({"rotors"}), SKEW, _fits("rotors"), skewed("rotors")),
    Kind("clocks", "commands_late", COMMANDS, LATE_S, _commanded, late(*COMMANDED)),
    Kind("clocks", "commands_skewed", COMMANDS, SKEW, _commanded, skewed(*COMMANDED)),
    Kind("clocks", "gyroscope_skewed", frozenset({"gyroscope"}), SKEW, _fits("gyroscope"), skewed("gyroscope")),
    Kind("clocks", "pose_skewed", frozenset(POSE), SKEW, _fits(*POSE), skewed(*POSE)),
)
