"""Where a report came from: versions, commit, configuration, hashes of raw files, date."""

from __future__ import annotations

import hashlib
import platform
import re
import subprocess
import tomllib
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import rotorid


def gather(raw: Sequence[str | Path], lock: str | Path, config: Mapping[str, Any]) -> dict[str, Any]:
    """Everything needed to make the same report again.

    Parameters
    ----------
    raw
        Files that instruments wrote.
    lock
        The lock file; the installed version of each package in it is recorded.
    config
        The configuration that the run used.
    """
    lock = Path(lock)
    return {
        "made": datetime.now(UTC).isoformat(timespec="seconds"),
        "commit": commit(lock.parent),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "packages": installed_versions(lock.read_text(encoding="utf-8")),
        "lock_sha256": sha256(lock),
        "config": dict(config),
        "raw_sha256": {str(path): sha256(path) for path in raw},
    }


def commit(folder: str | Path) -> str:
    """The commit of the working tree, with `-dirty` where files differ; says so where there is none."""
    command = ["git", "-C", str(folder), "describe", "--always", "--dirty", "--abbrev=40", "--exclude=*"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return "unknown: not a git checkout"
    return done.stdout.strip()


def own_commit() -> str:
    """The commit that the running library comes from, as `commit` says it; empty where it was not started from a clone.

    A library installed into another project's folder lies in that project's repository, which does not track it.
    """
    folder = Path(rotorid.__file__).parent
    tracked = ["git", "-C", str(folder), "ls-files", "--error-unmatch", "__init__.py"]
    try:
        subprocess.run(tracked, capture_output=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return ""
    return commit(folder)


def _commit_date(folder: str | Path) -> str:
    """The day of the commit of the working tree (ISO); empty where there is none."""
    command = ["git", "-C", str(folder), "log", "-1", "--format=%cs"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return ""
    return done.stdout.strip()


def stored_with(folder: str | Path, path: str) -> str:
    """The commit that last changed a file of a checkout, and its day: `09827fa, 2026-11-23`; or `not known`."""
    command = ["git", "-C", str(folder), "log", "-1", "--format=%h, %cs", "--abbrev=7", "--", path]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return "not known"
    return done.stdout.strip() or "not known"


def in_words(folder: str | Path, judging: str) -> str:
    """Commit, its date and the hash of the code that judges recordings, in one sentence for a title page."""
    made, day = commit(folder), _commit_date(folder)
    known = f"Made from commit {made[:10]}" + (" of " + day if day else "")
    known += ", with changes that are not committed" if made.endswith("-dirty") else ""
    source = known if day else "Made outside of a git checkout, so that no commit is known"
    return f"{source}. The code that judges recordings has the hash {judging[:7]} ({judging})."


def installed_versions(lock: str) -> dict[str, str]:
    """Installed version of each package that a lock file's text names."""
    found = {}
    for name in re.findall(r"^([A-Za-z0-9][A-Za-z0-9._-]*)==", lock, flags=re.MULTILINE):
        try:
            found[name] = version(name)
        except PackageNotFoundError:  # locked for another platform or Python
            continue
    return found


def asked_for(project: str) -> list[str]:
    """Packages that the text of a pyproject.toml asks for by name, its extras included, in their order there."""
    table = tomllib.loads(project)["project"]
    groups = [table.get("dependencies", []), *table.get("optional-dependencies", {}).values()]
    names = [re.match(r"[A-Za-z0-9._-]+", entry)[0] for group in groups for entry in group]
    return [name for name in dict.fromkeys(names) if name != table["name"]]


def sha256(path: str | Path) -> str:
    """SHA-256 of a file of any size, in hexadecimal digits."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()
