"""Figures of the grey box: networks by epoch, identifiability, excitation, errors, validation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from rotorid.report.plots import style

if TYPE_CHECKING:
    from collections.abc import Iterable

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_NAMES = {"c_f": ("thrust", "N", 1.0), "c_q": ("torque", "mN m", 1000.0)}


def rotor_networks(points: dict[str, pd.DataFrame], history: pd.DataFrame, fits: dict) -> Figure:
    """Error by epoch and the network's curve with the tests, thrust and torque (figures 4.18, 4.19)."""
    fig, axes = style.figure(4.4, 2, 2)
    for row, (key, (label, unit, scale)) in enumerate(_NAMES.items()):
        if key not in fits:
            _not_recorded(axes[row], label)
            continue
        mine = history[history["coefficient"] == key]
        axes[row, 0].loglog(mine["epoch"] + 1, mine["mse"], color=style.COLOUR["model"])
        axes[row, 0].set_ylabel(f"{label}: scaled MSE")
        tests = points[key]
        fine = np.linspace(0, tests["speed_rad_s"].max(), 200)
        axes[row, 1].plot(fine, scale * fits[key]["network"] * fine**2, color=style.COLOUR["model"], label="network")
        axes[row, 1].plot(
            tests["speed_rad_s"],
            scale * tests["value"],
            "o",
            color=style.COLOUR["measured"],
            label="tests",
            markersize=3,
        )
        axes[row, 1].set_ylabel(f"{label} ({unit})")
    axes[0, 1].legend(loc="upper left")
    axes[1, 0].set_xlabel("epoch")
    axes[1, 1].set_xlabel("rotor speed (rad/s)")
    return fig


def _not_recorded(axes: Iterable[Axes], label: str) -> None:
    """Empty axes that say why."""
    for axis in axes:
        axis.text(0.5, 0.5, f"no {label} tests recorded", ha="center", va="center", transform=axis.transAxes)
        axis.set_axis_off()


def hidden_sizes(sizes: pd.DataFrame) -> Figure:
    """Median error by epoch for several sizes of the hidden layer (figure 4.20)."""
    fig, axes = style.figure(2.6, 1, 2)
    for axis, (key, (label, _, _)) in zip(axes, _NAMES.items(), strict=True):
        if not (sizes["coefficient"] == key).any():
            _not_recorded([axis], label)
            continue
        for colour, (size, part) in zip(
            style.CYCLE, sizes[sizes["coefficient"] == key].groupby("hidden"), strict=False
        ):
            axis.loglog(part["epoch"] + 1, part["mse"], color=colour, label=f"{size}")
        axis.set_title(label)
        axis.set_xlabel("epoch")
    axes[0].set_ylabel("scaled MSE")
    axes[1].legend(title="hidden nodes", loc="lower left")
    return fig


def inertia_training(history: pd.DataFrame, fits: dict) -> Figure:
    """Error by epoch (figure 4.22) and, right, trained gyroscopic weights next to what their inertias imply."""
    fig, axes = style.figure(2.9, 1, 2)
    for colour, rate in zip(style.AXIS_COLOURS, "pqr", strict=True):
        axes[0].loglog(history["epoch"] + 1, history[rate], color=colour, label=rf"$\dot {rate}$")
        axes[0].loglog(history["epoch"] + 1, history[f"{rate}_scaled"], color=colour, linestyle="--")
    axes[0].set_xlabel("epoch")
    axes[0].set_ylabel(r"MSE ($\mathrm{rad^2/s^4}$)")
    axes[0].legend()
    place = np.arange(3)
    found = (
        ("thesis, trained", fits["thesis"][:3], style.ORANGE, "s"),
        ("network here, scaled", fits["network"][:3], style.BLUE, "o"),
        ("truth", fits["truth"][:3], style.BLACK, "_"),
    )
    for shift, (label, values, colour, mark) in zip((-0.2, 0.0, 0.2), found, strict=True):
        sigma = fits["same_samples"]["sigma"][:3] if "here" in label else None
        error = None if sigma is None else 1.96 * np.array(sigma)
        axes[1].errorbar(
            place + shift, values, error, fmt=mark, color=colour, label=label, markersize=6, capsize=2, linestyle="none"
        )
    axes[1].set_xticks(place, ["$w_{11}$", "$w_{22}$", "$w_{33}$"])
    axes[1].set_ylabel("gyroscopic weight")
    axes[1].legend()
    return fig


