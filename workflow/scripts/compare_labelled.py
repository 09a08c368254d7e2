"""What changed between flights whose authors say what they changed.

- The good flights are fitted once; flights with a weight and with a cut propeller are compared with them.
- Figures of both: every quantity of level 1 over the flights.
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
from rotorid.report import log
from rotorid.report.plots import style
from rotorid.report.plots.mismatch import draw_differences


def main(normal: str, changed: dict[str, str], found: str, differences: dict[str, str]) -> None:
    """Compare the sets in the folders `changed`, by what was changed, with that in `normal`.

    `differences` are the figures of level 1, by what was changed.
    """
    reports = [read_report(Path(folder)) for folder in (normal, *changed.values())]
    reasons = [report["reason"] for report in reports if not report["available"]]
    out = {"available": not reasons, "reason": reasons[0] if reasons else "", "pairs": {}}
    if reasons:
        for path in differences.values():
            style.placeholder(Path(path), reasons[0])
    else:
        reference = reference_of(read_set(normal))
        compared = {name: changes_from(reference, read_set(folder)) for name, folder in changed.items()}
        out["pairs"] = {name: words.as_json(own) for name, own in compared.items()}
        for name, own in compared.items():
            names = {d.quantity.key: quantity_words(d) for d in own.level_1.differences}
            draw_differences(own, names, Path(differences[name]))
    Path(found).write_text(json.dumps(out, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            normal=snakemake.input.normal,
            changed={name: snakemake.input[name] for name in ("weight", "cut")},
            found=snakemake.output.found,
            differences={name: snakemake.output[f"differs_{name}"] for name in ("weight", "cut")},
        )
