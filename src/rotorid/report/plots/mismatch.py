"""Figures of a verdict (before and after, where, in which regime, how much better) and of a comparison of two sets."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from rotorid.report.plots import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from rotorid.mismatch.changes.compare import Changes, Residual

STRIP_CELL_S = 0.5
_LARGEST = 10.0
"""Size relative to the noise at which the heat strip's colour ends."""
_SHADE = "#f3e6d8"
_STAGES = {"before": "as believed", "refitted": "values refitted", "after": "improved"}


def svg(fig: Figure) -> str:
    """The figure as SVG text, the same for the same data; closes it."""
    import matplotlib.pyplot as plt

    _names_are_names(fig)
    text = io.StringIO()
    fig.savefig(text, format="svg", metadata={"Date": None})
    plt.close(fig)
    return text.getvalue()


def _names_are_names(fig: Figure) -> None:
    """Let no text of the figure be read as mathematics: a run or a column may be called `$x$`.

    The numbers at a logarithmic axis, which matplotlib writes as powers of ten, stay what they are.
    """
    from matplotlib.text import Text

    powers = {
        label
        for ax in fig.axes
        for axis in (ax.xaxis, ax.yaxis)
        if axis.get_scale() == "log"
        for label in axis.get_ticklabels(which="both")
    }
    for text in fig.findobj(Text):
        if text not in powers:
            text.set_parse_math(False)


def heat_strip(
    channels: Sequence[str],
    labels: Sequence[str],
    runs: Sequence[str],
    held_out: Sequence[str],
    sizes: Mapping[tuple[str, str, str], tuple[np.ndarray, np.ndarray]],
    located: Mapping[tuple[str, str], Sequence[tuple[float, float]]],
) -> Figure:
    """Size of the error relative to the noise, channels down, the runs' time across, before above after.

    `sizes` maps (stage, run, channel) to instants and sizes in units of the noise; `located` maps (run, channel)
    to intervals, which are underlined.
    """
    import matplotlib.pyplot as plt
    from matplotlib.colors import LogNorm

    height = 0.9 + 2 * 0.19 * len(channels)
    span = {r: _span(sizes, r) for r in runs}
    widths = [max(span[r][1] - span[r][0], 1e-3) for r in runs]
    style.use()
    fig, axes = plt.subplots(
        2,
        len(runs),
        figsize=(style.TEXT_WIDTH_IN, height),
        squeeze=False,
        sharey=True,
        gridspec_kw={"width_ratios": widths},
    )
    norm = LogNorm(0.7, _LARGEST)
    for row, stage in enumerate(("before", "after")):
        for column, run in enumerate(runs):
            ax = axes[row, column]
            for line, channel in enumerate(channels):
                if (stage, run, channel) not in sizes:
                    continue
                time_s, size = sizes[stage, run, channel]
                step = float(np.median(np.diff(time_s))) if len(time_s) > 1 else STRIP_CELL_S
                edges = np.append(time_s - step / 2, time_s[-1] + step / 2)
                image = np.clip(size, 0.7, _LARGEST)[None, :]
                ax.pcolormesh(edges, [line - 0.44, line + 0.36], image, norm=norm, cmap="YlOrRd", rasterized=True, lw=0)
                if row == 0:
                    for start, stop in located.get((run, channel), ()):
                        ax.plot([start, stop], [line + 0.43] * 2, color="black", lw=1.2, solid_capstyle="butt")
            ax.set_xlim(*span[run])
            ax.grid(False)
            ax.tick_params(length=2)
            for side in ("left", "bottom"):
                ax.spines[side].set_visible(False)
            if row == 0:
                ax.set_xticklabels([])
                name = run if len(run) <= 14 else f"{run[:12]}…"
                ax.set_title(f"{name}\nheld out" if run in held_out else f"{name}\n", fontsize=7.5, pad=3)
            else:
                ax.locator_params(axis="x", nbins=3)
        axes[row, 0].set_yticks(range(len(channels)), labels)
        axes[row, 0].set_ylabel("as believed" if row == 0 else "improved")
    axes[0, 0].set_ylim(len(channels) - 0.4, -0.6)
    fig.supxlabel("time (s)", fontsize=9.5)
    fig.get_layout_engine().set(w_pad=0.01, wspace=0.01)
    scale = fig.colorbar(
        plt.cm.ScalarMappable(norm=norm, cmap="YlOrRd"), ax=axes, fraction=0.02, pad=0.01, ticks=[1, 2, 5, 10]
    )
    scale.ax.set_yticklabels(["1", "2", "5", "10"])
    scale.ax.minorticks_off()
    scale.set_label("error / noise")
    return fig


def _span(sizes, run: str) -> tuple[float, float]:
    times = [t for (_, r, _), (t, _) in sizes.items() if r == run and len(t)]
    if not times:
        return 0.0, 1.0
    start, stop = min(t[0] for t in times), max(t[-1] for t in times)
    # A run of a single cell is as wide as that.
    return (start, stop) if stop > start else (start - STRIP_CELL_S / 2, stop + STRIP_CELL_S / 2)


CHANNELS = {
    **{f"force_{axis}": (f"$F_{axis}$", "N") for axis in "xyz"},
    **{f"moment_{axis}": (f"$M_{axis}$", "N m") for axis in "xyz"},
}


def errors_over_time(traces: pd.DataFrame, channels: Sequence[str], located: pd.DataFrame) -> Figure:
    """Measured minus simulated over time, believed and improved vehicle, one channel a row; tinted: located.

    `traces` has `time_s channel run before after` of one run, `located` `run channel start_s stop_s`.
    """
    fig, axes = style.figure(0.4 + 1.15 * len(channels), len(channels), 1, sharex=True, squeeze=False)
    for axis, channel in zip(axes[:, 0], channels, strict=True):
        part = traces[traces["channel"] == channel]
        here = located[(located["channel"] == channel) & located["run"].isin(part["run"])]
        for row in here.itertuples():
            axis.axvspan(row.start_s, row.stop_s, color=_SHADE, lw=0, zorder=0)
        for stage in ("before", "after"):
            axis.plot(part["time_s"], part[stage], color=style.COLOUR[stage], lw=0.8, label=_STAGES[stage])
        label, unit = CHANNELS[channel]
        axis.set_ylabel(f"{label} ({unit})")
    axes[-1, 0].set_xlabel("time (s)")
    fig.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper right", ncols=2)
    return fig


def errors_by_channel(channels: pd.DataFrame) -> Figure:
    """Held-out error of each channel over the sensors' noise: as believed, values refitted, with the effects.

    `channels` has `channel before refitted after noise_floor`.
    """
    fig, axis = style.figure(2.6)
    places = np.arange(len(channels))
    for shift, (stage, name) in zip((-0.2, 0.0, 0.2), _STAGES.items(), strict=True):
        error = channels[stage] / channels["noise_floor"]
        axis.plot(places + shift, error, "o", color=style.COLOUR[stage], label=name, markersize=5)
    axis.axhline(1, color=style.COLOUR["noise"], lw=1, ls="--")
    axis.text(len(channels) - 0.45, 1.0, "noise", color=style.COLOUR["noise"], va="bottom", ha="right", fontsize=8.5)
    axis.set_yscale("log")
    axis.set_xticks(places, [CHANNELS[name][0] for name in channels["channel"]])
    axis.set_ylabel("error / sensors' noise")
    fig.legend(loc="outside upper right", ncols=3)
    return fig


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
