"""What stands in the way of believing a verdict: doubts of `check`, less those that the analysis corrected."""

from __future__ import annotations

from dataclasses import replace

from rotorid.mismatch.findings import Analysis
from rotorid.recordings import RecordingSet
from rotorid.recordings.check import doubts_of
from rotorid.recordings.doubts import Doubt


def with_doubts(analysis: Analysis, recordings: RecordingSet) -> Analysis:
    """The analysis with the doubts about the set as it was given, those that it corrected said to be so.

    Corrected is a doubt that the recordings as analysed, with the improved vehicle, no longer raise.
    """
    found = doubts_of(recordings)
    left = found
    if any(d.stops for d in found):
        left = doubts_of(replace(analysis.recordings, vehicle=corrected(analysis)))
    standing = {d.what for d in left}
    said = tuple(d if d.what in standing or not d.stops else as_corrected(d) for d in found)
    return replace(analysis, doubts=(*said, *recordings.proposed))


def corrected(analysis: Analysis):
    """The vehicle as the analysis has it: mistakes undone and wrong values at their numbers, without effects."""
    return analysis.improved.model_copy(update={"effects": ()})


def as_corrected(doubt: Doubt) -> Doubt:
    """A doubt that no longer stands in the way."""
    return replace(doubt, sentence=f"{doubt.sentence} The analysis found and corrected this.", stops=False)


def stopping(analysis: Analysis) -> tuple[Doubt, ...]:
    """Doubts because of which the set is not judged."""
    return tuple(d for d in analysis.doubts if d.stops)
