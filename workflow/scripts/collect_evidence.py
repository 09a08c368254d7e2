"""Evidence of many sets for the bench of decisions.

- Makes each set that is not kept yet (drawn, planted, or a real flight), judges it and keeps what a decision needs.
- Writes the list of what is kept of the sets that the configuration asks for.
"""

import hashlib
import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from rotorid.recordings import read_set
from rotorid.recordings.importers.faults import read_report
from rotorid_lab import log
from rotorid_proof.decisions import truths
from rotorid_proof.decisions.collect import Made, collect
from rotorid_proof.decisions.plan import Item, in_order
from rotorid_proof.plantings.flights import flight
from rotorid_proof.plantings.judge import cut
from rotorid_proof.plantings.plan import parsed
from rotorid_proof.plantings.sow import plant
from rotorid_proof.real import with_split
from rotorid_proof.studies import study


class Sets:
    """Makes the sets of items from the concealed simulators and the imported public sets.

    Parameters
    ----------
    public
        Folder with the imported public sets.
    drawing, planting
        Hashes of the code that draws sets, and of that which plants.
    """

    def __init__(self, public: Path, drawing: str, planting: str) -> None:
        self.public = public
        self.drawing, self.planting = drawing, planting
        self._contents: dict[str, str] = {}

    def folder_of(self, item: Item) -> Path:
        """Folder of the public set that an item is made from."""
        _, name, *_ = item.label.name.split("/")
        return self.public / (study(name).set if item.label.origin == "study" else flight(name).set)

    def available(self, item: Item) -> bool:
        """Whether the recordings that an item is made from could be had."""
        return item.label.origin == "drawn" or read_report(self.folder_of(item))["available"]

    def source_of(self, item: Item) -> str:
        """Hash of what an item is made from: code that draws it, or files of the public set and code that plants."""
        if item.label.origin == "drawn":
            return self.drawing
        folder = self.folder_of(item)
        if folder.name not in self._contents:
            files = sorted(p for p in folder.iterdir() if p.name != "import_report.json")
            digests = [f"{p.name} {hashlib.sha256(p.read_bytes()).hexdigest()}" for p in files]
            self._contents[folder.name] = hashlib.sha256("\n".join(digests).encode()).hexdigest()[:16]
        return self._contents[folder.name] + (self.planting if item.label.origin != "study" else "")

    def make(self, item: Item) -> Made:
        """The set of an item and what is true of it."""
        origin, _, rest = item.label.name.partition("/")
        if origin == "drawn":
            return self._drawn(rest)
        if origin == "planted":
            planting = parsed(rest)
            changed, planted = plant(cut(self.folder_of(item), planting.flight), planting)
            return Made(changed, {"truths": [truths.as_json(t) for t in planted]})
        if origin == "untouched":
            return Made(cut(self.folder_of(item), rest), {})
        wanted = study(rest)
        return Made(with_split(read_set(self.folder_of(item)), wanted), {"expected": list(wanted.expected)})

    def _drawn(self, case: str) -> Made:
        from rotorid_proof.concealed import build
        from rotorid_proof.concealed import cases as known

        (wanted,) = known.with_names([case])
        with tempfile.TemporaryDirectory() as made:
            answer = build.build(wanted, Path(made) / "sets", Path(made) / "answers")
            recordings = read_set(Path(made) / "sets" / wanted.set_name)
            return Made(recordings, {"answer": json.loads(answer.read_text(encoding="utf-8"))})


def main(items: Sequence[Item], folder: str, public: str, hashes: Mapping[str, str], out: str) -> None:
    """Keep the evidence of `items` in `folder`, the most informative first, and write the names of its files to `out`.

    `hashes` are those of the code that draws (`drawing`), plants (`planting`) and judges (`engine`).
    """
    sets = Sets(Path(public), hashes["drawing"], hashes["planting"])
    wanted = [item for item in in_order(items) if sets.available(item)]
    stems = collect(wanted, Path(folder), sets.make, sets.source_of, hashes["engine"], log.progress)
    Path(out).write_text(json.dumps({"engine": hashes["engine"], "kept": stems}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            items=snakemake.params.wanted,
            folder=snakemake.params.folder,
            public=snakemake.params.public,
            hashes=snakemake.params.hashes,
            out=snakemake.output.kept,
        )
