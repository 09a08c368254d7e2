"""What stands in the way of believing a verdict: doubts of `check`, less those that the analysis corrected."""

from __future__ import annotations

import math
from dataclasses import replace

from rotorid.mismatch.decision.findings import Analysis, by_channel, rms
from rotorid.mismatch.decision.sizes import scales
from rotorid.recordings import RecordingSet
from rotorid.recordings.check import doubts_of
from rotorid.recordings.doubts import Doubt

DESCRIBED = 0.1
"""Share of the weight, or of the moment that the rotors can make, that may stay off in a channel where a mistake in the
set counts as corrected: of wrong corrections seen a quarter to a half stayed, of right ones next to nothing."""


def with_doubts(analysis: Analysis, recordings: RecordingSet) -> Analysis:
    """The analysis with the doubts about the set as it was given, those that it corrected said to be so.

    Corrected is a doubt that the recordings as analysed, with the improved vehicle, no longer raise, where the model
    then describes them. Axes can be exchanged so that all sensors agree and the vehicle is another one.
    """
    found = doubts_of(recordings)
    left = found
    if any(d.stops for d in found) and still_off(analysis) < DESCRIBED:
        left = doubts_of(replace(analysis.recordings, vehicle=corrected(analysis)))
    standing = {d.what for d in left}
    said = tuple(d if d.what in standing or not d.stops else as_corrected(d) for d in found)
    return replace(analysis, doubts=(*said, *recordings.proposed))


def still_off(analysis: Analysis) -> float:
    """Largest error of a channel beyond its noise, over what a pilot knows: the weight, the moment at hand."""
    known, off = scales(analysis), [0.0]
    for channel, traces in by_channel(t for t in analysis.traces if t.channel in known).items():
        square = rms(t.named for t in traces) ** 2
        off.append(math.sqrt(max(square - analysis.noise_floor.get(channel, 0.0) ** 2, 0.0)) / known[channel].value)
    return max(off)


def corrected(analysis: Analysis):
    """The vehicle as the analysis has it: mistakes undone and wrong values at their numbers, without effects."""
    return analysis.improved.model_copy(update={"effects": (), "derivatives": ()})


def as_corrected(doubt: Doubt) -> Doubt:
    """A doubt that no longer stands in the way."""
    return replace(doubt, sentence=f"{doubt.sentence} The analysis found and corrected this.", stops=False)


def stopping(analysis: Analysis) -> tuple[Doubt, ...]:
    """Doubts because of which the set is not judged."""
    return tuple(d for d in analysis.doubts if d.stops)
