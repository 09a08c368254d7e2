"""Judge sets and their changed copies, and write what differs as a table.

    python -m tests.invariance TABLE.tsv SET_FOLDER ... [--changes renamed,turned]
    python -m tests.invariance TABLE.tsv              # only sums the table up

What the table holds already is not judged again.
"""

import argparse
import csv
import time
from pathlib import Path

from rotorid.errors import InputError
from rotorid.recordings import read_set
from rotorid.report.deliver import judge
from tests.invariance.changes import CHANGES, LESS_IS_KNOWN
from tests.invariance.compare import difference

COLUMNS = ("set", "kind", "change", "words", "hints", "moved", "which", "cpu_s")
MOST_MOVED = 0.05
"""Share of its 95 % interval by which a number may differ."""
MOST_MOVED_BY_LESS = 1.0
"""The same where samples were left out: a value may not leave the interval's width."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("table", type=Path)
    parser.add_argument("folders", type=Path, nargs="*")
    parser.add_argument("--changes", default=",".join(CHANGES))
    asked = parser.parse_args()
    new = not asked.table.exists() or not asked.table.stat().st_size
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
    print(summary(read(asked.table)))


def read(table: Path) -> list[dict[str, str]]:
    """Rows of a table."""
    with table.open(newline="") as file:
        return list(csv.DictReader(file, delimiter="\t"))


def too_far(row: dict[str, str]) -> bool:
    """Whether a number moved by more than it may."""
    most = MOST_MOVED_BY_LESS if row["change"] in LESS_IS_KNOWN else MOST_MOVED
    return bool(row["moved"]) and float(row["moved"]) > most


def summary(rows: list[dict[str, str]]) -> str:
    """A markdown table: of each change how many sets, in how many the words differ, in how many a number is too far."""
    lines = ["| change | sets | words differ | a number too far |", "| --- | ---: | ---: | ---: |"]
    for change in [*CHANGES, ""]:
        own = [row for row in rows if change in ("", row["change"])]
        counts = (len(own), sum(bool(row["words"]) for row in own), sum(map(too_far, own)))
        name = change.replace("_", " ") or f"all (sets: {len({row['set'] for row in rows})})"
        lines.append(f"| {name} | {' | '.join(map(str, counts))} |")
    return "\n".join(lines)


def compared(folder: Path, changes: list[str]):
    """A row for each change of one set."""
    recordings = read_set(folder)
    own = judge(recordings)
    for name in changes:
        start = time.process_time()
        row = {"set": folder.name, "kind": recordings.vehicle.kind, "change": name}
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
