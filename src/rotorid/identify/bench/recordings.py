"""The static tests as recording sets of kind `bench`: reconstructed force next to the load that was put on.

One run holds the loads of one axis and repeat in the order in which they were put on. Its time counts from the
first recording of the set, so that runs lie where they were in the day; each load has its own recording, tared
at its start, with a gap in time before the next.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd

from rotorid.identify.bench.channels import CELLS, FORCES
from rotorid.identify.bench.reconstruct import GF_N, Geometry, cell_forces, forces
from rotorid.io.tables import by_recording
from rotorid.recordings import columns as c
from rotorid.recordings.run import RecordingSet, Run
from rotorid.recordings.vehicle import Vehicle

_DIRECTION = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, -1.0)}
"""Unit vector of a load, body axes: along z it pulls upwards, as thrust does."""


def bench_force(coefficients_gf: np.ndarray, geometry: Geometry) -> Callable[[pd.DataFrame], np.ndarray]:
    """Force, N, shape (n, 3), of a prepared table: of six cells by eqs 2.3 to 2.9, else as the sensor gives it."""

    def force(table: pd.DataFrame) -> np.ndarray:
        if CELLS[0] in table and table[CELLS[0]].notna().any():
            return forces(cell_forces(table[list(CELLS)].to_numpy(), coefficients_gf), geometry)
        return table[list(FORCES)].to_numpy()

    return force


def reference(session, table: pd.DataFrame, force_n: np.ndarray) -> np.ndarray:
    """The known load at each sample, N, shape (n, 3).

    Nobody wrote down the very moment at which the weight came on: it is where the reading first exceeds half of
    its final value.
    """
    direction = np.array(_DIRECTION[session.axis])
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
        Of that platform, from `rotorid.identify.bench.channels` and `rotorid.io.tables`.
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
        table[list(c.REFERENCE_FORCE)] = reference(session, whole, force)
        kept = whole["index"].between(session.mark_tare_start, session.mark_read_stop).to_numpy()
        runs.setdefault(f"{session.axis}-r{int(session.repeat):02d}", []).append(table[kept])
    vehicle = Vehicle.model_validate({"name": name, "kind": "bench", "tared": True, "noise": {"force_n": noise_n}})
    made = tuple(
        Run(run, pd.concat(tables, ignore_index=True).sort_values(c.TIME, ignore_index=True))
        for run, tables in sorted(runs.items())
    )
    return RecordingSet(name, vehicle, made)
