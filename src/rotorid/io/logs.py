"""Raw logs to tidy tables: `read_log(path)` gives a table with units, quality flags and the metadata.

A log cut off anywhere is read up to the cut; `Log.cut_at` says so. The table's time is the device's own
clock, unwrapped; the host's time stands beside it, so that two instruments can be aligned.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.io import rawlog, wire
from rotorid.io.frames import DATA, END, START, StreamDecoder
from rotorid.io.sequence import Gap, Quality, Tracker
from rotorid.io.session import Session, SessionError, read_session, session_path


class LogError(ValueError):
    """A log that no table can be made of; the sentence names the file and what was expected."""


@dataclass(frozen=True)
class Log:
    """A parsed log.

    `table`, one row per sample in the device's order, columns:
      time_s       device time since the first sample; after a reset continued by the host's clock
      host_time_s  when the sample's bytes were read, host's monotonic time since the recording began
      segment      number of device resets before the sample
      index        the frame's unwrapped sequence number within its segment
      quality      sum of `rotorid.io.sequence.Quality` flags, 0 = good
      …            the instrument's channels, see `rotorid.io.wire`
    """

    path: Path
    instrument: wire.Instrument
    table: pd.DataFrame
    start: wire.StartRecord
    end: wire.EndRecord | None
    session: Session | None  # None where the metadata file is missing
    notes: list[tuple[float, dict]]  # host time in s since the beginning, what the recorder noted
    gaps: list[Gap]
    checksum_errors: int
    broken_frames: int
    repeated: int
    resets: int
    cut_at: int | None

    @property
    def complete(self) -> bool:
        """Whole file, end record there, nothing missing."""
        return self.cut_at is None and self.end is not None and not self.gaps

    @property
    def missing(self) -> int:
        return sum(gap.count for gap in self.gaps)


def read_log(path: str | Path) -> Log:
    """Parse a raw log (`.rlog` or `.rlog.gz`), whole or cut.

    Raises LogError where no start record tells the instrument (and no metadata does either), NotALog where
    the file is none, OSError where there is no file.
    """
    path = Path(path)
    raw = rawlog.read_raw(path)
    session = _session_of(path)
    decoder, tracker = StreamDecoder(), Tracker()
    start = end = None
    origin_ns = raw.chunks[0].host_ns if raw.chunks else 0
    places, hosts, payloads = [], [], []
    notes: list[tuple[float, dict]] = []
    for chunk in raw.chunks:
        host_ns = chunk.host_ns - origin_ns
        if chunk.tag == rawlog.NOTE:
            note = json.loads(chunk.data)
            notes.append((host_ns / 1e9, note))
            if note.get("note") == "port_lost":
                decoder.break_off()
        if chunk.tag != rawlog.RECEIVED:
            continue
        for frame in decoder.feed(chunk.data):
            place = tracker.place(frame)
            if place is None:
                continue
            if frame.kind == DATA:
                places.append(place)
                hosts.append(host_ns)
                payloads.append(frame.payload)
            elif frame.kind == START:
                start = wire.StartRecord.unpack(frame.payload)
            elif frame.kind == END:
                end = wire.EndRecord.unpack(frame.payload)
    instrument = _instrument(path, start, session)
    if start is None:
        start = wire.StartRecord(0, instrument.interval_us, 0, instrument.name, "unknown", "unknown")
    return Log(
        path=path,
        instrument=instrument,
        table=_table(path, instrument, places, hosts, payloads),
        start=start,
        end=end,
        session=session,
        notes=notes,
        gaps=list(tracker.gaps),
        checksum_errors=decoder.checksum_errors,
        broken_frames=decoder.broken_frames,
        repeated=tracker.repeated,
        resets=tracker.resets,
        cut_at=raw.cut_at,
    )


def _session_of(path: Path) -> Session | None:
    try:
        return read_session(session_path(path))
    except SessionError:
        if session_path(path).exists():
            raise
        return None


def _instrument(path: Path, start: wire.StartRecord | None, session: Session | None) -> wire.Instrument:
    name = start.instrument if start else session.instrument if session else None
    if name is None:
        raise LogError(
            f"{path}: no start record in it and no {session_path(path).name} beside it, "
            "so nothing says which instrument wrote it"
        )
    if name not in wire.INSTRUMENTS:
        raise LogError(f"{path}: unknown instrument {name!r}; known are {', '.join(wire.INSTRUMENTS)}")
    return wire.INSTRUMENTS[name]


def _table(path: Path, instrument: wire.Instrument, places, hosts, payloads) -> pd.DataFrame:
    for payload in payloads:
        if len(payload) != instrument.layout.size:
            raise LogError(
                f"{path}: a {instrument.name} sample has {instrument.layout.size} bytes, "
                f"here is one of {len(payload)}; does the firmware fit this version's wire format?"
            )
    dtype = np.dtype([(c.column, "<" + _NUMPY[c.code]) for c in instrument.channels])
    counts = np.frombuffer(b"".join(payloads), dtype=dtype)
    where = np.array(places, dtype=np.int64).reshape(-1, 4)
    host_ns = np.array(hosts, dtype=np.int64)
    order = np.lexsort((where[:, 1], where[:, 0]))  # by segment, then by index: late frames fall into place
    counts, where, host_ns = counts[order], where[order], host_ns[order]
    quality = where[:, 3].copy()
    columns = {}
    for channel in instrument.channels:
        raw = counts[channel.column].astype(np.int64)
        if channel.reading:
            quality[(raw <= channel.low) & (channel.low < 0) | (raw >= channel.high)] |= Quality.SATURATED
        columns[channel.column] = raw * channel.scale
    return pd.DataFrame(
        {
            "time_s": _device_time(where, host_ns),
            "host_time_s": host_ns / 1e9,
            "segment": where[:, 0],
            "index": where[:, 1],
            "quality": quality.astype(np.uint8),
            **columns,
        }
    )


_NUMPY = {"b": "i1", "B": "u1", "h": "i2", "H": "u2", "i": "i4", "I": "u4"}


def _device_time(where: np.ndarray, host_ns: np.ndarray) -> np.ndarray:
    """Seconds since the first sample, shape (n,): device clock within a segment, host clock across resets."""
    if not len(where):
        return np.empty(0)
    time_us = where[:, 2] - where[0, 2]
    for segment in np.unique(where[:, 0])[1:]:
        here = where[:, 0] == segment
        before = np.flatnonzero(where[:, 0] < segment)[-1]
        first = np.flatnonzero(here)[0]
        step_us = max((host_ns[first] - host_ns[before]) // 1000, 1)
        time_us[here] = where[here, 2] - where[first, 2] + time_us[before] + step_us
    return time_us / 1e6
