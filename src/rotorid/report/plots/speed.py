"""Figure of the chapter on speed: how time and memory grow with the recording."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pandas as pd

from rotorid.report.plots import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def growth(table: pd.DataFrame) -> Figure:
    """Processor time (s) and peak memory (MB) of an analysis against recorded samples; columns `samples`, `analysis_s`
    and `memory_mb`."""
    fig, axes = style.figure(2.6, 1, 2)
    for axis, column, label in zip(
        axes, ("analysis_s", "memory_mb"), ("analysis (s of one core)", "peak memory (MB)"), strict=True
    ):
        axis.loglog(table["samples"], table[column], "o-", color=style.BLUE)
        axis.set_xlabel("samples")
        axis.set_ylabel(label)
    return fig
