"""Figures of the bench (calibrations, static, dynamic and tensile tests), of the stand (clocks, one experiment,
steady wrenches, weight under tilt, rotor characteristics) and of public thrust stands (coefficients of rotors)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from rotorid.report.plots import style
from rotorid_lab.bench_tests import direction

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PLATFORM = {"al": "aluminium", "pla": "PLA", "jr3": "reference sensor"}
_PLATFORM_COLOUR = {"al": style.BLUE, "pla": style.ORANGE, "jr3": style.GREY}
_AXES = "xyz"
_WRENCH = tuple(style.WRENCH)


def reading(recording: pd.DataFrame, load_time_s: float, mean_from_s: float, mean_10uv: float) -> Figure:
    """One calibration recording: samples, both filters, and the mean that is kept (fig. 2.34).

    `recording` has `time_s`, `cell_v`, `cell_v_low_pass`, `cell_v_zero_phase`, V, tared.
    """
    fig, (whole, close) = style.figure(2.6, columns=2, gridspec_kw={"width_ratios": [1.5, 1]})
    time_s = recording["time_s"].to_numpy()
    for axis in (whole, close):
        axis.plot(time_s, 1e5 * recording["cell_v"], color=style.GREY, linewidth=0.7, label="samples")
        axis.plot(time_s, 1e5 * recording["cell_v_low_pass"], color=style.RED, label="first-order low-pass")
        axis.plot(time_s, 1e5 * recording["cell_v_zero_phase"], color=style.BLUE, label="zero-phase low-pass")
        axis.plot([mean_from_s, time_s[-1]], [mean_10uv] * 2, color=style.BLACK, linestyle="--", label="mean kept")
        axis.set_xlabel("time (s)")
    whole.set_ylabel(r"tared reading ($10^{-5}$ V)")
    close.set_xlim(load_time_s - 0.2, mean_from_s + 0.6)
    whole.legend(loc="lower right")
    return fig


def calibration(campaign: Sequence[Mapping], thesis: Sequence[Mapping]) -> Figure:
    """Coefficients of both calibrations with intervals, as differences from the thesis's table 2.8.

    Entries have `cell`, `a0_gf`, `a0_interval_95`, `a1_gf_per_10uv`, `a1_interval_95`; those of `thesis` also the
    printed `a0_printed_gf` and `a1_printed_gf_per_10uv`.
    """
    fig, axes = style.figure(2.7, columns=2, sharey=True)
    names = (
        ("a0_gf", "a0_interval_95", "a0_printed_gf", r"$a_0$ minus table 2.8 (gf)"),
        ("a1_gf_per_10uv", "a1_interval_95", "a1_printed_gf_per_10uv", r"$a_1$ minus table 2.8 (gf per $10^{-5}$ V)"),
    )
    for axis, (value, interval, printed, label) in zip(axes, names, strict=True):
        axis.axvline(0, color=style.COLOUR["reference"], linewidth=1.2)
        for entries, colour, shift, who in (
            (thesis, style.BLACK, -0.14, "thesis's tables (real)"),
            (campaign, style.BLUE, 0.14, "campaign (emulated)"),
        ):
            base = np.array([entry[printed] for entry in thesis])
            places = np.array([entry["cell"] for entry in entries]) + shift
            ends = np.array([entry[interval] for entry in entries]) - base[:, None]
            axis.hlines(places, ends[:, 0], ends[:, 1], color=colour)
            axis.plot(np.array([entry[value] for entry in entries]) - base, places, "o", color=colour, label=who)
        axis.set_xlabel(label)
        axis.locator_params(axis="x", nbins=5)
    axes[0].set_yticks(range(1, 7), [f"cell {i}" for i in range(1, 7)])
    axes[0].invert_yaxis()
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return fig


def calibration_residuals(readings: pd.DataFrame, cells: Sequence[Mapping]) -> Figure:
    """What each cell's line leaves of every campaign recording, against the weight; crosses where `flag` has a text."""
    fig, axes = style.figure(3.2, 2, 3, sharex=True, sharey=True)
    for axis, cell in zip(axes.flat, cells, strict=True):
        part = readings[readings["cell"] == cell["cell"]]
        left = part["weight_gf"] - (cell["a0_gf"] + cell["a1_gf_per_10uv"] * part["reading_10uv"])
        axis.plot(part["weight_gf"], left, "o", color=style.BLUE, markersize=3)
        wrong = part["flag"].notna()
        axis.plot(part["weight_gf"][wrong], left[wrong], "x", color=style.RED, markersize=8)
        axis.axhline(0, color=style.BLACK, linewidth=0.7)
        axis.set_title(f"cell {cell['cell']}")
    style.label_outer(axes, "weight (gf)", "residual (gf)")
    return fig


