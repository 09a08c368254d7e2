"""Voltages that no battery has: of a voltmeter that is not connected."""

from __future__ import annotations

import numpy as np

from rotorid.mismatch.mistakes.signals import Corrected, replace_columns
from rotorid.recordings import RecordingSet, Run
from rotorid.recordings import columns as c

_LEAST_V = 0.5
"""No battery that turns a rotor has less."""


def connected(recordings: RecordingSet) -> Corrected:
    """The set without voltages that no battery has, and a note for every run whose voltmeter read mostly such."""
    notes = []

    def change(run: Run):
        if not run.has(c.BATTERY_VOLTAGE):
            return {}
        voltage = run.table[c.BATTERY_VOLTAGE]
        dead = voltage < _LEAST_V
        if not dead.any():
            return {}
        mostly = dead.sum() > voltage.notna().sum() / 2
        if mostly:
            notes.append(f"{c.BATTERY_VOLTAGE} of {run.name} reads below {_LEAST_V} V: taken as not connected.")
        return {c.BATTERY_VOLTAGE: np.nan if mostly else voltage.mask(dead)}

    return Corrected(replace_columns(recordings, change), notes=tuple(notes))
