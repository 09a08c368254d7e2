"""Each vehicle of a fleet over its flights: what differs since the first ones, and from which flight on."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import pandas as pd

from rotorid.errors import InputError
from rotorid.mismatch.changes.level_one import (
    FALSE_ALARMS,
    Difference,
    as_one,
    differences,
    differences_at,
    measured,
    of_one_vehicle,
    usual_scatter,
)
from rotorid.mismatch.changes.quantities import Flown, flown, grid_of
from rotorid.mismatch.changes.words import difference_words, in_unit_of_words, quantity_words, unit_of
from rotorid.recordings import RecordingSet, read_set
from rotorid.report.fleet import day_of

_NUMBERS = ("vehicle", "set", "day", "good", "name", "quantity", "unit", "change", "low_95", "high_95", "limit")
EVENTS = ("vehicle", "set", "day", "id", "lasts", "sentence")
_Z95 = 1.96


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
        How many of the first sets are surely good.
    progress
        Gets one line a vehicle, and one for each set that is left out.

    Returns
    -------
    numbers
        One row a set and quantity: `vehicle`, `set`, `day`, `good` (1 of the first ones), `name`, `quantity` in words,
        `unit`, `change` against the mean of the good ones, `low_95`, `high_95` by the set's own pieces and the scatter
        from flight to flight, `limit` that the mean of the later sets must pass to be stated in 19 of 20 histories.
    events
        One row a quantity that differs from a set on: `vehicle`, `set`, `day`, `id` of the quantity, `lasts` (how many
        sets there are from this one to the next event), `sentence`.
    """
    numbers, events = [], []
    for vehicle, own in sets.items():
        if len(own) <= good:
            continue
        try:
            own = of_one_vehicle(own)
            as_one(own[:good])
            shown = shown_by(own, good, lambda text, v=vehicle: progress(f"{v}: {text}"))
        except InputError as error:
            progress(f"{vehicle} is left out: {error}")
            continue
        numbers += _numbers_of(vehicle, shown, good)
        events += [row for point in change_points(shown, good) for row in _rows_of(vehicle, *point)]
        progress(f"{vehicle}: {len(shown)} sets")
    return pd.DataFrame(numbers, columns=_NUMBERS), pd.DataFrame(events, columns=EVENTS)


_Shown = Mapping[str, Sequence[Flown]]
"""What the runs of each set show, in the order they were flown; each set counts as one flight."""


def shown_by(sets: Sequence[RecordingSet], good: int, progress: Callable[[str], None]) -> _Shown:
    """What each set shows; one that lacks something that the good ones have is left out, with a line.

    Raises
    ------
    InputError
        A good set has no stretch of flight that is long enough.
    """
    first = tuple(sets[:good])
    grid, out, needed = grid_of(first), {}, set()
    for k, own in enumerate(sets):
        runs = [flown(run, own.vehicle, grid) for run in own.runs] if grid_of((*first, own)).like(grid) else []
        runs = [run for run in runs if run is not None]
        if k < good:
            if not runs:
                raise InputError(f"set {own.name}: no stretch of flight is long enough; expected some seconds")
            needed |= set(runs[0].y)
        elif not runs or any(needed - set(run.y) for run in runs):
            progress(f"{own.name} is left out: it lacks flight or columns that the first sets have")
            continue
        out[own.name] = runs
    return out


def change_points(shown: _Shown, good: int) -> list[tuple[str, int, tuple[Difference, ...]]]:
    """The sets from which on something differs, in their order, in how many sets it lasts, and what differs.

    Each splits the history in two parts, looked at again. The false alarms of a vehicle are those of all sets at which
    it may have changed. A further change needs as many good sets before it as the first one.
    """
    names = list(shown)
    places = range(good, len(names))
    if not places:
        return []
    numbers = measured(list(shown.values()))
    best: tuple[float, float, int, tuple[Difference, ...]] | None = None
    for k in places:
        found = differences_at(k, numbers, names, usual_scatter())
        stated = tuple(d for d in found if d.false_alarms * len(places) <= FALSE_ALARMS)
        if stated and (best is None or _rarity(stated[0]) < best[:2]):
            best = (*_rarity(stated[0]), k, stated)
    if best is None:
        return []
    *_, k, stated = best
    before, after = ({n: shown[n] for n in part} for part in (names[:k], names[k:]))
    earlier, later = change_points(before, good), change_points(after, good)
    first = list(after).index(later[0][0]) if later else len(after)
    return [*earlier, (names[k], first, stated), *later]


def _rarity(d: Difference) -> tuple[float, float]:
    """How rare a difference is, the rarest first; of those that are equally rare, by their size."""
    return d.false_alarms, -abs(d.value) / d.sd


def _numbers_of(vehicle: str, shown: _Shown, good: int) -> list[dict]:
    """Rows of every quantity of all sets."""
    first, later = dict(list(shown.items())[:good]), dict(list(shown.items())[good:])
    if not later:
        return []
    out = []
    for d in differences(first, later, usual_scatter()):
        middle = sum(f.value for f in d.good) / len(d.good)
        for place, f in enumerate((*d.good, *d.new)):
            reach = _Z95 * (d.scatter**2 * (1.0 + 1.0 / len(d.good)) + f.sd**2) ** 0.5
            ends = (f.value - middle, f.value - middle - reach, f.value - middle + reach)
            change, low, high, limit = (in_unit_of_words(d, end) for end in (*ends, d.smallest))
            row = {"vehicle": vehicle, "set": f.name, "day": day_of(f.name), "good": int(place < len(d.good))}
            row |= {"name": d.quantity.key, "quantity": quantity_words(d), "unit": unit_of(d)}
            out.append(row | {"change": change, "low_95": low, "high_95": high, "limit": limit})
    return out


def _rows_of(vehicle: str, name: str, lasts: int, differing: Sequence[Difference]) -> list[dict]:
    """Rows of what differs from a set on, the rarest first."""
    head = {"vehicle": vehicle, "set": name, "day": day_of(name), "lasts": lasts}
    on = f"{vehicle}, from {name} on: "
    return [head | {"id": d.quantity.key, "sentence": on + difference_words(d)} for d in differing]
