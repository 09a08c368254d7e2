"""Raw logs to tidy tables: `read_log(path)` gives a table with units, quality flags and the metadata.

A log cut off anywhere is read up to the cut, a damaged one behind the damage as well; `Log.faults` says in sentences
what is not as it was recorded. The table's time is the device's own clock, unwrapped; the host's time stands next to
it, so that two instruments can be aligned. `read_tables` makes two tables of logs of one instrument: all samples, with
the recording's `id` before them, and one row a recording, with what the operator set, the marks (values of the column
`index`) and what went wrong on the line.
"""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid_acquire.io import rawlog, wire
from rotorid_acquire.io.frames import DATA, END, START, Intake, Quality
from rotorid_acquire.io.session import Ended, Gap, Session, read_session, session_path
from rotorid_acquire.io.wire import STREAMING

_SETUP = (
    "platform axis load_gf cell repeat experiment throttle motor infill_percent specimen gauge_length_mm "
    "cross_section_mm2 mount_roll_deg mount_pitch_deg tared"
).split()


@dataclass(frozen=True)
class Log:
    """A parsed log.

    `table`, one row per sample in the device's order, columns:
      time_s       device time since the first sample; after a reset continued by the host's clock
      host_time_s  when the sample's bytes were read, host's monotonic time since the recording began
      segment      number of device resets before the sample
      index        the frame's unwrapped sequence number within its segment
      quality      sum of `rotorid_acquire.io.frames.Quality` flags, 0 = good
      …            the instrument's channels, see `rotorid_acquire.io.wire`
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
    malformed: int = 0  # frames whose checksum fits and whose content does not
    unknown_kinds: int = 0
    missing_outside_gaps: int = 0  # before the first and behind the last frame, by the device's and recorder's counts
    damaged_bytes: int = 0  # of the file, not of the line
    faults: tuple[str, ...] = ()  # a sentence each: in what the file is not what the recorder wrote

    @property
    def complete(self) -> bool:
        """The file as it was written, end record there, nothing missing."""
        return not self.faults and self.cut_at is None and self.end is not None and not self.missing

    @property
    def missing(self) -> int:
        """Samples that were sent, or recorded, and are not in the table."""
        return sum(gap.count for gap in self.gaps) + self.missing_outside_gaps


def read_log(path: str | Path) -> Log:
    """Parse a raw log (`.rlog` or `.rlog.gz`), whole, cut or damaged.

    Raises InputError where no start record names the instrument (and no metadata does either), where the log and the
    metadata next to it are of two recordings, and where the file is no log or is not there.
    """
    path = Path(path)
    raw = rawlog.read_raw(path)
    session = read_session(session_path(path)) if session_path(path).exists() else None
    same_recording(path, raw, session)
    intake = Intake(wire.INSTRUMENTS.get(session.instrument) if session is not None else None)
    starts: list[wire.StartRecord] = []
    end = None
    origin_ns = raw.chunks[0].host_ns if raw.chunks else 0
    places, hosts, payloads = [], [], []
    notes: list[tuple[float, dict]] = []
    before_stream = 0  # samples sent before the latest stream began

    def sent_so_far() -> int:
        return len(places) + intake.tracker.missing + intake.malformed_samples

    for piece in raw.pieces():
        if isinstance(piece, rawlog.Damage):
            if piece.rescued is None:
                intake.decoder.break_off()
                continue
            piece = piece.rescued
        host_ns = piece.host_ns - origin_ns
        if piece.tag == rawlog.NOTE:
            note = _note(piece.data)
            notes.append((host_ns / 1e9, note))
            if note.get("note") == "port_lost":
                intake.decoder.break_off()
        if piece.tag != rawlog.RECEIVED:
            continue
        for kind, place, content in intake.feed(piece.data):
            if kind == DATA:
                places.append(place)
                hosts.append(host_ns)
                payloads.append(content)
            elif kind == START:
                starts.append(content)
                intake.instrument = wire.INSTRUMENTS.get(content.instrument, intake.instrument)
                if content.reason == STREAMING:
                    before_stream = sent_so_far()
            elif kind == END:
                end = content
                reached = sent_so_far() - before_stream
    instrument, fault = _instrument(path, starts, session)
    fitting = [
        number for number, payload in enumerate(payloads) if len(payload) == instrument.layout.size and not fault
    ]
    malformed = len(payloads) - len(fitting)
    unseen = max(0, end.sent - reached) if end is not None else 0
    if session is not None and session.ended != Ended.RECORDING:
        counts = session.counts
        unseen = max(unseen, counts.samples + counts.missing + (counts.malformed_samples or 0) - sent_so_far())
    faults = [*([fault] if fault else []), *faults_of(raw, session)]
    if starts:
        start = starts[-1]
    else:
        start = wire.StartRecord(0, instrument.interval_us, 0, instrument.name, "unknown", "unknown")
    kept = [[values[number] for number in fitting] for values in (places, hosts, payloads)]
    return Log(
        path=path,
        instrument=instrument,
        table=_table(instrument, *kept),
        start=start,
        end=end,
        session=session,
        notes=notes,
        gaps=list(intake.tracker.gaps),
        checksum_errors=intake.decoder.checksum_errors,
        broken_frames=intake.decoder.broken_frames,
        repeated=intake.tracker.repeated,
        resets=intake.tracker.resets,
        cut_at=raw.cut_at,
        malformed=intake.malformed + malformed,
        unknown_kinds=intake.unknown_kinds,
        missing_outside_gaps=unseen,
        damaged_bytes=raw.lost_bytes,
        faults=tuple(faults),
    )


def _note(data: bytes) -> dict:
    """A note of the recorder; one that is no JSON object (its checksum fits: someone else wrote it) says nothing."""
    try:
        note = json.loads(data)
    except ValueError:
        return {}
    return note if isinstance(note, dict) else {}


def same_recording(path: Path, raw: rawlog.RawLog, session: Session | None) -> None:
    """Raises InputError where the log's own name is not that of the metadata next to it."""
    if session is None:
        return
    for chunk in raw.chunks:
        if chunk.tag == rawlog.NOTE and _note(chunk.data).get("note") == "begin":
            name = _note(chunk.data).get("id")
            if name is not None and name != session.id:
                raise InputError(
                    f"{path}: holds the recording {name!r}, and the metadata next to it are those of {session.id!r}; "
                    "put the right file back"
                )
            return


