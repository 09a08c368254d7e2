"""Figures of public recordings: the NeuroBEM flights' residuals, and the coefficients of rotors on a thrust stand."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from rotorid.report.plots import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def residual_against_airspeed(bins: pd.DataFrame, points: pd.DataFrame) -> Figure:
    """Residual of each channel against airspeed: samples of the rigid body, its RMS and NeuroBEM's.

    `bins`: columns `model`, `channel`, `airspeed_low_m_s`, `airspeed_high_m_s`, `rms`, `low_95`, `high_95`. `points`:
    columns `airspeed_m_s` and the six channels: residual of the rigid body (N, N m).
    """
    fig, axes = style.figure(4.6, rows=2, columns=3, sharex=True)
    for axis, (channel, (label, unit)) in zip(axes.flat, style.CHANNELS.items(), strict=True):
        size = points[channel].abs()
        axis.plot(points["airspeed_m_s"], size, ".", markersize=1.6, color="#bbbbbb", rasterized=True, zorder=0)
        for model, colour, name in (
            ("rigid_body", style.COLOUR["before"], "rigid body, RMS"),
            ("neurobem", style.COLOUR["after"], "NeuroBEM, RMS"),
        ):
            part = bins[(bins["model"] == model) & (bins["channel"] == channel)]
            middle = (part["airspeed_low_m_s"] + part["airspeed_high_m_s"]) / 2
            axis.fill_between(middle, part["low_95"], part["high_95"], color=colour, alpha=0.25, linewidth=0)
            axis.plot(middle, part["rms"], "o-", color=colour, label=name)
        mine = bins[bins["channel"] == channel]
        axis.set_ylim(0, 1.15 * max(mine["high_95"].max(), size.quantile(0.99)))
        axis.set_xlim(0, None)
        axis.set_ylabel(f"residual of {label} ({unit})")
    style.label_outer(axes, "airspeed (m/s)")
    fig.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return fig


def rmse_of_flights(flights: pd.DataFrame) -> Figure:
    """RMSE of force and moment of each flight: rigid body, NeuroBEM, NeuroBEM with its paper's mass.

    `flights`: columns `flight`, `model`, `force`, `moment`.
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
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return fig


def apparent_coefficient(points: pd.DataFrame, pooled: dict[str, dict], names: dict[str, str]) -> Figure:
    """F/ω² of every steady point against rotor speed, one panel a propeller, with the two pooled forms.

    `points`: columns `propeller`, `run`, `speed_rad_s`, `thrust_n`, `used`. `pooled`: per propeller the C_F through the
    origin, the C_F with offset and the mean offset (N), keys `origin`, `offset`, `mean_offset_n`. `names`: heading of
    each panel.
    """
    fig, axes = style.figure(4.2, rows=2, columns=2, sharex=True)
    for axis, (propeller, fits) in zip(axes.flat, pooled.items(), strict=False):
        mine = points[(points["propeller"] == propeller) & points["used"]]
        for cells, colour in (("2s", style.BLUE), ("3s", style.ORANGE)):
            part = mine[mine["run"].str.endswith(cells)]
            axis.plot(
                part["speed_rad_s"],
                1e6 * part["thrust_n"] / part["speed_rad_s"] ** 2,
                "o",
                markersize=2.2,
                color=colour,
                label={"2s": "7.4 V", "3s": "11.1 V"}[cells],
            )
        speed = np.linspace(300, mine["speed_rad_s"].max(), 200)
        axis.axhline(1e6 * fits["origin"], color=style.BLACK, label="through the origin")
        bent = 1e6 * (fits["offset"] + fits["mean_offset_n"] / speed**2)
        axis.plot(speed, bent, color=style.RED, linestyle="--", label="with offset")
        axis.set_title(names[propeller])
        axis.set_ylim(0.45 * 1e6 * fits["origin"], 1.3 * 1e6 * fits["origin"])
    style.label_outer(axes, "rotor speed (rad/s)", r"$F/\omega^2$ ($10^{-6}$ N s²)")
    axes[1, 0].legend(loc="lower right", ncols=2, markerscale=2)
    return fig


def motors(table: pd.DataFrame, pooled: dict[str, dict], names: dict[str, str]) -> Figure:
    """C_F of each motor with its interval, and the pooled value with its own; one column a propeller.

    `table`: columns `propeller`, `motor`, `form`, `c_f_n_s2`, `low_95_n_s2`, `high_95_n_s2`, `outlying`. `pooled`: per
    propeller and form: `value`, `interval_95`, `prediction_95` (N s²). `names`: heading of each panel.
    """
    fig, axes = style.figure(2.5, columns=len(names), sharey=True)
    letters = sorted(table["motor"].unique())
    for axis, propeller in zip(np.atleast_1d(axes), names, strict=True):
        for form, colour, shift in (("origin", style.BLACK, -0.15), ("offset", style.RED, 0.15)):
            part = table[(table["propeller"] == propeller) & (table["form"] == form)]
            place = np.array([letters.index(m) for m in part["motor"]]) + shift
            centre = 1e6 * part["c_f_n_s2"].to_numpy()
            ends = 1e6 * part[["low_95_n_s2", "high_95_n_s2"]].to_numpy()
            axis.hlines(place, ends[:, 0], ends[:, 1], color=colour, linewidth=0.9)
            label = {"origin": "through the origin", "offset": "with offset"}[form]
            axis.plot(centre, place, "o", markersize=3, color=colour, label=label)
            outlying = (part["outlying"] == "yes").to_numpy()
            axis.plot(centre[outlying], place[outlying], "o", markersize=8, mfc="none", color=colour)
            low, high = (1e6 * v for v in pooled[propeller][form]["interval_95"])
            axis.axvspan(low, high, color=colour, alpha=0.15, linewidth=0)
        axis.set_title(names[propeller], fontsize=8.5)
        axis.set_xlabel(r"$C_F$ ($10^{-6}$ N s²)")
        axis.set_yticks(range(len(letters)), letters)
    axes = np.atleast_1d(axes)
    axes[0].set_ylabel("motor")
    axes[0].set_ylim(len(letters) - 0.5, -0.5)
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return fig
