"""Getting the public recordings: from a folder that is there or by download; SHA-256 is always checked.

Nothing here is fatal: a file that cannot be had is named with the reason, and the pipeline goes on without.
"""

from __future__ import annotations

import hashlib
import urllib.error
import urllib.parse
import urllib.request
from dataclasses import dataclass
from pathlib import Path

from rotorid.errors import InputError
from rotorid.recordings.manifest import sha256

RAW_FILES = "https://raw.githubusercontent.com"
TIMEOUT_S = 20.0


@dataclass(frozen=True)
class Obtained:
    """What was had of one source: its folder, the files that are right, and why others are not."""

    source: str
    folder: Path
    files: tuple[str, ...]
    missing: dict[str, str]

    @property
    def complete(self) -> bool:
        return not self.missing


def address(source: dict, file: dict, base: str = RAW_FILES) -> str:
    """Where a file of the manifest is downloaded: repository, commit and path upstream."""
    path = urllib.parse.quote(file.get("upstream", file["path"]))
    return f"{base}/{source['repository']}/{source['commit']}/{path}"


def _download(url: str, wanted: str, path: Path) -> None:
    with urllib.request.urlopen(url, timeout=TIMEOUT_S) as answer:
        data = answer.read()
    found = hashlib.sha256(data).hexdigest()
    if found != wanted:
        raise InputError(f"{url}: SHA-256 is {found}, expected {wanted}")
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(path.name + ".part")
    partial.write_bytes(data)
    partial.rename(path)


def _from_folder(name: str, source: dict, folder: Path) -> Obtained:
    files, missing = [], {}
    for file in source["files"]:
        path = folder / name / file["path"]
        if not path.is_file():
            missing[file["path"]] = f"{path} is not there"
        elif sha256(path) != file["sha256"]:
            missing[file["path"]] = f"{path} is not the file of the manifest (SHA-256 differs)"
        else:
            files.append(file["path"])
    return Obtained(name, folder / name, tuple(files), missing)


def _from_network(name: str, source: dict, cache: Path, base: str) -> Obtained:
    files, missing, offline = [], {}, ""
    for file in source["files"]:
        path = cache / name / file["path"]
        if path.is_file() and sha256(path) == file["sha256"]:
            files.append(file["path"])
            continue
        if offline:
            missing[file["path"]] = offline
            continue
        url = address(source, file, base)
        try:
            _download(url, file["sha256"], path)
            files.append(file["path"])
        except InputError as error:
            missing[file["path"]] = str(error)
        except urllib.error.HTTPError as error:
            missing[file["path"]] = f"{url}: the server answers {error.code}"
        except OSError as error:
            host = urllib.parse.urlsplit(base).netloc
            offline = f"no answer from {host} ({getattr(error, 'reason', error)})"
            missing[file["path"]] = offline
    return Obtained(name, cache / name, tuple(files), missing)


def obtain(name: str, source: dict, folder: Path | None, cache: Path, base: str = RAW_FILES) -> Obtained:
    """Files of one source of the manifest.

    Parameters
    ----------
    name, source
        Name and entry of the source in the manifest.
    folder
        A folder with the public recordings (what ROTORID_PUBLIC_DATA names), or None to download.
    cache
        Where downloads are kept.
    base
        Server of raw files.
    """
    if folder is not None:
        return _from_folder(name, source, Path(folder))
    return _from_network(name, source, Path(cache), base)