def identifiability(promises: pd.DataFrame) -> Figure:
    """Standard error of each weight that ten seconds of a manoeuvre allow; the lower the better."""
    fig, axes = style.figure(2.9, 1, 2)
    groups = (
        (("w11", "w22", "w33"), "gyroscopic weights (absolute)", 1.0),
        (("w14", "w25", "w36"), "torque weights (%)", 100.0),
    )
    labels = dict(w11="$w_{11}$", w22="$w_{22}$", w33="$w_{33}$", w14="$1/J_{xx}$", w25="$1/J_{yy}$", w36="$1/J_{zz}$")
    for axis, (weights, title, scale) in zip(axes, groups, strict=True):
        for number, (name, part) in enumerate(promises.groupby("manoeuvre", sort=False)):
            values = part.set_index("weight").loc[list(weights), "standard_error"] * scale
            axis.bar(np.arange(3) + 0.27 * (number - 1), values, 0.25, color=style.CYCLE[number], label=name)
        axis.set_yscale("log")
        axis.set_xticks(range(3), [labels[w] for w in weights])
        axis.set_title(title)
    axes[0].set_ylabel("standard error")
    handles, names = axes[0].get_legend_handles_labels()
    fig.legend(handles, names, loc="outside lower center", ncols=3)
    return fig


def excitation(traces: pd.DataFrame) -> Figure:
    """Moments and body rates of the designed manoeuvre."""
    fig, axes = style.figure(3.4, 2, 1, sharex=True)
    for colour, axis, label in zip(style.AXIS_COLOURS, "xyz", ("roll", "pitch", "yaw"), strict=True):
        axes[0].plot(traces["time_s"], 1000 * traces[f"moment_{axis}_n_m"], color=colour, label=label, linewidth=0.7)
        axes[1].plot(traces["time_s"], traces[f"angular_velocity_{axis}_rad_s"], color=colour, linewidth=0.7)
    axes[0].set_ylabel("moment (mN m)")
    axes[1].set_ylabel("body rate (rad/s)")
    axes[1].set_xlabel("time (s)")
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return fig


def errors(draws: pd.DataFrame, thesis_percent: list[float], network_percent: list[float]) -> Figure:
    """Error of each inertia: every draw of the noise with its interval; the thesis's and the network's next to it."""
    fig, axes = style.figure(2.7, 1, 3, sharey=True)
    for k, (axis, name) in enumerate(zip(axes, ("xx", "yy", "zz"), strict=True)):
        axis.axhspan(-0.2, 0.2, color="#e6f2ea")
        axis.errorbar(
            draws["draw"],
            draws[f"{name}_error_percent"],
            draws[f"{name}_half_width_percent"],
            fmt="o",
            color=style.COLOUR["after"],
            markersize=3,
            linewidth=0.7,
            label="output error, designed flight",
        )
        axis.axhline(thesis_percent[k], color=style.ORANGE, linestyle="--", label="thesis (table 4.3)")
        axis.axhline(network_percent[k], color=style.RED, linestyle=":", label="network, thesis's manoeuvre")
        axis.set_yscale("symlog", linthresh=0.5)
        axis.set_yticks([-3, -1, -0.2, 0, 0.2, 1, 3], ["-3", "-1", "-0.2", "0", "0.2", "1", "3"])
        axis.set_title(f"$J_{{{name}}}$")
        axis.set_xlabel("flight")
    axes[0].set_ylabel("error (%)")
    handles, names = axes[0].get_legend_handles_labels()
    fig.legend(handles, names, loc="outside lower center", ncols=3)
    return fig


def accelerations(traces: pd.DataFrame) -> Figure:
    """Angular accelerations of white and grey boxes on eq. 4.81 (figure 4.23), their differences below."""
    fig, axes = style.figure(4.2, 2, 3, sharex=True, height_ratios=(1.4, 1))
    time = traces["time_s"].to_numpy()
    late = time >= 0.05
    for column, rate in enumerate("pqr"):
        white = traces[f"white_{rate}_rad_s2"]
        axes[0, column].plot(time[late], white[late], color=style.BLACK, label="white box", linewidth=0.9)
        for name, label, colour, line in (
            ("thesis_grey", "thesis's grey box", style.ORANGE, "--"),
            ("improved_grey", "improved grey box", style.BLUE, ":"),
        ):
            values = traces[f"{name}_{rate}_rad_s2"]
            axes[0, column].plot(time[late], values[late], color=colour, linestyle=line, label=label)
            axes[1, column].plot(time[late], (values - white)[late], color=colour, linewidth=0.9)
        axes[0, column].set_title(rf"$\dot {rate}$")
        axes[1, column].set_xlabel("time (s)")
    axes[0, 0].set_ylabel("acceleration (rad/s²)")
    axes[1, 0].set_ylabel("less white box (rad/s²)")
    handles, names = axes[0, 0].get_legend_handles_labels()
    fig.legend(handles, names, loc="outside lower center", ncols=3)
    return fig