def faults_of(raw: rawlog.RawLog, session: Session | None) -> list[str]:
    """What is not as it was written, a sentence each."""
    faults = []
    if raw.damages:
        first = raw.damages[0].start
        places = f"{len(raw.damages)} places" if len(raw.damages) > 1 else "one place"
        faults.append(f"damaged in {places}, {raw.lost_bytes} bytes, first at byte {first}; the rest is read")
    expected = session.log_sha256 if session is not None else None
    if expected is not None and raw.sha256 != expected:
        faults.append(f"not the bytes that were recorded: SHA-256 {raw.sha256[:12]}…, by the metadata {expected[:12]}…")
    return faults


def _instrument(path: Path, starts: list[wire.StartRecord], session: Session | None) -> tuple[wire.Instrument, str]:
    """Who wrote the log, and a sentence where that is an instrument we do not know: its samples cannot be read."""
    named = [start.instrument for start in starts]
    for name in reversed(named):
        if name in wire.INSTRUMENTS:
            return wire.INSTRUMENTS[name], ""
    name = named[-1] if named else session.instrument if session else None
    if name is None:
        raise InputError(
            f"{path}: no start record in it and no {session_path(path).name} next to it, "
            "so nothing says which instrument wrote it"
        )
    known = f"unknown instrument {name!r}; known are {', '.join(wire.INSTRUMENTS)}"
    if name in wire.INSTRUMENTS:
        return wire.INSTRUMENTS[name], ""
    if session is None or session.instrument not in wire.INSTRUMENTS:
        raise InputError(f"{path}: {known}")
    return wire.INSTRUMENTS[session.instrument], known


def _table(instrument: wire.Instrument, places, hosts, payloads) -> pd.DataFrame:
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


def read_tables(paths: Iterable[str | Path]) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Samples and recordings of logs of one instrument, in the order of the recordings' time.

    InputError for no logs, logs of different instruments, one without its metadata or with bytes that are not those of
    the recording, and two of the same id.
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
        "rate_hz": float(1 / log.table["time_s"].diff().median()),
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


def read_sessions(path: str | Path) -> pd.DataFrame:
    """The table of recordings as `read_tables` makes it, from CSV; only recordings that came to their end."""
    table = pd.read_csv(path, dtype={"specimen": str})
    return table[table["finished"]].reset_index(drop=True)


def by_recording(samples: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Samples of each recording, by id, in the order of the table."""
    return {str(name): part for name, part in samples.groupby("id", sort=False)}
