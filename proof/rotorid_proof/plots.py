"""Figures of the proof: targets, confusion, power, held-out error against the oracle's, the next flight."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rotorid.report.plots import style
from rotorid_proof.next_flight import WITHIN
from rotorid_proof.show import in_words

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd
    from matplotlib.figure import Figure

FEWEST_CASES = 10
"""Cases behind each point of an effect's own power curve: with fewer it goes up and down by chance."""
LAST_COLUMNS = ("several", "a value", "nothing")


RATIO_ROWS = "oracle"
"""End of the ids of targets that are a ratio and no share."""


def targets(summary: pd.DataFrame, names: Mapping[str, str] | None = None) -> Figure:
    """Every row that has a target, its 95 % interval, and the stretch that the target allows.

    Above the shares, below the ratios of errors. Green: the target holds; red: it fails; grey: not refuted. A release
    is called by its commit in `names`.
    """
    rows = summary[(summary["at_least"].notna() | summary["at_most"].notna()) & summary["value"].notna()].iloc[::-1]
    ratio = rows["id"].str.endswith(RATIO_ROWS)
    shares, ratios = rows[~ratio], rows[ratio]
    heights = [max(len(shares), 1), max(len(ratios), 1)]
    fig, axes = style.figure(1.0 + 0.115 * sum(heights), rows=2, gridspec_kw={"height_ratios": heights})
    for ax, part, label in ((axes[0], shares, "share"), (axes[1], ratios, "error over the oracle's")):
        top = 1.0 if part is shares else 1.05 * max([1.05, *part["high_95"].dropna()])
        for k, row in enumerate(part.itertuples()):
            low = row.at_least if np.isfinite(row.at_least) else (0.0 if part is shares else 0.95)
            high = row.at_most if np.isfinite(row.at_most) else top
            ax.barh(k, high - low, left=low, height=0.8, color="#dcefe6", zorder=0)
            colour = {"holds": style.COLOUR["after"], "fails": style.COLOUR["before"]}.get(row.holds, style.GREY)
            ax.plot([row.low_95, row.high_95], [k, k], color=colour, lw=1.6)
            ax.plot(row.value, k, "o", color=colour, markersize=3)
        labels = [f"{in_words(r.what, names or {})} ({int(r.cases)})" for r in part.itertuples()]
        ax.set_yticks(range(len(part)), labels, fontsize=6)
        ax.set_ylim(-0.7, len(part) - 0.3)
        ax.set_xlabel(f"{label} (in brackets: cases)")
        ax.grid(axis="y", visible=False)
    axes[0].set_xlim(-0.02, 1.02)
    return fig


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


def next_flight(rows: pd.DataFrame) -> Figure:
    """Separation predicted by the plan against that found in both sets together, and what became of the question.

    One point a set that was open and whose truth was among what was asked; bars: the interval that the plan stated.
    """
    number = {
        n: rows[n].astype(float) for n in ("predicted_sigma", "predicted_low", "predicted_high", "measured_sigma")
    }
    rows = rows.assign(**number).dropna(subset=["predicted_sigma", "measured_sigma"])
    if rows.empty:
        return nothing("No planned flight in this proof.")
    fig, ax = style.figure(3.2)
    most = 1.3 * float(rows[["predicted_high", "measured_sigma"]].to_numpy().max())
    line = np.geomspace(0.5, most, 50)
    ax.fill_between(
        line, line / WITHIN, line * WITHIN, color="#dcefe6", zorder=0, label=f"within a factor of {WITHIN:g}"
    )
    colours = {"right": style.COLOUR["after"], "wrong": style.COLOUR["before"], "open": style.GREY}
    words = {"right": "settled rightly", "wrong": "settled wrongly", "open": "still open"}
    for outcome, own in rows.groupby("outcome"):
        at = own["predicted_sigma"].clip(lower=0.5), own["measured_sigma"].clip(lower=0.5)
        low, high = own["predicted_low"].clip(lower=0.5, upper=at[0]), own["predicted_high"].clip(lower=at[0])
        colour = colours.get(outcome, style.GREY)
        ax.errorbar(
            *at, xerr=[at[0] - low, high - at[0]], fmt="o", color=colour, lw=0.8, label=words.get(outcome, outcome)
        )
    ax.set(xscale="log", yscale="log", xlim=(0.5, most), ylim=(0.4, most))
    ax.set_xlabel("predicted separation [standard errors]")
    ax.set_ylabel("found [standard errors; 0.5: or less]")
    ax.legend(loc="upper left")
    return fig


def nothing(reason: str) -> Figure:
    """A small figure that says why there is nothing to show."""
    fig, ax = style.figure(0.8)
    ax.set_axis_off()
    ax.text(0.5, 0.5, reason, ha="center", va="center", color=style.GREY, transform=ax.transAxes)
    return fig
