"""Mistakes in the recording set itself, recognised before any physics is asked for, named and corrected."""

from __future__ import annotations

from rotorid.mismatch.decision.findings import Finding
from rotorid.mismatch.mistakes import axes, dropout, rotor_layout, timing, units, vibration
from rotorid.mismatch.mistakes.dead_voltmeter import connected
from rotorid.mismatch.mistakes.signals import ReadSet
from rotorid.recordings import RecordingSet


def find_mistakes(recordings: RecordingSet) -> tuple[RecordingSet, tuple[Finding, ...], tuple[str, ...]]:
    """The set as corrected, what was wrong with it, and notes for the reader."""
    findings: list[Finding] = []
    recordings = ReadSet(recordings.name, recordings.vehicle, recordings.runs, recordings.held_out)
    if recordings.vehicle.kind == "flight":
        recordings, lost = dropout.find(recordings)
        findings += [lost] if lost else []
    for error in units.by_size(recordings):
        recordings = units.corrected(recordings, error)
        findings.append(units.as_finding(error))
    recordings, notes = connected(recordings)
    for step in (axes.find, rotor_layout.find, timing.find):
        found = step(recordings)
        recordings, notes = found.recordings, notes + found.notes
        findings += found.findings
    shaking = vibration.find(recordings)
    findings += [shaking] if shaking else []
    recordings = RecordingSet(recordings.name, recordings.vehicle, recordings.runs, recordings.held_out)
    return recordings, tuple(findings), notes
