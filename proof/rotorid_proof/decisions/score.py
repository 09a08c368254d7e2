"""A decision on one set against what is true of it, in counts that can be added up over sets.

What counts as named, false, new or lost is what the proof says (`rotorid_proof.score`) and the plantings
(`rotorid_proof.plantings.score`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

from rotorid_proof.decisions.decisions import PROBABILITY_OF, Said
from rotorid_proof.plantings.kinds import Truth
from rotorid_proof.plantings.score import ALONE, IN_CLASS, UNSEEN, beside, classes, score_truth
from rotorid_proof.score import acceptable_names, score_case

LEVELS = (0.90, 0.99)
"""Probabilities from which statements are counted: those from 90 to 99 %, and those of 99 % and more."""


@dataclass(frozen=True)
class Counts:
    """What a decision got right and wrong."""

    sets: int = 0
    failed: int = 0
    """Sets on which the stage stopped."""
    rated: int = 0
    """Sets of which the whole truth is known, or what changed in them."""
    right: int = 0
    """Of these: everything named, nothing else."""
    causes: int = 0
    """Effects that can be seen."""
    named: int = 0
    """Of these: by their id, or in a class that is fair."""
    wrong: int = 0
    """Names of drawn sets that are none of what is at work."""
    clean: int = 0
    """Drawn sets with nothing hidden."""
    alarmed: int = 0
    """Of these: with a name or a value that is not fair."""
    compared: int = 0
    """Planted sets that are compared with their flight untouched."""
    new: int = 0
    """Names of those that the flight untouched does not have."""
    lost: int = 0
    """Names of the flight untouched that they have not."""
    values_true: int = 0
    """Believed values that are wrong."""
    values_right: int = 0
    """Of these: called wrong."""
    values_wrong: int = 0
    """Values called wrong that are right (drawn), or new or lost against the untouched flight (planted)."""
    intervals: int = 0
    """Stated 95 % intervals of a known number."""
    covered: int = 0
    """Of these: that hold it."""
    said_90: int = 0
    """Statements at 90 to 99 % of which it is known whether they hold."""
    held_90: int = 0
    said_99: int = 0
    """Statements at 99 % and more."""
    held_99: int = 0

    def __add__(self, other: Counts) -> Counts:
        return Counts(**{f.name: getattr(self, f.name) + getattr(other, f.name) for f in fields(Counts)})


@dataclass(frozen=True)
class Scored:
    """A decision's counts on a set, and in words what they count."""

    counts: Counts
    words: Mapping[str, Sequence[str]] = field(default_factory=dict)
    """`missed`, `wrong`, `new`, `lost`, `values_missed`, `values_wrong`, by name."""


def statements(said: Said) -> list[tuple[frozenset[str], float]]:
    """Classes that a decision states, each with its probability; several of one class once, by the surest."""
    found: dict[frozenset[str], float] = {}
    for effect in said.get("effects", ()):
        if effect["status"] not in PROBABILITY_OF:
            continue  # at work or not, it is said not to matter
        stated = effect.get("probability")
        probability = PROBABILITY_OF[effect["status"]] if stated is None else stated
        others = effect["alternatives"] if effect["status"] == "ambiguous" else ()
        members = frozenset({effect["id"], *others})
        found[members] = max(probability, found.get(members, 0.0))
    return list(found.items())


def calibrated(judged: Iterable[tuple[float, bool]]) -> Counts:
    """Statements, each by its probability and whether it holds, counted by level."""
    judged = list(judged)
    low = [holds for p, holds in judged if LEVELS[0] <= p < LEVELS[1]]
    high = [holds for p, holds in judged if p >= LEVELS[1]]
    return Counts(said_90=len(low), held_90=sum(low), said_99=len(high), held_99=sum(high))


def score_drawn(said: Said, answer: Mapping[str, Any]) -> Scored:
    """A decision on a set of which all is known."""
    s = score_case(said, answer)
    near, wrong = acceptable_names(answer), set(answer["wrong_parameters"])
    stated = set(s["values_claimed"])
    false_values = sorted(stated - wrong - set(answer.get("fair", ())))
    missed = [*s["missed"], *s["blurred"]]
    held = [p["covered"] for p in s["parameters"] if p["covered"] is not None]
    counts = Counts(
        sets=1,
        failed=int(s["failed"]),
        rated=1,
        right=int(s["right"]),
        causes=len(s["truth"]),
        named=len(s["truth"]) - len(missed),
        wrong=s["false_count"],
        clean=int(s["clean"]),
        alarmed=int(s["clean"] and s["false_alarm"]),
        values_true=len(wrong),
        values_right=len(stated & wrong),
        values_wrong=len(false_values),
        intervals=len(held),
        covered=sum(held),
    )
    words = {"missed": missed, "wrong": s["false_names"], "values_missed": sorted(wrong - stated)}
    words |= {"values_wrong": false_values}
    return Scored(counts + calibrated((p, bool(c & near)) for c, p in statements(said)), words)


def score_planted(said: Said, untouched: Said, truths: Sequence[Truth]) -> Scored:
    """A decision on a set with something planted, against the same decision on its flight untouched."""
    if "failed" in said or "failed" in untouched:
        return Scored(Counts(sets=1, failed=1))
    rows = [(t, score_truth(said, untouched, t)) for t in truths]
    seen = [(t, row, row["named"] in (ALONE, IN_CLASS)) for t, row in rows if row["named"] != UNSEEN]
    covered = [row["covered"] for _, row, _ in seen if row["covered"] is not None]
    effects = [named for t, _, named in seen if t.ratio is None]
    values = [named for t, _, named in seen if t.ratio is not None]
    words = {
        "missed": [" or ".join(sorted(t.names)) for t, _, named in seen if t.ratio is None and not named],
        "values_missed": [" or ".join(sorted(t.names)) for t, _, named in seen if t.ratio is not None and not named],
    }
    counts = Counts(
        sets=1,
        causes=len(effects),
        named=sum(effects),
        values_true=len(values),
        values_right=sum(values),
        intervals=len(covered),
        covered=sum(bool(c) for c in covered),
    )
    # A set in which something cannot be seen may put it down to something else: nothing else is held against it.
    if len(seen) < len(rows):
        return Scored(counts, words)
    other = beside(said, untouched, truths)
    moved = [*other["values_new"], *other["values_lost"]]
    words |= {"new": other["new"], "lost": other["lost"], "values_wrong": moved}
    counts += Counts(
        rated=1,
        right=int(all(named for *_, named in seen) and not (other["new"] or other["lost"] or moved)),
        compared=1,
        new=len(other["new"]),
        lost=len(other["lost"]),
        values_wrong=len(moved),
    )
    planted = frozenset().union(*(t.names | t.fair for t in truths))
    known = frozenset().union(*classes(untouched))
    # Of what the untouched flight states too nobody knows whether it holds.
    judged = ((p, bool(c & planted)) for c, p in statements(said) if c & planted or not c & known)
    return Scored(counts + calibrated(judged), words)


def score_real(said: Said, expected: Sequence[str]) -> Scored:
    """A decision on a real set with nothing planted: one of the ids that a reader expects should be among its names."""
    if "failed" in said:
        return Scored(Counts(sets=1, failed=1))
    found = frozenset().union(*classes(said))
    missed = [" or ".join(expected)] if expected and not found & set(expected) else []
    return Scored(
        Counts(sets=1, causes=int(bool(expected)), named=int(bool(expected)) - len(missed)), {"missed": missed}
    )
