"""What an importer found wrong in a file and what it did about it."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path


@dataclass(frozen=True)
class ImportFault:
    """One fault of a recording: its kind and column, what was seen and done, how many samples it touches."""

    kind: str
    column: str
    found: str
    action: str
    samples: int
    run: str = ""

    def in_run(self, run: str) -> ImportFault:
        return replace(self, run=run)

    @property
    def sentence(self) -> str:
        place = ", ".join(part for part in (self.run, self.column) if part)
        return f"{place + ': ' if place else ''}{self.found}; {self.action}."


FILE_NAME = "import_report.json"


@dataclass(frozen=True)
class ImportReport:
    """Where a contract set comes from and every fault met on the way; or why it is not there."""

    set: str
    available: bool
    source: str
    licence: str
    citation: str
    reason: str = ""
    files: dict[str, str] = field(default_factory=dict)
    """SHA-256 of each file read."""
    axes: str = ""
    faults: tuple[ImportFault, ...] = ()
    notes: tuple[str, ...] = ()

    def after(self, earlier: dict) -> ImportReport:
        """The report of a set that holds what was imported now and, as its earlier report says, before."""
        faults = tuple(
            ImportFault(**{f.name: fault[f.name] for f in fields(ImportFault)}) for fault in earlier["faults"]
        )
        files = {**earlier["files"], **self.files}
        return replace(
            self,
            source=", ".join(files),
            files=files,
            faults=tuple(dict.fromkeys((*faults, *self.faults))),
            notes=tuple(dict.fromkeys((*earlier["notes"], *self.notes))),
        )

    def write(self, folder: Path) -> Path:
        """Write `import_report.json` into a set's folder, the same bytes for the same content."""
        content = asdict(self)
        for entry, fault in zip(content["faults"], self.faults, strict=True):
            entry["sentence"] = fault.sentence
        path = Path(folder) / FILE_NAME
        path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
        return path


def read_report(folder: Path) -> dict:
    """The import report of a set's folder."""
    return json.loads((Path(folder) / FILE_NAME).read_text(encoding="utf-8"))
