"""What a recorder writes next to the bytes: `<log>.yaml`, one validated model for recorder and pipeline.

`raw/sessions.tsv`: one row per recording, made from the metadata next to the logs.

Its last row is no recording: `sessions_sha256` and the SHA-256 of all bytes but that row's, so that a changed bit is
noticed, as in metadata (`rotorid_acquire.io.metadata_checksum`). An index without that row, as earlier versions wrote
it, is read all the same.
"""

from __future__ import annotations

import csv
import io
import re
from datetime import datetime
from enum import StrEnum
from hashlib import sha256
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, Literal

import yaml
from pydantic import Field, field_validator

from rotorid.errors import InputError
from rotorid.io.models import KnownKeys, Number, Whole, read_model
from rotorid.io.text.files import LARGEST_INDEX, LARGEST_METADATA, MOST_METADATA_VALUES, check_text, read_bytes
from rotorid.io.text.wording import hint, listed
from rotorid.io.text.writing import all_or_none
from rotorid_acquire.io import metadata_checksum

INDEX_COLUMNS = (
    "id group kind instrument platform axis load_gf cell experiment mount_roll_deg mount_pitch_deg throttle "
    "infill_percent specimen repeat started source ended samples missing file metadata"
).split()

INDEX = "sessions.tsv"
INDEX_KEY = "sessions_sha256"
_ROW = re.compile(rb"^sessions_sha256\t.*\n?", re.MULTILINE)
_LOCAL = "local"
"""Folder for recordings that no index takes unasked."""


class Ended(StrEnum):
    """How a recording ended. RECORDING means: it never did; the recorder was killed."""

    RECORDING = "recording"
    FINISHED = "finished"
    INTERRUPTED = "interrupted"
    DEVICE_LOST = "device_lost"
    DEVICE_SILENT = "device_silent"
    DEVICE_RESET = "device_reset"
    REFUSED = "refused"
    DISK_FULL = "disk_full"
    DEVICE_FAULT = "device_fault"
    GAVE_UP = "gave_up"
    LIMIT_EXCEEDED = "limit_exceeded"
    FAILED = "failed"


class RoomAir(KnownKeys):
    """Air during the recording."""

    temperature_c: Number = Field(ge=-90, le=70)
    pressure_pa: Number = Field(ge=10_000, le=120_000)
    relative_humidity: Number = Field(ge=0, le=1)

    @property
    def density_kg_m3(self) -> float:
        """Of moist air, kg/m³: dry air and vapour as ideal gases, Magnus's formula for saturation."""
        saturation_pa = 611.2 * 2.718281828 ** (17.62 * self.temperature_c / (243.12 + self.temperature_c))
        vapour_pa = self.relative_humidity * saturation_pa
        kelvin = self.temperature_c + 273.15
        return (self.pressure_pa - vapour_pa) / (287.05 * kelvin) + vapour_pa / (461.5 * kelvin)


class Setup(KnownKeys):
    """What the operator knows and the instrument does not. Everything is optional."""

    kind: str = "free"  # calibration, static, dynamic, thrust, torque, dynamics, tensile, free
    operator: str | None = None
    platform: str | None = None  # al, pla, jr3; stand
    axis: str | None = None  # of the applied load: x, y, z
    load_gf: Number | None = None
    load_items: list[str] | None = None
    repeat: Whole | None = None
    cell: Whole | None = None
    experiment: Whole | None = None  # table A.1
    throttle: Number | None = None
    motor: Whole | None = None
    specimen: str | None = None
    infill_percent: Whole | None = None
    gauge_length_mm: Number | None = None
    cross_section_mm2: Number | None = None
    rotor: str | None = None  # whose motor and propeller turned: tests of one rotor are pooled
    propeller: str | None = None
    battery: str | None = None
    mount_roll_deg: Number | None = None
    mount_pitch_deg: Number | None = None
    sensor_position_m: Annotated[list[Number], Field(min_length=3, max_length=3)] | None = (
        None  # body axes, from the believed centre of mass
    )
    tared: bool | None = None  # the reading was zeroed with the vehicle in place
    air: RoomAir | None = None
    remarks: str | None = None


