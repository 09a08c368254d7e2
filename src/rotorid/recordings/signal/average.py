"""Mean of a steady stretch and how well it is known when neighbouring samples are not independent."""

from __future__ import annotations

import numpy as np


def mean_and_error(values: np.ndarray, blocks: int | None = None) -> tuple[float, float]:
    """Mean and its standard error, from the means of consecutive blocks, about √n of them by default.

    Means of blocks are nearly independent where single samples are not: noise that is slow, drift and ringing
    widen the error as they should. Of a periodic signal a block is one period. Fewer than 16 samples are taken
    one by one.
    """
    values = np.asarray(values, float)
    values = values[np.isfinite(values)]
    if len(values) < 2:
        return (float(values.mean()) if len(values) else float("nan")), float("nan")
    count = blocks or block_count(len(values))
    means = np.array([block.mean() for block in np.array_split(values, count)])
    return float(values.mean()), float(means.std(ddof=1) / np.sqrt(count)) if count > 1 else float("nan")


def block_count(samples: int) -> int:
    """Into how many blocks so many samples are divided."""
    return samples if samples < 16 else int(samples**0.5)