def static_z(loads: pd.DataFrame) -> Figure:
    """Three platforms along z: output against target, error against load (fig. 2.42)."""
    fig, (output, error) = style.figure(2.9, columns=2)
    own = loads[(loads["axis"] == "z") & loads["method"].isin(["equations", "sensor"])]
    largest = own["load_n"].max()
    output.plot([0, largest], [0, largest], color=style.BLACK, linewidth=0.7, label="target")
    for platform, label in PLATFORM.items():
        part = own[own["platform"] == platform].sort_values("load_n")
        colour = _PLATFORM_COLOUR[platform]
        output.plot(part["load_n"], part["load_n"] + part["error_n"], "o-", color=colour, label=label, linewidth=0.7)
        low, high = part["error_n"] - part["low_95_n"], part["high_95_n"] - part["error_n"]
        error.errorbar(part["load_n"], part["error_n"], (low, high), fmt="o-", color=colour, linewidth=0.7, capsize=2)
    error.axhline(0, color=style.BLACK, linewidth=0.7)
    output.set(xlabel="applied force (N)", ylabel="output (N)")
    error.set(xlabel="applied force (N)", ylabel="error (N)")
    output.legend()
    return fig


def static_axes(points: pd.DataFrame, series: pd.DataFrame) -> Figure:
    """Aluminium along x, y and z: every measurement against the target with r (fig. 2.45), and below its error."""
    fig, axes = style.figure(4.1, 2, 3, sharex=True, height_ratios=(1.5, 1))
    for column, name in enumerate(_AXES):
        part = points[(points["platform"] == "al") & (points["axis"] == name) & (points["method"] == "equations")]
        found = series[(series["platform"] == "al") & (series["axis"] == name) & (series["method"] == "equations")]
        top, low = axes[0, column], axes[1, column]
        largest = part["load_n"].max()
        top.plot([0, largest], [0, largest], color=style.BLACK, linewidth=0.7)
        top.plot(part["load_n"], part["force_n"], "o", color=style.COLOUR[name], markersize=3)
        top.set_title(f"{name}: $r$ = {found['r'].iloc[0]:.6f}")
        low.plot(part["load_n"], 1e3 * part["error_n"], "o", color=style.COLOUR[name], markersize=2.5)
        low.errorbar(
            part.groupby("load_n")["load_n"].first(),
            1e3 * part.groupby("load_n")["error_n"].mean(),
            2e3 * part.groupby("load_n")["uncertainty_n"].mean(),
            fmt="none",
            color=style.BLACK,
            capsize=2,
            linewidth=0.8,
        )
        low.axhline(0, color=style.BLACK, linewidth=0.7)
        low.set_xlabel("applied force (N)")
    axes[0, 0].set_ylabel("output (N)")
    axes[1, 0].set_ylabel("error (mN)")
    return fig


def methods(points: pd.DataFrame) -> Figure:
    """Loads along several axes at once: reconstructed against applied component, by equations and by matrix."""
    fig, axes = style.figure(2.9, columns=3)
    several = points[points["axis"].str.len() > 1]
    unit = {axis: direction(axis) for axis in several["axis"].unique()}
    for k, (axis, name) in enumerate(zip(axes, _AXES, strict=True)):
        applied = several["load_n"] * several["axis"].map({label: part[k] for label, part in unit.items()})
        for method, colour, marker, label in (
            ("equations", style.RED, "o", "thesis's equations"),
            ("matrix", style.BLUE, "^", "calibration matrix"),
        ):
            mine = (several["method"] == method).to_numpy()
            there = applied[mine] + several.loc[mine, f"error_{name}_n"]
            axis.plot(applied[mine], there, marker, color=colour, markersize=3, label=label, mfc="none")
        ends = np.array([applied.min(), applied.max()])
        axis.plot(ends, ends, color=style.BLACK, linewidth=0.7, zorder=0)
        axis.set(xlabel=f"applied $F_{name}$ (N)", ylabel=f"reconstructed $F_{name}$ (N)")
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return fig


