"""Figures of the white box: rotor curves and the attitude-control simulation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from rotorid.plots import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ANGLES = ("roll", "pitch", "yaw")
AXIS_COLOURS = tuple(style.COLOUR[a] for a in "xyz")


def rotor_curves(thrust: pd.DataFrame, torque: pd.DataFrame, fits: dict) -> Figure:
    """Steady points of the rotor tests, the fitted parabolas (figure 4.6) and, below, what they leave.

    `thrust` and `torque` have columns `speed_rad_s` and `value` (N, N m); `fits` has `c_f` and `c_q`.
    """
    fig, axes = style.figure(3.9, 2, 2, sharex="col", height_ratios=(2.2, 1))
    for column, (points, fit, label, scale, unit) in enumerate(
        ((thrust, fits["c_f"], "thrust", 1.0, "N"), (torque, fits["c_q"], "torque", 1000.0, "mN m"))
    ):
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
    fig, axes = style.figure(3.4, 3, 1, sharex=True)
    for axis, angle in zip(axes, ANGLES, strict=True):
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
    fig, axes = style.figure(4.6, 3, 3, sharex=True)
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
            place.plot(flight["time_s"].to_numpy()[kept], values[kept], color=AXIS_COLOURS[column], linewidth=0.7)
            if column == 0:
                place.set_ylabel(label)
            if row == 0:
                place.set_title(ANGLES[column])
            if row == 2:
                place.set_xlabel("time (s)")
    return fig


def view(flight: pd.DataFrame, every_s: float = 0.5) -> Figure:
    """The vehicle's frame along its path in three dimensions (figure 4.9a)."""
    import matplotlib.pyplot as plt

    from rotorid.vehicle.attitude import quaternion_from_euler, rotation_from_quaternion

    style.use()
    fig = plt.figure(figsize=(style.TEXT_WIDTH_IN, 2.3))
    axes = fig.add_subplot(projection="3d")
    step = float(flight["time_s"].iloc[1])
    rows = flight.iloc[:: max(int(every_s / step), 1)]
    places = rows[[f"position_{a}_m" for a in "xyz"]].to_numpy()
    euler = rows[["roll_rad", "pitch_rad", "yaw_rad"]].to_numpy()
    # Drawn at every half second beside one another: the fall would otherwise hide the attitude.
    arms = 0.0884 * np.array([[1, 1, 0], [1, -1, 0], [-1, -1, 0], [-1, 1, 0]])
    for number, (place, angles) in enumerate(zip(places, euler, strict=True)):
        hubs = arms @ rotation_from_quaternion(quaternion_from_euler(angles)).T
        hubs = hubs + [0.32 * number, place[1], 0.0]
        for a, b in ((0, 2), (1, 3)):
            axes.plot(*(np.array([hubs[a], hubs[b]]) * [1, -1, -1]).T, color=style.BLACK, linewidth=1.2)
        for hub, colour in zip(hubs, (style.RED, style.RED, style.BLUE, style.BLUE), strict=True):
            axes.plot(*(hub[None] * [1, -1, -1]).T, "o", color=colour, markersize=4)
    axes.set_box_aspect((4.2, 1.0, 0.7), zoom=2.1)
    axes.set_xticks([0.32 * i for i in range(0, len(rows), 2)], [f"{every_s * i:g}" for i in range(0, len(rows), 2)])
    axes.set_yticks([])
    axes.set_zticks([])
    axes.set_xlabel("time (s)", labelpad=12)
    axes.view_init(elev=28, azim=-75)
    return fig
