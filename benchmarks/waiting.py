"""How well a verdict says how long is left: the steps of real verdicts, each foreknown by the record of the others.

    python benchmarks/waiting.py record DIR SET    a file of the steps of a verdict and their processor seconds into DIR
    python benchmarks/waiting.py table DIR [--out benchmarks/waiting.md]

Every fiftieth of the time from the first fifth on, the estimate is compared with what was left; what is less than 5 s
counts as 5 s, as it is shown.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from rotorid.cli.console import SOON_S, time_left

TIMES = [share / 50 for share in range(10, 50)]


def record(out: Path, folder: Path) -> None:
    """Judge a set and write its steps."""
    from rotorid.recordings import read_set
    from rotorid.report.deliver import deliver
    from rotorid.steps import heard_by

    run, begun = [], [("", 0.0)]

    def hear(path: tuple[str, ...]) -> None:
        run.append((begun[-1][0], time.process_time() - begun[-1][1]))
        begun.append(("/".join(path), time.process_time()))

    with tempfile.TemporaryDirectory() as place, heard_by(hear):
        deliver(read_set(folder), Path(place))
    hear(())
    out.mkdir(parents=True, exist_ok=True)
    (out / f"{folder.name}.json").write_text(json.dumps(run), encoding="utf-8")


def ratios(run: list, others: list) -> dict[float, float | None]:
    """Estimate over truth by the share of the time that is over; None where no number is shown."""
    out, whole = {}, sum(seconds for _, seconds in run)
    for share in TIMES:
        done, spent = 0, share * whole
        while spent > run[done][1]:
            spent, done = spent - run[done][1], done + 1
        known = time_left(others, run[:done], run[done][0], spent)
        out[share] = None if known is None else max(known, SOON_S) / max((1 - share) * whole, SOON_S)
    return out


def table(folder: Path) -> str:
    """The table of all recorded sets."""
    runs = {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in sorted(folder.glob("*.json"))}
    rows, shown_all, right_all, without = [], 0, 0, 0
    for name, run in runs.items():
        found = ratios(run, [other for key, other in runs.items() if key != name])
        shown = [r for r in found.values() if r is not None]
        right = sum(0.5 <= r <= 2.0 for r in shown)
        shown_all, right_all, without = shown_all + len(shown), right_all + right, without + (right == len(shown))
        cells = ["none" if found[t] is None else f"{found[t]:.1f}" for t in (0.2, 0.5, 0.8)]
        share = f"{len(shown) / len(found):.0%}"
        rows.append(
            f"| {name} | {sum(s for _, s in run):.0f} | {' | '.join(cells)} | {share} | {right} of {len(shown)} |"
        )
    return "\n".join(
        [
            "# How long is left",
            "",
            "`python benchmarks/waiting.py`: estimate over truth at 20, 50 and 80 % of the time, by the record of all "
            "other sets; seconds are of the processor. With an empty record no number is shown.",
            "",
            "| set | s | 20 % | 50 % | 80 % | shown | within a factor of two |",
            "| --- | ---: | ---: | ---: | ---: | ---: | ---: |",
            *rows,
            "",
            f"At {len(TIMES) * len(runs)} times {shown_all} numbers are shown; {right_all} of them "
            f"({right_all / shown_all:.0%}) are within a factor of two. {without} of {len(runs)} sets show no other.",
            "",
        ]
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("record", "table"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("set", type=Path, nargs="?")
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    if given.what == "record":
        record(given.folder, given.set)
    else:
        text = table(given.folder)
        print(text)
        if given.out:
            given.out.write_text(text, encoding="utf-8")
