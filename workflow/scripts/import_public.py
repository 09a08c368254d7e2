"""Public recordings of one source as contract sets.

- Takes the files from the folder that ROTORID_PUBLIC_DATA names, otherwise downloads them; checks SHA-256.
- Writes one folder a set; a set whose files cannot be had holds only the report that says so.
"""

import json
import logging
from collections.abc import Sequence
from pathlib import Path

from rotorid.recordings.importers.faults import read_report
from rotorid_lab import log, public_sets
from rotorid_lab.public_list import read_manifest
from rotorid_lab.public_sets import obtain

LOGGER = logging.getLogger("rotorid.public")


def main(
    source: str, manifest: str, vehicles: Sequence[str], folder: str, cache: str, parent: str, status: str
) -> None:
    """Import every set of `source` below `parent` and write what was had to the JSON file `status`."""
    entry = read_manifest(manifest)[source]
    obtained = obtain(source, entry, Path(folder) if folder else None, Path(cache))
    missing = obtained[1]
    for file, reason in missing.items():
        LOGGER.warning("%s: %s", file, reason)
    sets = {}
    for name in public_sets.sets_of(source):
        made = public_sets.build(name, obtained, entry, Path(vehicles[0]).parent, Path(parent))
        report = read_report(made)
        sets[name] = {"available": report["available"], "faults": len(report["faults"])}
        for fault in report["faults"]:
            LOGGER.info("%s: %s", name, fault["sentence"])
    words = {key: entry[key] for key in ("repository", "commit", "licence", "citation", "contents")}
    status_of = {
        "source": source,
        "taken_from": "folder" if folder else "network",
        "available": not missing,
        "files": len(entry["files"]),
        "files_missing": len(missing),
        "reason": next(iter(missing.values()), ""),
        **words,
        "sets": sets,
    }
    Path(status).write_text(json.dumps(status_of, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            source=snakemake.params.source,
            manifest=snakemake.input.manifest,
            vehicles=snakemake.input.vehicles,
            folder=snakemake.params.folder,
            cache=snakemake.params.cache,
            parent=snakemake.params.parent,
            status=snakemake.output.status,
        )