def dynamic(flights: pd.DataFrame) -> Figure:
    """Thrust over time of each set on the three platforms (fig. 2.47)."""
    numbers = sorted(flights["set"].unique())
    fig, axes = style.figure(1.6 * len(numbers), len(numbers), 1, sharex=True, squeeze=False)
    axes = axes[:, 0]
    for number, axis in zip(numbers, axes, strict=True):
        for platform in ("jr3", "pla", "al"):
            flight = flights[(flights["set"] == number) & (flights["platform"] == platform)]
            values = flight["zero_phase_n"].to_numpy()
            kept = style.thin(values, 700)
            axis.plot(
                flight["time_s"].to_numpy()[kept],
                values[kept],
                color=_PLATFORM_COLOUR[platform],
                linewidth=0.6 if platform == "jr3" else 1.0,
                label=PLATFORM[platform],
            )
        axis.set_ylabel(f"set {number}: thrust (N)")
    axes[-1].set_xlabel("time (s)")
    named = {label: handle for axis in axes for handle, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    fig.legend(named.values(), named.keys(), loc="outside lower center", ncols=3)
    return fig


def tensile(curves: pd.DataFrame, specimens: pd.DataFrame) -> Figure:
    """Stress against strain of all specimens (fig. 2.29), and close by the 0.2 % yield points."""
    fig, (whole, close) = style.figure(3.0, columns=2, gridspec_kw={"width_ratios": [1.3, 1]})
    for colour, (infill, part) in zip(style.CYCLE, curves.groupby("infill_percent"), strict=False):
        for number, (_, curve) in enumerate(part.groupby("specimen")):
            label = f"{infill} %" if number == 0 else None
            for axis in (whole, close):
                axis.plot(100 * curve["strain"], curve["stress_pa"] / 1e6, color=colour, linewidth=0.8, label=label)
        found = specimens[specimens["infill_percent"] == infill]
        close.plot(100 * found["yield_strain"], found["yield_mpa"], "o", color=colour, markersize=4)
    for axis in (whole, close):
        axis.set_xlabel("strain (%)")
    whole.set(xlim=(0, None), ylim=(0, None), ylabel="stress (MPa)")
    whole.legend(title="infill")
    close.set(xlim=(0, 1.6), ylim=(0, 24), title="0.2 % yield")
    return fig


def lines_and_residuals(
    weights_gf: Sequence[float],
    readings: Mapping[str, Sequence[float]],
    lines: Mapping[str, tuple[float, float]],
    flagged_gf: Mapping[str, Sequence[float]],
) -> Figure:
    """Calibration lines of all cells, and below them what the lines leave over.

    `weights_gf`: known weights [gf], shape (n,). `readings`: reading of each cell [1e-5 V], shape (n,) each. `lines`:
    intercept [gf] and slope [gf per 1e-5 V] of each cell. `flagged_gf`: weights [gf] of each cell whose readings do not
    match them; drawn as crosses.
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

    `cells`: names of the cells, k of them. `estimates`, `printed`: values of `a0` [gf] and `a1` [gf per 1e-5 V], shape
    (k,) each. `intervals`: 95 % intervals of the same, shape (k, 2) each.
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
    for axis, names, scale in ((axes[1], _WRENCH[:3], 1.0), (axes[2], _WRENCH[3:], 1e3)):
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
    for k, (name, (label, _)) in enumerate(style.WRENCH.items()):
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
        axis.margins(y=0.12)  # no mark is cut at an end
        axis.set_ylabel(f"{label} ({'N' if k < 3 else 'mN m'})")
    style.label_outer(axes, "experiment")
    fig.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return fig


def weight(table: pd.DataFrame) -> Figure:
    """Moments of the weight at rest: measured, of the believed centre of mass, of the fitted one."""
    fig, axes = style.figure(2.8, columns=2)
    for axis, name in zip(axes, _WRENCH[3:5], strict=True):
        label = style.WRENCH[name][0]
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
