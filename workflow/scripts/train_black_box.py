"""The thesis's black box (section 4.4): 6-20-20-6, 50,000 epochs, tested on 15 samples drawn at random.

- RMSE and R² of each output on those samples, next to how far the samples themselves spread.
- Continues from its checkpoint when interrupted; the same seed gives the same network.
"""

from pathlib import Path

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid_lab import log
from rotorid_lab.black_box import OUTPUTS, fit_thesis_network


def main(
    experiments: str,
    epochs: int,
    rate: float,
    hidden: tuple[int, ...],
    held_out: int,
    seed: int,
    history: str,
    tested: str,
    scored: str,
    checkpoint: str,
) -> None:
    """Write the error by epoch, the held-out samples with their predictions, and their scores (CSV)."""
    table = pd.read_csv(experiments)
    if held_out >= len(table):
        raise InputError(f"black_box.held_out_samples is {held_out}, expected fewer than the {len(table)} samples")
    chosen = np.random.default_rng(seed).choice(len(table), held_out, replace=False)
    mask = np.zeros(len(table), bool)
    mask[chosen] = True
    how = (epochs, rate, tuple(hidden), seed)
    predict, kept, mse = fit_thesis_network(table[~mask], *how, checkpoint=Path(checkpoint))
    errors = pd.DataFrame(mse, columns=list(OUTPUTS))
    errors.insert(0, "epoch", kept)
    errors.to_csv(history, index=False, float_format="%.6g")
    rows = table[mask].reset_index(drop=True)
    predicted = pd.DataFrame(predict(rows), columns=[f"predicted_{name}" for name in OUTPUTS])
    pd.concat([rows, predicted], axis=1).to_csv(tested, index=False, float_format="%.9g")
    measured = rows[list(OUTPUTS)].to_numpy()
    error2 = ((measured - predicted.to_numpy()) ** 2).mean(axis=0)
    spread2 = measured.var(axis=0)
    scores = {"output": OUTPUTS, "rmse": np.sqrt(error2), "spread": np.sqrt(spread2), "r2": 1 - error2 / spread2}
    whole = {"spread_all": table[list(OUTPUTS)].to_numpy().std(axis=0)}
    tilted = int((rows[["roll_rad", "pitch_rad"]].abs().sum(axis=1) > 0).sum())
    pd.DataFrame(scores | whole | {"samples": held_out, "tilted": tilted}).to_csv(
        scored, index=False, float_format="%.6g"
    )
    # The finished network is in the results; a checkpoint left behind would make the next run skip the training.
    Path(checkpoint).unlink(missing_ok=True)


if __name__ == "__main__":
    with log.to(snakemake.log[0]):
        settings = {k: v for k, v in snakemake.params.items() if k != "code"}
        main(experiments=snakemake.input.experiments, **settings, **dict(snakemake.output.items()))
