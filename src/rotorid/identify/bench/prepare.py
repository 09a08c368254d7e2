"""Bench readings made ready: rest reading taken off, spikes out, filtered as the thesis does and without lag.

The quality of a sample is that of `rotorid.io.logs` plus `SPIKE` where a channel jumped and came back.

Static tests that are ready make recording sets of kind `bench`: reconstructed force next to the load that was put on.
One run holds the loads of one axis and repeat in the order in which they were put on. Its time counts from the first
recording of the set, so that runs lie where they were in the day; each load has its own recording, tared at its start,
with a gap in time before the next.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.identify.bench.reconstruct import CELLS, DIRECTION, FORCES, GF_N, Geometry, cell_forces, forces
from rotorid.io.tables import by_recording
from rotorid.recordings import columns as c
from rotorid.recordings.run import RecordingSet, Run
from rotorid.recordings.signal import filters
from rotorid.recordings.vehicle import Vehicle

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


def bench_force(coefficients_gf: np.ndarray, geometry: Geometry) -> Callable[[pd.DataFrame], np.ndarray]:
    """Force, N, shape (n, 3), of a prepared table: of six cells by eqs 2.3 to 2.9, else as the sensor gives it."""

    def force(table: pd.DataFrame) -> np.ndarray:
        if CELLS[0] in table and table[CELLS[0]].notna().any():
            return forces(cell_forces(table[list(CELLS)].to_numpy(), coefficients_gf), geometry)
        return table[list(FORCES)].to_numpy()

    return force


def _reference(session, table: pd.DataFrame, force_n: np.ndarray) -> np.ndarray:
    """The known load at each sample, N, shape (n, 3).

    Nobody wrote down the very moment at which the weight came on: it is where the reading first exceeds half of
    its final value.
    """
    direction = np.array(DIRECTION[session.axis])
    along = force_n @ direction
    index = table["index"].to_numpy()
    final = along[(index >= session.mark_read_start) & (index <= session.mark_read_stop)].mean()
    after_tare = index > session.mark_tare_stop
    on = after_tare & (np.abs(along) > 0.5 * abs(final))
    loaded = np.arange(len(index)) >= (np.argmax(on) if on.any() else len(index))
    return np.outer(loaded * session.load_gf * GF_N, direction)


def bench_set(
    name: str,
    prepared: pd.DataFrame,
    sessions: pd.DataFrame,
    force_of: Callable[[pd.DataFrame], np.ndarray],
    noise_n: float,
) -> RecordingSet:
    """Static tests of one platform as a contract set.

    Parameters
    ----------
    prepared, sessions
        Of that platform, from `rotorid.identify.bench.reconstruct` and `rotorid.io.tables`.
    force_of
        Force (n, 3), N, of a prepared recording, see `bench_force`.
    noise_n
        One-sigma noise of a sample as it is believed, N.
    """
    parts = by_recording(prepared)
    started = pd.to_datetime(sessions["started"])
    day_s = (started - started.min()).dt.total_seconds()
    runs: dict[str, list[pd.DataFrame]] = {}
    for session, offset_s in zip(sessions.itertuples(), day_s, strict=True):
        whole = parts[session.id]
        force = force_of(whole)
        table = pd.DataFrame({c.TIME: whole["time_s"].to_numpy() + offset_s})
        table[list(c.FORCE)] = force
        table[list(c.REFERENCE_FORCE)] = _reference(session, whole, force)
        kept = whole["index"].between(session.mark_tare_start, session.mark_read_stop).to_numpy()
        runs.setdefault(f"{session.axis}-r{int(session.repeat):02d}", []).append(table[kept])
    vehicle = Vehicle.model_validate({"name": name, "kind": "bench", "tared": True, "noise": {"force_n": noise_n}})
    made = tuple(
        Run(run, pd.concat(tables, ignore_index=True).sort_values(c.TIME, ignore_index=True))
        for run, tables in sorted(runs.items())
    )
    return RecordingSet(name, vehicle, made)
