"""The picture of a plan: where to fly, how high and fast, and how far apart the competing models would be."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rotorid.plan.plan import BETWEEN_S, Plan
from rotorid.report.plots.style import BLUE, GREY, ORANGE, RED, figure, use

SHOWN_HZ = 25.0


def draw(plan: Plan, path: Path) -> None:
    """Write the picture as PNG."""
    use()
    flight = plan.flight
    motion = flight.motion
    every = max(1, int(round(1.0 / (SHOWN_HZ * (motion.time_s[1] - motion.time_s[0])))))
    t, place = motion.time_s[::every], motion.position[::every]
    fig, axes = figure(6.4, 3, 2, width_ratios=(1.0, 1.25))
    top, reference = axes[0, 0], plan.reference.position_m + np.array([*plan.limits.middle_m[:2], 0.0])
    x, y = plan.limits.x_m, plan.limits.y_m
    top.plot([y[0], y[1], y[1], y[0], y[0]], [x[0], x[0], x[1], x[1], x[0]], color=GREY, lw=0.8)
    top.plot(reference[::every, 1], reference[::every, 0], color=ORANGE, lw=0.7, label="asked")
    top.plot(place[:, 1], place[:, 0], color=BLUE, label="flown")
    top.set(xlabel="east of the start [m]", ylabel="north [m]", title="From above, and the volume", aspect="equal")
    top.legend(loc="upper right")
    series = (
        (axes[0, 1], motion.height[::every], "height [m]"),
        (axes[1, 0], np.linalg.norm(flight.world_velocity[::every, :2], axis=1), "speed over ground [m/s]"),
        (axes[1, 1], np.degrees(np.arccos(np.clip(motion.rotation[::every, 2, 2], -1, 1))), "tilt [°]"),
        (axes[2, 0], np.degrees(plan.reference.yaw_rad[::every]), "yaw asked [°]"),
    )
    starts = np.cumsum([BETWEEN_S] + [p.duration_s + BETWEEN_S for p in plan.pieces])
    for ax, values, label in series:
        ax.plot(t, values[: len(t)], color=BLUE)
        ax.set(xlabel="time [s]", ylabel=label, xlim=(0, t[-1]))
        for i, start in enumerate(starts[:-1]):
            ax.axvline(start, color=GREY, lw=0.5, ls=":")
            if ax is axes[0, 1]:
                ax.annotate(str(i + 1), (start, 1.0), xycoords=("data", "axes fraction"), va="bottom", fontsize=8)
    ax = axes[2, 1]
    found = [s for _, own in plan.questions for s in own]
    if found:
        rows = np.arange(len(found))[::-1]
        for row, s in zip(rows, found, strict=True):
            ax.plot(s.interval_95, [row, row], color=BLUE, lw=1.5)
            ax.plot(s.sigma, row, "o", color=BLUE)
            ax.plot(s.so_far, row, "o", color=ORANGE, mfc="none")
        ax.axvline(plan.limits.target_sigma, color=RED, lw=0.8)
        ax.set_yticks(rows, [f"{s.true} against {s.rival}".replace("_", " ") for s in found], fontsize=7)
        ax.set_xscale("symlog", linthresh=3)
        ax.tick_params(axis="x", which="minor", bottom=False)
        most = max(s.interval_95[1] for s in found)
        ax.set(xlabel="separation [standard errors]", ylim=(-0.6, len(found) - 0.4), xlim=(-0.3, 1.3 * most))
        ax.set_title("Ring: so far. Dot: with this flight. Line: wanted", loc="right")
    else:
        ax.set_axis_off()
    fig.savefig(path, format="png")
