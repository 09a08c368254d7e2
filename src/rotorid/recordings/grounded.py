"""How much of a log is flight: rotors that hardly turn lift nothing, and what is fitted there is no flight."""

from __future__ import annotations

import numpy as np

from rotorid.recordings import columns as c
from rotorid.recordings.doubts import Doubt
from rotorid.recordings.run import RecordingSet, Run

LIFTING = 0.4
"""Share of the usual thrust (the median of the upper half of its seconds) below which rotors carry no weight."""
WORTH_SAYING = 0.05
"""Share of the log on the ground from which it is said."""


def thrust_shape(run: Run, rotors: int) -> np.ndarray | None:
    """Sum of the squared rotor speeds, commands or throttles, (n,), whichever is recorded; None without any."""
    for group in ("rotor_speed", "rotor_command", "throttle"):
        names = c.rotor_columns(group, rotors)
        if run.has(*names):
            return (run.array(names) ** 2).sum(axis=1)
    return None


def grounded_share(recordings: RecordingSet) -> float:
    """Share of the samples, 0 to 1, in which the rotors do not carry the vehicle; 0 where that is not recorded."""
    shapes = [s for run in recordings.runs if (s := thrust_shape(run, recordings.vehicle.rotor_count)) is not None]
    every = np.concatenate(shapes) if shapes else np.zeros(0)
    every = every[np.isfinite(every)]
    if not len(every):
        return 0.0
    usual = np.median(every[every >= np.median(every)])
    return float(np.mean(every < LIFTING * usual))


def grounded(recordings: RecordingSet) -> tuple[Doubt, ...]:
    """A doubt where a good part of a set of flights is on the ground."""
    share = grounded_share(recordings)
    if share < WORTH_SAYING:
        return ()
    sentence = f"In {100 * share:.0f} % of the log the rotors carry no weight: it is on the ground."
    return (Doubt("time_s", sentence, stops=False),)
