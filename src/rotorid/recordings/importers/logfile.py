"""Any log that rotorid knows, recognised by its first bytes, as flights in contract columns.

Other people's readers at work: with a limit on their memory, and without what they print.

Packed logs can be made to unpack to anything. Where the system can (Linux), the process gets a limit while a log is
read, so that a bomb ends as one sentence and not with the machine. What is wrong with a log is said once, by the
importer; the readers print a line for each byte that they stumble over.
"""

from __future__ import annotations

import io
import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from rotorid.errors import InputError
from rotorid.io.text.files import LARGEST_FILE, LEAST_MEMORY, MEMORY_TIMES_FILE, check_file
from rotorid.io.text.wording import printable
from rotorid.recordings import columns as c
from rotorid.recordings.importers import (
    ardupilot,
    betaflight,
    crazyflie,
    in_the_air,
    neurobem,
    px4_ulog,
    rcbenchmark,
    ros,
)
from rotorid.recordings.importers.faults import ImportFault
from rotorid.recordings.importers.known import Known, px4_vehicle
from rotorid.recordings.importers.mapping import ELECTRICAL, Mapping, read_by_mapping

_GZIP = b"\x1f\x8b"
_BY_FIRST_BYTES = (
    (b"H Product:Blackbox", "betaflight"),
    (b'"Product","Blackbox', "betaflight"),
    (b"\xa3\x95", "ardupilot"),
    (b"#ROSBAG V2.0", "ros"),
    (b"\x89MCAP0", "ros"),
    (b"SQLite format 3", "ros"),
)
_RCBENCHMARK = re.compile(r"ESC signal ?[(,](.*[,;])?\s*\"?Motor (Electrical|Optical) Speed ?[(,\r\n]", re.DOTALL)
"""Headings of RCbenchmark's stands of one rotor; those of other stands are read by a mapping."""
TEMPLATES = {"px4": "x500", "betaflight": "five-inch", "crazyflie": "crazyflie-2.1", "neurobem": "neurobem"}
"""Template vehicle that supplies what a log of an autopilot or format does not say."""


@dataclass(frozen=True)
class _Imported:
    """Flights of one log by name, in contract columns, with what was found on the way."""

    format: str
    runs: dict[str, pd.DataFrame]
    faults: tuple[ImportFault, ...]
    axes: str
    known: Known = Known("")
    kind: str = "flight"
    speed_unit: str = "rad/s"
    """Unit in which the log states rotor speeds."""


def is_bag(path: Path) -> bool:
    """Whether a path is the folder of a ROS 2 bag (`metadata.yaml` next to its .db3 or .mcap), and no recording set."""
    return (path / "metadata.yaml").is_file() and not (path / "vehicle.yaml").is_file()


def files_of(path: Path) -> dict[str, Path]:
    """The files of a log by name: itself, or all that lie in the folder of a bag."""
    if not path.is_dir():
        return {path.name: path}
    return {f"{path.resolve().name}/{p.name}": p for p in sorted(path.iterdir()) if p.is_file()}


def format_of(path: Path) -> str:
    """`px4`, `crazyflie`, `betaflight`, `ardupilot`, `ros`, `neurobem`, `rcbenchmark`, `csv` or `parquet`.

    InputError for what is none of them.
    """
    if path.is_dir():
        if is_bag(path):
            return "ros"
        raise InputError(f"{path}: expected a log, found a folder (that of a ROS 2 bag has a metadata.yaml)")
    check_file(path)
    with open(path, "rb") as file:
        head = file.read(4096)
    if not head:
        raise InputError(f"{path}: the file is empty")
    if head.startswith(b"ULog\x01\x12\x35"):
        return "px4"
    if head[0] == 0xBC:
        return "crazyflie"
    if head.startswith(_GZIP):
        return "csv"
    if head.startswith(b"PAR1"):
        return "parquet"
    if head[8:9] in (b"\xfe", b"\xfd") and path.suffix.lower() in (".tlog", ".rlog"):
        raise InputError(
            f"{path}: a telemetry log of MAVLink, which is not read; take the autopilot's own log (.bin, .ulg), or "
            "make a table of it (`pip install pymavlink`, then `mavlogdump.py --format csv --types "
            f"RAW_IMU,ATTITUDE,SERVO_OUTPUT_RAW {path.name} > flight.csv`) and import that"
        )
    for start, name in _BY_FIRST_BYTES:
        if head.startswith(start):
            return name
    if path.suffix.lower() == ".mat":
        return "neurobem"
    text = head.decode("utf-8", errors="replace")
    if "\0" in text:
        raise InputError(
            f"{path}: not a log that rotorid knows (PX4 ULog, Betaflight, ArduPilot, ROS bag, MCAP, Crazyflie uSD, "
            "NeuroBEM .mat, RCbenchmark CSV, any CSV, Parquet); its first bytes are " + head[:8].hex(" ")
        )
    if crazyflie.is_table([name.strip(' "') for name in re.split("[,;\t]", text.splitlines()[0])]):
        return "crazyflie"
    return "rcbenchmark" if _RCBENCHMARK.search(text) and "Thrust" in text else "csv"


def read_log(path: Path, mapping: Mapping | None = None) -> _Imported:
    """Every flight in a log; InputError in one sentence where the file holds none."""
    path = Path(path)
    kind = format_of(path)
    if kind != "ros" and (size := path.stat().st_size) > LARGEST_FILE:  # a bag's pictures are not read
        raise InputError(f"{path}: has {size / 1e6:.0f} MB, expected at most {LARGEST_FILE / 1e6:.0f} MB")
    try:
        with limited(path), _silent():
            return _read(path, kind, mapping)
    except InputError as error:
        said = printable(error)  # it may quote what stands in the file
        raise InputError(said if said.startswith(str(path)) else f"{path}: {said}") from None


