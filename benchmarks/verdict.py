"""Two checkouts side by side on the same recording sets: what `rotorid verdict` costs, and whether it says the same.

Run: python benchmarks/verdict.py OTHER_CHECKOUT SET [SET ...] [--out benchmarks/verdict.md]

Every set goes to both in turn, each in a process of its own (the order alternates), so both meet the same machine.
Times are of one core, start-up included; the first set is flown once before, for what is compiled once. Of the verdicts
statuses are compared, and whether numbers lie in each other's 95 % intervals.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parents[1]
ONE_CORE = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
SHOWN = ("established", "ambiguous")


@dataclass(frozen=True)
class Judged:
    """A verdict, and what it cost."""

    processor_s: float
    peak_mib: float
    verdict: dict | None
    """None where the set was refused."""

    @property
    def statuses(self) -> dict[str, str]:
        """Status of every effect that is named."""
        effects = self.verdict["effects"] if self.verdict else []
        return {e["id"]: e["status"] for e in effects if e["status"] in SHOWN}

    @property
    def numbers(self) -> dict[tuple[str, str], dict]:
        """Parameters of the effects named, by id and symbol."""
        effects = self.verdict["effects"] if self.verdict else []
        return {(e["id"], p["symbol"]): p for e in effects if e["status"] in SHOWN for p in e.get("parameters", [])}


def judged(checkout: Path, recordings: Path) -> Judged:
    """The verdict of a checkout's code on a set."""
    with tempfile.TemporaryDirectory() as place:
        command = [sys.executable, "-m", "rotorid", "verdict", str(recordings), "--out", place]
        where = os.environ | ONE_CORE | {"PYTHONPATH": str(checkout / "src")}
        child = subprocess.Popen(command, env=where, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        _, _, used = os.wait4(child.pid, 0)
        found = Path(place) / "verdict.json"
        verdict = json.loads(found.read_text(encoding="utf-8")) if found.exists() else None
    return Judged(used.ru_utime + used.ru_stime, used.ru_maxrss / 1024, verdict)


def outside(ours: Judged, theirs: Judged) -> list[str]:
    """Numbers that are outside of each other's intervals."""
    out = []
    for key in ours.numbers.keys() & theirs.numbers.keys():
        (a, b) = (own.numbers[key] for own in (ours, theirs))
        if not all(isinstance(p.get("interval_95"), list) for p in (a, b)):
            continue
        within = [q["interval_95"][0] <= p["value"] <= q["interval_95"][1] for p, q in ((a, b), (b, a))]
        out += [] if any(within) else [" ".join(key)]
    return sorted(out)


def row(name: str, ours: Judged, theirs: Judged) -> str:
    """A line of the table."""
    now, before = ours.statuses, theirs.statuses
    differs = [f"{i}: {before.get(i, '–')} → {now.get(i, '–')}" for i in sorted({*now, *before})
               if now.get(i) != before.get(i)]  # fmt: skip
    refused = [who for who, own in (("here", ours), ("other", theirs)) if own.verdict is None]
    said = "; ".join([*differs, *outside(ours, theirs), *(f"refused: {who}" for who in refused)]) or "same"
    return (
        f"| {name} | {theirs.processor_s:.1f} | {ours.processor_s:.1f} | {ours.processor_s / theirs.processor_s:.2f} "
        f"| {theirs.peak_mib:.0f} | {ours.peak_mib:.0f} | {said} |"
    )


def revision(checkout: Path) -> str:
    """Short hash of a checkout's commit."""
    return subprocess.check_output(["git", "-C", checkout, "rev-parse", "--short", "HEAD"], text=True).strip()


def main(other: Path, sets: list[Path], out: Path | None) -> None:
    for checkout in (HERE, other):
        judged(checkout, sets[0])
    rows, pairs = [], []
    for number, recordings in enumerate(sets):
        order = (HERE, other) if number % 2 else (other, HERE)
        made = {checkout: judged(checkout, recordings) for checkout in order}
        ours, theirs = made[HERE], made[other]
        pairs.append((ours, theirs))
        rows.append(row(recordings.name, ours, theirs))
        print(rows[-1], flush=True)
    total = [sum(own[i].processor_s for own in pairs) for i in (1, 0)]
    same = sum(a.statuses == b.statuses for a, b in pairs)
    text = "\n".join(
        [
            "# A verdict, side by side",
            "",
            f"`python benchmarks/verdict.py`: {revision(other)} and {revision(HERE)} in turn, {len(sets)} sets, "
            f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores of which one is used.",
            "",
            "| set | before, s | now, s | ratio | before, MiB | now, MiB | statuses, numbers |",
            "| --- | ---: | ---: | ---: | ---: | ---: | --- |",
            *rows,
            f"| all | {total[0]:.0f} | {total[1]:.0f} | {total[1] / total[0]:.2f} | | | {same} of {len(sets)} same |",
            "",
        ]
    )
    if out:
        out.write_text(text, encoding="utf-8")
    print(rows and text.splitlines()[-1])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("other", type=Path, help="folder of the other checkout")
    parser.add_argument("sets", type=Path, nargs="+")
    parser.add_argument("--out", type=Path)
    given = parser.parse_args()
    main(given.other.resolve(), given.sets, given.out)
