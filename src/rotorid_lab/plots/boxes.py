"""Figures of the white box (rotor curves, attitude control), the grey box (networks by epoch, identifiability,
excitation, errors, validation), the black box (training, held-out samples, models compared, intervals) and of
residuals of the rigid body and NeuroBEM."""

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
_ANGLES = ("roll", "pitch", "yaw")


def rotor_curves(thrust: pd.DataFrame, torque: pd.DataFrame, fits: dict) -> Figure:
    """Steady points of the rotor tests, the fitted parabolas (figure 4.6) and, below, what they leave.

    `thrust` and `torque` have columns `speed_rad_s` and `value` (N, N m); `fits` has `c_f` and `c_q`, or
    one of them, or none.
    """
    fig, axes = style.figure(3.2, 2, 2, sharex="col", height_ratios=(2.2, 1))
    for column, (points, fit, label, scale, unit) in enumerate(
        ((thrust, fits.get("c_f"), "thrust", 1.0, "N"), (torque, fits.get("c_q"), "torque", 1000.0, "mN m"))
    ):
        if fit is None:
            for axis in axes[:, column]:
                axis.set_axis_off()
            axes[0, column].text(
                0.5, 0.5, f"no {label} tests recorded", ha="center", va="center", transform=axes[0, column].transAxes
            )
            continue
        speed = points["speed_rad_s"].to_numpy()
        fine = np.linspace(0, speed.max(), 200)
        top, low = axes[0, column], axes[1, column]
        top.plot(fine, scale * fit["value"] * fine**2, color=style.COLOUR["model"], label="least squares")
        top.plot(speed, scale * points["value"], "o", color=style.COLOUR["measured"], label="tests", markersize=3)
        top.set_ylabel(f"{label} ({unit})")
        top.legend(loc="upper left")
        rest = points["value"] - fit["value"] * speed**2
        small = 1000.0 if column == 0 else 1e6
        low.plot(speed, small * rest, "o", color=style.COLOUR["measured"], markersize=3)
        low.axhline(0, color=style.COLOUR["model"])
        low.set_ylabel("rest (mN)" if column == 0 else "rest (µN m)")
        low.set_xlabel("rotor speed (rad/s)")
    return fig


def attitude(flight: pd.DataFrame) -> Figure:
    """Euler angles and their references over time (figure 4.9b)."""
    fig, axes = style.figure(2.6, 3, 1, sharex=True)
    for axis, angle in zip(axes, _ANGLES, strict=True):
        axis.plot(
            flight["time_s"],
            np.degrees(flight[f"{angle}_reference_rad"]),
            color=style.COLOUR["reference"],
            linestyle="--",
            label="reference",
        )
        axis.plot(flight["time_s"], np.degrees(flight[f"{angle}_rad"]), color=style.COLOUR["model"], label="flown")
        axis.set_ylabel(f"{angle} (deg)")
    axes[-1].legend(loc="upper left")
    axes[-1].set_xlabel("time (s)")
    return fig


def motion(flight: pd.DataFrame) -> Figure:
    """Body rates, angular accelerations and moments (figure 4.9c-e)."""
    fig, axes = style.figure(3.8, 3, 3, sharex=True)
    kinds = (
        ("angular_velocity_{}_rad_s", "rate (rad/s)", 1.0),
        ("angular_acceleration_{}_rad_s2", "acceleration (rad/s²)", 1.0),
        ("moment_{}_n_m", "moment (mN m)", 1000.0),
    )
    for row, (name, label, scale) in enumerate(kinds):
        for column, axis in enumerate("xyz"):
            place = axes[row, column]
            values = scale * flight[name.format(axis)].to_numpy()
            kept = style.thin(values, 800)
            place.plot(flight["time_s"].to_numpy()[kept], values[kept], color=style.AXIS_COLOURS[column], linewidth=0.7)
            if column == 0:
                place.set_ylabel(label)
            if row == 0:
                place.set_title(_ANGLES[column])
            if row == 2:
                place.set_xlabel("time (s)")
    return fig


_TILTS_DRAWN = 3
"""Roll and pitch are drawn this many times as large: five degrees would hardly show."""
_ELEVATION_DEG, _AZIMUTH_DEG = 24.0, 35.0
_ROTOR_SHARE = 0.62
"""Radius of a rotor over the distance of its hub from the centre."""


