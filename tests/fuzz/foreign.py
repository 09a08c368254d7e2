"""Logs of other makers under damage: read, or refused in one sentence; what is read is a table of a flight.

The first byte chooses a small sound log of one format, the rest says where it is damaged: in each seven bytes the place
(three), how much is cut out (one), how much is put in (one) and the first of that (two). Without a damage left the rest
stands behind the head of the format instead.
"""

import io
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.io import savemat

from rotorid.errors import InputError
from rotorid.recordings import columns as c
from rotorid.recordings.importers.logfile import read_log
from tests.unit.recordings.importers import test_importers, test_log_formats

EVERY = 8
"""Every how many samples of the known flight the sound logs hold."""
HEAD = 300


def flown() -> pd.DataFrame:
    """The known flight, sparse."""
    return test_log_formats.flown().iloc[::EVERY].reset_index(drop=True)


def _px4() -> bytes:
    truth = flown()
    stamps = (truth[c.TIME] * 1e6 + 1e6).to_numpy(np.uint64)

    def topic(text: str, name: str, columns) -> tuple[str, np.ndarray]:
        rows = np.zeros(len(stamps), np.dtype([("timestamp", "<u8"), (name, "<f4", len(columns))]))
        rows["timestamp"], rows[name] = stamps, truth[list(columns)].to_numpy()
        return f"uint64_t timestamp;{text}", rows

    return test_importers.ulog_bytes(
        {
            "vehicle_angular_velocity": topic("float[3] xyz;", "xyz", c.ANGULAR_VELOCITY),
            "vehicle_acceleration": topic("float[3] xyz;", "xyz", c.SPECIFIC_FORCE),
            "vehicle_attitude": topic("float[4] q;", "q", c.QUATERNION),
            "actuator_motors": topic("float[4] control;", "control", c.rotor_columns("throttle", 4)),
        }
    )


def _crazyflie() -> bytes:
    truth = flown()
    rows = truth[[*c.SPECIFIC_FORCE, *c.ANGULAR_VELOCITY, *c.rotor_columns("throttle", 4)]].to_numpy()
    names = [f"{sensor}.{axis}" for sensor in ("acc", "gyro") for axis in "xyz"] + [f"motor.m{i}" for i in range(1, 5)]
    times = [int(t * 1e6) for t in truth[c.TIME]]
    return test_importers.usd_bytes([(name, "f") for name in names], rows * ([1.0] * 6 + [65535.0] * 4), times=times)


def _mat() -> bytes:
    held = io.BytesIO()
    savemat(held, {"m": np.random.default_rng(0).standard_normal((60, 41))}, do_compression=True)
    return held.getvalue()


def _csv() -> bytes:
    return flown().round(4).to_csv(index=False).encode()


def _foreign_csv() -> bytes:
    table = flown()[[c.TIME, *c.SPECIFIC_FORCE, *c.ANGULAR_VELOCITY]].round(4)
    return table.set_axis(["t", "ax", "ay", "az", "gx", "gy", "gz"], axis=1).to_csv(index=False, sep=";").encode()


def _bench() -> bytes:
    return "\n".join([test_importers.HEADING, *test_importers.ROWS, ""]).encode()


def _parquet() -> bytes:
    held = io.BytesIO()
    flown().to_parquet(held, index=False)
    return held.getvalue()


def _bag(kind: str) -> bytes:
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / ("flight.bag" if kind == "bag" else "flight")
        return test_log_formats.write_bag(path, kind, flown()).read_bytes()


SOUND: dict[str, Callable[[], bytes]] = {
    "log.ulg": _px4, "log.bbl": lambda: test_log_formats.blackbox(flown()),
    "log.bin": lambda: test_log_formats.dataflash(flown(), test_log_formats.PARAMETERS), "log.usd": _crazyflie,
    "log.mat": _mat, "log.csv": _csv, "other.csv": _foreign_csv, "bench.csv": _bench, "log.parquet": _parquet,
    "log.bag": lambda: _bag("bag"), "log.mcap": lambda: _bag("mcap"),
}  # fmt: skip


@cache
def sound(name: str) -> bytes:
    """A whole log of the format that bears this name."""
    return SOUND[name]()


def log_of(data: bytes) -> tuple[str, bytes]:
    """Name and bytes of a log from any bytes."""
    name = list(SOUND)[data[0] % len(SOUND)] if data else "log.csv"
    whole, rest = bytearray(sound(name)), data[1:]
    if len(rest) < 7:
        return name, bytes(whole[: HEAD + len(rest)] + rest)
    for at in range(0, len(rest) - 6, 7):
        start = int.from_bytes(rest[at : at + 3], "little") % max(len(whole), 1)
        cut, put = rest[at + 3] % 40, rest[at + 4] % 12
        whole[start : start + cut] = rest[at + 5 : at + 5 + put]
    return name, bytes(whole)


def look(data: bytes, folder: Path) -> None:
    """AssertionError, or any error but InputError, where an importer does what it must not."""
    name, content = log_of(data)
    path = folder / name
    path.write_bytes(content)
    try:
        found = read_log(path)
    except InputError as error:
        assert str(error).startswith(str(path)) and str(error).isprintable() and len(str(error)) < 800, str(error)
    else:
        for table in found.runs.values():
            time_s = table[c.TIME].to_numpy(float)
            assert len(time_s) and np.isfinite(time_s).all() and (np.diff(time_s) > 0).all(), found.format
