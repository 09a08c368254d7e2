"""Figures of the NeuroBEM flights' residuals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pandas as pd

from rotorid.report.plots import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

CHANNELS = ("force_x", "force_y", "force_z", "moment_x", "moment_y", "moment_z")
_LABEL = {
    "force_x": "$F_x$ (N)",
    "force_y": "$F_y$ (N)",
    "force_z": "$F_z$ (N)",
    "moment_x": "$M_x$ (N m)",
    "moment_y": "$M_y$ (N m)",
    "moment_z": "$M_z$ (N m)",
}


def residual_against_airspeed(bins: pd.DataFrame, points: pd.DataFrame) -> Figure:
    """Residual of each channel against airspeed: samples of the rigid body, its RMS and NeuroBEM's.

    Parameters
    ----------
    bins
        Columns `model`, `channel`, `airspeed_low_m_s`, `airspeed_high_m_s`, `rms`, `low_95`, `high_95`.
    points
        Columns `airspeed_m_s` and the six channels: residual of the rigid body (N, N m).
    """
    fig, axes = style.figure(4.6, rows=2, columns=3, sharex=True)
    for axis, channel in zip(axes.flat, CHANNELS, strict=True):
        size = points[channel].abs()
        axis.plot(points["airspeed_m_s"], size, ".", markersize=1.6, color="#bbbbbb", rasterized=True, zorder=0)
        for model, colour, label in (
            ("rigid_body", style.COLOUR["before"], "rigid body, RMS"),
            ("neurobem", style.COLOUR["after"], "NeuroBEM, RMS"),
        ):
            part = bins[(bins["model"] == model) & (bins["channel"] == channel)]
            middle = (part["airspeed_low_m_s"] + part["airspeed_high_m_s"]) / 2
            axis.fill_between(middle, part["low_95"], part["high_95"], color=colour, alpha=0.25, linewidth=0)
            axis.plot(middle, part["rms"], "o-", color=colour, label=label)
        mine = bins[bins["channel"] == channel]
        axis.set_ylim(0, 1.15 * max(mine["high_95"].max(), size.quantile(0.99)))
        axis.set_xlim(0, None)
        axis.set_ylabel(f"residual of {_LABEL[channel]}")
    for axis in axes[-1]:
        axis.set_xlabel("airspeed (m/s)")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    fig.legend(handles, labels, loc="outside upper center", ncols=2)
    return fig


def rmse_of_flights(flights: pd.DataFrame) -> Figure:
    """RMSE of force and moment of each flight: rigid body, NeuroBEM, NeuroBEM with its paper's mass.

    Parameters
    ----------
    flights
        Columns `flight`, `model`, `force`, `moment`.
    """
    fig, axes = style.figure(2.4, columns=2)
    names = list(dict.fromkeys(flights["flight"]))
    models = (
        ("rigid_body", "rigid body", style.COLOUR["before"]),
        ("neurobem", "NeuroBEM", style.COLOUR["after"]),
        ("neurobem_paper_mass", "NeuroBEM, its paper's mass", style.SKY),
    )
    for axis, (total, unit) in zip(axes, (("force", "N"), ("moment", "N m")), strict=True):
        for shift, (model, label, colour) in enumerate(models):
            part = flights[flights["model"] == model].set_index("flight").loc[names, total]
            places = [n + 0.27 * (shift - 1) for n in range(len(names))]
            axis.bar(places, part, width=0.25, color=colour, label=label)
        axis.set_xticks(range(len(names)), [str(n + 1) for n in range(len(names))])
        axis.set_xlabel("flight")
        axis.set_ylabel(f"RMSE of the {total} ({unit})")
        axis.grid(axis="x", visible=False)
    handles, labels = axes[0].get_legend_handles_labels()
    fig.legend(handles, labels, loc="outside lower center", ncols=3)
    return fig
