"""Figures of the stand: clocks, one experiment, steady wrenches, weight under tilt, rotor characteristics."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from rotorid.report.plots import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

WRENCH = ("force_x_n", "force_y_n", "force_z_n", "moment_x_n_m", "moment_y_n_m", "moment_z_n_m")
_NAMES = ("$F_x$", "$F_y$", "$F_z$", "$M_x$", "$M_y$", "$M_z$")


def clocks(arrivals: Mapping[str, pd.DataFrame], table: pd.DataFrame) -> Figure:
    """When samples arrived against when they were taken, and the clocks' offset of every experiment.

    `arrivals` holds for each device of one experiment `time_s` and `host_time_s`; `table` is that of the clocks.
    """
    fig, (left, right) = style.figure(2.7, columns=2)
    for (device, samples), colour in zip(arrivals.items(), (style.BLUE, style.ORANGE), strict=False):
        late = samples["host_time_s"] - samples["time_s"]
        late = 1e3 * (late - late.min())
        left.plot(samples["time_s"], late, ".", color=colour, markersize=2, label=device, rasterized=True)
    left.set(xlabel="device time (s)", ylabel="arrival after the earliest (ms)")
    left.legend(loc="upper right", markerscale=4)
    for sine, colour, label in ((False, style.BLACK, "trapezoids"), (True, style.RED, "sines")):
        part = table[table["sine"] == sine]
        right.errorbar(
            part["experiment"],
            1e3 * part["offset_s"],
            1.96e3 * part["offset_error_s"],
            fmt="o",
            color=colour,
            markersize=2.5,
            linewidth=0.8,
            label=label,
        )
    right.set(xlabel="experiment", ylabel="offset left by arrivals (ms)")
    right.legend(loc="lower right")
    return fig


def experiment(run: pd.DataFrame, start_s: float, stop_s: float) -> Figure:
    """One experiment (fig. 3.21): throttles, forces and moments; shaded: what the mean is taken of."""
    fig, axes = style.figure(3.7, 3, 1, sharex=True)
    time_s = run["time_s"].to_numpy()
    for colour, number in zip(style.CYCLE, (1, 2, 3, 4), strict=False):
        axes[0].plot(time_s, 100 * run[f"throttle_{number}"], color=colour, label=f"motor {number}", linewidth=0.9)
    for axis, names, scale in ((axes[1], WRENCH[:3], 1.0), (axes[2], WRENCH[3:], 1e3)):
        for letter, name in zip("xyz", names, strict=True):
            values = scale * run[name].to_numpy()
            kept = style.thin(values, 700)
            axis.plot(time_s[kept], values[kept], color=style.COLOUR[letter], linewidth=0.6, label=letter)
    for axis, label in zip(axes, ("throttle (%)", "force (N)", "moment (mN m)"), strict=True):
        axis.axvspan(start_s, stop_s, color=style.GREY, alpha=0.15, linewidth=0)
        axis.set_ylabel(label)
        axis.legend(loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=4, borderaxespad=0.0)
    axes[-1].set_xlabel("time (s)")
    return fig


def steady(table: pd.DataFrame) -> Figure:
    """Steady wrench of the 48 experiments: measured with 95 % intervals, and what the believed vehicle gives."""
    fig, axes = style.figure(3.7, 3, 2, sharex=True)
    for k, (name, label) in enumerate(zip(WRENCH, _NAMES, strict=True)):
        axis = axes[k % 3, k // 3]
        scale = 1.0 if k < 3 else 1e3
        axis.plot(
            table["experiment"],
            scale * table[f"{name}_model"],
            "_",
            color=style.COLOUR["model"],
            markersize=6,
            label="believed vehicle",
        )
        axis.errorbar(
            table["experiment"],
            scale * table[name],
            scale * table[f"{name}_half_95"],
            fmt="o",
            color=style.COLOUR["measured"],
            markersize=2,
            linewidth=0.8,
            label="measured",
        )
        axis.set_ylabel(f"{label} ({'N' if k < 3 else 'mN m'})")
    for axis in axes[-1]:
        axis.set_xlabel("experiment")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    fig.legend(handles, labels, loc="outside lower center", ncols=2)
    return fig


def weight(table: pd.DataFrame) -> Figure:
    """Moments of the weight at rest: measured, of the believed centre of mass, of the fitted one."""
    fig, axes = style.figure(2.8, columns=2)
    for axis, name, label in zip(axes, WRENCH[3:5], _NAMES[3:5], strict=True):
        measured = 1e3 * table[f"{name}_rest"]
        for kind, colour, marker, what in (
            ("believed", style.RED, "x", "believed centre of mass"),
            ("fitted", style.BLUE, "o", "fitted centre of mass"),
        ):
            values = 1e3 * table[f"{name}_rest_{kind}"]
            axis.plot(measured, values, marker, color=colour, markersize=4, mfc="none", label=what)
        ends = np.array([measured.min(), measured.max()])
        axis.plot(ends, ends, color=style.BLACK, linewidth=0.7)
        axis.set(xlabel=f"{label} measured at rest (mN m)", ylabel=f"{label} of the weight (mN m)")
    axes[0].legend(loc="upper left")
    return fig


def characteristic(thrust: pd.DataFrame, torque: pd.DataFrame, laws: Mapping, curve: pd.DataFrame) -> Figure:
    """Thrust and torque against speed (fig. 3.22) and speed against throttle.

    `curve` has `throttle` and `speed_rad_s`, the law of throttle at the mean voltage.
    """
    fig, axes = style.figure(2.7, columns=3)
    for axis, points, fit, scale, label in (
        (axes[0], thrust, laws["c_f"], 1.0, "thrust (N)"),
        (axes[1], torque, laws["c_q"], 1e3, "torque (mN m)"),
    ):
        fine = np.linspace(0, points["speed_rad_s"].max(), 200)
        axis.plot(fine, scale * fit["value"] * fine**2, color=style.COLOUR["model"])
        axis.plot(points["speed_rad_s"], scale * points["value"], "o", color=style.COLOUR["measured"], markersize=2.5)
        axis.set(xlabel="rotor speed (rad/s)", ylabel=label)
    axes[2].plot(100 * curve["throttle"], curve["speed_rad_s"], color=style.COLOUR["model"], label="law, mean voltage")
    for points, marker, label in ((thrust, "o", "thrust tests"), (torque, "^", "torque tests")):
        axes[2].plot(100 * points["throttle"], points["speed_rad_s"], marker, markersize=2.5, label=label, mfc="none")
    axes[2].set(xlabel="throttle (%)", ylabel="rotor speed (rad/s)")
    axes[2].legend(loc="lower right")
    return fig
