"""Which sets the bench for decisions keeps, and in which order. Light: read at every start.

Sets that belong together (a simulator, a laboratory's flight) are a group, and every group gets the same share of time:
however early a collection is stopped, what is kept is a fair sample, with many sets of those that cost little.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from rotorid_proof.decisions.label import Label
from rotorid_proof.plan import DRAWN, Entry
from rotorid_proof.plantings.flights import FLIGHTS
from rotorid_proof.plantings.plan import SECONDS, Planting
from rotorid_proof.studies import Study

DRAWN_S = {
    "multibody": 22.0,
    "continuous": 15.0,
    "feedback": 15.0,
    "richsim": 30.0,
    "rotorpy": 30.0,
    "rig": 4.0,
    "ground": 4.0,
}
"""Usual seconds of one core to record and judge a set of each simulator."""
STUDY_S = 120.0


@dataclass(frozen=True)
class Item:
    """A set to keep: how it is called, what it costs, and with which it shares."""

    label: Label
    seconds: float
    first: bool = False
    """Whether others are compared with it."""

    @property
    def group(self) -> tuple[str, str, str]:
        """Sets that share a part of the time: studies are of many laboratories, each of few and long sets."""
        laboratory = "" if self.label.origin == "study" else self.label.laboratory
        return self.label.origin, self.label.plant, laboratory


def simulator_of(entry: Entry) -> str:
    """Which simulator draws a concealed case."""
    first, second = entry.case.split("/")[:2]
    if not entry.is_flight:
        return "rig" if second == "rig" else "ground"
    return first if first in DRAWN or first == "rotorpy" else "richsim"


def drawn(entries: Iterable[Entry]) -> list[Item]:
    """Items of concealed cases."""
    out = []
    for entry in entries:
        plant = "flight" if entry.is_flight else entry.case.split("/")[0]
        simulator = simulator_of(entry)
        family = entry.family.removeprefix(f"{plant}-")
        if entry.family.removesuffix("-clean") in DRAWN:
            family = entry.case.split("/")[-3]
        label = Label(f"drawn/{entry.case}", plant, simulator, family)
        out.append(Item(label, DRAWN_S[simulator]))
    return out


def planted(plantings: Iterable[Planting]) -> list[Item]:
    """Items of plantings in real flights."""
    return [
        Item(Label(f"planted/{p.name}", "flight", p.flight, p.family), SECONDS.get(p.flight, 40.0)) for p in plantings
    ]


def untouched(names: Iterable[str]) -> list[Item]:
    """Items of the flights in which something is planted, with nothing planted."""
    return [
        Item(Label(f"untouched/{f.name}", "flight", f.name, "untouched"), SECONDS.get(f.name, 40.0), first=True)
        for f in FLIGHTS
        if f.name in set(names)
    ]


def studies(wanted: Iterable[Study]) -> list[Item]:
    """Items of studies of real flights and stands."""
    return [Item(Label(f"study/{s.name}", s.kind, s.set, "study"), STUDY_S) for s in wanted]


def joint(hashes: Iterable[str]) -> str:
    """One hash of several."""
    return hashlib.sha256("\n".join(hashes).encode()).hexdigest()[:16]


def in_order(items: Sequence[Item]) -> list[Item]:
    """Those first with which others are compared, then all groups by turns with the same share of time for each.

    Within a group the order is drawn from the names, so that no family comes first.
    """
    spent: dict[tuple[str, str, str], float] = {}
    due = {}
    for item in sorted(items, key=lambda i: hashlib.sha256(i.label.name.encode()).digest()):
        spent[item.group] = spent.get(item.group, 0.0) + item.seconds
        due[item.label.name] = 0.0 if item.first else spent[item.group]
    return sorted(items, key=lambda i: due[i.label.name])
