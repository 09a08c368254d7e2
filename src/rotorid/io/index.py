"""`raw/sessions.tsv`: one row per recording, made from the metadata next to the logs.

Its last row is no recording: `sessions_sha256` and the SHA-256 of all bytes but that row's, so that a changed bit is
noticed, as in metadata (`rotorid.io.metadata_checksum`). An index without that row, as earlier versions wrote it, is
read all the same.
"""

from __future__ import annotations

import csv
import io
import re
from hashlib import sha256
from pathlib import Path, PurePosixPath

from rotorid.errors import InputError
from rotorid.io import metadata_checksum
from rotorid.io.session import Session, SessionError, read_session, replace_bytes, session_path
from rotorid.io.text.files import LARGEST_INDEX, LARGEST_METADATA, check_text, read_bytes
from rotorid.io.text.wording import hint, listed

COLUMNS = (
    "id group kind instrument platform axis load_gf cell experiment mount_roll_deg mount_pitch_deg throttle "
    "infill_percent specimen repeat started source ended samples missing file metadata"
).split()

NAME = "sessions.tsv"
KEY = "sessions_sha256"
_ROW = re.compile(rb"^sessions_sha256\t.*\n?", re.MULTILINE)
_LOCAL = "local"
"""Folder for recordings that no index takes unasked."""


def _index_row(session: Session, metadata: Path, raw: Path) -> dict[str, str]:
    """A row of the index; paths are relative to `raw`, what is not known is empty."""
    values = session.setup.model_dump() | session.model_dump(exclude={"setup"}) | session.counts.model_dump()
    values["file"] = metadata.with_name(session.log).relative_to(raw).as_posix()
    values["metadata"] = metadata.relative_to(raw).as_posix()
    return {name: "" if values.get(name) is None else str(values[name]) for name in COLUMNS}


