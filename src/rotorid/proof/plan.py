"""Which concealed cases a proof takes, in which batches, and about how long that lasts. Light: read at every start.

The list of all cases is `tests/concealed/cases.tsv` (`case`, `set`, the recording set's name that says nothing). The
first part of a case's name is its family, the last number in it its seed.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

BUILD_S, JUDGE_S, PEERS_S, START_S = 6.0, 8.0, 3.0, 4.0
"""Usual seconds of one core: to fly and record a case, to judge it, to ask the peers, to start a job."""


@dataclass(frozen=True)
class Entry:
    """One concealed case of the list."""

    case: str
    set: str

    @property
    def family(self) -> str:
        """Kind of case: `single`, `clean`, ..."""
        return self.case.split("/")[0]

    @property
    def seed(self) -> int:
        """Number of the repetition; seeds below n are taken where n repetitions are asked for."""
        return int(self.case.rsplit("/", 1)[1])


def read_index(path: Path) -> list[Entry]:
    """All concealed cases, in their order."""
    with path.open(encoding="utf-8", newline="") as text:
        return [Entry(row["case"], row["set"]) for row in csv.DictReader(text, delimiter="\t")]


def choose(entries: Sequence[Entry], seeds: Mapping[str, int], patterns: Sequence[str]) -> list[Entry]:
    """Cases whose seed lies below the number for their family (0 for one not named) and whose name fits a pattern."""
    return [
        e for e in entries if e.seed < seeds.get(e.family, 0) and any(fnmatch(e.case, pattern) for pattern in patterns)
    ]


def batches(entries: Sequence[Entry], size: int) -> dict[str, list[Entry]]:
    """Cases in batches of one family, lower seeds first: with more seeds asked for, earlier batches stay the same."""
    out: dict[str, list[Entry]] = {}
    for family in dict.fromkeys(e.family for e in entries):
        own = sorted((e for e in entries if e.family == family), key=lambda e: e.seed)
        for start in range(0, len(own), size):
            out[f"{family}-{start // size:03d}"] = own[start : start + size]
    return out


def estimate_s(missing_cases: int, missing_batches: int, peers: bool, cores: int = 2) -> float:
    """About how many seconds a proof lasts."""
    each = BUILD_S + JUDGE_S + (PEERS_S if peers else 0.0)
    jobs = (3 if peers else 2) * START_S
    return (missing_cases * each + missing_batches * jobs) / cores


def announcement(chosen: Mapping[str, Sequence[Entry]], done: Sequence[str], peers: bool) -> str:
    """One line for the person who waits: how many cases, how many done, about how long."""
    missing = [name for name in chosen if name not in done]
    cases = sum(len(own) for own in chosen.values())
    left = sum(len(chosen[name]) for name in missing)
    minutes = estimate_s(left, len(missing), peers) / 60
    return (
        f"Proof: {cases} concealed cases in {len(chosen)} batches, {cases - left} judged before; "
        f"about {minutes:.0f} minutes on two cores"
    )
