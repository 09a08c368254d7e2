"""`raw/sessions.tsv`: one row per recording, made from the metadata beside the logs."""

from __future__ import annotations

import csv
from pathlib import Path

from rotorid.io.session import Session, SessionError, read_session

COLUMNS = (
    "id group kind instrument platform axis load_gf cell experiment mount_roll_deg mount_pitch_deg throttle "
    "infill_percent specimen repeat started source ended samples missing file metadata"
).split()

LOCAL = "local"
"""Folder for recordings that no index takes unasked."""


def index_row(session: Session, metadata: Path, raw: Path) -> dict[str, str]:
    """A row of the index; paths are relative to `raw`, what is not known is empty."""
    values = session.setup.model_dump() | session.model_dump(exclude={"setup"}) | session.counts.model_dump()
    values["file"] = metadata.with_name(session.log).relative_to(raw).as_posix()
    values["metadata"] = metadata.relative_to(raw).as_posix()
    return {name: "" if values.get(name) is None else str(values[name]) for name in COLUMNS}


def write_index(raw: Path) -> list[dict[str, str]]:
    """Find all recordings below `raw`, in the order of their time, and write the index.

    What lies in `raw/local`, where the recorders write by default, is left out: first tries are no part of a campaign.
    Such a folder has an index of its own, by `write_index(raw / "local")`. Files that are no session metadata (tables,
    vehicle files) are passed over. Raises SessionError for a session file that is damaged.
    """
    rows = []
    for path in sorted(raw.rglob("*.yaml")):
        if path.relative_to(raw).parts[0] != LOCAL and _is_session(path):
            rows.append(index_row(read_session(path), path, raw))
    rows.sort(key=lambda row: (row["started"], row["id"]))
    with open(raw / "sessions.tsv", "w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS, delimiter="\t", lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    return rows


def read_index(raw: Path) -> list[dict[str, str]]:
    """Rows of the index. Raises SessionError where there is none or its columns are others."""
    path = raw / "sessions.tsv"
    try:
        with open(path, encoding="utf-8", newline="") as file:
            reader = csv.DictReader(file, delimiter="\t")
            if reader.fieldnames != COLUMNS:
                raise SessionError(f"{path}: the columns should be {', '.join(COLUMNS)}")
            return list(reader)
    except FileNotFoundError as error:
        raise SessionError(f"{path}: no such file; `rotorid-acquire index` makes it") from error


def _is_session(path: Path) -> bool:
    with open(path, encoding="utf-8", errors="replace") as file:
        return file.readline().strip() == "format: rotorid-session-1"
