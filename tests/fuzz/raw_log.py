"""Any bytes as a raw log: read, or refused in one sentence; what is read holds together.

The first byte says how the rest becomes a log, since hardly any random byte passes two checksums: as it is, as the
contents of chunks, as frames, or as a damaged log of frames.
"""

from pathlib import Path

import numpy as np

from rotorid.errors import InputError
from rotorid_acquire.io import rawlog
from rotorid_acquire.io.frames import DATA, END, START, Frame, encode
from rotorid_acquire.io.lines import Description, LineDecoder
from rotorid_acquire.io.logs import read_log
from rotorid_acquire.io.wire import INSTRUMENTS, StartRecord

KINDS = (DATA, START, END, ord("A"), ord("C"), ord("x"))
NAMES = (*INSTRUMENTS, "toaster")
FORMS = (
    Description(name="a", form="csv", separator=",", columns={"x": {"field": 1}}),
    Description(name="b", form="key=value", separator=";", decimal=",", columns={"x": {"field": "Fz"}}),
    Description(name="c", form="fixed", columns={"x": {"start": 2, "stop": 9}}),
)


def log_of(data: bytes) -> bytes:
    """A log's bytes from any bytes."""
    way, rest = data[:1], data[1:]
    if way == b"\0":
        return rest
    if way == b"\1":
        return rawlog.MAGIC + rest
    if way == b"\2":
        tags = (rawlog.RECEIVED, rawlog.SENT, rawlog.NOTE)
        parts = [rest[i : i + 17] for i in range(0, len(rest), 17)]
        return rawlog.MAGIC + b"".join(
            rawlog.pack_chunk(tags[part[0] % 3], number * 1000, part[1:]) for number, part in enumerate(parts)
        )
    log = rawlog.MAGIC + b"".join(_chunks(rest))
    if way == b"\3" and len(rest) > 4:  # damage in the midst
        place = int.from_bytes(rest[:2], "little") % len(log)
        log = log[:place] + rest[2:4] + log[place + rest[0] % 40 :]
    return log


def _chunks(rest: bytes):
    """Frames of known and unknown kinds: 8 bytes say kind, length, sequence and clock; the payload follows."""
    at, number = 0, 0
    while at + 8 <= len(rest):
        kind, length = KINDS[rest[at] % len(KINDS)], rest[at + 1] % 40
        sequence, clock = (
            int.from_bytes(rest[at + 2 : at + 4], "little"),
            int.from_bytes(rest[at + 4 : at + 8], "little"),
        )
        payload = rest[at + 8 : at + 8 + length]
        if kind == START and length < 20:  # one that makes sense
            name = NAMES[length % len(NAMES)]
            payload = StartRecord(sequence % 4, clock % 100_000, rest[at + 1] % 3, name, "f", "s").pack()
        yield rawlog.pack_chunk(rawlog.RECEIVED, number * 1000, encode(Frame(kind, sequence, clock, payload)))
        at, number = at + 8 + length, number + 1


def look(data: bytes, folder: Path) -> None:
    """AssertionError, or any error but InputError, where the reader does what it must not."""
    path = folder / "x.rlog"
    path.write_bytes(log_of(data))
    try:
        log = read_log(path)
    except InputError as error:
        assert str(error).startswith(str(path)) and str(error).isprintable()
    else:
        table = log.table
        assert np.isfinite(table[["time_s", "host_time_s"]].to_numpy()).all()
        assert log.missing >= 0 and log.repeated >= 0 and log.damaged_bytes >= 0
        places = table[["segment", "index"]].to_numpy()
        assert (np.diff(places[:, 0]) >= 0).all()
        same = np.diff(places[:, 0]) == 0
        assert (np.diff(places[:, 1])[same] > 0).all(), "one sample, one place"
    for form in FORMS:
        for values in LineDecoder(form).feed(data):
            assert np.isfinite(values).all()
