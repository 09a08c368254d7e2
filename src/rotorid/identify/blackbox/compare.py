"""Models compared on whole experiments held out, with intervals; calibrated prediction intervals; range of validity."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.identify.blackbox.experiments import INPUTS, OUTPUTS
from rotorid.identify.blackbox.models import ColumnScale, Predict

_INPUT_NAMES = {f"force_{i}_n": f"the force of motor {i} (N)" for i in (1, 2, 3, 4)} | {
    "roll_rad": "roll (rad)",
    "pitch_rad": "pitch (rad)",
}

Fit = Callable[[pd.DataFrame], Predict]


def folds(experiments: np.ndarray, count: int, rng: np.random.Generator) -> list[np.ndarray]:
    """Masks (n,) of the held-out samples of each fold; whole experiments go together.

    InputError where a fold would have no experiment.
    """
    numbers = rng.permutation(np.unique(experiments))
    if count > len(numbers):
        raise InputError(f"black_box.folds is {count}, expected at most the {len(numbers)} experiments")
    return [np.isin(experiments, part) for part in np.array_split(numbers, count)]


def out_of_fold(table: pd.DataFrame, fits: Mapping[str, Fit], masks: Sequence[np.ndarray]) -> dict[str, np.ndarray]:
    """Predictions (n, 6) of each model for samples that its training did not hold."""
    found = {name: np.full((len(table), len(OUTPUTS)), np.nan) for name in fits}
    for held_out in masks:
        for name, fit in fits.items():
            found[name][held_out] = fit(table[~held_out])(table[held_out])
    return found


def scores(
    measured: np.ndarray, predicted: np.ndarray, experiments: np.ndarray, rng: np.random.Generator, draws: int = 1000
) -> dict[str, np.ndarray]:
    """RMSE and R² of each output with 95 % intervals by drawing whole experiments, arrays (6,) and (6, 2)."""
    numbers = np.unique(experiments)
    error2, spread2, count = (np.empty((len(numbers), measured.shape[1])) for _ in range(3))
    mean = measured.mean(axis=0)
    for row, number in enumerate(numbers):
        mine = experiments == number
        error2[row] = ((measured - predicted)[mine] ** 2).sum(axis=0)
        spread2[row] = ((measured[mine] - mean) ** 2).sum(axis=0)
        count[row] = mine.sum()
    drawn = rng.integers(0, len(numbers), (draws, len(numbers)))
    e, s, c = error2[drawn].sum(1), spread2[drawn].sum(1), count[drawn].sum(1)
    return {
        "rmse": np.sqrt(error2.sum(0) / count.sum(0)),
        "rmse_interval": np.quantile(np.sqrt(e / c), [0.025, 0.975], axis=0).T,
        "r2": 1 - error2.sum(0) / spread2.sum(0),
        "r2_interval": np.quantile(1 - e / s, [0.025, 0.975], axis=0).T,
    }


def conformal_half_width(absolute_error: np.ndarray, experiments: np.ndarray, share: float = 0.95) -> np.ndarray:
    """Half widths (6,) of intervals that cover `share` of new samples of new experiments.

    Split conformal with whole experiments as the exchangeable unit: each experiment counts alike (its samples
    share its weight), and one unseen experiment is added at infinity.
    """
    numbers, index, counts = np.unique(experiments, return_inverse=True, return_counts=True)
    weight = 1.0 / counts[index] / (len(numbers) + 1)
    out = np.empty(absolute_error.shape[1])
    for k, column in enumerate(absolute_error.T):
        order = np.argsort(column)
        total = np.cumsum(weight[order])
        place = np.searchsorted(total, share - 1e-9)
        out[k] = column[order[place]] if place < len(order) else np.inf
    return out


def conformal_coverage(
    measured: np.ndarray, predicted: np.ndarray, experiments: np.ndarray, masks: Sequence[np.ndarray], share: float
) -> tuple[np.ndarray, np.ndarray]:
    """Half widths (6,) from all folds, and the coverage (6,) of each fold by widths from the other folds alone.

    Raises InputError where no width covers `share`: of n experiments n / (n + 1) can be promised.
    """
    fewest = min(len(np.unique(experiments[~held_out])) for held_out in masks)
    if share > fewest / (fewest + 1):
        raise InputError(
            f"black_box.share is {share:g}, expected at most {fewest / (fewest + 1):.3g}, all that the {fewest} "
            f"experiments outside one of {len(masks)} folds can promise"
        )
    error = np.abs(measured - predicted)
    inside = np.zeros_like(error, bool)
    for held_out in masks:
        width = conformal_half_width(error[~held_out], experiments[~held_out], share)
        inside[held_out] = error[held_out] <= width
    return conformal_half_width(error, experiments, share), inside.mean(axis=0)


@dataclass(frozen=True)
class TrainingRange:
    """Where the training samples lie; says when an input is outside."""

    scale: ColumnScale
    points: np.ndarray
    reach: float
    """Distance to the nearest other experiment's sample within which 99 % of the training samples lie, scaled."""

    @classmethod
    def of(cls, table: pd.DataFrame) -> TrainingRange:
        values = table[list(INPUTS)].to_numpy()
        scale = ColumnScale.of(values)
        points = scale.apply(values)
        experiments = table["experiment"].to_numpy()
        gap = np.linalg.norm(points[:, None] - points[None], axis=2)
        gap[experiments[:, None] == experiments[None]] = np.inf
        return cls(scale, points, float(np.quantile(gap.min(axis=1), 0.99)))

    def statement(self, inputs: np.ndarray) -> str:
        """A sentence for one input (6,): inside, or what lies outside and by how much."""
        scaled = self.scale.apply(np.asarray(inputs, float))
        outside = [
            f"{_INPUT_NAMES[name]} is {value:.3g}, trained from {low:.3g} to {high:.3g}"
            for name, value, low, high, s in zip(INPUTS, inputs, self.scale.low, self.scale.high, scaled, strict=True)
            if s < -1e-9 or s > 1 + 1e-9
        ]
        if outside:
            return "outside the training range: " + "; ".join(outside)
        distance = float(np.min(np.linalg.norm(self.points - scaled, axis=1)))
        if distance > self.reach:
            return (
                f"outside the training data: no such combination was trained (nearest sample {distance:.2f} of the "
                f"range away, {self.reach:.2f} is usual)"
            )
        return "inside the training range"
