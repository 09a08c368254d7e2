"""Sets of one vehicle judged together, and what of the first's open questions the later ones settled.

Values of the vehicle and effects are held equal in all sets; each run keeps what belongs to a run (a scale of its
thrust where runs differ beyond doubt, gusts, offsets in time). Runs are named by their set, so that `2-hover` is of the
second. What the first holds out stays held out; of each other a third is held out. One of fewer than three runs is cut
for that: runs held out of calm flights say nothing of what a planned flight excites.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from rotorid.errors import InputError
from rotorid.mismatch.decision.findings import Analysis, Finding
from rotorid.mismatch.plant.comparison import ENVIRONMENT_S
from rotorid.mismatch.plant.split import split_runs
from rotorid.mismatch.posterior.status import CLAIMED
from rotorid.recordings import RecordingSet, Run

_MAY_DIFFER = ("name", "noise", "effects", "ground_z_m")
"""Keys of vehicle.yaml that say nothing of the vehicle itself."""


def joined_sets(first: RecordingSet, *others: RecordingSet) -> tuple[RecordingSet, tuple[str, ...]]:
    """All sets as one, and what a reader must know about it.

    Raises
    ------
    InputError
        The sets are not of one vehicle as believed, or share no columns but the time.
    """
    others = tuple(in_thirds(s) for s in others)
    sets = (first, *others)
    beliefs = [s.vehicle.model_dump(exclude=set(_MAY_DIFFER)) for s in sets]
    for other, belief in zip(others, beliefs[1:], strict=True):
        for key, value in beliefs[0].items():
            if value != belief[key]:
                raise InputError(
                    f"sets {first.name} and {other.name} differ in {key} of vehicle.yaml ({_brief(value)} and "
                    f"{_brief(belief[key])}); judged together they must be of one vehicle as believed"
                )
    split = split_runs(first)
    held = [] if split.held_out == split.training else [f"1-{n}" for n in split.held_out]
    notes = ["Values and effects are held equal in all sets; thrust may differ from run to run."]
    for number, other in enumerate(others, 2):
        if len(other.runs) >= 3:
            held += [f"{number}-{n}" for n in split_runs(other).held_out]
    columns = [set.intersection(*(_present(r) for r in s.runs)) for s in sets]
    shared = set.intersection(*columns)
    name = "+".join(s.name for s in sets)
    if shared <= {"time_s"}:
        raise InputError(f"sets {' and '.join(s.name for s in sets)} have no column in common but the time")
    for number, own in enumerate(columns, 1):
        if extra := sorted(own - shared):
            notes.append(f"Not all sets have {', '.join(extra[:4])}{' …' if len(extra) > 4 else ''} of set {number}.")
    runs = [replace(r, name=f"{number}-{r.name}") for number, s in enumerate(sets, 1) for r in s.runs]
    runs = [replace(r, table=r.table[[n for n in r.table.columns if n in shared]]) for r in runs]
    return RecordingSet(name, first.vehicle, tuple(runs), tuple(held) or None), tuple(notes)


def in_thirds(recordings: RecordingSet) -> RecordingSet:
    """A set of one or two runs with each in three parts, as far as these are as long as an environment."""
    if len(recordings.runs) >= 3 or recordings.held_out is not None:
        return recordings
    runs = []
    for run in recordings.runs:
        edges = np.linspace(0, len(run.table), 4).astype(int)
        parts = [run.table.iloc[a:b].reset_index(drop=True) for a, b in zip(edges, edges[1:], strict=False)]
        long = run.time_s[-1] - run.time_s[0] >= 3 * ENVIRONMENT_S
        runs += [replace(run, name=f"{run.name}-{i}", table=t) for i, t in enumerate(parts, 1)] if long else [run]
    return replace(recordings, runs=tuple(runs))


def _brief(value) -> str:
    """A value of vehicle.yaml, short."""
    text = str(value)
    return text if len(text) < 40 else text[:37] + "…"


def _present(run: Run) -> set[str]:
    """Columns with anything in them."""
    return {n for n in run.table.columns if run.has(n)}


@dataclass(frozen=True)
class _Outcome:
    """What became of a question that the first set left open."""

    ids: tuple[str, ...]
    answer: str
    """The id that is established now; empty where the question is still open."""
    sentence: str


def answers(open_before: Sequence[tuple[str, ...]], findings: Sequence[Finding]) -> list[_Outcome]:
    """What the findings of all sets together say of each class that was left open."""
    out = []
    for ids in open_before:
        named = " or ".join(ids)
        sure = [f.id for f in findings if f.status == "established" and f.id in ids]
        still = [f for f in findings if f.status == "ambiguous" and set(f.alternatives) & set(ids)]
        if sure and not still:
            what = " and ".join(sure)
            out.append(_Outcome(ids, sure[0], f"{named}: all sets together say {what}"))
        elif still:
            left = still[0].alternatives
            fewer = set(left) < set(ids)
            out.append(_Outcome(ids, "", f"{named}: {'narrowed to' if fewer else 'still'} {' or '.join(left)}"))
        else:
            weaker = [f.id for f in findings if f.status == "suggested" and f.id in ids]
            said = f"suggested is {weaker[0]}" if weaker else "neither is established"
            out.append(_Outcome(ids, "", f"{named}: {said}"))
    return out


def open_classes(analysis: Analysis) -> list[tuple[str, ...]]:
    """Classes that an analysis left open, each once."""
    found = [tuple(f.alternatives) for f in analysis.findings if f.status in CLAIMED and f.alternatives]
    return list(dict.fromkeys(found))
