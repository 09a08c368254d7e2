"""Readings of a stand or bench that keep one value in every run while others change: nothing was read there."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from rotorid.io.text.names import listed
from rotorid.recordings import columns as c
from rotorid.recordings.doubts import Doubt
from rotorid.recordings.run import RecordingSet
from rotorid.recordings.sufficient import compared_readings


def still_readings(recordings: RecordingSet) -> Iterator[Doubt]:
    """One doubt for all such readings; it stops a verdict where no reading of the instrument changes."""
    runs, vehicle = recordings.runs, recordings.vehicle
    if vehicle.kind == "flight":
        return
    names = list(dict.fromkeys(name for run in runs for name in compared_readings(run, vehicle)))
    spans = {}
    for name in names:
        values = np.concatenate([run.column(name) for run in runs if run.has(name)])
        values = values[np.isfinite(values)]
        if len(values) > 1:
            spans[name] = float(np.ptp(values)), float(values[0])
    # A reference may be the weights that were put on, the same in every run.
    own = [name for name in spans if name not in c.REFERENCE_FORCE]
    still = [name for name in own if spans[name][0] == 0]
    moving = [name for name, (span, _) in spans.items() if span > 0]
    if still and moving:
        values = list(dict.fromkeys(f"{spans[name][1]:.4g}" for name in still))
        yield Doubt(
            still[0],
            f"{listed(still)} {'keeps' if len(still) == 1 else 'keep'} one value ({listed(values)}) in every run while "
            f"{listed(moving)} {'changes' if len(moving) == 1 else 'change'}, expected at least the noise of a sensor: "
            "not measured, or a sensor that stands still",
            stops=len(still) == len(own),
        )
