"""Figures of the proof: confusion, power, held-out error against the oracle's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from rotorid.report.plots import style

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

FEWEST_CASES = 10
"""Cases behind each point of an effect's own power curve: with fewer it goes up and down by chance."""
LAST_COLUMNS = ("several", "a value", "nothing")


def confusion(table: pd.DataFrame) -> Figure:
    """Share of cases of each true effect (rows) for what was said of them (columns); of one kind or several."""
    if table.empty:
        return nothing("No such cases in this proof.")
    mixed = table["kind"].nunique() > 1
    table = table.assign(truth=[f"{r.kind}: {r.truth}" if mixed else r.truth for r in table.itertuples()])
    truths = sorted(table["truth"].unique(), key=lambda t: (t in LAST_COLUMNS, t))
    said = sorted(set(table["claimed"]) | (set() if mixed else set(truths)), key=lambda t: (t in LAST_COLUMNS, t))
    grid = np.zeros((len(truths), len(said)))
    for row in table.itertuples():
        grid[truths.index(row.truth), said.index(row.claimed)] = row.share
    fig, ax = style.figure(1.6 + 0.17 * len(truths))
    shown = ax.imshow(grid, cmap="Blues", vmin=0, vmax=1, aspect="auto")
    for (i, j), share in np.ndenumerate(grid):
        if 0 < share and len(truths) < 45:
            ax.text(j, i, f"{share:.1f}".lstrip("0") if share < 1 else "1", ha="center", va="center", fontsize=7,
                    color="white" if share > 0.5 else "black")  # fmt: skip
    ax.set_xticks(range(len(said)), [plain(t) for t in said], rotation=90, fontsize=7)
    ax.set_yticks(range(len(truths)), [plain(t) for t in truths], fontsize=7)
    ax.set_xlabel("said")
    ax.set_ylabel("hidden")
    ax.grid(visible=False)
    fig.colorbar(shown, ax=ax, label="share of cases", fraction=0.03, pad=0.01)
    return fig


def plain(name: str) -> str:
    """An id in words."""
    return str(name).replace("_", " ")


def power(table: pd.DataFrame) -> Figure:
    """Share detected against the effect's size over the noise, with intervals: all effects together.

    An effect has a curve of its own where `FEWEST_CASES` cases stand behind each of its points.
    """
    if table.empty:
        return nothing("No cases of growing size in this proof.")
    fig, ax = style.figure(2.9)
    for effect, own in table[table["effect"] != "all"].groupby("effect"):
        if own["cases"].min() >= FEWEST_CASES:
            ax.plot(own["size_over_noise"], own["detected"], lw=0.7, alpha=0.7, label=plain(effect))
    pooled = table[table["effect"] == "all"]
    ax.fill_between(pooled["size_over_noise"], pooled["low_95"], pooled["high_95"], color="black", alpha=0.12, lw=0)
    ax.plot(pooled["size_over_noise"], pooled["detected"], "o-", color="black", lw=1.8, label="all")
    ax.set_xscale("log")
    ax.set_xlabel("rms of the effect over rms of the noise, below 20 Hz")
    ax.set_ylabel("share of cases named")
    ax.set_ylim(-0.03, 1.03)
    if len(ax.lines) > 1:
        ax.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return fig


def oracle(cases: pd.DataFrame) -> Figure:
    """Held-out error over the true model's, by family: before (faint), refitted, after."""
    known = cases[cases["held_out_after"].notna()]
    if known.empty:
        return nothing("No held-out error in this proof.")
    known = known.assign(
        family=[r.family if r.kind == "flight" else f"{r.kind} {r.family}" for r in known.itertuples()]
    )
    families = list(dict.fromkeys(known["family"]))
    fig, ax = style.figure(2.9)
    rng = np.random.default_rng(0)
    for k, family in enumerate(families):
        own = known[known["family"] == family]
        for shift, stage in ((-0.25, "before"), (0.0, "refitted"), (0.25, "after")):
            x = k + shift + rng.uniform(-0.08, 0.08, len(own))
            ax.plot(x, own[f"held_out_{stage}"], ".", ms=3, alpha=0.5, color=style.COLOUR[stage],
                    label=stage if k == 0 else None)  # fmt: skip
    ax.axhline(1, color="black", lw=0.7)
    ax.axhline(1.05, color="black", lw=0.7, ls=":")
    ax.set_yscale("log")
    ax.set_xticks(range(len(families)), [plain(f) for f in families], rotation=45, ha="right")
    ax.set_ylabel("held-out error / true model's")
    ax.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.0, markerscale=3)
    return fig


def nothing(reason: str) -> Figure:
    """A small figure that says why there is nothing to show."""
    fig, ax = style.figure(0.8)
    ax.set_axis_off()
    ax.text(0.5, 0.5, reason, ha="center", va="center", color=style.GREY, transform=ax.transAxes)
    return fig


_SMOOTHED_S = 0.2
"""Residuals are shown as means over this time: what is faster is noise of the derivatives."""


def _smoothed(time_s: np.ndarray, values: np.ndarray, over_s: float) -> np.ndarray:
    """Running mean (n,) over `over_s` seconds of evenly sampled values (n,)."""
    width = max(1, round(over_s / float(np.median(np.diff(time_s)))))
    kernel = np.ones(width)
    return np.convolve(values, kernel, "same") / np.convolve(np.ones(len(values)), kernel, "same")


def moments(left: Mapping[str, pd.DataFrame]) -> Figure:
    """Roll and pitch moment over time, measured less modelled, a column a set: believed vehicle, and with the names.

    Each table has `time_s`, `moment_x_before`, `moment_x_after` and the same of y (N m).
    """
    fig, axes = style.figure(3.1 if len(left) > 1 else 2.5, 2, len(left), sharey="row", squeeze=False)
    for column, (name, table) in enumerate(left.items()):
        time = table["time_s"].to_numpy() - table["time_s"].iloc[0]
        for row, channel in enumerate(("moment_x", "moment_y")):
            axis = axes[row, column]
            for stage, label in (("before", "as believed"), ("after", "with what was named")):
                values = 1000 * _smoothed(time, table[f"{channel}_{stage}"].to_numpy(), _SMOOTHED_S)
                axis.plot(time, values, color=style.COLOUR[stage], lw=0.9, label=label)
            axis.axhline(0.0, color=style.GREY, lw=0.6)
            symbol, _ = style.CHANNELS[channel]
            if not column:
                axis.set_ylabel(f"{symbol} (mN m)")
        if len(left) > 1:
            axes[0, column].set_title(name)
        axes[1, column].set_xlabel("time (s)")
    fig.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper right", ncols=2)
    return fig


def bench_error(traces: pd.DataFrame, channels: Sequence[str]) -> Figure:
    """Reading less reference of one run, means over a second, a row a channel: as believed and with the names."""
    fig, axes = style.figure(0.5 + 0.95 * len(channels), len(channels), 1, sharex=True, squeeze=False)
    for axis, channel in zip(axes[:, 0], channels, strict=True):
        part = traces[traces["channel"] == channel]
        time = part["time_s"].to_numpy()
        for stage, label in (("before", "as believed"), ("after", "with what was named")):
            axis.plot(
                time, _smoothed(time, part[stage].to_numpy(), 1.0), color=style.COLOUR[stage], lw=1.1, label=label
            )
        symbol, unit = style.CHANNELS[channel]
        axis.set_ylabel(f"{symbol} ({unit})")
    axes[-1, 0].set_xlabel("time (s)")
    fig.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper right", ncols=2)
    return fig
