"""Raw logs written by the test itself, byte for byte as a recorder would."""

import struct
from pathlib import Path

import numpy as np

from rotorid_acquire.io import rawlog, wire
from rotorid_acquire.io.frames import DATA, END, START, Frame, encode
from rotorid_acquire.io.session import Counts, Ended, Session, Setup, session_path, write_session

CODES = {"H": "H", "h": "h", "i": "i", "I": "I", "B": "B"}


def write_log(
    folder: Path,
    name: str,
    instrument: str,
    values: np.ndarray,
    setup: Setup,
    marks: dict[str, int],
    started: str = "2024-03-04T09:00:00-06:00",
    ended: Ended = Ended.FINISHED,
) -> Path:
    """A log of `values` (n, channels) in the channels' units, its metadata beside it; returns the log's path."""
    device = wire.INSTRUMENTS[instrument]
    step_us = device.interval_us
    frames = [Frame(START, 0, 0, wire.StartRecord(1, step_us, 1, instrument, "1", "1").pack())]
    for i, row in enumerate(values):
        counts = [round(value / channel.scale) for value, channel in zip(row, device.channels, strict=True)]
        payload = b"".join(struct.pack("<" + c.code, n) for c, n in zip(device.channels, counts, strict=True))
        frames.append(Frame(DATA, i + 1, step_us * (i + 1), payload))
    frames.append(Frame(END, len(values) + 1, step_us * (len(values) + 1), wire.EndRecord(len(values), 0, 1).pack()))
    path = folder / f"{name}.rlog"
    data = rawlog.MAGIC
    for frame in frames:
        data += rawlog.pack_chunk(rawlog.RECEIVED, frame.clock_us * 1000, encode(frame))
    path.write_bytes(data)
    session = Session(
        id=name, instrument=instrument, started=started, host_start_ns=0, setup=setup, marks=marks,
        counts=Counts(samples=len(values)), ended=ended, log=path.name,
    )  # fmt: skip
    write_session(session, session_path(path))
    return path


def cells(loaded_v: np.ndarray, rest: int = 60, load: int = 140, noise_v: float = 0.0, seed: int = 0) -> np.ndarray:
    """Six voltages: a zero of 1e-4 V, then `loaded_v` (6,) more; shape (rest + load, 6)."""
    rng = np.random.default_rng(seed)
    values = np.full((rest + load, 6), 1e-4) + noise_v * rng.normal(size=(rest + load, 6))
    values[rest:] += loaded_v
    return values
