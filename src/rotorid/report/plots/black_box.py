"""Figures of the black box: training, held-out samples, comparison of models, calibrated intervals."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from rotorid.report.plots import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

OUTPUTS = {
    "force_x_n": ("$F_x$", "N"),
    "force_y_n": ("$F_y$", "N"),
    "force_z_n": ("$F_z$", "N"),
    "moment_x_n_m": ("$M_x$", "N m"),
    "moment_y_n_m": ("$M_y$", "N m"),
    "moment_z_n_m": ("$M_z$", "N m"),
}


def training(history: pd.DataFrame) -> Figure:
    """Scaled squared error of each output by epoch (figure 4.25)."""
    fig, axes = style.figure(2.6)
    for colour, (name, (label, _)) in zip(style.CYCLE, OUTPUTS.items(), strict=False):
        axes.loglog(history["epoch"] + 1, history[name], color=colour, label=label)
    axes.set_xlabel("epoch")
    axes.set_ylabel("scaled MSE")
    axes.legend(ncols=2)
    return fig


def samples(tested: pd.DataFrame) -> Figure:
    """Measured and predicted wrench of the held-out samples (figure 4.26)."""
    fig, axes = style.figure(3.5, 2, 3, sharex=True)
    number = np.arange(1, len(tested) + 1)
    for axis, (name, (label, unit)) in zip(axes.flat, OUTPUTS.items(), strict=True):
        axis.vlines(number, tested[name], tested[f"predicted_{name}"], color=style.GREY, linewidth=0.8)
        axis.plot(number, tested[name], "o", color=style.COLOUR["measured"], label="measured")
        axis.plot(number, tested[f"predicted_{name}"], "x", color=style.COLOUR["model"], label="network")
        axis.set_title(f"{label} ({unit})")
    for axis in axes[1]:
        axis.set_xlabel("held-out sample")
    axes[0, 0].legend()
    return fig


def comparison(metrics: pd.DataFrame) -> Figure:
    """RMSE of each model and output on whole experiments held out, with intervals."""
    from matplotlib.ticker import NullFormatter

    fig, axes = style.figure(4.0, 2, 3, sharey=True)
    models = list(dict.fromkeys(metrics["model"]))[::-1]
    for axis, (name, (label, unit)) in zip(axes.flat, OUTPUTS.items(), strict=True):
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
    for axis in axes[1]:
        axis.set_xlabel("RMSE")
    return fig


def coverage(predictions: pd.DataFrame, metrics: pd.DataFrame, model: str, name: str) -> Figure:
    """Out-of-fold predictions of one model against the measured wrench, with its calibrated interval."""
    fig, axes = style.figure(3.6, 2, 3)
    widths = metrics[metrics["model"] == name].set_index("output")["half_width"]
    for axis, (output, (label, unit)) in zip(axes.flat, OUTPUTS.items(), strict=True):
        measured, predicted = predictions[output], predictions[f"{model}_{output}"]
        ends = np.array([measured.min(), measured.max()])
        axis.fill_between(ends, ends - widths[output], ends + widths[output], color="#dbe9f4", linewidth=0)
        axis.plot(ends, ends, color=style.GREY, linewidth=0.8)
        axis.plot(measured, predicted, "o", markersize=2.2, color=style.BLUE, rasterized=True)
        axis.set_title(f"{label} ({unit})")
    for axis in axes[1]:
        axis.set_xlabel("measured")
    for axis in axes[:, 0]:
        axis.set_ylabel("predicted")
    return fig


def held_out_rows(scores: pd.DataFrame) -> pd.DataFrame:
    """Scores of the held-out samples as a table's rows: symbol, unit, RMSE, spread there and over all samples, R².

    Moments in mN m.
    """
    rows = []
    for row in scores.itertuples():
        label, unit = OUTPUTS[row.output]
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
