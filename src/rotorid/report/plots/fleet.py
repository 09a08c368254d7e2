"""Figures of a fleet: in how many sets each effect shows, how numbers change from set to set and since the first."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.report.plots import style

_MOST_EFFECTS = 15
_MOST_PARAMETERS = 4
_MOST_NAMED = 6
"""Vehicles that still have a colour each."""
_WORDS = {"established": style.BLUE, "ambiguous": style.ORANGE, "suggested": style.GREY}


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
        value, low, high = (part[c].to_numpy(float) for c in ("value", "low_95", "high_95"))
        colour = style.CYCLE[number] if few else style.BLUE
        bars = [np.maximum(value - low, 0.0), np.maximum(high - value, 0.0)]
        axis.errorbar(place, value, bars, fmt=".-", ms=3, color=colour, lw=0.4, elinewidth=0.8, label=vehicle)
    unit = own["unit"].iloc[0]
    axis.set_ylabel(own["parameter"].iloc[0] + (f"\n({unit})" if unit and unit != "1" else ""))
    if dated:
        axis.tick_params(axis="x", rotation=20)
    else:
        axis.set_xlim(0.0, count + 1.0)
        axis.set_xlabel("set, in order of day and name")
    if few and len(vehicles) > 1:
        axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))


_MOST_HISTORIES = 8
"""Vehicles whose history is drawn, those with the most events first."""


def draw_history(numbers: pd.DataFrame, events: pd.DataFrame, path: Path) -> None:
    """Each vehicle's trims, shares and thrust over its sets, as changes since its first ones with intervals (95 %).

    `numbers` and `events` are the tables of `rotorid.report.fleet_history.history`. A quantity that differs from
    some set on has a colour, the others are grey; a line stands where an event begins.
    """
    counts = events["vehicle"].value_counts()
    vehicles = sorted(numbers["vehicle"].unique(), key=lambda v: (-counts.get(v, 0), v))[:_MOST_HISTORIES]
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
        place = own["set"].map(order).to_numpy()
        value, low, high = (own[c].to_numpy(float) for c in ("change", "low_95", "high_95"))
        colour = style.CYCLE[changed.index(name) % len(style.CYCLE)] if name in changed else style.GREY
        bars = [np.maximum(value - low, 0.0), np.maximum(high - value, 0.0)]
        label = name if name in changed else None
        axis.errorbar(place, value, bars, fmt=".-", ms=3, color=colour, lw=0.5, elinewidth=0.8, label=label)
    for name in dict.fromkeys(events["set"]):
        axis.axvline(order[name] - 0.5, color=style.ORANGE, lw=0.8, ls="--")
    axis.set_xlim(0.5, len(order) + 0.5)
    units = sorted(set(numbers["unit"])) or ["%"]
    axis.set_ylabel(f"change ({', '.join(units)})")
    axis.set_xlabel("set, the good ones shaded")
    if changed:
        axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0))


_ABREAST = 4
"""Quantities of a vehicle next to each other."""


def draw_vehicle(numbers: pd.DataFrame, events: pd.DataFrame, path: Path) -> None:
    """Every quantity of one vehicle over its sets: good ones shaded, limits dotted, a line where it has an event.

    `numbers` and `events` are the vehicle's rows of the tables of `rotorid.report.fleet_history.history`.
    """
    names = list(dict.fromkeys(numbers["name"]))
    rows = -(-len(names) // _ABREAST) or 1
    fig, axes = style.figure(1.15 * rows + 0.3, rows, _ABREAST, squeeze=False)
    for axis in axes.ravel()[len(names) :]:
        axis.set_axis_off()
    for axis, name in zip(axes.ravel(), names, strict=False):
        own = numbers[numbers["name"] == name]
        place = {s: k for k, s in enumerate(own["set"], 1)}
        begins = [place[s] for s in events[events["id"] == name]["set"] if s in place]
        value, low, high = (own[c].to_numpy(float) for c in ("change", "low_95", "high_95"))
        colour = style.RED if begins else style.BLUE
        axis.axvspan(0.5, own["good"].sum() + 0.5, color=style.GREY, alpha=0.15, lw=0)
        for limit in (-own["limit"].iloc[0], own["limit"].iloc[0]):
            axis.axhline(limit, color=style.GREY, lw=0.7, ls=":")
        bars = [np.maximum(value - low, 0.0), np.maximum(high - value, 0.0)]
        axis.errorbar(list(place.values()), value, bars, fmt=".", ms=4, color=colour, elinewidth=0.7)
        for begin in begins:
            axis.axvline(begin - 0.5, color=style.ORANGE, lw=0.8, ls="--")
        axis.set_title(own["quantity"].iloc[0], fontsize=8, color=colour if begins else style.BLACK)
        axis.set_xticks([])
        axis.set_xlim(0.5, len(place) + 0.5)
    style.save(fig, path)
