"""Mistakes in the recording set itself, recognised before any physics is asked for, named and corrected."""

from __future__ import annotations

from rotorid.mismatch.decide.findings import Finding
from rotorid.mismatch.mistakes import axes, dropout, rotor_layout, timing, units, vibration
from rotorid.mismatch.mistakes.signals import Corrected, ReadSet, connected
from rotorid.recordings import RecordingSet
from rotorid.steps import step


@step("looking for mistakes in the recordings")
def find_mistakes(recordings: RecordingSet) -> tuple[RecordingSet, tuple[Finding, ...], tuple[str, ...]]:
    """The set of a vehicle in flight as corrected, what was wrong with it, and notes for the reader.

    `proposed` of the set that comes out holds what was doubted and left as it is.
    """
    before = _read(recordings)
    recordings, lost = dropout.find(before)
    notes: tuple[str, ...] = ()
    if lost:
        recordings, notes = dropout.what_is_left(recordings, before, lost)
    result = Corrected(recordings, (lost,) if lost else (), notes)
    for find in (units.find, connected, axes.find, rotor_layout.find, timing.find, vibration.find):
        result = result.then(find)
    return _written(result.recordings), result.findings, result.notes


def in_its_units(recordings: RecordingSet) -> tuple[RecordingSet, tuple[Finding, ...]]:
    """The set in the contract's units, and what was not: sizes of columns alone leave no doubt of a unit."""
    result = units.find(_read(recordings))
    return _written(result.recordings), result.findings


def _read(recordings: RecordingSet) -> ReadSet:
    return ReadSet(recordings.name, recordings.vehicle, recordings.runs, recordings.held_out)


def _written(recordings: ReadSet) -> RecordingSet:
    return RecordingSet(
        recordings.name, recordings.vehicle, recordings.runs, recordings.held_out, proposed=recordings.proposed
    )