def _pose(roll_rad: float, pitch_rad: float, yaw_rad: float) -> list[np.ndarray]:
    """Lines of the vehicle at an attitude as a camera sees them, (n, 2) each: four arms, then four rotors' circles.

    Unit: the distance of a hub from the centre; first across, then up. Tilts are drawn `_TILTS_DRAWN` times as large.
    """
    from rotorid.vehicle.attitude import quaternion_from_euler, rotation_from_quaternion

    angles = np.array([_TILTS_DRAWN * roll_rad, _TILTS_DRAWN * pitch_rad, yaw_rad])
    rotation = rotation_from_quaternion(quaternion_from_euler(angles))
    lift, turn = np.radians(_ELEVATION_DEG), np.radians(_AZIMUTH_DEG)
    # North, east, down to across and up, from behind and above.
    across = np.array([-np.sin(turn), np.cos(turn), 0.0])
    up = np.array([np.sin(lift) * np.cos(turn), np.sin(lift) * np.sin(turn), -np.cos(lift)])
    camera = np.stack([across, up], axis=1)
    hubs = np.array([[1, 1, 0], [1, -1, 0], [-1, -1, 0], [-1, 1, 0]]) / np.sqrt(2)
    around = np.linspace(0, 2 * np.pi, 21)
    circle = _ROTOR_SHARE * np.stack([np.cos(around), np.sin(around), 0 * around], axis=1)
    lines = [np.stack([np.zeros(3), hub]) for hub in hubs] + [hub + circle for hub in hubs]
    return [line @ rotation.T @ camera for line in lines]


def view(flight: pd.DataFrame, every_s: float = 1.0) -> Figure:
    """Key poses of the simulated flight (figure 4.9a), one next to the other, with the angles that they have."""
    step = float(flight["time_s"].iloc[1])
    rows = flight.iloc[:: max(int(round(every_s / step)), 1)]
    fig, axes = style.figure(1.75, 1, len(rows), gridspec_kw={"wspace": 0.02})
    for axis, row in zip(np.atleast_1d(axes), rows.itertuples(), strict=True):
        for number, line in enumerate(_pose(row.roll_rad, row.pitch_rad, row.yaw_rad)):
            front = number % 4 < 2
            colour = style.BLACK if number < 4 else style.RED if front else style.BLUE
            axis.plot(*line.T, color=colour, linewidth=1.5 if number < 4 else 1.1)
        axis.set_xlim(-1.75, 1.75)
        axis.set_ylim(-1.3, 1.3)
        axis.set_aspect("equal")
        axis.set_axis_off()
        axis.set_title(f"{row.time_s:.1f} s")
        said = [f"{np.degrees(getattr(row, f'{angle}_rad')):.1f}°".replace("-", "−") for angle in _ANGLES]
        text = "\n".join(f"{angle} {value}" for angle, value in zip(_ANGLES, said, strict=True))
        axis.text(0.5, -0.02, text, transform=axis.transAxes, ha="center", va="top", fontsize=8.5)
    return fig


def animation(flight: pd.DataFrame, every_s: float = 0.1) -> str:
    """The same flight as a moving drawing (SVG), at its own speed and over and over, for the page."""
    step = float(flight["time_s"].iloc[1])
    rows = flight.iloc[:: max(int(round(every_s / step)), 1)]
    whole_s = every_s * len(rows)
    frames = []
    for number, row in enumerate(rows.itertuples()):
        start, stop = number / len(rows), (number + 1) / len(rows)
        values, times = ("visible;hidden", f"0;{stop:.4f}") if number == 0 else (
            "hidden;visible;hidden", f"0;{start:.4f};{stop:.4f}"
        )  # fmt: skip
        if number == len(rows) - 1:
            values, times = "hidden;visible", f"0;{start:.4f}"
        lines = []
        for k, line in enumerate(_pose(row.roll_rad, row.pitch_rad, row.yaw_rad)):
            colour = style.BLACK if k < 4 else style.RED if k % 4 < 2 else style.BLUE
            points = " ".join(f"{315 + 110 * x:.1f},{125 - 110 * y:.1f}" for x, y in line)
            lines.append(f'<polyline points="{points}" stroke="{colour}"/>')
        said = ", ".join(
            f"{angle} {np.degrees(getattr(row, f'{angle}_rad')):.1f}°".replace("-", "\u2212") for angle in _ANGLES
        )
        frames.append(
            f'<g visibility="{"visible" if number == 0 else "hidden"}"><animate attributeName="visibility" '
            f'calcMode="discrete" values="{values}" keyTimes="{times}" dur="{whole_s:g}s" repeatCount="indefinite"/>'
            f'{"".join(lines)}<text x="315" y="288" text-anchor="middle">{row.time_s:.1f} s: {said}</text></g>'
        )
    return (
        '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 630 300" font-family="serif" font-size="16" '
        f'fill="none" stroke-width="2.5"><g>{"".join(frames)}</g></svg>\n'
    ).replace("<text ", '<text fill="black" stroke="none" ')


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
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
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
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
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
    fig.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return fig


def training(history: pd.DataFrame) -> Figure:
    """Scaled squared error of each output by epoch (figure 4.25)."""
    fig, axes = style.figure(2.6)
    for colour, (name, (label, _)) in zip(style.CYCLE, style.WRENCH.items(), strict=False):
        axes.loglog(history["epoch"] + 1, history[name], color=colour, label=label)
    axes.set_xlabel("epoch")
    axes.set_ylabel("scaled MSE")
    axes.legend(ncols=2)
    return fig


