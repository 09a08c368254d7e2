"""Bench readings made ready: rest reading taken off, spikes out, filtered as the thesis does and without lag.

The quality of a sample is that of `rotorid.io.logs` plus `SPIKE` where a channel jumped and came back.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.identify.bench.channels import CELLS, FORCES
from rotorid.io.tables import by_recording
from rotorid.recordings.signal import filters

SPIKE = 16
_SETTLING_SAMPLES = 10
"""Fig. 2.35: so many samples let the spikes of switching on dissipate."""


@dataclass(frozen=True)
class Filter:
    """Settings of the filters for one instrument."""

    low_pass_hz: float
    zero_phase_hz: float
    spike_window: int
    """Samples."""
    spike_threshold: float
    """Robust standard deviations."""
    steady_window: int
    """Samples."""
    steady_tolerance: float
    """Span of the low-passed signal, unit of the channel."""


def _rest_range(session: pd.Series, table: pd.DataFrame) -> tuple[int, int]:
    """First and last row of the rest reading: the recorder's tare, else what lies between settling and load.

    Marks are values of the table's column `index`.
    """
    index = table["index"].to_numpy()
    start, stop = session.get("mark_tare_start"), session.get("mark_tare_stop")
    if pd.notna(start) and pd.notna(stop):
        first, last = np.searchsorted(index, start), np.searchsorted(index, stop, side="right") - 1
    else:
        load = session.get("mark_load")
        if pd.isna(load):
            raise InputError(f"{session['id']}: has neither a tare nor a mark where the load was put on")
        first, last = _SETTLING_SAMPLES, np.searchsorted(index, load) - 2
    if last < first:
        raise InputError(f"{session['id']}: no samples at rest before the load")
    return int(first), int(last)


def _prepare_recording(session: pd.Series, table: pd.DataFrame, channels: Sequence[str], settings: Filter):
    """One recording made ready: columns `id time_s index quality steady`, and for each channel its tared values,
    `<channel>_low_pass` and `<channel>_zero_phase`."""
    rate_hz = float(session["rate_hz"])
    raw = table[list(channels)].to_numpy()
    jumped = filters.spikes(raw, settings.spike_window, settings.spike_threshold)
    clean = filters.without_spikes(raw, jumped)
    clean = clean - filters.tare(clean, *_rest_range(session, table))
    low = filters.first_order(clean, settings.low_pass_hz, rate_hz)
    out = table[["id", "time_s", "index"]].copy()
    out["quality"] = table["quality"].to_numpy() | np.where(jumped.any(axis=1), SPIKE, 0).astype(np.uint8)
    out["steady"] = filters.steady(low, settings.steady_window, settings.steady_tolerance)
    smooth = filters.zero_phase(clean, settings.zero_phase_hz, rate_hz)
    for kind, values in (("", clean), ("_low_pass", low), ("_zero_phase", smooth)):
        out[[name + kind for name in channels]] = values
    return out


def prepare(samples: pd.DataFrame, sessions: pd.DataFrame, settings: Filter) -> pd.DataFrame:
    """All recordings of one kind and instrument made ready; of a calibration only the cell under load, as `cell_v`."""
    parts = by_recording(samples)
    out = []
    for _, session in sessions.iterrows():
        table = parts[session["id"]]
        if session["kind"] == "calibration":
            name = f"cell_{int(session['cell'])}_v"
            table = table.rename(columns={name: "cell_v"})
            out.append(_prepare_recording(session, table, ["cell_v"], settings))
        else:
            channels = [name for name in (*CELLS, *FORCES) if name in table]
            out.append(_prepare_recording(session, table, channels, settings))
    return pd.concat(out, ignore_index=True)
