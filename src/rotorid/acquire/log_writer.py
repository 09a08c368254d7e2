"""Appends chunks to a raw log. Bytes are on disk before anything looks at them."""

from __future__ import annotations

import errno
import os
from pathlib import Path

from rotorid.acquire.errors import DiskFull
from rotorid.io import rawlog

BALLAST_BYTES = 64 * 1024
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)


class LogWriter:
    """An open raw log.

    A ballast keeps 64 KiB of the disk in reserve: a file that is open and has no name any more, so that it is gone with
    this program, however that ends. When the disk runs full the ballast is given up, so that the chunk in hand and the
    session's metadata still find room; then DiskFull is raised.
    """

    def __init__(self, path: Path, durable: bool = True) -> None:
        """Creates the log. `durable` forces it to disk every second and at the end (a power cut loses no
        more than that). Raises FileExistsError: a recording is never overwritten."""
        self.path = path
        self.bytes_written = 0
        self.durable = durable
        self._synced_ns = 0
        self._ballast = -1
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o644)
        try:
            if durable:
                self._take_ballast()
            self._append(rawlog.MAGIC)
        except OSError as error:
            self.discard()
            raise self._full(error) from error

    def write(self, tag: int, host_ns: int, data: bytes) -> None:
        """Append a chunk. Raises DiskFull; the chunk is whole on disk if the ballast gave room for it."""
        self._write(rawlog.pack_chunk(tag, host_ns, data), host_ns)

    def close(self) -> None:
        if self._file < 0:
            return
        if self.durable:
            os.fsync(self._file)
        os.close(self._file)
        self._file = -1
        self._drop_ballast()

    def discard(self) -> None:
        """Leave nothing behind: for a recording that never began."""
        self.durable = False
        self.close()
        self.path.unlink(missing_ok=True)

    def _write(self, packed: bytes, host_ns: int) -> None:
        start = self.bytes_written
        try:
            self._append(packed)
            if self.durable and host_ns - self._synced_ns > 1_000_000_000:
                os.fdatasync(self._file)
                self._synced_ns = host_ns
        except OSError as error:
            if error.errno not in FULL:
                raise
            self._drop_ballast()
            full = self._full(error)
            try:
                self._append(packed[self.bytes_written - start :])
                full.stored = True
            except OSError:  # not even the ballast's room was enough: the log ends in a cut chunk
                pass
            raise full from error

    def _take_ballast(self) -> None:
        try:
            # Never with a name, however early this program is killed.
            self._ballast = os.open(self.path.parent, os.O_WRONLY | os.O_TMPFILE, 0o600)
        except (AttributeError, OSError):  # not every system, nor every file system, has such files
            path = self.path.with_name(self.path.name + ".ballast")
            self._ballast = os.open(path, os.O_WRONLY | os.O_CREAT, 0o600)
            path.unlink()
        data = bytes(BALLAST_BYTES)
        while data:
            data = data[os.write(self._ballast, data) :]

    def _drop_ballast(self) -> None:
        if self._ballast >= 0:
            os.close(self._ballast)
            self._ballast = -1

    def _append(self, data: bytes) -> None:
        while data:
            written = os.write(self._file, data)
            self.bytes_written += written
            data = data[written:]

    def _full(self, error: OSError) -> DiskFull:
        return DiskFull(
            f"{self.path}: cannot be written any more ({os.strerror(error.errno)}). "
            "What came before is safe. Free some space or use another disk (--out), then record again."
        )
