"""Figures of a comparison of two sets, and of
a fleet (in how many sets each effect shows, numbers from set to set and since the first)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from rotorid.report.plots import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rotorid.mismatch.changes.compare import Changes

_MOST_EFFECTS = 15
_MOST_PARAMETERS = 4
_MOST_NAMED = 6
"""Vehicles that still have a colour each."""
_WORDS = {"established": style.BLUE, "ambiguous": style.ORANGE, "suggested": style.GREY}


_CLAIMED = ("established", "ambiguous")
_ABREAST = 4
"""Quantities next to each other."""


def draw_values(found: Changes, names: Mapping[str, str], path: Path) -> None:
    """The change of every believed value with its 95 % interval, in percent; `names` are their names in words."""
    changed = {i for c in found.changes if c.status in _CLAIMED for i in (c.id, *c.alternatives)}
    values = found.values[::-1]
    fig, axis = style.figure(0.6 + 0.28 * max(1, len(values)))
    for place, p in enumerate(values):
        colour = style.RED if p.symbol in changed else style.BLUE
        axis.plot([100 * p.low, 100 * p.high], [place, place], color=colour, lw=2.0)
        axis.plot(100 * p.value, place, "o", ms=4, color=colour)
    axis.axvline(0.0, color=style.GREY, lw=0.8)
    axis.set_yticks(range(len(values)), [names[p.symbol] for p in values])
    axis.set_xlabel("change (%), with 95 % interval; red: stated as changed")
    style.save(fig, path)


def draw_residuals(found: Changes, names: Mapping[str, str], path: Path) -> None:
    """What each set's believed vehicle leaves of every force and moment, over the time of a stretch of each."""
    most_points = 1500  # Points of a line at most: more are not seen at the width of a page.
    channels = [c for c in found.residuals[0] if c in found.residuals[1]]
    fig, axes = style.figure(1.25 * max(1, len(channels)) + 0.4, max(1, len(channels)), 1, squeeze=False, sharex=True)
    for axis, channel in zip(axes[:, 0], channels, strict=False):
        names_of_sets = ("good flights" if found.kind == "flight" else found.base, found.new)
        for sets, name, colour in zip(found.residuals, names_of_sets, (style.BLUE, style.RED), strict=True):
            left = sets[channel]
            step = max(1, len(left.time_s) // most_points)
            axis.plot(left.time_s[::step] - left.time_s[0], left.values[::step], color=colour, lw=0.7, label=name)
        axis.set_ylabel(f"{names[channel]}\n({'N' if channel.startswith('force') else 'N m'})")
    if channels:
        axes[0, 0].legend(loc="upper left", bbox_to_anchor=(0.0, 1.35), ncols=2)
        axes[-1, 0].set_xlabel("time since the start of the stretch (s)")
    style.save(fig, path)


def _quantities(count: int) -> tuple[Figure, np.ndarray]:
    """A figure with axes, (count,), for as many quantities, some next to each other."""
    rows = -(-count // _ABREAST) or 1
    fig, axes = style.figure(1.15 * rows + 0.3, rows, _ABREAST, squeeze=False)
    for axis in axes.ravel()[count:]:
        axis.set_axis_off()
    return fig, axes.ravel()[:count]


def _over_flights(axis, name: str, flights: int, good: int, limit: float, colour: str) -> None:
    """Prepare axes for a quantity over flights: the good ones shaded, what is stated beyond dotted lines."""
    axis.axvspan(0.5, good + 0.5, color=style.GREY, alpha=0.15, lw=0)
    for end in (-limit, limit):
        axis.axhline(end, color=style.GREY, lw=0.7, ls=":")
    axis.set_title(name, fontsize=8, color=colour)
    axis.set_xticks([])
    axis.set_xlim(0.5, flights + 0.5)


def _with_intervals(axis, place, table: pd.DataFrame, column: str, **look) -> None:
    """Draw a column at places (n,) with its intervals (95 %)."""
    value, low, high = (table[c].to_numpy(float) for c in (column, "low_95", "high_95"))
    axis.errorbar(place, value, [np.maximum(value - low, 0.0), np.maximum(high - value, 0.0)], **look)


def draw_differences(found: Changes, names: Mapping[str, str], path: Path) -> None:
    """Every quantity of level 1 over the flights in order: good ones shaded, with the limits of what is stated."""
    differences = sorted(found.level_1.differences, key=lambda d: list(names).index(d.quantity.key))
    fig, axes = _quantities(len(differences))
    for axis, d in zip(axes, differences, strict=True):
        flights = [*d.good, *d.new]
        place, count = np.arange(1, len(flights) + 1), len(d.good)
        value, sd = (np.array([getattr(f, name) for f in flights]) for name in ("value", "sd"))
        middle, name = value[:count].mean(), names[d.quantity.key]
        scale = 100.0 if name.endswith("(%)") else np.rad2deg(1.0) if "(°)" in name else 1.0
        value, sd, limit = scale * (value - middle), scale * sd, scale * d.smallest
        colour = style.RED if d.stated else style.BLUE
        axis.axhline(0.0, color=style.GREY, lw=0.6)
        _over_flights(axis, name, len(flights), count, limit, colour if d.stated else style.BLACK)
        axis.errorbar(place[:count], value[:count], 2.0 * sd[:count], fmt=".", ms=4, color=style.BLUE, elinewidth=0.7)
        axis.errorbar(place[count:], value[count:], 2.0 * sd[count:], fmt=".", ms=4, color=colour, elinewidth=0.7)
    style.save(fig, path)


def draw_fleet(counts: pd.DataFrame, parameters: pd.DataFrame, sets: pd.DataFrame, path: Path) -> None:
    """Bars of `counts` (`rotorid.report.fleet.by_effect`), and below them the numbers most often established.

    Each number stands at its set's day, or its place in the order of day and name, with its interval (95 %).
    """
    shown = counts.head(_MOST_EFFECTS).iloc[::-1]
    numbers = _most_frequent(parameters)
    rows = 1 + len(numbers)
    heights = [0.4 + 0.19 * max(len(shown), 1), *[1.5] * len(numbers)]
    fig, axes = style.figure(sum(heights) + 0.4 * rows, rows, 1, height_ratios=heights, squeeze=False)
    _bars(axes[0, 0], shown, sets)
    order = {name: place for place, name in enumerate(sets.sort_values(["day", "set"])["set"], 1)}
    for axis, name in zip(axes[1:, 0], numbers, strict=True):
        _over_time(axis, parameters[parameters["parameter"] == name], order, len(sets))
    style.save(fig, path)


def _most_frequent(parameters: pd.DataFrame) -> list[str]:
    """Names of the numbers that most sets state and that an established effect or a wrong value has."""
    sure = parameters[parameters["status"].isin(["established", "wrong value"])]
    counts = sure["parameter"].value_counts()
    # Names in order of the alphabet where as many sets state them, so that two runs draw the same.
    ordered = sorted(counts.items(), key=lambda pair: (-pair[1], pair[0]))
    return [name for name, _ in ordered[:_MOST_PARAMETERS]]


def _bars(axis, shown: pd.DataFrame, sets: pd.DataFrame) -> None:
    """How many sets show each effect, by the verdict's word."""
    left = np.zeros(len(shown))
    for word, colour in _WORDS.items():
        values = shown[word].to_numpy(float)
        axis.barh(shown["effect"], values, left=left, color=colour, label=word)
        left += values
    judged = int((sets["verdict"] != "failed").sum())
    axis.set_xlabel(f"sets, of {judged} judged")
    if len(shown):
        axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))
    else:
        axis.text(0.5, 0.5, "no effect in any set", ha="center", transform=axis.transAxes)
        axis.set_yticks([])


