"""Completes the metadata of a recording whose recorder was killed, from the log alone."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

from rotorid.io.logs import Log
from rotorid.io.rawlog import RECEIVED, read_raw
from rotorid.io.session import Counts, Ended, GapEntry, session_path, write_session


def repair(log: Path, parsed: Log) -> bool:
    """Fill in counts and gaps where the metadata still say `recording`. True if there was something to do.

    A log whose recorder is still at work looks the same: the command is for logs, not for recordings.
    """
    session = parsed.session
    if session is None or session.ended != Ended.RECORDING or session.duration_s is not None:
        return False
    table = parsed.table
    raw = read_raw(log)
    received = sum(len(chunk.data) for chunk in raw.chunks if chunk.tag == RECEIVED)
    session.counts = Counts(
        bytes_received=received,
        samples=len(table),
        missing=parsed.missing,
        repeated=parsed.repeated,
        checksum_errors=parsed.checksum_errors,
        broken_frames=parsed.broken_frames,
        resets=parsed.resets,
        malformed=parsed.malformed or None,
        unknown_kinds=parsed.unknown_kinds or None,
    )
    if not parsed.faults:  # from now on a change of the log is noticed
        session.log_sha256 = raw.sha256
    session.gaps = [GapEntry(**asdict(gap)) for gap in parsed.gaps[:1000]]
    session.gaps_left_out = max(0, len(parsed.gaps) - 1000)
    session.duration_s = round(float(table.time_s.iloc[-1]), 6) if len(table) else 0.0
    write_session(session, session_path(log))
    return True
