"""Which planted sets are judged, in which batches, and about how long that lasts. Light: read at every start.

The list of all is `workflow/plantings.tsv`, written by `python -m rotorid_proof.plantings.sow`.
"""

from __future__ import annotations

import csv
import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path

PAIR = "pair"
MISTAKES = ("clocks", "axes", "units", "stuck")
MISTAKEN_KINDS = ("rotors_swapped", "spins_reversed")
"""Families, and kinds of another, that the search for mistakes has to name before any physics is tested."""
SECONDS = {"neurobem": 40.0, "imrc": 60.0, "arpl-10": 50.0, "arpl-15": 40.0, "crazypad": 25.0, "appius": 5.0}
"""Usual seconds of one core to judge a set of each flight."""
START_S = 6.0


@dataclass(frozen=True)
class Planting:
    """One set: a flight, what is planted (one kind, or two of a pair), a size and a seed."""

    flight: str
    family: str
    """Family of the kind; `pair` of two."""
    kinds: tuple[str, ...]
    size: str
    seed: int

    @property
    def name(self) -> str:
        """`flight/family/kind/size/seed`; of two kinds `flight/pair/kind+kind/size/seed`."""
        return f"{self.flight}/{self.family}/{'+'.join(self.kinds)}/{self.size}/{self.seed}"

    @property
    def file(self) -> str:
        """The name as that of a file."""
        return self.name.replace("/", "-")


def parsed(name: str) -> Planting:
    """The planting of a name."""
    flight, family, kinds, size, seed = name.split("/")
    return Planting(flight, family, tuple(kinds.split("+")), size, int(seed))


def read_list(path: Path) -> list[Planting]:
    """All plantings, in their order."""
    with path.open(encoding="utf-8", newline="") as text:
        return [parsed(row["planting"]) for row in csv.DictReader(text, delimiter="\t")]


def chosen(plantings: Sequence[Planting], patterns: Sequence[str]) -> list[Planting]:
    """Those whose name fits one of some shell patterns."""
    return [p for p in plantings if any(fnmatch(p.name, pattern) for pattern in patterns)]


def batches(plantings: Sequence[Planting], size: int) -> dict[str, list[Planting]]:
    """Plantings of one flight in batches, each named by what is in it, so that no verdict is taken for another's."""
    out = {}
    for flight in dict.fromkeys(p.flight for p in plantings):
        own = [p for p in plantings if p.flight == flight]
        for start in range(0, len(own), size):
            part = own[start : start + size]
            content = hashlib.sha256("\n".join(p.name for p in part).encode()).hexdigest()[:8]
            out[f"{flight}-{start // size:03d}-{content}"] = part
    return out


def mistakes(plantings: Sequence[Planting], flight: str) -> list[Planting]:
    """Single plantings of a flight that the search for mistakes has to name."""
    return [
        p for p in plantings if p.flight == flight and (p.family in MISTAKES or set(p.kinds) <= set(MISTAKEN_KINDS))
    ]


def announcement(chosen: Mapping[str, Sequence[Planting]], done: Sequence[str]) -> str:
    """One line for the person who waits: how many sets, how many batches are done, about how long."""
    missing = [name for name in chosen if name not in done]
    seconds = sum(START_S + sum(SECONDS.get(p.flight, 40.0) for p in chosen[name]) for name in missing)
    sets = sum(len(own) for own in chosen.values())
    left = sum(len(chosen[name]) for name in missing)
    return (
        f"Plantings: {sets} sets in {len(chosen)} batches, {sets - left} judged before; "
        f"about {seconds / 120:.0f} minutes on two cores"
    )
