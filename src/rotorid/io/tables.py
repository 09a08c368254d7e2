"""Raw logs of one kind and instrument as two tidy tables: all samples, and one row per recording.

The table of samples keeps the instrument's columns with the unit in their names, the quality flags of
`rotorid.io.logs`, and the recording's `id` before them. The table of recordings holds what the operator set,
the marks (values of the column `index`) and what went wrong on the line.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.io.logs import Log, read_log
from rotorid.io.session import Ended

_SETUP = (
    "platform axis load_gf cell repeat experiment throttle motor infill_percent specimen gauge_length_mm "
    "cross_section_mm2 mount_roll_deg mount_pitch_deg tared"
).split()


def read_tables(paths: Iterable[str | Path]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Samples and recordings of logs of one instrument, in the order of the recordings' time.

    Raises
    ------
    InputError
        No logs, logs of different instruments, a log without its metadata or with bytes that are not those of the
        recording, or two of the same id.
    """
    logs = [read_log(path) for path in paths]
    if not logs:
        raise InputError("no raw logs to read: is the campaign recorded, and listed in raw/sessions.tsv?")
    for log in logs:
        if log.session is None:
            raise InputError(f"{log.path}: its metadata file is missing, so nobody knows what was measured")
        if log.faults and not log.damaged_bytes and log.cut_at is None:
            raise InputError(f"{log.path}: {log.faults[0]}; put the right file back")
        if log.instrument.name != logs[0].instrument.name:
            raise InputError(f"{log.path}: is of a {log.instrument.name}, expected one of a {logs[0].instrument.name}")
    logs.sort(key=lambda log: (log.session.started, log.session.id))
    sessions = pd.DataFrame([_row(log) for log in logs])
    twice = sessions["id"][sessions["id"].duplicated()]
    if len(twice):
        raise InputError(f"two recordings are called {twice.iloc[0]}; every id must be there once")
    samples = pd.concat([log.table.assign(id=log.session.id) for log in logs], ignore_index=True)
    return samples[["id", *(name for name in samples.columns if name != "id")]], sessions


def _row(log: Log) -> dict:
    """What the recording is, how it went, and its marks as columns `mark_<name>`."""
    session = log.session
    setup = session.setup.model_dump()
    flagged = int((log.table["quality"] != 0).sum())
    return {
        "id": session.id,
        "group": session.group or session.id,
        "kind": session.setup.kind,
        "source": session.source,
        "started": session.started,
        "host_start_s": session.host_start_ns / 1e9,
        **{name: setup[name] for name in _SETUP},
        "sensor_x_m": _part(setup["sensor_position_m"], 0),
        "sensor_y_m": _part(setup["sensor_position_m"], 1),
        "sensor_z_m": _part(setup["sensor_position_m"], 2),
        "air_density_kg_m3": session.setup.air.density_kg_m3 if session.setup.air else np.nan,
        "samples": len(log.table),
        "rate_hz": _rate(log.table["time_s"].to_numpy()),
        "flagged": flagged,
        "missing": log.missing,
        "damaged": log.checksum_errors + log.broken_frames + log.malformed,
        "damaged_bytes": log.damaged_bytes,
        "repeated": log.repeated,
        "resets": log.resets,
        "complete": log.complete,
        "faults": "; ".join(log.faults),
        "metadata_checksum": session.metadata_sha256 is not None,
        # a cut log has lost its end, whatever its metadata say
        "finished": session.ended == Ended.FINISHED and log.cut_at is None,
        **{f"mark_{name}": place for name, place in session.marks.items()},
    }


def _part(values: list[float] | None, place: int) -> float:
    return np.nan if values is None else values[place]


def _rate(time_s: np.ndarray) -> float:
    """Samples per second of device time by the median step; NaN of fewer than two samples."""
    return float(1 / np.median(np.diff(time_s))) if len(time_s) > 1 else float("nan")


def read_sessions(path: str | Path) -> pd.DataFrame:
    """The table of recordings as `read_tables` makes it, from CSV; only recordings that came to their end."""
    table = pd.read_csv(path, dtype={"specimen": str})
    return table[table["finished"]].reset_index(drop=True)


def by_recording(samples: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Samples of each recording, by id, in the order of the table."""
    return {str(name): part for name, part in samples.groupby("id", sort=False)}
