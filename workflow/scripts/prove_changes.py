"""Prove `rotorid compare` on pairs of sets in which it is known what changed.

- Draws pairs of two simulators that share no code with the library, from the hash of a commit.
- Cuts drawn sets in halves, in which nothing changed.
- Plants changes in real flights, against the same flight untouched and against another flight of the vehicle.
- Compares real sets of which the authors say what changed.
- Writes the row of every pair as it comes, so that an interrupted proof goes on where it stopped.
"""

import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations
from pathlib import Path

import pandas as pd

from rotorid.errors import InputError
from rotorid.mismatch.changes.compare import changes_from
from rotorid.mismatch.changes.joint import Reference, reference_of
from rotorid.recordings import RecordingSet, read_set
from rotorid.report import log
from rotorid_proof import changes as proof
from rotorid_proof.plantings.plan import Planting, read_list
from rotorid_proof.plantings.sow import plant


@dataclass(frozen=True)
class Made:
    """Two sets and what is known of them."""

    base: RecordingSet
    new: RecordingSet
    sought: tuple[proof.Sought, ...] = ()
    fair: tuple[str, ...] = ()
    """Ids that are no wrong names."""
    must: bool = True
    """Whether what changed has to be found."""


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


def as_read(recording, name: str) -> RecordingSet:
    """A recording as a user's files would hand it over."""
    from rotorid_proof.concealed.write import write_set

    with tempfile.TemporaryDirectory() as folder:
        write_set(recording, Path(folder) / name)
        return read_set(Path(folder) / name)


def drawn(seed: str, count: int) -> Iterator[Pair]:
    """Drawn pairs of each simulator."""
    from rotorid_proof.concealed import pairs

    def made(name: str) -> Made:
        pair = pairs.make(name)
        truth = pair.truth
        sets = as_read(pair.base, "base"), as_read(pair.new, "new")
        return Made(*sets, proof.sought_in(truth), tuple(truth["fair"]), not truth["need_not_be_found"])

    for name in pairs.names(seed, count):
        yield Pair(f"drawn/{name}", "drawn", partial(made, name))


def halves(seed: str, count: int) -> Iterator[Pair]:
    """The halves of drawn sets."""
    from rotorid_proof.concealed import drawn as sets

    def made(name: str, key: int) -> Made:
        recording, _, _ = sets.make(name, key)
        return Made(*proof.halves(as_read(recording, "set")))

    for number in range(count):
        for simulator in ("multibody", "continuous"):
            families = list(sets.SIMULATORS[simulator])
            family = f"{simulator}/{families[number % len(families)]}"
            key = sets.seed_of(seed, family, number)
            name = f"{family}/{seed}/{number:03d}"
            yield Pair(f"halves/{name}", "halves", partial(made, name, key))


def planted(recordings: Path, plantings: Path) -> Iterator[Pair]:
    """Plantings of the larger size against the flight untouched, and against another flight of the vehicle."""
    from rotorid_proof.plantings.flights import flight
    from rotorid_proof.plantings.judge import cut

    def made(one: Planting, others: tuple[Sequence[str], Sequence[str]] | None) -> Made:
        whole = cut(recordings / flight(one.flight).set, one.flight)
        base, own = (whole, whole) if others is None else (proof.some_runs(whole, runs) for runs in others)
        new, truths = plant(own, one)
        sought = tuple(
            proof.Sought(min(t.names), t.names | t.fair, {s.symbol: s.value for form in t.sizes[:1] for s in form})
            for t in truths
            if not t.unseen
        )
        return Made(base, new, sought, tuple(i for t in truths for i in (*t.names, *t.fair)), bool(sought))

    for one in read_list(plantings):
        if one.size != "large" or one.family == "pair" or not (recordings / flight(one.flight).set).is_dir():
            continue
        yield Pair(f"planted/{one.name}", "planted", partial(made, one, None), one.flight)
        if one.flight in OTHERS:
            kind = "planted in another"
            yield Pair(f"{kind}/{one.name}", kind, partial(made, one, OTHERS[one.flight]), f"some of {one.flight}")


def real(recordings: Path) -> Iterator[Pair]:
    """Labelled and unlabelled pairs."""

    def labelled(first: str, second: str, what: str, also: tuple[str, ...]) -> Made:
        base, new = (read_set(recordings / name) for name in (first, second))
        return Made(base, new, (proof.Sought(what, frozenset(also)),))

    def unlabelled(name: str, first: Sequence[str], second: Sequence[str]) -> Made:
        whole = read_set(recordings / name)
        return Made(proof.some_runs(whole, first), proof.some_runs(whole, second))

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


def compared(pair: Pair, known: dict[str, Reference]) -> proof.Row:
    """The row of one pair; `known` holds the first set that was fitted last."""
    made, start = pair.make(), time.process_time()
    if not pair.base or pair.base not in known:
        known.clear()
        known[pair.base] = reference_of(made.base)
    found = changes_from(known[pair.base], made.new)
    row = proof.row_of(pair.name, pair.kind, found, made.sought, made.fair, made.must)
    return replace(row, seconds=round(time.process_time() - start, 1))


def main(
    table: str,
    summary: str,
    so_far: str,
    recordings: str,
    plantings: str,
    seed: str,
    code: str = "",
    drawn_pairs: int = 100,
    drawn_halves: int = 100,
    only: str = "",
    part: int = 0,
    parts: int = 1,
) -> None:
    """Write `table` (a row a pair) and `summary`; rows are kept in `so_far` as they come.

    A row of another `code` stays until its pair is compared anew. `only` takes pairs whose name begins so; `part` of
    `parts` takes every so many.
    """
    warnings.simplefilter("ignore")
    kept = Path(so_far)
    kept.parent.mkdir(parents=True, exist_ok=True)
    rows = pd.read_csv(kept, keep_default_na=False).to_dict("records") if kept.is_file() else []
    done = {r["pair"] for r in rows if str(r["judged_by"]) == code}
    chosen = pairs_of(seed, Path(recordings), Path(plantings), drawn_pairs, drawn_halves)
    known: dict[str, Reference] = {}
    for pair in [p for p in chosen if p.name.startswith(only)][part::parts]:
        if pair.name in done:
            continue
        try:
            row = replace(compared(pair, known), judged_by=code)
        except (InputError, RuntimeError) as error:
            print(f"{pair.name}: {error}", file=sys.stderr, flush=True)
            continue
        rows = [r for r in rows if r["pair"] != row.pair] + proof.table([row]).to_dict("records")
        pd.DataFrame(rows).to_csv(kept, index=False)
        print(f"{row.pair}: {row.changed or 'nothing'} -> {row.claims or 'nothing'}", file=sys.stderr, flush=True)
    found = pd.DataFrame(rows)
    found.to_csv(table, index=False)
    proof.summary(found).to_csv(summary, index=False)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        main(
            table=snakemake.output.table,
            summary=snakemake.output.summary,
            so_far=snakemake.params.so_far,
            recordings=snakemake.params.recordings,
            plantings=snakemake.input.plantings,
            seed=snakemake.params.seed,
            code=str(snakemake.params.code),
        )