def _over_time(axis, own: pd.DataFrame, order: dict[str, int], count: int) -> None:
    """One number with its interval in each set that states it, the sets of a vehicle joined by a line.

    Over the day where every set has one, else over the place in the order of day and name. Vehicles have a colour and a
    name each where they are few.
    """
    dated = bool((own["day"] != "").all()) and own["day"].nunique() > 1
    vehicles = sorted(own["vehicle"].unique())
    few = len(vehicles) <= _MOST_NAMED
    for number, vehicle in enumerate(vehicles):
        part = own[own["vehicle"] == vehicle].sort_values(["day", "set"])
        place = pd.to_datetime(part["day"]).to_numpy() if dated else part["set"].map(order).to_numpy()
        look = {"color": style.CYCLE[number] if few else style.BLUE, "lw": 0.4, "label": vehicle}
        _with_intervals(axis, place, part, "value", fmt=".-", ms=3, elinewidth=0.8, **look)
    unit = own["unit"].iloc[0]
    axis.set_ylabel(own["parameter"].iloc[0] + (f"\n({unit})" if unit and unit != "1" else ""))
    if dated:
        axis.tick_params(axis="x", rotation=20)
    else:
        axis.set_xlim(0.0, count + 1.0)
        axis.set_xlabel("set, in order of day and name")
    if few and len(vehicles) > 1:
        axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))


