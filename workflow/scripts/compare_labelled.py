"""What changed between flights whose authors say what they changed.

- The good flights are fitted once; flights with a weight and with a cut propeller are compared with them.
- Where the recordings are not there, the result says so.
"""

import json
from pathlib import Path

from rotorid.mismatch.changes import words
from rotorid.mismatch.changes.compare import changes_from
from rotorid.mismatch.changes.joint import reference_of
from rotorid.mismatch.changes.words import quantity_words
from rotorid.recordings import read_set
from rotorid.recordings.importers.faults import read_report
from rotorid_lab import log


def main(normal: str, changed: dict[str, str], found: str) -> None:
    """Compare the sets in the folders `changed`, by what was changed, with that in `normal`."""
    reports = [read_report(Path(folder)) for folder in (normal, *changed.values())]
    reasons = [report["reason"] for report in reports if not report["available"]]
    out = {"available": not reasons, "reason": reasons[0] if reasons else "", "pairs": {}}
    if not reasons:
        reference = reference_of(read_set(normal))
        for name, folder in changed.items():
            own = changes_from(reference, read_set(folder))
            names = {d.quantity.key: quantity_words(d) for d in own.level_1.differences}
            out["pairs"][name] = words.as_json(own) | {"names": names}
    Path(found).write_text(json.dumps(out, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            normal=snakemake.input.normal,
            changed={name: snakemake.input[name] for name in ("weight", "cut")},
            found=snakemake.output.found,
        )