def _read(path: Path, kind: str, mapping: Mapping | None) -> _Imported:
    if kind == "px4":
        return _px4(path)
    if kind == "crazyflie" and mapping is None:
        return _crazyflie(path)
    if kind == "betaflight":
        runs, faults = betaflight.read_betaflight(path)
        axes = "body forward-left-up, turned by half a turn about x into FRD"
        return _Imported(kind, runs, tuple(faults), axes, Known("betaflight"), speed_unit="rpm")
    if kind == "ardupilot":
        runs, faults, order = ardupilot.read_ardupilot(path)
        axes = "ArduPilot's: body forward-right-down, world north-east-down, as the contract's"
        return _Imported(kind, runs, tuple(faults), axes, Known(order), speed_unit="rpm")
    if kind == "ros":
        runs, faults, unit = ros.read_ros(path)
        axes = "REP 103: body forward-left-up, world z up, turned by half a turn about x into FRD and z down"
        return _Imported(kind, runs, tuple(faults), axes, speed_unit=unit)
    if kind == "neurobem":
        table, faults = neurobem.read_neurobem(path)
        return _Imported(kind, {path.stem: table}, tuple(faults), "NeuroBEM's, turned into FRD and NED")
    if kind == "rcbenchmark":
        table, faults = rcbenchmark.read_rcbenchmark(path)
        axes = "thrust along -z of the body"
        return _Imported(kind, {_stem(path): table}, tuple(faults), axes, kind="stand")
    table, faults, axes = read_by_mapping(path, mapping)
    runs, cuts = _in_the_air(table, _stem(path), path)
    speeds = None if mapping is None else mapping.channels.get("rotor_speed") or mapping.channels.get("rotor_command")
    unit = (speeds.unit if speeds else "") or "rad/s"
    unit = "rpm" if unit in ELECTRICAL else unit  # they are turns of the rotor by now
    stand = any({*c.FORCE, *c.MOMENT} & set(run) for run in runs.values())
    return _Imported(kind, runs, (*faults, *cuts), axes, kind="stand" if stand else "flight", speed_unit=unit)


def _in_the_air(table: pd.DataFrame, name: str, path: Path) -> tuple[dict[str, pd.DataFrame], list[ImportFault]]:
    """The flights of a table in contract columns; the table as it is where all of it is in the air, or of a stand."""
    if set(table) & {*c.FORCE, *c.MOMENT}:
        return {name: table}, []
    flying, _ = in_the_air.airborne(table)
    return ({name: table}, []) if flying.all() else in_the_air.flights(table, flying, name, path)


def _stem(path: Path) -> str:
    return path.name.removesuffix(".gz").rsplit(".", 1)[0]


def _px4(path: Path) -> _Imported:
    log = px4_ulog.open_log(path)
    try:
        rotors = px4_ulog.rotor_count(log)
        table, found, flying, jumps = px4_ulog.convert(log, rotors)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    known, faults = px4_vehicle(px4_ulog.in_flight(log), rotors)
    runs, cuts = in_the_air.flights(table, flying, path.stem, path, jumps)
    axes = "PX4's: body forward-right-down, world north-east-down, as the contract's"
    return _Imported("px4", runs, (*found, *faults, *cuts), axes, known, speed_unit="rpm")


def _crazyflie(path: Path) -> _Imported:
    runs, faults = crazyflie.flights(path)
    axes = "body forward-left-up and world z up, turned by half a turn about x into FRD and NED"
    return _Imported("crazyflie", runs, tuple(faults), axes, Known("crazyflie"), speed_unit="rpm")


@contextmanager
def limited(path: Path) -> Iterator[None]:
    """Inside, memory beyond the limit for this file is an InputError; nothing is limited where the system cannot."""
    try:
        import resource
    except ImportError:  # pragma: no cover - depends on the platform
        yield
        return
    taken = _taken_bytes()
    size = path.stat().st_size if path.is_file() else sum(p.stat().st_size for p in path.rglob("*") if p.is_file())
    more = max(LEAST_MEMORY, MEMORY_TIMES_FILE * size)
    soft, hard = resource.getrlimit(resource.RLIMIT_DATA)
    if taken is None or (soft != resource.RLIM_INFINITY and soft <= taken + more):
        yield
        return
    resource.setrlimit(resource.RLIMIT_DATA, (taken + more, hard))
    try:
        yield
    except MemoryError:
        raise InputError(
            f"{path}: reading it takes more than {more / 1e6:.0f} MB of memory, far more than a log of its size does"
        ) from None
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))


@contextmanager
def _silent() -> Iterator[None]:
    """Inside, nothing reaches the screen, not even from compiled code."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = [os.dup(number) for number in (1, 2)]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        for number in (1, 2):
            os.dup2(nowhere, number)
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            yield
    finally:
        for number, own in zip((1, 2), kept, strict=True):
            os.dup2(own, number)
            os.close(own)
        os.close(nowhere)


def _taken_bytes() -> int | None:
    """Bytes that count against the limit already; None where the system does not say."""
    try:
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    except OSError:
        return None
    return next((int(line.split()[1]) * 1024 for line in lines if line.startswith("VmData:")), None)