def samples(tested: pd.DataFrame) -> Figure:
    """Measured and predicted wrench of the held-out samples (figure 4.26)."""
    fig, axes = style.figure(3.5, 2, 3, sharex=True)
    number = np.arange(1, len(tested) + 1)
    for axis, (name, (label, unit)) in zip(axes.flat, style.WRENCH.items(), strict=True):
        axis.vlines(number, tested[name], tested[f"predicted_{name}"], color=style.GREY, linewidth=0.8)
        axis.plot(number, tested[name], "o", color=style.COLOUR["measured"], label="measured")
        axis.plot(number, tested[f"predicted_{name}"], "x", color=style.COLOUR["model"], label="network")
        axis.set_title(f"{label} ({unit})")
    style.label_outer(axes, "held-out sample")
    axes[0, 0].legend()
    return fig


def comparison(metrics: pd.DataFrame) -> Figure:
    """RMSE of each model and output on whole experiments held out, with intervals."""
    from matplotlib.ticker import NullFormatter

    fig, axes = style.figure(4.0, 2, 3, sharey=True)
    models = list(dict.fromkeys(metrics["model"]))[::-1]
    for axis, (name, (label, unit)) in zip(axes.flat, style.WRENCH.items(), strict=True):
        part = metrics[metrics["output"] == name].set_index("model").loc[models]
        scale = 1000.0 if unit == "N m" else 1.0
        low, high = scale * (part["rmse"] - part["rmse_low"]), scale * (part["rmse_high"] - part["rmse"])
        axis.errorbar(
            scale * part["rmse"],
            range(len(models)),
            xerr=[low.clip(lower=0), high.clip(lower=0)],
            fmt="o",
            color=style.BLUE,
            capsize=2,
        )
        axis.set_xscale("log")
        axis.xaxis.set_minor_formatter(NullFormatter())
        axis.set_title(f"{label} ({'m' if scale > 1 else ''}{unit})")
    for axis in axes[:, 0]:
        axis.set_yticks(range(len(models)), models)
    style.label_outer(axes, "RMSE")
    return fig


def coverage(predictions: pd.DataFrame, metrics: pd.DataFrame, model: str, name: str) -> Figure:
    """Out-of-fold predictions of one model against the measured wrench, with its calibrated interval."""
    fig, axes = style.figure(3.6, 2, 3)
    widths = metrics[metrics["model"] == name].set_index("output")["half_width"]
    for axis, (output, (label, unit)) in zip(axes.flat, style.WRENCH.items(), strict=True):
        measured, predicted = predictions[output], predictions[f"{model}_{output}"]
        ends = np.array([measured.min(), measured.max()])
        axis.fill_between(ends, ends - widths[output], ends + widths[output], color="#dbe9f4", linewidth=0)
        axis.plot(ends, ends, color=style.GREY, linewidth=0.8)
        axis.plot(measured, predicted, "o", markersize=2.2, color=style.BLUE, rasterized=True)
        axis.set_title(f"{label} ({unit})")
    style.label_outer(axes, "measured", "predicted")
    return fig


def held_out_rows(scores: pd.DataFrame) -> pd.DataFrame:
    """Scores of the held-out samples as a table's rows: symbol, unit, RMSE, spread there and over all samples, R².

    Moments in mN m.
    """
    rows = []
    for row in scores.itertuples():
        label, unit = style.WRENCH[row.output]
        scale, unit = (1000.0, "mN m") if unit == "N m" else (1.0, "N")
        sizes = {"rmse": scale * row.rmse, "spread": scale * row.spread, "spread_all": scale * row.spread_all}
        rows.append({"output": label.strip("$"), "unit": unit, **sizes, "r2": row.r2})
    return pd.DataFrame(rows)


_EFFECTS = {
    **{f"thrust_factor_{i}": (f"thrust of rotor {i}", "believed", 1.0) for i in (1, 2, 3, 4)},
    **{f"torque_factor_{i}": (f"torque of rotor {i}", "believed", 1.0) for i in (1, 2, 3, 4)},
    "sensor_origin_x_m": ("sensor origin, x", "mm", 1000.0),
    "sensor_origin_y_m": ("sensor origin, y", "mm", 1000.0),
    "mount_roll_rad": ("mount, roll", "mrad", 1000.0),
    "mount_pitch_rad": ("mount, pitch", "mrad", 1000.0),
}


def effect_rows(effects: dict) -> pd.DataFrame:
    """The fitted effects with their intervals as a table's rows."""
    rows = []
    for name, (words, unit, scale) in _EFFECTS.items():
        low, high = effects[name]["interval_95"]
        rows.append(
            {
                "effect": words,
                "unit": unit,
                "value": scale * effects[name]["value"],
                "low_95": scale * low,
                "high_95": scale * high,
            }
        )
    return pd.DataFrame(rows)


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
