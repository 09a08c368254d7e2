"""The proof of `rotorid compare`: pairs of sets of one vehicle in which it is known what changed.

A row is one pair. Its kinds:

- `drawn`: two sets of a concealed simulator; nothing, one or two things changed (`concealed.pairs`).
- `halves`: the two halves of every run of a concealed set; nothing changed, whatever else is hidden in it.
- `planted`: a real flight with something planted, against the same flight untouched; `planted, smaller`: by less.
- `planted in another`: the same against another flight of the vehicle.
- `labelled`, `unlabelled`: real sets of which the authors say what changed, or that nothing did.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace

import numpy as np
import pandas as pd

from rotorid.mismatch.changes.compare import Changes
from rotorid.mismatch.decide.status import CLAIMED
from rotorid.recordings import RecordingSet
from rotorid_proof.intervals import wilson

SEPARATOR = "; "
RELATIVE = "1"


@dataclass(frozen=True)
class Sought:
    """A change that is to be named."""

    id: str
    equivalent: frozenset[str] = frozenset()
    """Further ids: a class that holds one of these and nothing foreign names it as well."""
    sizes: Mapping[str, float] | None = None
    """Symbol of its parameters to by how much they are more; None where they are not to be compared."""
    must: bool = True
    """Whether it is large enough that it has to be found; else silence is right, too."""


@dataclass(frozen=True)
class Row:
    """What became of one pair."""

    pair: str
    kind: str
    changed: str
    """Ids that changed, joined by `; `; empty where nothing did."""
    claims: str
    """What was claimed, each a class as `a or b`, joined by `; `."""
    named: int
    """How many of the ids that changed were named, alone or in a class."""
    wrong: str
    """Claims that are of nothing that changed."""
    inside: int = 0
    """How many numbers of named changes lie in their 95 % interval."""
    compared: int = 0
    """How many such numbers there are."""
    seconds: float = float("nan")
    """Processor time, the first set's fit included."""
    judged_by: str = ""
    """Hash of the code that compared them."""

    @property
    def right(self) -> bool:
        """Everything that changed was named and nothing else was."""
        return self.named == len(parts(self.changed)) and not self.wrong


def parts(text: str) -> list[str]:
    """The parts of a joined cell."""
    return [part for part in text.split(SEPARATOR) if part]


def classes_of(changes: Changes) -> list[frozenset[str]]:
    """What is claimed, each as its class of ids."""
    return [frozenset({c.id, *c.alternatives}) for c in changes.changes if c.status in CLAIMED]


def row_of(pair: str, kind: str, changes: Changes, sought: Sequence[Sought], fair: Iterable[str] = ()) -> Row:
    """The row of a pair.

    Parameters
    ----------
    sought
        What changed.
    fair
        Ids that are no wrong names.
    """
    claims = classes_of(changes)
    known = {i for s in sought for i in (s.id, *s.equivalent)} | set(fair)
    wrong = [c for c in claims if not c & known]
    named = [s for s in sought if any(c & {s.id, *s.equivalent} for c in claims)]
    asked = [s for s in sought if s.must or s in named]
    inside = [ok for s in named for ok in inside_of(changes, s)]
    return Row(
        pair=pair,
        kind=kind,
        changed=SEPARATOR.join(s.id for s in asked),
        claims=SEPARATOR.join(" or ".join(sorted(c)) for c in claims),
        named=len(named),
        wrong=SEPARATOR.join(" or ".join(sorted(c)) for c in wrong),
        inside=sum(inside),
        compared=len(inside),
    )


def inside_of(changes: Changes, sought: Sought) -> list[bool]:
    """Whether each known number of a change lies in the interval stated for it."""
    found = {p.symbol: p for c in changes.changes if c.id == sought.id for p in c.parameters}
    sizes = sought.sizes or {}
    return [bool(found[s].low <= value <= found[s].high) for s, value in sizes.items() if s in found]


def sought_in(truth: Mapping) -> tuple[Sought, ...]:
    """What changed in a drawn pair, from its answer."""
    return tuple(
        Sought(
            c["id"],
            frozenset(c["equivalent"]),
            {p["symbol"]: p["value"] for p in c["parameters"]} if c.get("form") != "blade" else None,
            not c["need_not_be_found"],
        )
        for c in truth["changes"]
    )


def halves(recordings: RecordingSet) -> tuple[RecordingSet, RecordingSet]:
    """The first and the second half of every run."""

    def half(second: bool) -> RecordingSet:
        runs = []
        for run in recordings.runs:
            t = run.time_s
            later = t - t[0] >= 0.5 * (t[-1] - t[0])
            runs.append(replace(run, table=run.table[later == second].reset_index(drop=True)))
        name = f"{recordings.name}-{'second' if second else 'first'}-half"
        return replace(recordings, name=name, runs=tuple(runs), held_out=())

    return half(False), half(True)


def some_runs(recordings: RecordingSet, names: Sequence[str]) -> RecordingSet:
    """A set of some of the runs alone."""
    runs = tuple(run for run in recordings.runs if run.name in names)
    return replace(recordings, name="+".join(names), runs=runs, held_out=())


def table(rows: Sequence[Row]) -> pd.DataFrame:
    """The rows as a table."""
    return pd.DataFrame(
        [asdict(r) | {"right": r.right} for r in rows], columns=[*(f.name for f in fields(Row)), "right"]
    )


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """Shares by kind with their 95 % intervals (Wilson)."""
    rows = rows.fillna({"changed": "", "claims": "", "wrong": ""})
    out = []
    for kind, own in rows.groupby("kind", sort=False):
        nothing = own["changed"] == ""
        causes = own["changed"].map(lambda text: len(parts(text)))
        counted = [
            ("nothing changed: a change claimed", int((own["wrong"] != "")[nothing].sum()), int(nothing.sum())),
            ("something changed: right as a whole", int(own["right"][~nothing].sum()), int((~nothing).sum())),
            ("changes named", int(np.minimum(own["named"], causes).sum()), int(causes.sum())),
            ("something changed: with a wrong name", int((own["wrong"] != "")[~nothing].sum()), int((~nothing).sum())),
            ("numbers inside their interval", int(own["inside"].sum()), int(own["compared"].sum())),
        ]
        for what, count, of in counted:
            low, high = wilson(count, of)
            share = count / of if of else float("nan")
            out.append({"kind": kind, "what": what, "count": count, "of": of, "share": share, "low": low, "high": high})
    return pd.DataFrame(out)
