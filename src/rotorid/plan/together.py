"""A second set judged together with the first, and what of the first's open questions it settled.

Values of the vehicle and effects are held equal in both sets; each run keeps what belongs to a run (a scale of its
thrust where runs differ beyond doubt, gusts, offsets in time). Runs are named by their set, so that `2-hover` is of the
second. What the first holds out stays held out; of the second a third is held out where it has three runs or more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from rotorid.errors import InputError
from rotorid.mismatch.findings import CLAIMED, Analysis, Finding
from rotorid.mismatch.split import split_runs
from rotorid.recordings import RecordingSet, Run

MAY_DIFFER = ("name", "noise", "effects", "ground_z_m")
"""Keys of vehicle.yaml that say nothing of the vehicle itself."""


def joined_sets(first: RecordingSet, second: RecordingSet) -> tuple[RecordingSet, tuple[str, ...]]:
    """Both sets as one, and what a reader must know about it.

    Raises
    ------
    InputError
        The sets are not of one vehicle as believed, or share no columns beside the time.
    """
    beliefs = [s.vehicle.model_dump(exclude=set(MAY_DIFFER)) for s in (first, second)]
    for key, value in beliefs[0].items():
        if value != beliefs[1][key]:
            raise InputError(
                f"sets {first.name} and {second.name} differ in {key} of vehicle.yaml ({brief(value)} and "
                f"{brief(beliefs[1][key])}); judged together they must be of one vehicle as believed"
            )
    split = split_runs(first)
    held = [] if split.held_out == split.training else [f"1-{n}" for n in split.held_out]
    if len(second.runs) >= 3:
        held += [f"2-{n}" for n in split_runs(replace(second, held_out=second.held_out)).held_out]
    runs = [*(renamed(r, "1") for r in first.runs), *(renamed(r, "2") for r in second.runs)]
    columns = [set.intersection(*(present(r) for r in s.runs)) for s in (first, second)]
    shared = columns[0] & columns[1]
    if shared <= {"time_s"}:
        raise InputError(f"sets {first.name} and {second.name} have no column in common but the time")
    notes = ["Values and effects are held equal in both sets; thrust may differ from run to run."]
    for number, (own, other) in enumerate((columns, columns[::-1]), 1):
        if extra := sorted(own - other):
            notes.append(f"Only set {number} has {', '.join(extra[:4])}{' …' if len(extra) > 4 else ''}.")
    runs = [replace(r, table=r.table[[n for n in r.table.columns if n in shared]]) for r in runs]
    whole = RecordingSet(f"{first.name}+{second.name}", first.vehicle, tuple(runs), tuple(held) or None)
    return whole, tuple(notes)


def brief(value) -> str:
    """A value of vehicle.yaml, short."""
    text = str(value)
    return text if len(text) < 40 else text[:37] + "…"


def renamed(run: Run, number: str) -> Run:
    """A run that carries its set's number."""
    return replace(run, name=f"{number}-{run.name}")


def present(run: Run) -> set[str]:
    """Columns with anything in them."""
    return {n for n in run.table.columns if run.has(n)}


@dataclass(frozen=True)
class Answer:
    """What became of a question that the first set left open."""

    ids: tuple[str, ...]
    answer: str
    """The id that is established now; empty where the question is still open."""
    sentence: str


def answers(open_before: Sequence[tuple[str, ...]], findings: Sequence[Finding]) -> list[Answer]:
    """What the findings of both sets together say of each class that was left open."""
    out = []
    for ids in open_before:
        named = " or ".join(ids)
        sure = [f.id for f in findings if f.status == "established" and f.id in ids]
        still = [f for f in findings if f.status == "ambiguous" and set(f.alternatives) & set(ids)]
        if sure and not still:
            what = " and ".join(sure)
            out.append(Answer(ids, sure[0], f"{named}: both sets together say {what}"))
        elif still:
            left = still[0].alternatives
            fewer = set(left) < set(ids)
            out.append(Answer(ids, "", f"{named}: {'narrowed to' if fewer else 'still'} {' or '.join(left)}"))
        else:
            weaker = [f.id for f in findings if f.status == "suggested" and f.id in ids]
            said = f"suggested is {weaker[0]}" if weaker else "neither is established"
            out.append(Answer(ids, "", f"{named}: {said}"))
    return out


def open_classes(analysis: Analysis) -> list[tuple[str, ...]]:
    """Classes that an analysis left open, each once."""
    found = [tuple(f.alternatives) for f in analysis.findings if f.status in CLAIMED and f.alternatives]
    return list(dict.fromkeys(found))
