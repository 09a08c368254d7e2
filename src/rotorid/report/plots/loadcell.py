"""Figures of the load-cell calibration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from rotorid.report.plots import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def lines_and_residuals(
    weights_gf: Sequence[float],
    readings: Mapping[str, Sequence[float]],
    lines: Mapping[str, tuple[float, float]],
    flagged_gf: Mapping[str, Sequence[float]],
) -> Figure:
    """Calibration lines of all cells, and below them what the lines leave over.

    Parameters
    ----------
    weights_gf
        Known weights [gf], shape (n,).
    readings
        Reading of each cell [1e-5 V], shape (n,) each.
    lines
        Intercept [gf] and slope [gf per 1e-5 V] of each cell.
    flagged_gf
        Weights [gf] of each cell whose readings do not match them; drawn as crosses.
    """
    weights = np.asarray(weights_gf, float)
    fig, (above, below) = style.figure(4.6, rows=2, gridspec_kw={"height_ratios": [1.6, 1]})
    for colour, (cell, values) in zip(style.CYCLE, readings.items(), strict=False):
        reading = np.asarray(values, float)
        a0, a1 = lines[cell]
        ends = np.array([0.0, reading.max() * 1.04])
        above.plot(ends, a0 + a1 * ends, color=colour, linewidth=0.8)
        above.plot(reading, weights, "o", color=colour, label=f"cell {cell}")
        residual = weights - (a0 + a1 * reading)
        below.plot(weights, residual, "o-", color=colour, linewidth=0.7)
        wrong = np.isin(weights, flagged_gf[cell])
        below.plot(weights[wrong], residual[wrong], "x", color=style.RED, markersize=8)
    above.set(xlabel=r"reading ($10^{-5}$ V)", ylabel="weight (gf)", xlim=(0, None), ylim=(0, None))
    above.legend(ncols=2, loc="upper left")
    below.axhline(0, color=style.BLACK, linewidth=0.7)
    below.set(xlabel="weight (gf)", ylabel="residual (gf)", xlim=(0, None))
    return fig


def against_printed(
    cells: Sequence[str],
    estimates: Mapping[str, Sequence[float]],
    intervals: Mapping[str, Sequence[Sequence[float]]],
    printed: Mapping[str, Sequence[float]],
) -> Figure:
    """Coefficients with 95 % intervals as differences from printed ones.

    Parameters
    ----------
    cells
        Names of the cells, k of them.
    estimates, printed
        Values of `a0` [gf] and `a1` [gf per 1e-5 V], shape (k,) each.
    intervals
        95 % intervals of the same, shape (k, 2) each.
    """
    fig, axes = style.figure(2.5, columns=2, sharey=True)
    places = np.arange(len(cells))
    labels = {"a0": r"$a_0$ minus table (gf)", "a1": r"$a_1$ minus table (gf per $10^{-5}$ V)"}
    for panel, (name, label) in zip(axes, labels.items(), strict=True):
        base = np.asarray(printed[name], float)
        middle = np.asarray(estimates[name], float) - base
        ends = np.asarray(intervals[name], float) - base[:, None]
        panel.axvline(0, color=style.COLOUR["reference"], linewidth=1.2)
        panel.hlines(places, ends[:, 0], ends[:, 1], color=style.COLOUR["after"])
        panel.plot(middle, places, "o", color=style.COLOUR["after"])
        panel.set_xlabel(label)
        panel.locator_params(axis="x", nbins=5)
    axes[0].set_yticks(places, [f"cell {cell}" for cell in cells])
    axes[0].invert_yaxis()
    return fig