class Gap(KnownKeys):
    """Missing frames, `count` of them from `first_index` on, within one segment (between two resets).

    `start_s` and `stop_s` are the device times of the last frame before and the first one after the gap.
    """

    segment: int
    first_index: int
    count: int
    start_s: float
    stop_s: float


class Event(KnownKeys):
    """Something that happened to the line, at the host's time since the recording began."""

    host_s: float
    what: str
    text: str


class Counts(KnownKeys):
    """Totals of a recording."""

    bytes_received: int = 0
    frames: int = 0
    samples: int = 0
    missing: int = 0
    repeated: int = 0
    late: int = 0
    checksum_errors: int = 0
    broken_frames: int = 0
    lost_bytes: int = 0
    resets: int = 0
    clock_rollovers: int = 0
    port_losses: int = 0
    device_skipped: int = 0  # samples the device itself said it had to skip
    # absent where there were none, which is nearly always
    malformed: int | None = None  # frames with a right checksum and a content that is none
    malformed_samples: int | None = None  # those of them that should have been samples
    unknown_kinds: int | None = None  # frames of a kind that this version does not know


class Session(KnownKeys):
    """One recording of one instrument."""

    format: Literal["rotorid-session-1"] = "rotorid-session-1"
    id: str
    group: str | None = None  # recordings that belong together (quadrotor and wrench of one experiment)
    instrument: str
    firmware: str | None = None
    serial_number: str | None = None
    source: str | None = None  # instrument | emulator
    started: str  # ISO 8601 with offset
    host_start_ns: int  # the host's monotonic clock at that moment; comparable within a group
    port: str | None = None
    baud_rate: int | None = None
    setup: Setup = Setup()
    procedure: dict[str, Any] = {}  # what the recorder was asked to do
    marks: dict[str, int] = {}  # step: value of the table's column `index` at its first (or last) sample
    tare: dict[str, Number] | None = None  # column: mean of the 25 tare samples
    promised_rate_hz: float | None = None
    measured_rate_hz: float | None = None  # samples over device time
    device_clock_ratio: float | None = None  # device seconds per host second
    duration_s: float | None = None
    counts: Counts = Counts()
    gaps: list[Gap] = []
    gaps_left_out: int = 0  # beyond the first thousand
    events: list[Event] = []
    warnings: list[str] = []
    ended: Ended = Ended.RECORDING
    message: str = "the recorder never got to the end: it was killed or the computer stopped"
    log: str  # file name next to this file
    log_sha256: str | None = None  # of the unpacked log
    metadata_sha256: str | None = None  # as read; None: the file has no checksum, a change of it goes unnoticed

    @field_validator("started")
    @classmethod
    def _is_a_time(cls, text: str) -> str:
        try:
            datetime.fromisoformat(text)
        except ValueError:
            raise ValueError(f"found {text!r}, expected a time such as 2024-03-04T09:00:00-06:00") from None
        return text

    @field_validator("log")
    @classmethod
    def _lies_beside(cls, name: str) -> str:
        if name in ("", ".", "..") or "/" in name or "\0" in name:
            raise ValueError(f"found {name!r}, expected the name of a file next to this one")
        return name


def session_path(log: str | Path) -> Path:
    """Where the metadata of a log stands: `x.rlog` or `x.rlog.gz` → `x.yaml`."""
    log = Path(log)
    return log.with_name(log.name.removesuffix(".gz").removesuffix(".rlog") + ".yaml")


def write_session(session: Session, path: str | Path) -> None:
    """Write atomically, with a checksum: a reader sees the old file or the new one, never half of either."""
    content = session.model_dump(mode="json", exclude_none=True, exclude={"metadata_sha256"})
    text = yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=110)
    _replace_bytes(Path(path), metadata_checksum.with_checksum(text.encode()))


