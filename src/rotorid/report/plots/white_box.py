"""Figures of the white box: rotor curves and the attitude-control simulation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from rotorid.report.plots import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

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
