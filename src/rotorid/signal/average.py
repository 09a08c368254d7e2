"""Mean of a steady stretch and how well it is known when neighbouring samples are not independent."""

from __future__ import annotations

import numpy as np


def mean_and_error(values: np.ndarray) -> tuple[float, float]:
    """Mean and its standard error, from the means of about √n consecutive blocks.

    Means of blocks are nearly independent where single samples are not: noise that is slow, drift and ringing
    widen the error as they should. Fewer than 16 samples are taken one by one.
    """
    values = np.asarray(values, float)
    values = values[np.isfinite(values)]
    if len(values) < 2:
        return (float(values.mean()) if len(values) else float("nan")), float("nan")
    blocks = (
        values if len(values) < 16 else np.array([b.mean() for b in np.array_split(values, int(len(values) ** 0.5))])
    )
    return float(values.mean()), float(blocks.std(ddof=1) / np.sqrt(len(blocks)))
