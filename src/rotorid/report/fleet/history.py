"""Each vehicle of a fleet over its flights: what changed since the first ones, and from which flight on."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import pandas as pd

from rotorid.effects.catalogue import catalogue
from rotorid.errors import InputError
from rotorid.mismatch.changes.compare import Changes, changes_from
from rotorid.mismatch.changes.joint import reference_of
from rotorid.mismatch.changes.level_one import as_one
from rotorid.mismatch.changes.words import change_words
from rotorid.recordings import RecordingSet, read_set
from rotorid.report.fleet.summary import day_of

CLAIMED = ("established", "ambiguous")
NUMBERS = ("vehicle", "set", "day", "name", "change", "low_95", "high_95")
EVENTS = ("vehicle", "set", "day", "id", "lasts", "sentence")


def by_vehicle(
    folders: Sequence[Path], progress: Callable[[str], None] = lambda text: None
) -> dict[str, list[RecordingSet]]:
    """Sets of flights by the name of their vehicle, each in the order of its days, then of its names.

    A set that cannot be read, or is none of flights, is left out; `progress` gets a line that says so.
    """
    out: dict[str, list[RecordingSet]] = {}
    for folder in sorted(folders, key=lambda f: (day_of(f.name), f.name)):
        try:
            own = read_set(folder)
        except InputError as error:
            progress(f"{folder.name} is left out: {error}")
            continue
        if own.vehicle.kind == "flight":
            out.setdefault(own.vehicle.name, []).append(own)
    return out


def history(
    sets: Mapping[str, Sequence[RecordingSet]], good: int, progress: Callable[[str], None] = lambda text: None
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Numbers and events of every vehicle.

    Parameters
    ----------
    sets
        By vehicle, in the order they were flown.
    good
        How many of the first sets are the good ones, which all later ones are compared with.
    progress
        Gets one line a set.

    Returns
    -------
    numbers
        One row a set and believed value: `vehicle`, `set`, `day`, `name`, `change` (relative), `low_95`, `high_95`.
    events
        One row a change that a set shows and no set before did: `vehicle`, `set`, `day`, `id`, `lasts` (in how
        many of the sets from this one on it shows), `sentence`.
    """
    numbers, events = [], []
    for vehicle, own in sets.items():
        if len(own) <= good:
            continue
        compared = {}
        try:
            reference = reference_of(as_one(own[:good]))
        except InputError as error:
            progress(f"{vehicle} is left out: {error}")
            continue
        for later in own[good:]:
            try:
                compared[later.name] = changes_from(reference, later)
                progress(f"{vehicle}: {later.name}")
            except InputError as error:
                progress(f"{vehicle}: {later.name} is left out: {error}")
        numbers += [row for name, found in compared.items() for row in numbers_of(vehicle, name, found)]
        events += events_of(vehicle, compared)
    return pd.DataFrame(numbers, columns=NUMBERS), pd.DataFrame(events, columns=EVENTS)


def numbers_of(vehicle: str, name: str, found: Changes) -> list[dict]:
    """Rows of a set's numbers."""
    head = {"vehicle": vehicle, "set": name, "day": day_of(name)}
    return [head | {"name": p.symbol, "change": p.value, "low_95": p.low, "high_95": p.high} for p in found.values]


def events_of(vehicle: str, compared: Mapping[str, Changes]) -> list[dict]:
    """Rows of what a set shows and no set before it did; of a class its likeliest member.

    A value that another change of the set would change by itself (a payload the inertias) is no event of its own.
    """
    names, out = list(compared), []
    claimed = {name: [c for c in compared[name].changes if c.status in CLAIMED] for name in names}
    shown = {name: {i for c in own for i in (c.id, *c.alternatives)} for name, own in claimed.items()}
    for k, name in enumerate(names):
        before = set().union(*(shown[earlier] for earlier in names[:k]))
        before |= {value for i in shown[name] & set(catalogue()) for value in catalogue()[i].would_change}
        for change in claimed[name]:
            members = {change.id, *change.alternatives}
            if members & before:
                continue
            lasts = sum(bool(members & shown[later]) for later in names[k:])
            sentence = f"{vehicle}, from {name} on: {change_words(change)}"
            row = {"set": name, "day": day_of(name), "id": change.id, "lasts": lasts, "sentence": sentence}
            out.append({"vehicle": vehicle, **row})
    return out
