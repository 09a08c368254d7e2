"""What is delivered of one set or of every set below a folder, how well it predicts, and whether it flies.

- Reads recording sets, runs the mismatch stage on each.
- Writes a row a set: what stands in each file, every candidate's number, errors on runs held out, what does not fly.
"""

import json
from pathlib import Path

from rotorid_lab import log
from rotorid_proof.delivered import rows_of


def main(sets: str, one: bool, rows: str) -> None:
    """Judge the set `sets`, or every set below it, into the file `rows` (JSON)."""
    folders = [Path(sets)] if one else sorted(path for path in Path(sets).iterdir() if path.is_dir())
    found = rows_of(folders, log.progress)
    Path(rows).write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(sets=str(snakemake.input.sets), one=snakemake.params.one, rows=snakemake.output.rows)
