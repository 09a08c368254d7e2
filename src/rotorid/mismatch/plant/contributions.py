"""What a model adds to the channels, less what is only the sensors' noise come in through its regressors.

A true model with a noisy tachometer as its input may leave more than no model at all: the acceleration of rotors that
turn evenly is all noise. The noise added once more shows how much of a contribution is noise at each frequency; the
best that can be said of the contribution itself is what Wiener's filter passes. Where noise is a small part of it the
contribution stands as it is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.signal import fftconvolve, welch

from rotorid.mismatch.plant.rows import Rows

_LEAST_NOISE = 0.1
"""Share of a contribution's energy in a channel of a run that must be noise before it is filtered."""
_PIECE_S = 4.0
"""Length of the pieces that spectra are averaged over, and of the filter."""
_SHORTEST = 16
"""Rows that a stretch must have to be filtered; in a shorter one the contribution stands."""


@dataclass(frozen=True)
class Contributions:
    """Rows of every stretch, and the same with the sensors' noise added once more (None where that is not known)."""

    rows: list[Rows]
    noisy: list[Rows] | None = None
    rate_hz: float = 1.0

    def of(self, columns: np.ndarray, beta: np.ndarray) -> list[np.ndarray]:
        """What coefficients `beta` (k,) of some columns add to the channels of each stretch, (n, 12)."""
        # All columns in one product: to pick some out of an array of gigabytes costs several times as much.
        whole = np.zeros(self.rows[0].x.shape[2])
        whole[columns] = beta
        return self._less_noise(lambda rows: [_product(r.x, whole) for r in rows])

    def left_out(self, columns: np.ndarray, betas: np.ndarray, fold: list[np.ndarray]) -> list[np.ndarray]:
        """The same where every row has the coefficients that were fitted without its fold.

        `betas` (folds, k); `fold` holds the fold of every row of each stretch, (n,), -1 for a row of none, of which
        nothing is said (zero).
        """

        def made(rows: list[Rows]) -> list[np.ndarray]:
            out = [np.zeros_like(r.y) for r in rows]
            for part, r, own in zip(out, rows, fold, strict=True):
                for number, beta in enumerate(betas):
                    where = np.flatnonzero(own == number)
                    part[where] = r.x[where][:, :, columns] @ beta
            return out

        return self._less_noise(made)

    def _less_noise(self, made: Callable[[list[Rows]], list[np.ndarray]]) -> list[np.ndarray]:
        """Contributions (n, 12) made of rows, through Wiener's filter where much of them is noise."""
        parts = made(self.rows)
        if self.noisy is None:
            return parts
        noise = [again - p for again, p in zip(made(self.noisy), parts, strict=True)]
        for run in dict.fromkeys(r.run for r in self.rows):
            own = [k for k, r in enumerate(self.rows) if r.run == run]
            for c in range(parts[0].shape[1]):
                cleared = self.cleared([parts[k][:, c] for k in own], [noise[k][:, c] for k in own])
                for k, part in zip(own, cleared, strict=True):
                    parts[k][:, c] = part
        return parts

    def cleared(self, parts: list[np.ndarray], noise: list[np.ndarray]) -> list[np.ndarray]:
        """Contributions (n,) to one channel of one run, through Wiener's filter if much of them is noise."""
        whole, own = sum(float(p @ p) for p in parts), sum(float(n @ n) for n in noise)
        if own <= _LEAST_NOISE * whole:
            return parts
        long = [k for k, p in enumerate(parts) if len(p) >= _SHORTEST]
        if not long:
            return parts
        size = min(int(_PIECE_S * self.rate_hz), max(len(parts[k]) for k in long)) // 2 * 2
        long = [k for k in long if len(parts[k]) >= size // 2]
        power, of_noise = (_spectrum([x[k] for k in long], size) for x in (parts, noise))
        passed = np.clip(1.0 - of_noise / np.maximum(power, 1e-300), 0.0, 1.0)
        taps = np.fft.fftshift(np.fft.irfft(passed, size))
        taps = np.append(taps, taps[0]) * np.hanning(size + 3)[1:-1]
        half = size // 2
        return [fftconvolve(np.pad(p, half, mode="reflect"), taps, mode="valid") if len(p) > half else p for p in parts]


def _product(x: np.ndarray, beta: np.ndarray) -> np.ndarray:
    """x @ beta, (n, 12)."""
    return (x.reshape(-1, x.shape[2]) @ beta).reshape(x.shape[:2])


def _spectrum(parts: list[np.ndarray], size: int) -> np.ndarray:
    """Power spectrum of stretches in pieces of `size`, weighed by their lengths, (size / 2 + 1,)."""
    total = sum(len(p) for p in parts)
    padded = [p if len(p) >= size else np.pad(p, (0, size - len(p))) for p in parts]
    return sum(len(p) / total * welch(q, nperseg=size, detrend=False)[1] for p, q in zip(parts, padded, strict=True))
