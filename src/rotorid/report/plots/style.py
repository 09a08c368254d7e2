"""One look for every figure: sizes, fonts, a colour per quantity, and the same bytes in every run."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

TEXT_WIDTH_IN = 6.3
"""Width of the report's text [in]; a figure of this width is printed at its own size."""

# Okabe and Ito's palette, legible to colour-blind readers.
BLACK, ORANGE, SKY, GREEN, _YELLOW, BLUE, RED, _PURPLE = (
    "#000000",
    "#e69f00",
    "#56b4e9",
    "#009e73",
    "#f0e442",
    "#0072b2",
    "#d55e00",
    "#cc79a7",
)
GREY = "#7f7f7f"

COLOUR = {
    "measured": BLACK,
    "model": RED,
    "before": RED,
    "refitted": ORANGE,
    "after": BLUE,
    "noise": GREY,
    "reference": GREEN,
    "x": BLUE,
    "y": ORANGE,
    "z": GREEN,
}
"""Colour of a quantity, the same in every figure."""
AXIS_COLOURS = tuple(COLOUR[axis] for axis in "xyz")

CHANNELS = {
    **{f"force_{axis}": (f"$F_{axis}$", "N") for axis in "xyz"},
    **{f"moment_{axis}": (f"$M_{axis}$", "N m") for axis in "xyz"},
}
"""Symbol and unit of each force and moment."""
WRENCH = {f"{name}_{unit.replace(' ', '_').lower()}": (symbol, unit) for name, (symbol, unit) in CHANNELS.items()}
"""The same by the columns that hold them: `force_x_n` to `moment_z_n_m`."""

CYCLE = (BLUE, RED, GREEN, ORANGE, _PURPLE, SKY, BLACK, _YELLOW)
"""Colours in order for things without a fixed one (cells, motors, flights)."""

_RC = {
    "figure.constrained_layout.use": True,
    "figure.dpi": 110,
    "savefig.dpi": 220,
    "font.family": "STIXGeneral",
    "mathtext.fontset": "stix",
    "font.size": 9.5,
    "axes.titlesize": 9.5,
    "axes.labelsize": 9.5,
    "xtick.labelsize": 8.5,
    "ytick.labelsize": 8.5,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.linewidth": 0.7,
    "axes.grid": True,
    "grid.color": "#dddddd",
    "grid.linewidth": 0.5,
    "axes.axisbelow": True,
    "lines.linewidth": 1.1,
    "lines.markersize": 4,
    "xtick.major.width": 0.7,
    "ytick.major.width": 0.7,
    "axes.unicode_minus": True,
    "svg.hashsalt": "rotorid",
    "svg.fonttype": "path",
}


def use() -> None:
    """Make this look the default of matplotlib for the running program."""
    import matplotlib
    from cycler import cycler

    matplotlib.rcParams.update(_RC)
    matplotlib.rcParams["axes.prop_cycle"] = cycler(color=CYCLE)


def figure(height_in: float, rows: int = 1, columns: int = 1, **subplots: Any) -> tuple[Figure, Any]:
    """A figure as wide as the text with its axes, in the project's look.

    `height_in`: height [in]. `rows`, `columns`: number of axes down and across. `subplots`: passed on to
    `matplotlib.pyplot.subplots` (`sharex`, `squeeze`, ...).
    """
    import matplotlib.pyplot as plt

    use()
    return plt.subplots(rows, columns, figsize=(TEXT_WIDTH_IN, height_in), **subplots)


def label_outer(axes: np.ndarray, across: str, up: str = "") -> None:
    """Name what a grid of axes, shape (rows, columns), shares: on its lowest row and its first column."""
    for axis in axes[-1]:
        axis.set_xlabel(across)
    for axis in axes[:, 0] if up else ():
        axis.set_ylabel(up)


def save(fig: Figure, path: str | Path) -> None:
    """Write a figure without the date, so that the same data give the same bytes, and close it."""
    import matplotlib.pyplot as plt

    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    dated = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    fig.savefig(path, metadata=dated.get(path.suffix))
    plt.close(fig)


def show(thing: Figure | pd.DataFrame | str, path: str | Path, **csv: Any) -> None:
    """Save a chapter's figure (SVG) or table (CSV) and display it in the notebook whose cell calls this.

    A text is a figure that cannot be made: it says why. `csv`: passed on to `DataFrame.to_csv`.
    """
    from IPython.display import Image, display

    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    if isinstance(thing, str):
        placeholder(path, thing)
        display(thing)
    elif hasattr(thing, "to_csv"):
        thing.to_csv(path, index=False, **csv)
        display(thing)
    else:
        save(thing, path)
        # The saved file is large where it holds many points; a picture of it is what a page of a notebook carries.
        picture = io.BytesIO()
        thing.savefig(picture, format="png", dpi=110)
        display(Image(picture.getvalue()))


def placeholder(path: str | Path, reason: str) -> None:
    """Write a small figure that says why there is nothing to show."""
    fig, axes = figure(0.8)
    axes.set_axis_off()
    axes.text(0.5, 0.5, reason, ha="center", va="center", color=GREY, transform=axes.transAxes)
    save(fig, path)


def thin(values: np.ndarray, samples: int) -> np.ndarray:
    """Indices (k,), sorted, of about `samples` points that keep the envelope of a trace (n,), any unit.

    They are the smallest and the largest value of each of `samples / 2` equal stretches; a trace that is no longer than
    `samples` is kept whole.
    """
    values = np.asarray(values)
    if len(values) <= samples:
        return np.arange(len(values))
    edges = np.linspace(0, len(values), samples // 2 + 1).astype(int)
    kept = set()
    for start, stop in zip(edges[:-1], edges[1:], strict=True):
        stretch = values[start:stop]
        if np.all(np.isnan(stretch)):
            kept.add(int(start))
        else:
            kept.update((start + int(np.nanargmin(stretch)), start + int(np.nanargmax(stretch))))
    return np.array(sorted(kept))
