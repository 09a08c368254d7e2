"""Honest comparison on whole experiments held out: the thesis's network against simpler and more physical models.

- RMSE and R² of each output with intervals over experiments.
- Intervals calibrated by conformal prediction, their coverage on experiments not used to set them.
- What the model says of inputs inside and outside its training range.
"""

import json
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.special import stdtrit as student_quantile

from rotorid.recordings import read_vehicle
from rotorid_lab import black_box, log
from rotorid_lab.black_box import (
    INPUTS,
    OUTPUTS,
    conformal_coverage,
    folds,
    out_of_fold,
    scores,
    within_training,
)

ASKED = {
    "hover, level": (1.0, 1.0, 1.0, 1.0, 0.0, 0.0),
    "more thrust than trained": (3.0, 3.0, 3.0, 3.0, 0.0, 0.0),
    "tilted further than trained": (1.0, 1.0, 1.0, 1.0, 0.8, 0.0),
    "roll and pitch at once": (1.0, 1.0, 1.0, 1.0, 0.4, 0.4),
    "a yaw moment while tilted": (1.4, 0.3, 1.4, 0.3, 0.52, 0.0),
}


def main(
    experiments: str,
    vehicle_file: str,
    epochs: int,
    rate: float,
    hidden: tuple[int, ...],
    fold_count: int,
    share: float,
    seed: int,
    metrics: str,
    predictions: str,
    summary: str,
) -> None:
    """Write metrics and out-of-fold predictions (CSV) and the summary (JSON)."""
    table = pd.read_csv(experiments)
    vehicle = read_vehicle(Path(vehicle_file))
    numbers = table["experiment"].to_numpy()
    measured = table[list(OUTPUTS)].to_numpy()
    fits = {
        "thesis_network": lambda t: black_box.fit_thesis_network(t, epochs, rate, tuple(hidden), seed)[0],
        "linear": black_box.fit_linear,
        "ridge_physics": lambda t: black_box.fit_ridge_physics(t, t["experiment"].to_numpy()),
        "boosting": lambda t: black_box.fit_boosting(t, seed),
        "white_box": lambda t: black_box.white_box(vehicle),
        "white_box_effects": lambda t: black_box.fit_white_box_effects(vehicle, t)[0],
    }
    masks = folds(numbers, fold_count, np.random.default_rng(seed))
    predicted = out_of_fold(table, fits, masks)
    rows, found = [], {"models": {}, "samples": len(table), "experiments": int(len(np.unique(numbers))), "share": share}
    for name, values in predicted.items():
        score = scores(measured, values, numbers, np.random.default_rng(seed))
        width, coverage = conformal_coverage(measured, values, numbers, masks, share)
        for k, output in enumerate(OUTPUTS):
            rows.append(
                {
                    "model": black_box.NAMES[name],
                    "output": output,
                    "rmse": score["rmse"][k],
                    "rmse_low": score["rmse_interval"][k, 0],
                    "rmse_high": score["rmse_interval"][k, 1],
                    "r2": score["r2"][k],
                    "r2_low": score["r2_interval"][k, 0],
                    "r2_high": score["r2_interval"][k, 1],
                    "half_width": width[k],
                    "coverage": coverage[k],
                }
            )
        found["models"][name] = {
            "name": black_box.NAMES[name],
            "rmse": score["rmse"].tolist(),
            "r2": score["r2"].tolist(),
            "worst_r2": float(score["r2"].min()),
            "mean_coverage": float(coverage.mean()),
        }
    _, effects, errors = black_box.fit_white_box_effects(vehicle, table)
    half = student_quantile(found["experiments"] - 1, 0.975) * errors
    found["effects"] = {
        name: {"value": value, "interval_95": [value - width, value + width]}
        for name, value, width in zip(black_box.EFFECT_PARAMETERS, effects.tolist(), half.tolist(), strict=True)
    }
    said_of = within_training(table)
    found["statements"] = [{"asked": name, "says": said_of(values)} for name, values in ASKED.items()]
    found["inputs"] = list(INPUTS)
    pd.DataFrame(rows).to_csv(metrics, index=False, float_format="%.6g")
    frame = table.copy()
    for name, values in predicted.items():
        for k, output in enumerate(OUTPUTS):
            frame[f"{name}_{output}"] = values[:, k]
    frame.to_csv(predictions, index=False, float_format="%.6g")
    Path(summary).write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        settings = {k: v for k, v in snakemake.params.items() if k != "code"}
        main(
            experiments=snakemake.input.experiments,
            vehicle_file=snakemake.input.vehicle,
            **settings,
            **dict(snakemake.output.items()),
        )
