"""What a recorder writes next to the bytes: `<log>.yaml`, one validated model for recorder and pipeline."""

from __future__ import annotations

import os
from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Literal

import yaml
from pydantic import Field, field_validator

from rotorid.errors import InputError
from rotorid.io import metadata_checksum
from rotorid.io.models import KnownKeys, Number, Whole, read_model
from rotorid.io.text.files import LARGEST_METADATA, MOST_METADATA_VALUES, read_bytes


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


class SessionError(InputError):
    """The metadata file is missing, unreadable or not what it should be."""


def session_path(log: str | Path) -> Path:
    """Where the metadata of a log stands: `x.rlog` or `x.rlog.gz` → `x.yaml`."""
    log = Path(log)
    return log.with_name(log.name.removesuffix(".gz").removesuffix(".rlog") + ".yaml")


def write_session(session: Session, path: str | Path) -> None:
    """Write atomically, with a checksum: a reader sees the old file or the new one, never half of either."""
    content = session.model_dump(mode="json", exclude_none=True, exclude={"metadata_sha256"})
    text = yaml.safe_dump(content, sort_keys=False, allow_unicode=True, width=110)
    replace_bytes(Path(path), metadata_checksum.with_checksum(text.encode()))


def replace_bytes(path: Path, data: bytes) -> None:
    """Put a whole new content in the place of a file, or leave it as it is. Raises OSError."""
    temporary = path.with_name(path.name + ".tmp")
    try:
        with open(temporary, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(temporary, path)
    except OSError:
        temporary.unlink(missing_ok=True)
        raise


def read_session(path: str | Path) -> Session:
    """Read and validate. Raises SessionError naming the file and the first key that is wrong, or that the file was
    changed after recording; `metadata_sha256` of the session is None where nothing can say that it was not."""
    path = Path(path)
    if not path.exists() and not path.is_symlink():
        raise SessionError(f"{path}: no such file; every log has its metadata next to it")
    try:
        metadata_checksum.check(read_bytes(path, LARGEST_METADATA), path)
    except InputError as error:
        raise SessionError(str(error)) from None
    return read_model(path, Session, SessionError, LARGEST_METADATA, MOST_METADATA_VALUES, compiled=True)
