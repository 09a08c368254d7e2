"""Errors of channels compared on masked rows: whether squares have grown, by blocks of a second."""

from __future__ import annotations

import numpy as np

LEAST_BLOCKS = 8
CHANNELS_OF_WRENCH = 6


def growth(
    before: list[np.ndarray], after: list[np.ndarray], held: list[np.ndarray], per: int
) -> tuple[np.ndarray, np.ndarray]:
    """Ratio of the held-out errors after and before of each wrench channel, and its growth in standard errors.

    Squares are compared by blocks of `per` rows; without LEAST_BLOCKS of them nothing is said (ratio 1, growth 0).
    """
    blocks = []
    for b, a, mask in zip(before, after, held, strict=True):
        rows = np.flatnonzero(mask)
        if len(rows) >= per:
            parts = np.array_split(rows, len(rows) // per)
            squares = [x[:, :CHANNELS_OF_WRENCH] ** 2 for x in (b, a)]
            blocks += [[s[p].mean(axis=0) for s in squares] for p in parts]
    if not long_enough(held, per):
        return np.ones(CHANNELS_OF_WRENCH), np.zeros(CHANNELS_OF_WRENCH)
    was, now = np.array(blocks).transpose(1, 0, 2)
    change = now - was
    doubt = change.std(axis=0, ddof=1) / np.sqrt(len(change))
    ratio = np.sqrt(now.mean(axis=0) / np.maximum(was.mean(axis=0), 1e-300))
    return np.nan_to_num(ratio, nan=1.0), np.nan_to_num(change.mean(axis=0) / np.maximum(doubt, 1e-300))


def long_enough(held: list[np.ndarray], per: int) -> bool:
    """Whether there are LEAST_BLOCKS of `per` rows held out."""
    return sum(int(mask.sum()) // per for mask in held) >= LEAST_BLOCKS
