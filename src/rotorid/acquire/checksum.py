"""Gives metadata and indexes the checksum that they lack, or on purpose a new one after an edit; no log is touched."""

from __future__ import annotations

from pathlib import Path

from rotorid.io import index, metadata_checksum
from rotorid.io.index import metadata_files
from rotorid.io.session import LARGEST_METADATA, SessionError, read_session, replace_bytes, session_path
from rotorid.io.text.files import read_bytes


def metadata_of(place: Path) -> list[Path]:
    """Files with a checksum meant by a folder, a log, metadata or an index. Raises SessionError where there are none.

    Of a folder its index comes first, where it has one.
    """
    if place.is_dir():
        found = metadata_files(place)
        if not found:
            raise SessionError(f"{place}: holds no metadata of recordings (`<log>.yaml`)")
        return [place / index.NAME] * (place / index.NAME).is_file() + found
    return [place if place.suffix == ".yaml" or place.name == index.NAME else session_path(place)]


def add(path: Path) -> bool:
    """Add the checksum where there is none; True if there was none. Raises SessionError for metadata that are none,
    or whose checksum does not fit."""
    if path.name == index.NAME:
        return index.add_checksum(path)
    if read_session(path).metadata_sha256 is not None:
        return False
    replace_bytes(path, metadata_checksum.with_checksum(read_bytes(path, LARGEST_METADATA)))
    return True


def renew(path: Path) -> bool:
    """Make the checksum fit what stands in the file now; True if it did not. Raises SessionError for metadata that are
    none with it, and then leaves the file as it was."""
    if path.name == index.NAME:
        return index.renew_checksum(path)
    if not path.exists():
        raise SessionError(f"{path}: no such file; every log has its metadata next to it")
    before = read_bytes(path, LARGEST_METADATA)
    after = metadata_checksum.with_checksum(before)
    if after == before:
        return False
    replace_bytes(path, after)
    try:
        read_session(path)
    except SessionError:
        replace_bytes(path, before)
        raise
    return True
