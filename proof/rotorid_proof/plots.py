"""Figures of the proof: confusion, power, held-out error against the oracle's."""

from __future__ import annotations

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
