"""Files in a set's folder that look like recordings and are not read."""

from __future__ import annotations

import re
from pathlib import Path

from rotorid.recordings.doubts import Doubt
from rotorid.recordings.files import RUN_SUFFIXES, run_name
from rotorid.recordings.run import RecordingSet

TABLES = ("csv", "tsv", "parquet", "feather", "xlsx", "xls", "ods", "h5", "hdf5", "mat", "npz")
LOGS = ("ulg", "bin", "bbl", "bfl", "mcap", "db3", "bag", "tlog")
PACKED = ("zip", "gz", "bz2", "xz", "zst", "7z", "tar", "tgz")
LEFT_BEHIND = ("bak", "old", "orig", "part", "tmp", "copy", "crdownload")
RECORDING = re.compile(
    rf"\.({'|'.join(TABLES + LOGS + PACKED)})(\.({'|'.join(PACKED + LEFT_BEHIND)})|~)*$", re.IGNORECASE
)


def unread_files(recordings: RecordingSet) -> tuple[Doubt, ...]:
    """One doubt for each such file; none for a set that was never a folder."""
    if not recordings.path or not Path(recordings.path).is_dir():
        return ()
    names = sorted(path.name for path in Path(recordings.path).iterdir() if not path.name.startswith("."))
    return tuple(
        Doubt(
            name,
            f"{name} looks like a recording and is not read: runs end in {', '.join(RUN_SUFFIXES)}; unpack, import or "
            "rename it, or move it out of the set.",
            stops=False,
        )
        for name in names
        if RECORDING.search(name) and run_name(Path(name)) is None
    )
