"""The list of all plantings, made from kinds, flights and seeds, and the planting itself.

    python -m rotorid_proof.plantings.sow

writes the list anew; it needs the imported public sets (`snakemake --cores 2 public`).
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

import numpy as np

from rotorid.recordings import RecordingSet, read_set
from rotorid_proof.plantings import air, clocks, commands, geometry, sensors, values
from rotorid_proof.plantings.flights import FLIGHTS, Flight, taken
from rotorid_proof.plantings.kinds import LARGE, SMALL, Kind, Truth
from rotorid_proof.plantings.plan import PAIR, Planting

KINDS: tuple[Kind, ...] = (
    *geometry.KINDS,
    *clocks.KINDS,
    *sensors.KINDS,
    *air.KINDS,
    *commands.KINDS,
    *values.KINDS,
)
PAIRS = 12
"""Pairs of kinds drawn for a flight, each in both sizes."""


def kind(name: str) -> Kind:
    """The kind of that name."""
    return next(k for k in KINDS if k.name == name)


def generator(text: str) -> np.random.Generator:
    """Random numbers that hang on a text alone."""
    return np.random.default_rng(int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "big"))


def fitting(recordings: RecordingSet) -> tuple[Kind, ...]:
    """Kinds that a set has the columns for."""
    return tuple(k for k in KINDS if k.fits(recordings))


def of_flight(
    name: str, kinds: Sequence[Kind], pairs: int = PAIRS, sizes: Sequence[str] = (LARGE, SMALL)
) -> list[Planting]:
    """All plantings of a flight: each kind in some of its sizes, and `pairs` pairs of kinds in both of them.

    Pairs are of two families and of kinds that change different things; drawn, the same at every start.
    """
    out = [Planting(name, k.family, (k.name,), size, 0) for size in sizes for k in kinds if size in k.sizes]
    apart = [(a.name, b.name) for a, b in combinations(kinds, 2) if a.family != b.family and not a.touches & b.touches]
    drawn = generator(f"{name}/pairs").permutation(len(apart))[:pairs]
    return out + [Planting(name, PAIR, apart[k], size, 0) for size in sizes for k in drawn]


def planned(flight: Flight, kinds: Sequence[Kind]) -> list[Planting]:
    """The plantings of a flight; of one that has less recorded than another the large size of each kind, no pairs."""
    return of_flight(flight.name, kinds, 0, (LARGE,)) if flight.reduced else of_flight(flight.name, kinds)


def plant(recordings: RecordingSet, planting: Planting) -> tuple[RecordingSet, tuple[Truth, ...]]:
    """The set with a planting in it, and what is true of it: one truth a kind.

    In a pair a kind without the small size is planted in its large one.
    """
    out, truths = recordings, []
    for name in planting.kinds:
        wanted = kind(name)
        rng = generator(f"{planting.flight}/{name}/{planting.seed}")
        out, truth = wanted.plant(out, wanted.sizes.get(planting.size, wanted.sizes[LARGE]), rng)
        truths.append(truth)
    return out, tuple(truths)


def list_text(sets: Path) -> str:
    """The list of all plantings as text; `sets` holds the imported public sets."""
    lines = ["planting"]
    for flight in FLIGHTS:
        kinds = fitting(taken(read_set(sets / flight.set), flight))
        lines += [p.name for p in planned(flight, kinds)]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    folder, out = sys.argv[1:] if len(sys.argv) == 3 else ("results/recordings", "workflow/plantings.tsv")
    Path(out).write_text(list_text(Path(folder)), encoding="utf-8")