def write_index(raw: Path) -> list[dict[str, str]]:
    """Find all recordings below `raw`, in the order of their time, and write the index.

    What lies in `raw/local`, where the recorders write by default, is left out: first tries are no part of a campaign.
    Such a folder has an index of its own, by `write_index(raw / "local")`. Files that are no session metadata (vehicle
    files) are passed over. Raises SessionError for a session file that is damaged.
    """
    rows = [_index_row(read_session(path), path, raw) for path in metadata_files(raw)]
    rows.sort(key=lambda row: (row["started"], row["id"]))
    text = io.StringIO(newline="")
    writer = csv.DictWriter(text, COLUMNS, delimiter="\t", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    replace_bytes(raw / NAME, with_checksum(text.getvalue().encode()))
    return rows


def with_checksum(data: bytes) -> bytes:
    """The index with a checksum that fits in its last row; one that is there is replaced, every other byte is kept."""
    rest = _ROW.sub(b"", data)
    if not rest.endswith(b"\n"):
        rest += b"\n"
    # As many cells as the others: to every reader of tables it stays one.
    cells = [KEY, sha256(rest).hexdigest()]
    return rest + "\t".join(cells + [""] * (len(COLUMNS) - len(cells))).encode() + b"\n"


def files_with_checksum(place: Path) -> list[Path]:
    """Files with a checksum meant by a folder, a log, metadata or an index. Raises SessionError where there are none.

    Of a folder its index comes first, where it has one.
    """
    if place.is_dir():
        found = metadata_files(place)
        if not found:
            raise SessionError(f"{place}: holds no metadata of recordings (`<log>.yaml`)")
        return [place / NAME] * (place / NAME).is_file() + found
    return [place if place.suffix == ".yaml" or place.name == NAME else session_path(place)]


def add_checksum(path: Path) -> bool:
    """Add the checksum to metadata or an index without one; True if there was none. Raises SessionError for files that
    are neither, or whose checksum does not fit."""
    if path.name == NAME:
        read_index(path.parent)
        data = read_bytes(path, LARGEST_INDEX)
        lacking, added = _ROW.search(data) is None, with_checksum
    else:
        lacking, added = read_session(path).metadata_sha256 is None, metadata_checksum.with_checksum
        data = read_bytes(path, LARGEST_METADATA)
    if lacking:
        replace_bytes(path, added(data))
    return lacking


def renew_checksum(path: Path) -> bool:
    """Make the checksum fit what stands in the file now; True if it did not. Raises SessionError for metadata or an
    index that are none with it, and then leaves the file as it was."""
    of_index = path.name == NAME
    if not path.exists():
        why = "`rotorid-acquire index` makes it" if of_index else "every log has its metadata next to it"
        raise SessionError(f"{path}: no such file; {why}")
    before = read_bytes(path, LARGEST_INDEX if of_index else LARGEST_METADATA)
    after = (with_checksum if of_index else metadata_checksum.with_checksum)(before)
    if after == before:
        return False
    replace_bytes(path, after)
    try:
        read_index(path.parent) if of_index else read_session(path)
    except SessionError:
        replace_bytes(path, before)
        raise
    return True


def metadata_files(raw: Path) -> list[Path]:
    """Metadata of the recordings below `raw`, those in `raw/local` left out."""
    return [
        path for path in sorted(raw.rglob("*.yaml")) if path.relative_to(raw).parts[0] != _LOCAL and _is_session(path)
    ]


def read_index(raw: Path) -> list[dict[str, str]]:
    """Rows of the index.

    Raises SessionError where there is none, its columns are others, a row is none or its checksum does not fit.
    """
    path = raw / NAME
    if not path.exists() and not path.is_symlink():
        raise SessionError(f"{path}: no such file; `rotorid-acquire index` makes it")
    try:
        data = read_bytes(path, LARGEST_INDEX)
        rows = _rows(data, path)
    except InputError as error:
        raise SessionError(str(error)) from None
    if _ROW.search(data) is not None and with_checksum(data) != data:
        raise SessionError(
            f"{path}: the index was changed after it was written, its checksum ({KEY}, the last row) does not fit; "
            f"make it anew from the metadata: rotorid-acquire index {raw}, or, if the change is meant, renew the "
            f"checksum: rotorid-acquire checksum --renew {path}"
        )
    return rows


def _rows(data: bytes, path: Path) -> list[dict[str, str]]:
    """Rows of an index without that of its checksum."""
    check_text(data, path)
    lines = data.decode("utf-8-sig").splitlines()
    found = lines[0].split("\t") if lines else []
    if found != COLUMNS:
        wrong = next((name for name in found if name not in COLUMNS), None)
        lacking = [name for name in COLUMNS if name not in found]
        what = f"{wrong!r} is none{hint(wrong, COLUMNS)}" if wrong else f"{listed(lacking) or 'their order'} is wrong"
        raise SessionError(f"{path}, line 1: the columns should be {', '.join(COLUMNS)}: {what}")
    try:
        rows = list(csv.reader(lines[1:], delimiter="\t", strict=True))
    except csv.Error as error:
        raise SessionError(f"{path}: not a table ({error}); `rotorid-acquire index` makes it anew") from None
    seen: dict[str, int] = {}
    recordings = []
    for number, row in enumerate(rows, 2):
        if row[:1] == [KEY]:
            continue
        if len(row) != len(COLUMNS):
            raise SessionError(f"{path}, line {number}: has {len(row)} cells, expected {len(COLUMNS)}")
        if row[0] in seen:
            raise SessionError(f"{path}, line {number}: {row[0]} is there twice (first in line {seen[row[0]]})")
        seen[row[0]] = number
        for name in ("file", "metadata"):
            place = PurePosixPath(row[COLUMNS.index(name)])
            if place.is_absolute() or ".." in place.parts or not place.name:
                raise SessionError(
                    f"{path}, line {number}: {name}: found {str(place)!r}, expected a file below {path.parent}"
                )
        recordings.append(dict(zip(COLUMNS, row, strict=True)))
    return recordings


def _is_session(path: Path) -> bool:
    if not path.is_file():
        return False
    # By its log, too: with a damaged first line it is still a recording, and must not be passed over.
    if any(path.with_suffix(suffix).exists() for suffix in (".rlog", ".rlog.gz")):
        return True
    with open(path, encoding="utf-8", errors="replace") as file:
        return file.readline(100).strip() == "format: rotorid-session-1"
