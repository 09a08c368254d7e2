"""Figures of a comparison: changes with their intervals, and what is left of both sets over each other."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rotorid.report.plots import style

if TYPE_CHECKING:
    from rotorid.mismatch.changes.compare import Changes, Residual

_CLAIMED = ("established", "ambiguous")
_ABREAST = 4
"""Quantities next to each other."""
_MOST_POINTS = 1500
"""Points of a line at most: more are not seen at the width of a page."""


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
    channels = [c for c in found.residuals[0] if c in found.residuals[1]]
    fig, axes = style.figure(1.25 * max(1, len(channels)) + 0.4, max(1, len(channels)), 1, squeeze=False, sharex=True)
    for axis, channel in zip(axes[:, 0], channels, strict=False):
        sets = zip(
            found.residuals,
            ("good flights" if found.kind == "flight" else found.base, found.new),
            (style.BLUE, style.RED),
            strict=True,
        )
        for residuals, name, colour in sets:
            time_s, values = _thinned(residuals[channel])
            axis.plot(time_s, values, color=colour, lw=0.7, label=name)
        axis.set_ylabel(f"{names[channel]}\n({'N' if channel.startswith('force') else 'N m'})")
    if channels:
        axes[0, 0].legend(loc="upper left", bbox_to_anchor=(0.0, 1.35), ncols=2)
        axes[-1, 0].set_xlabel("time since the start of the stretch (s)")
    style.save(fig, path)


def _thinned(residual: Residual) -> tuple[np.ndarray, np.ndarray]:
    """Times from 0 and values of a line that is not longer than a page shows."""
    step = max(1, len(residual.time_s) // _MOST_POINTS)
    return residual.time_s[::step] - residual.time_s[0], residual.values[::step]


def draw_differences(found: Changes, names: Mapping[str, str], path: Path) -> None:
    """Every quantity of level 1 over the flights in order: good ones shaded, with the limits of what is stated."""
    differences = sorted(found.level_1.differences, key=lambda d: list(names).index(d.quantity.key))
    rows = -(-len(differences) // _ABREAST) or 1
    fig, axes = style.figure(1.15 * rows + 0.3, rows, _ABREAST, squeeze=False)
    for axis in axes.ravel()[len(differences) :]:
        axis.set_axis_off()
    for axis, d in zip(axes.ravel(), differences, strict=False):
        flights = [*d.good, *d.new]
        place, count = np.arange(1, len(flights) + 1), len(d.good)
        value, sd = (np.array([getattr(f, name) for f in flights]) for name in ("value", "sd"))
        middle = value[:count].mean()
        scale = (
            100.0
            if names[d.quantity.key].endswith("(%)")
            else np.rad2deg(1.0)
            if "(°)" in names[d.quantity.key]
            else 1.0
        )
        value, sd, limit = scale * (value - middle), scale * sd, scale * d.smallest
        axis.axvspan(0.5, count + 0.5, color=style.GREY, alpha=0.15, lw=0)
        axis.axhline(0.0, color=style.GREY, lw=0.6)
        for end in (-limit, limit):
            axis.axhline(end, color=style.GREY, lw=0.7, ls=":")
        colour = style.RED if d.stated else style.BLUE
        axis.errorbar(place[:count], value[:count], 2.0 * sd[:count], fmt=".", ms=4, color=style.BLUE, elinewidth=0.7)
        axis.errorbar(place[count:], value[count:], 2.0 * sd[count:], fmt=".", ms=4, color=colour, elinewidth=0.7)
        axis.set_title(names[d.quantity.key], fontsize=8, color=colour if d.stated else style.BLACK)
        axis.set_xticks([])
        axis.set_xlim(0.5, len(flights) + 0.5)
    style.save(fig, path)