def _replace_bytes(path: Path, data: bytes) -> None:
    """Put a whole new content in the place of a file, or leave it as it is. Raises OSError."""
    with all_or_none(path) as (part,):
        part.write_bytes(data)


def read_session(path: str | Path) -> Session:
    """Read and validate. Raises InputError naming the file and the first key that is wrong, or that the file was
    changed after recording; `metadata_sha256` of the session is None where nothing can say that it was not."""
    path = Path(path)
    if not path.exists() and not path.is_symlink():
        raise InputError(f"{path}: no such file; every log has its metadata next to it")
    metadata_checksum.check(read_bytes(path, LARGEST_METADATA), path)
    return read_model(path, Session, LARGEST_METADATA, MOST_METADATA_VALUES, compiled=True)


def write_index(raw: Path) -> list[dict[str, str]]:
    """Find all recordings below `raw`, in the order of their time, and write the index. What is not known is empty.

    What lies in `raw/local`, where the recorders write by default, is left out: first tries are no part of a campaign.
    Such a folder has an index of its own, by `write_index(raw / "local")`. Files that are no session metadata (vehicle
    files) are passed over. Raises InputError for a session file that is damaged.
    """
    rows = []
    for path in metadata_files(raw):
        session = read_session(path)
        values = session.setup.model_dump() | session.model_dump(exclude={"setup"}) | session.counts.model_dump()
        values["file"] = path.with_name(session.log).relative_to(raw).as_posix()
        values["metadata"] = path.relative_to(raw).as_posix()
        rows.append({name: "" if values.get(name) is None else str(values[name]) for name in INDEX_COLUMNS})
    rows.sort(key=lambda row: (row["started"], row["id"]))
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, INDEX_COLUMNS, delimiter="\t", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    _replace_bytes(raw / INDEX, index_with_checksum(text.getvalue().encode()))
    return rows


def index_with_checksum(data: bytes) -> bytes:
    """The index with a checksum that fits in its last row; one that is there is replaced, every other byte is kept."""
    rest = _ROW.sub(b"", data)
    if not rest.endswith(b"\n"):
        rest += b"\n"
    # As many cells as the others: to every reader of tables it stays one.
    cells = [INDEX_KEY, sha256(rest).hexdigest()]
    return rest + "\t".join(cells + [""] * (len(INDEX_COLUMNS) - len(cells))).encode() + b"\n"


def files_with_checksum(place: Path) -> list[Path]:
    """Files with a checksum meant by a folder, a log, metadata or an index. Raises InputError where there are none.

    Of a folder its index comes first, where it has one.
    """
    if place.is_dir():
        found = metadata_files(place)
        if not found:
            raise InputError(f"{place}: holds no metadata of recordings (`<log>.yaml`)")
        return [place / INDEX] * (place / INDEX).is_file() + found
    return [place if place.suffix == ".yaml" or place.name == INDEX else session_path(place)]


def add_checksum(path: Path) -> bool:
    """Add the checksum to metadata or an index without one; True if there was none. Raises InputError for files that
    are neither, or whose checksum does not fit."""
    if path.name == INDEX:
        read_index(path.parent)
        data = read_bytes(path, LARGEST_INDEX)
        lacking, added = _ROW.search(data) is None, index_with_checksum
    else:
        lacking, added = read_session(path).metadata_sha256 is None, metadata_checksum.with_checksum
        data = read_bytes(path, LARGEST_METADATA)
    if lacking:
        _replace_bytes(path, added(data))
    return lacking


