"""What an importer found wrong in a file and what it did about it."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, replace
from pathlib import Path


@dataclass(frozen=True)
class Fault:
    """One fault of a recording: its kind and column, what was seen and done, how many samples it touches."""

    kind: str
    column: str
    found: str
    action: str
    samples: int
    run: str = ""

    def in_run(self, run: str) -> Fault:
        return replace(self, run=run)

    @property
    def sentence(self) -> str:
        place = ", ".join(part for part in (self.run, self.column) if part)
        return f"{place + ': ' if place else ''}{self.found}; {self.action}."


@dataclass(frozen=True)
class ImportReport:
    """Where a contract set comes from and every fault met on the way."""

    set: str
    source: str
    licence: str
    files: tuple[str, ...]
    axes: str
    faults: tuple[Fault, ...]
    notes: tuple[str, ...] = ()

    def write(self, path: Path) -> None:
        """Write as JSON, the same bytes for the same content."""
        content = asdict(self)
        for entry, fault in zip(content["faults"], self.faults, strict=True):
            entry["sentence"] = fault.sentence
        path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
