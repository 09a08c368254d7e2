"""Pictures of how the effects of the catalogue show, drawn from their own equations."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from rotorid.report.plots import style
from rotorid.report.plots.signature import Signature

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def signature_figure(shown: Signature) -> Figure:
    """The signature of an effect: points over what it hangs on, or lines with and without it over time."""
    if shown.layouts is not None:
        figure, axes = style.figure(2.4, 1, 2)
        for axis, rotors, title in zip(axes, shown.layouts, ("as it is", "as vehicle.yaml says"), strict=True):
            _draw_rotors(axis, rotors, title)
        return figure
    figure, axis = style.figure(2.1)
    if shown.without is not None:
        axis.plot(shown.x, shown.without, color=style.COLOUR["noise"], label="without")
        axis.plot(shown.x, shown.y, color=style.COLOUR["model"], label="with")
        axis.legend()
    elif shown.over.startswith("time"):
        axis.plot(shown.x, shown.y, color=style.COLOUR["model"])
    else:
        axis.plot(shown.x, shown.y, ".", markersize=1.5, color=style.COLOUR["model"], rasterized=True)
    axis.set_xlabel(shown.over)
    axis.set_ylabel(shown.shows)
    if np.ptp(shown.y) == 0:
        middle = float(shown.y[0]) if len(shown.y) else 0.0
        axis.set_ylim(min(0.0, 2 * middle), max(0.0, 2 * middle))
    return figure


def _draw_rotors(axis, rotors, title: str) -> None:
    for number, rotor in enumerate(rotors, 1):
        colour = style.COLOUR["x"] if rotor.spin == "ccw" else style.COLOUR["y"]
        axis.plot(rotor.y_m, rotor.x_m, "o", markersize=22, markerfacecolor="none", color=colour)
        axis.annotate(f"{number}\n{rotor.spin}", (rotor.y_m, rotor.x_m), ha="center", va="center", fontsize=7.5)
    axis.set_aspect("equal")
    axis.margins(0.35)
    axis.set_title(f"{title}, seen from above")
    axis.set_xlabel("y, to the right (m)")
    axis.set_ylabel("x, forward (m)")
