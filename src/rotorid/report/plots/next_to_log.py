"""Figure of an exported vehicle flown next to a log: how its error grows over half a second, and some windows."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from rotorid.mismatch.deliver.flown import UNITS
from rotorid.report.next_to_log import NextToLog
from rotorid.report.plots import style

_LINES = {"believed": ("before", "believed vehicle"), "improved": ("after", "improved vehicle, here")}


def draw(found: NextToLog, path: Path) -> None:
    """Write the figure as PNG: growth of the error in velocity and attitude, and velocities of some windows."""
    shown_windows = 8
    style.use()
    import matplotlib.pyplot as plt

    channels = [c for c in ("velocity", "attitude") if c in found.errors["exported"]]
    fig, axes = plt.subplots(1, len(channels) + 1, figsize=(style.TEXT_WIDTH_IN * 1.35, 2.7))
    elapsed = found.windows[0].time_s - found.windows[0].time_s[0]
    for ax, channel in zip(axes, channels, strict=False):
        for model, (colour, label) in _LINES.items():
            rms = np.sqrt(np.mean(found.errors[model][channel] ** 2, axis=0))
            ax.plot(elapsed, rms, color=style.COLOUR[colour], label=label)
        rms = np.sqrt(np.mean(found.errors["exported"][channel] ** 2, axis=0))
        ax.plot(elapsed, rms, color=style.GREEN, ls="--", label="exported")
        ax.set(xlabel="s since the restart", ylabel=f"error of the {channel}, {UNITS[channel]}")
        ax.set_ylim(bottom=0)
    axes[0].legend()
    ax, velocity = axes[-1], found.flown[0].velocity is not None
    chosen = np.unique(np.linspace(0, len(found.windows) - 1, min(shown_windows, len(found.windows))).astype(int))
    for place, k in enumerate(chosen):
        window, made = found.windows[k], found.flown[k]
        series = (window.recorded.velocity, made.velocity) if velocity else (
            window.recorded.angular_velocity, made.angular_velocity
        )  # fmt: skip
        for values, colour, dash, label in zip(
            series, (style.BLACK, style.GREEN), ("-", "--"), ("log", "exported"), strict=True
        ):
            for axis in range(3):
                shown = label if place == 0 and axis == 0 else None
                ax.plot(
                    place + elapsed / elapsed[-1] * 0.9, values[:, axis], color=colour, ls=dash, label=shown, lw=0.9
                )
    ax.set_xticks(np.arange(len(chosen)) + 0.45, [f"{found.windows[k].time_s[0]:.0f}" for k in chosen])
    ax.set(
        xlabel="windows of half a second that begin at s",
        ylabel="velocity x, y, z, m/s" if velocity else "body rates x, y, z, rad/s",
    )
    ax.legend()
    fig.savefig(path, metadata={"Software": None})
    plt.close(fig)