def draw_history(numbers: pd.DataFrame, events: pd.DataFrame, path: Path) -> None:
    """Each vehicle's trims, shares and thrust over its sets, as changes since its first ones with intervals (95 %).

    `numbers` and `events` are the tables of `rotorid.report.fleet.history`. A quantity that differs from
    some set on has a colour, the others are grey; a line stands where an event begins.
    """
    most_histories = 8  # Vehicles whose history is drawn, those with the most events first.
    counts = events["vehicle"].value_counts()
    vehicles = sorted(numbers["vehicle"].unique(), key=lambda v: (-counts.get(v, 0), v))[:most_histories]
    rows = max(1, len(vehicles))
    fig, axes = style.figure(1.7 * rows + 0.3, rows, 1, squeeze=False)
    if not vehicles:
        axes[0, 0].text(0.5, 0.5, "no vehicle has more sets than the good ones", ha="center")
        axes[0, 0].set_axis_off()
    for axis, vehicle in zip(axes[:, 0], vehicles, strict=False):
        _one_history(axis, numbers[numbers["vehicle"] == vehicle], events[events["vehicle"] == vehicle])
        axis.set_title(vehicle, loc="left")
    style.save(fig, path)


def _one_history(axis, numbers: pd.DataFrame, events: pd.DataFrame) -> None:
    """One vehicle's values over its sets."""
    order = {name: place for place, name in enumerate(dict.fromkeys(numbers["set"]), 1)}
    changed = [name for name in dict.fromkeys(numbers["name"]) if name in set(events["id"])]
    good = int(numbers.groupby("name")["good"].sum().max())
    axis.axvspan(0.5, good + 0.5, color=style.GREY, alpha=0.15, lw=0)
    first = numbers["name"].str.startswith(("share/", "trim/", "lift"))
    numbers = numbers[first | numbers["name"].isin(changed)]
    for name, own in numbers.groupby("name", sort=False):
        look = {"color": style.GREY}
        if name in changed:
            look = {"color": style.CYCLE[changed.index(name) % len(style.CYCLE)], "label": name}
        place = own["set"].map(order).to_numpy()
        _with_intervals(axis, place, own, "change", fmt=".-", ms=3, lw=0.5, elinewidth=0.8, **look)
    for name in dict.fromkeys(events["set"]):
        axis.axvline(order[name] - 0.5, color=style.ORANGE, lw=0.8, ls="--")
    axis.set_xlim(0.5, len(order) + 0.5)
    units = sorted(set(numbers["unit"])) or ["%"]
    axis.set_ylabel(f"change ({', '.join(units)})")
    axis.set_xlabel("set, the good ones shaded")
    if changed:
        axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))


def draw_vehicle(numbers: pd.DataFrame, events: pd.DataFrame, path: Path) -> None:
    """Every quantity of one vehicle over its sets: good ones shaded, limits dotted, a line where it has an event.

    `numbers` and `events` are the vehicle's rows of the tables of `rotorid.report.fleet.history`.
    """
    names = list(dict.fromkeys(numbers["name"]))
    fig, axes = _quantities(len(names))
    for axis, name in zip(axes, names, strict=True):
        own = numbers[numbers["name"] == name]
        place = {s: k for k, s in enumerate(own["set"], 1)}
        begins = [place[s] for s in events[events["id"] == name]["set"] if s in place]
        colour, of_words = (style.RED, style.RED) if begins else (style.BLUE, style.BLACK)
        _over_flights(axis, own["quantity"].iloc[0], len(place), own["good"].sum(), own["limit"].iloc[0], of_words)
        _with_intervals(axis, list(place.values()), own, "change", fmt=".", ms=4, color=colour, elinewidth=0.7)
        for begin in begins:
            axis.axvline(begin - 0.5, color=style.ORANGE, lw=0.8, ls="--")
    style.save(fig, path)
