"""Pairs of sets of one vehicle in which it is known what changed."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from pathlib import Path

from rotorid.mismatch.changes.compare import changes_from
from rotorid.mismatch.changes.joint import FittedReference, reference_of
from rotorid.recordings import RecordingSet, read_set
from rotorid_proof.changes import score
from rotorid_proof.plantings.plan import Planting, read_list
from rotorid_proof.plantings.sow import plant
from rotorid_proof.row_by_row import as_read


@dataclass(frozen=True)
class Made:
    """Two sets and what is known of them."""

    base: RecordingSet
    new: RecordingSet
    sought: tuple[score.Sought, ...] = ()
    fair: tuple[str, ...] = ()
    """Ids that are no wrong names."""


@dataclass(frozen=True)
class Pair:
    """A pair to be compared."""

    name: str
    kind: str
    make: Callable[[], Made]
    base: str = ""
    """Name of the first set where several pairs share it: it is fitted once."""


LABELLED = (
    ("crazypad-normal", "crazypad-weight", "payload", ("com_offset", "mass_kg", "inertia_products")),
    ("crazypad-normal", "crazypad-cut", "unequal_rotors", ()),
)
"""Two sets, what the authors changed, and what a change of it is, too."""
NEUROBEM = ("20210218170320seg2", "20210218171908seg2", "20210223104803seg2", "20210223114138seg3")
CRAZYPAD = tuple(tuple(f"E9_log0{log}_{n}" for n in (1, 2)) for log in range(4))
UNLABELLED = {
    "neurobem": tuple((run,) for run in NEUROBEM),
    "imrc-brushless": tuple((f"eckart{a}", f"eckart{b}") for a, b in (("00", "01"), (12, 13), (17, 18), (24, 27))),
    "crazypad-normal": CRAZYPAD,
}
"""Flights of one vehicle in which nothing changed: which runs are a set of their own."""
OTHERS = {
    "neurobem": (NEUROBEM[:2], NEUROBEM[2:]),
    "imrc": (("eckart00", "eckart12"), ("eckart01", "eckart13")),
    "crazypad": (CRAZYPAD[0] + CRAZYPAD[1], CRAZYPAD[2] + CRAZYPAD[3]),
}
"""Runs that stay untouched, and other flights of the vehicle in which something is planted."""


DRIFTING = ("skewed",)
"""Families of which the second half differs from the first: a clock that runs too fast is later there."""


def drawn(seed: str, count: int) -> Iterator[Pair]:
    """Drawn pairs of each simulator."""
    from rotorid_proof.concealed import pairs
    from rotorid_proof.concealed.write import write_set

    def made(name: str) -> Made:
        pair = pairs.make(name)
        sets = as_read(pair.base, write_set, "base"), as_read(pair.new, write_set, "new")
        return Made(*sets, score.sought_in(pair.truth), tuple(pair.truth["fair"]))

    for name in pairs.names(seed, count):
        yield Pair(f"drawn/{name}", "drawn", partial(made, name))


def halves(seed: str, count: int) -> Iterator[Pair]:
    """The halves of drawn sets."""
    from rotorid_proof.concealed import drawn as sets
    from rotorid_proof.concealed.write import write_set

    def made(name: str, key: int) -> Made:
        recording, _, _ = sets.make(name, key)
        return Made(*score.halves(as_read(recording, write_set, "set")))

    for number in range(count):
        for simulator in ("multibody", "continuous"):
            families = [name for name in sets.SIMULATORS[simulator] if name not in DRIFTING]
            family = f"{simulator}/{families[number % len(families)]}"
            key = sets.seed_of(seed, family, number)
            name = f"{family}/{seed}/{number:03d}"
            yield Pair(f"halves/{name}", "halves", partial(made, name, key))


def planted(recordings: Path, plantings: Path) -> Iterator[Pair]:
    """Plantings against the flight untouched, and those of the larger size against another flight of the vehicle."""
    from rotorid_proof.plantings.commands import commanded
    from rotorid_proof.plantings.flights import flight
    from rotorid_proof.plantings.judge import cut

    def made(one: Planting, others: tuple[Sequence[str], Sequence[str]] | None) -> Made:
        whole = cut(recordings / flight(one.flight).set, one.flight)
        if one.family == "commands":
            # A flight that is given commands is compared with itself under the same ones.
            whole, _ = commanded(whole)
        base, own = (whole, whole) if others is None else (score.some_runs(whole, runs) for runs in others)
        new, truths = plant(own, one)
        sought = tuple(
            score.Sought(min(t.names), t.names | t.fair, {s.symbol: s.value for form in t.sizes[:1] for s in form})
            for t in truths
            if not t.unseen
        )
        return Made(base, new, sought, tuple(i for t in truths for i in (*t.names, *t.fair)))

    for one in read_list(plantings):
        if one.family == "pair" or not (recordings / flight(one.flight).set / "vehicle.yaml").is_file():
            continue
        kind = "planted" if one.size == "large" else "planted, smaller"
        flown = f"{one.flight} under commands" if one.family == "commands" else one.flight
        yield Pair(f"{kind}/{one.name}", kind, partial(made, one, None), flown)
        if one.flight in OTHERS and one.size == "large":
            kind = "planted in another"
            yield Pair(f"{kind}/{one.name}", kind, partial(made, one, OTHERS[one.flight]), f"some of {flown}")


def real(recordings: Path) -> Iterator[Pair]:
    """Labelled and unlabelled pairs."""

    def labelled(first: str, second: str, what: str, also: tuple[str, ...]) -> Made:
        base, new = (read_set(recordings / name) for name in (first, second))
        return Made(base, new, (score.Sought(what, frozenset(also)),))

    def unlabelled(name: str, first: Sequence[str], second: Sequence[str]) -> Made:
        whole = read_set(recordings / name)
        return Made(score.some_runs(whole, first), score.some_runs(whole, second))

    for first, second, what, also in LABELLED:
        if (recordings / second / "vehicle.yaml").is_file():
            yield Pair(f"labelled/{second}", "labelled", partial(labelled, first, second, what, also), first)
    for name, groups in UNLABELLED.items():
        if not (recordings / name / "vehicle.yaml").is_file():
            continue
        for first, second in combinations(groups, 2):
            own = f"unlabelled/{name}/{'+'.join(first)}/{'+'.join(second)}"
            yield Pair(own, "unlabelled", partial(unlabelled, name, first, second), "+".join(first))


def pairs_of(seed: str, recordings: Path, plantings: Path, drawn_pairs: int, drawn_halves: int) -> list[Pair]:
    """All pairs."""
    return [*real(recordings), *drawn(seed, drawn_pairs), *halves(seed, drawn_halves), *planted(recordings, plantings)]


def compared(pair: Pair, known: dict[str, FittedReference]) -> score.Row:
    """The row of one pair; `known` holds the first set that was fitted last."""
    made, start = pair.make(), time.process_time()
    if not pair.base or pair.base not in known:
        known.clear()
        known[pair.base] = reference_of(made.base)
    found = changes_from(known[pair.base], made.new)
    row = score.row_of(pair.name, pair.kind, found, made.sought, made.fair)
    return replace(row, seconds=round(time.process_time() - start, 1))
