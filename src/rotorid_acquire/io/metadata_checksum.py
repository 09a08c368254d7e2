"""The last line of a recording's metadata: the SHA-256 of all bytes before it.

    metadata_sha256: '0b5c…'

The recorder writes it. It is over bytes and not over values, so that every changed bit is noticed, in a remark as well
as in a load. Files of earlier recorders have no such line and are read all the same.
"""

from __future__ import annotations

import re
from hashlib import sha256
from pathlib import Path

from rotorid.errors import InputError

_KEY = "metadata_sha256"
_LINE = re.compile(rb"^metadata_sha256:.*\n?", re.MULTILINE)


def with_checksum(data: bytes) -> bytes:
    """The metadata with a checksum that fits; one that is there is replaced, every other byte is kept."""
    rest = _LINE.sub(b"", data)
    if not rest.endswith(b"\n"):
        rest += b"\n"
    # In quotes: to YAML a digest such as 12e4… may be a number.
    return rest + f"{_KEY}: '{sha256(rest).hexdigest()}'\n".encode()


def check(data: bytes, path: Path) -> bool:
    """Whether the metadata have a checksum at all. Raises InputError where they have one that does not fit."""
    if _LINE.search(data) is None:
        return False
    if with_checksum(data) != data:
        raise InputError(
            f"{path}: the metadata were changed after recording, their checksum ({_KEY}, the last line) does not fit; "
            f"put the recorded file back, or, if the change is meant, renew the checksum: "
            f"rotorid-acquire checksum --renew {path}"
        )
    return True


def without_checksum(number: int, first: Path | str) -> str:
    """What to say, once, of recordings whose metadata have no checksum; `first` names one of them."""
    where = f"{first}: the metadata have" if number == 1 else f"{number} recordings, first {first}: the metadata have"
    return f"{where} no checksum, so a change of them after recording goes unnoticed; rotorid-acquire checksum adds it"
