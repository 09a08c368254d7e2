"""Judge sets and their changed copies, and write what differs as a table.

    python -m tests.invariance TABLE.tsv SET_FOLDER ... [--changes renamed,turned]

What the table holds already is not judged again.
"""

import argparse
import csv
import time
from pathlib import Path

from rotorid.errors import InputError
from rotorid.mismatch.deliver import judge
from rotorid.recordings import read_set
from tests.invariance.changes import CHANGES
from tests.invariance.compare import difference

COLUMNS = ("set", "change", "words", "hints", "moved", "which", "cpu_s")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("table", type=Path)
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--changes", default=",".join(CHANGES))
    asked = parser.parse_args()
    new = not asked.table.exists()
    done = set()
    if not new:
        with asked.table.open(newline="") as file:
            done = {(row["set"], row["change"]) for row in csv.DictReader(file, delimiter="\t")}
    with asked.table.open("a", newline="", buffering=1) as file:
        rows = csv.DictWriter(file, COLUMNS, delimiter="\t")
        if new:
            rows.writeheader()
        for folder in asked.folders:
            left = [name for name in asked.changes.split(",") if (folder.name, name) not in done]
            if left:
                for row in compared(folder, left):
                    rows.writerow(row)


def compared(folder: Path, changes: list[str]):
    """A row for each change of one set."""
    recordings = read_set(folder)
    own = judge(recordings)
    for name in changes:
        start = time.process_time()
        row = {"set": folder.name, "change": name}
        changed = CHANGES[name](recordings, own.runs.held_out)
        if changed is None:
            continue
        try:
            found = difference(own, judge(changed.recordings), changed)
        except (InputError, ArithmeticError, ValueError) as error:
            yield row | {"words": f"{type(error).__name__}: {error}"}
            continue
        yield row | {
            "words": "; ".join(found.words),
            "hints": "; ".join(found.hints),
            "moved": f"{found.moved:.3g}",
            "which": found.which,
            "cpu_s": f"{time.process_time() - start:.1f}",
        }


if __name__ == "__main__":
    main()
