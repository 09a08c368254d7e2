"""Counts of every decision added up: over all sets, by where they come from, plant, laboratory and family."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import pandas as pd

from rotorid_proof.decisions.decisions import Said
from rotorid_proof.decisions.label import Label
from rotorid_proof.decisions.score import Counts, Scored
from rotorid_proof.plantings.score import classes

WORDS = ("missed", "wrong", "new", "lost", "values_missed", "values_wrong")
SHARES = {
    "right": "rated",
    "named": "causes",
    "alarmed": "clean",
    "values_right": "values_true",
    "covered": "intervals",
    "held_90": "said_90",
    "held_99": "said_99",
}
"""Counts that are shown as a share of another."""


@dataclass(frozen=True)
class Row:
    """One decision on one set."""

    decision: str
    label: Label
    older: bool
    """Whether the evidence is of another code than that of now."""
    said: Said
    scored: Scored


def groups_of(label: Label) -> list[tuple[str, str]]:
    """Groups that a set counts in: kind of group, and its name."""
    return [
        ("plant", label.plant),
        ("origin", f"{label.plant} {label.origin}"),
        ("laboratory", f"{label.plant} {label.laboratory}"),
        ("family", f"{label.plant} {label.origin} {label.family}"),
    ]


def table(rows: Iterable[Row]) -> pd.DataFrame:
    """One line for each group and decision, counts in columns; `older` sets were judged by another code."""
    sums: dict[tuple[str, str, str], Counts] = {}
    older: dict[tuple[str, str, str], int] = {}
    for row in rows:
        for group in groups_of(row.label):
            key = (*group, row.decision)
            sums[key] = sums.get(key, Counts()) + row.scored.counts
            older[key] = older.get(key, 0) + row.older
    order = {"plant": 0, "origin": 1, "laboratory": 2, "family": 3}
    lines = [
        {"group": group, "name": name, "decision": decision, "older": older[group, name, decision], **asdict(counts)}
        for (group, name, decision), counts in sums.items()
    ]
    # By group and name; decisions stay in their order.
    return pd.DataFrame(sorted(lines, key=lambda line: (order[line["group"]], line["name"])))


def sets(rows: Iterable[Row]) -> pd.DataFrame:
    """One line for each set and decision: its classes, and by name what is missed, wrong, new or lost."""
    return pd.DataFrame([line(row) for row in rows])


def line(row: Row) -> dict[str, Any]:
    """A set's line."""
    said = [" or ".join(sorted(c)) for c in classes(row.said)]
    words = {f"{name}_names": "; ".join(row.scored.words.get(name, ())) for name in WORDS}
    head = {**asdict(row.label), "decision": row.decision, "older": row.older, "said": "; ".join(said)}
    values = "; ".join(row.said.get("parameters", {}))
    return {**head, "values": values, **words, **asdict(row.scored.counts)}


def markdown(found: pd.DataFrame, groups: Sequence[str] = ("plant", "origin", "laboratory")) -> str:
    """The table for a person: shares as `12 of 15`."""
    columns = ["name", "decision", "sets", *SHARES, "wrong", "new", "lost", "values_wrong"]
    lines = ["| " + " | ".join(columns) + " |", "| --- " * len(columns) + "|"]
    for _, own in found[found["group"].isin(groups)].iterrows():
        lines.append("| " + " | ".join(cell(own, name) for name in columns) + " |")
    return "\n".join(lines) + "\n"


def cell(own: Mapping[str, Any], name: str) -> str:
    """One cell of it."""
    return f"{own[name]} of {own[SHARES[name]]}" if name in SHARES else str(own[name])