def renew_checksum(path: Path) -> bool:
    """Make the checksum fit what stands in the file now; True if it did not. Raises InputError for metadata or an
    index that are none with it, and then leaves the file as it was."""
    of_index = path.name == INDEX
    if not path.exists():
        why = "`rotorid-acquire index` makes it" if of_index else "every log has its metadata next to it"
        raise InputError(f"{path}: no such file; {why}")
    before = read_bytes(path, LARGEST_INDEX if of_index else LARGEST_METADATA)
    after = (index_with_checksum if of_index else metadata_checksum.with_checksum)(before)
    if after == before:
        return False
    _replace_bytes(path, after)
    try:
        read_index(path.parent) if of_index else read_session(path)
    except InputError:
        _replace_bytes(path, before)
        raise
    return True


def metadata_files(raw: Path) -> list[Path]:
    """Metadata of the recordings below `raw`; those in `raw/local`, and what is half written, left out."""
    found = ((path, path.relative_to(raw).parts) for path in sorted(raw.rglob("*.yaml")))
    return [
        path
        for path, parts in found
        if parts[0] != _LOCAL and not any(part.startswith(".") for part in parts[:-1]) and _is_session(path)
    ]


def read_index(raw: Path) -> list[dict[str, str]]:
    """Rows of the index.

    Raises InputError where there is none, its columns are others, a row is none or its checksum does not fit.
    """
    path = raw / INDEX
    if not path.exists() and not path.is_symlink():
        raise InputError(f"{path}: no such file; `rotorid-acquire index` makes it")
    data = read_bytes(path, LARGEST_INDEX)
    rows = _rows(data, path)
    if _ROW.search(data) is not None and index_with_checksum(data) != data:
        raise InputError(
            f"{path}: the index was changed after it was written, its checksum ({INDEX_KEY}, the last row) does not fit"
            f"; make it anew from the metadata: rotorid-acquire index {raw}, or, if the change is meant, renew the "
            f"checksum: rotorid-acquire checksum --renew {path}"
        )
    return rows


def _rows(data: bytes, path: Path) -> list[dict[str, str]]:
    """Rows of an index without that of its checksum."""
    check_text(data, path)
    lines = data.decode("utf-8-sig").splitlines()
    found = lines[0].split("\t") if lines else []
    if found != INDEX_COLUMNS:
        wrong = next((name for name in found if name not in INDEX_COLUMNS), None)
        lacking = [name for name in INDEX_COLUMNS if name not in found]
        what = (
            f"{wrong!r} is none{hint(wrong, INDEX_COLUMNS)}"
            if wrong
            else f"{listed(lacking) or 'their order'} is wrong"
        )
        raise InputError(f"{path}, line 1: the columns should be {', '.join(INDEX_COLUMNS)}: {what}")
    try:
        rows = list(csv.reader(lines[1:], delimiter="\t", strict=True))
    except csv.Error as error:
        raise InputError(f"{path}: not a table ({error}); `rotorid-acquire index` makes it anew") from None
    seen: dict[str, int] = {}
    recordings = []
    for number, row in enumerate(rows, 2):
        if row[:1] == [INDEX_KEY]:
            continue
        if len(row) != len(INDEX_COLUMNS):
            raise InputError(f"{path}, line {number}: has {len(row)} cells, expected {len(INDEX_COLUMNS)}")
        if row[0] in seen:
            raise InputError(f"{path}, line {number}: {row[0]} is there twice (first in line {seen[row[0]]})")
        seen[row[0]] = number
        for name in ("file", "metadata"):
            place = PurePosixPath(row[INDEX_COLUMNS.index(name)])
            if place.is_absolute() or ".." in place.parts or not place.name:
                raise InputError(
                    f"{path}, line {number}: {name}: found {str(place)!r}, expected a file below {path.parent}"
                )
        recordings.append(dict(zip(INDEX_COLUMNS, row, strict=True)))
    return recordings


def _is_session(path: Path) -> bool:
    if not path.is_file():
        return False
    # By its log, too: with a damaged first line it is still a recording, and must not be passed over.
    if any(path.with_suffix(suffix).exists() for suffix in (".rlog", ".rlog.gz")):
        return True
    with open(path, encoding="utf-8", errors="replace") as file:
        return file.readline(100).strip() == "format: rotorid-session-1"
