"""What the page keeps: a folder a set, with the logs as they came, a state and the answer.

All that a visitor names is looked up among what is there: an id among the folders, a file among those of a folder. No
path is ever made of what a visitor wrote, but the name under which a log is kept, and that has no separator in it.
"""

from __future__ import annotations

import json
import re
import secrets
import shutil
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rotorid.errors import InputError
from rotorid.io.text.files import LARGEST_METADATA, read_text
from rotorid.io.text.wording import printable
from rotorid.io.text.writing import write_texts

STATE, LOGS, ANSWER, SET = "state.json", "logs", "answer", "set"
_ID = re.compile(r"[0-9]{8}-[0-9a-f]{12}")
_LONGEST_NAME = 120
MOST_LOGS = 50
"""Logs of one set that come through the page."""
WORKING = ("waiting", "working")
"""Stages in which somebody is at work, or will be."""
INTERRUPTED = "The page was closed while it worked; the logs are still here, ask again."


class NotThere(KeyError):
    """There is no set of that id, or no file of that name in it."""


def safe_name(name: str) -> str:
    """A log's own name without folders and without what file systems, or a terminal, read otherwise."""
    last = re.split(r"[/\\]", name)[-1]
    kept = re.sub(r'[\\<>:"|?*]', "_", printable(last)).strip(" .")
    if len(kept.encode()) > _LONGEST_NAME:
        stem, dot, suffix = kept.rpartition(".")
        whole = stem if dot and len(suffix) < 12 else kept
        end = f".{suffix}" if whole is stem else ""
        kept = whole.encode()[: _LONGEST_NAME - len(end)].decode(errors="ignore") + end
    return kept or "log"


class Shelf:
    """The sets that a page keeps, the newest first."""

    def __init__(self, folder: Path) -> None:
        """What was at work when the last page ended is marked so."""
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
        for state in self.states():
            if state["stage"] in WORKING:
                self.change(state["id"], stage="failed", sentence=INTERRUPTED)

    def path(self, id_: str) -> Path:
        """The folder of a set; NotThere where there is none."""
        path = self.folder / id_ if _ID.fullmatch(id_) else None
        if path is None or path.is_symlink() or not path.is_dir():
            raise NotThere(id_)
        return path

    def new(self) -> str:
        """The id of a new set without logs."""
        id_ = f"{time.strftime('%Y%m%d')}-{secrets.token_hex(6)}"
        path = self.folder / id_
        (path / LOGS).mkdir(parents=True)
        self._write(path, {"id": id_, "name": "", "made_s": time.time(), "stage": "new", "sentence": "", "logs": []})
        return id_

    def states(self) -> list[dict[str, Any]]:
        """What is known of each set."""
        found = []
        for path in self.folder.iterdir():
            if _ID.fullmatch(path.name) and path.is_dir() and not path.is_symlink():
                found.append(self.state(path.name))
        return sorted(found, key=lambda state: -state["made_s"])

    def state(self, id_: str) -> dict[str, Any]:
        """What is known of a set; NotThere where there is none.

        Of a folder whose state cannot be read its name is known, so that it can be deleted.
        """
        path = self.path(id_)
        try:
            state = json.loads(read_text(path / STATE, LARGEST_METADATA))
            if state["id"] == id_ and isinstance(state["made_s"], float) and isinstance(state["logs"], list):
                return state
        except (OSError, ValueError, KeyError, TypeError):
            pass
        said = "What is known of this set cannot be read; its files are still in its folder."
        made_s = path.stat().st_mtime if path.exists() else 0.0
        return {"id": id_, "name": id_, "made_s": made_s, "stage": "failed", "sentence": said, "logs": []}

    def change(self, id_: str, **values: Any) -> dict[str, Any]:
        """Write down what is new of a set, and return all of it; NotThere where it was deleted."""
        state = self.state(id_) | values
        self._write(self.path(id_), state)
        return state

    def _write(self, path: Path, state: Mapping[str, Any]) -> None:
        write_texts({path / STATE: json.dumps(state, ensure_ascii=False)})

    def place_for(self, id_: str, name: str, bag: str = "") -> Path:
        """Where a log, or a file of a bag's folder, is written that is coming, under a name that no other has there."""
        logs = self.path(id_) / LOGS
        folder = logs / safe_name(bag) if bag else logs
        if folder.is_file():
            raise InputError(f"{folder.name}: a log of this set has the name of the folder; rename one of them")
        # A folder that is new counts among the logs, a file in one among those of the folder.
        there = {p.name.casefold() for p in (folder if folder.is_dir() else logs).iterdir()}
        if len(there) >= MOST_LOGS:
            raise InputError(f"a set takes at most {MOST_LOGS} logs here; make several sets of them")
        if not folder.is_dir():
            folder.mkdir()
            there = set()
        wanted = safe_name(name)
        stem, dot, suffix = wanted.partition(".")
        number = 1
        while wanted.casefold() in there:
            number += 1
            wanted = f"{stem}_{number}{dot}{suffix}"
        return folder / wanted

    def logs(self, id_: str) -> list[Path]:
        """The logs of a set in the order of their names; of ROS 2 bags the folders that are whole."""
        return sorted(p for p in (self.path(id_) / LOGS).iterdir() if p.is_file() or (p / "metadata.yaml").is_file())

    def files(self, id_: str) -> dict[str, Path]:
        """The files of the answer by name."""
        folder = self.path(id_) / ANSWER
        if not folder.is_dir():
            return {}
        return {p.name: p for p in sorted(folder.iterdir()) if p.is_file() and not p.is_symlink()}

    def delete(self, id_: str) -> None:
        """Delete a set with its logs and answers; NotThere where there is none."""
        path = self.path(id_)
        aside = self.folder / f".deleted-{secrets.token_hex(4)}"
        path.rename(aside)  # gone in one step, whatever happens while its files go
        shutil.rmtree(aside, ignore_errors=True)
