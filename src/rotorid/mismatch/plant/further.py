"""What each of many further terms would explain given the same others: one solution of those, all terms at once.

A further term borders the normal equations of the others by its few columns (Schur's complement), so what it explains
follows from the inverse of theirs. It is what `Regression.explained` says of the two together, to rounding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

MOST_ALIKE = 1e6
"""Largest element of the inverse of scaled equations (1 / (1 - R²) of a column) of which rounding leaves enough."""


@dataclass(frozen=True)
class Equations:
    """Normal equations of all K columns on the blocks fitted, and what they are judged by, in scaled columns.

    After the K columns stand some that are nothing: terms of fewer columns than the largest are filled up with them.
    """

    count: int
    """K."""
    normal: np.ndarray
    """(K, K) the noise of the regressors taken off, with priors and ridge."""
    right: np.ndarray
    """(K,)."""
    gram: np.ndarray
    """(K, K) of every channel, the noise of the regressors taken off."""
    cross: np.ndarray
    """(K,)."""
    limit: np.ndarray
    """(K,) the furthest that a coefficient may be."""
    energy: np.ndarray
    """(K, K) products as they are, scaled to a unit diagonal, with a trace of ridge."""
    noise: np.ndarray
    """(K, K) what the noise adds to `energy`."""

    def explained(
        self, base: np.ndarray, further: np.ndarray, hold: float, most_noise: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Squares explained by columns `base` (k,) with each of `further` (m, s), and where they are not known, (m,).

        They are not known here where more than a share `most_noise` of all directions together is noise, or where
        columns are so much alike that the complement is nothing but rounding. What is further out than its limit, the
        worst first, is held there by a prior of precision `hold`.
        """
        shape, flat = further.shape, further.ravel()
        diagonal = further[:, :, None], further[:, None, :]
        inverse = np.linalg.inv(self.normal[base[:, None], base])
        row, column = self.normal[flat[:, None], base], self.normal[base[:, None], flat]
        behind = (inverse @ column).T.reshape(*shape, -1)
        ahead = row.reshape(*shape, -1)
        own = np.linalg.inv(self.normal[diagonal] - ahead @ behind.swapaxes(1, 2))
        start = inverse @ self.right[base]
        beta = (own @ (self.right[further] - ahead @ start)[:, :, None])[:, :, 0]
        others = start - (beta[:, None] @ behind)[:, 0]
        values = np.flatnonzero(np.isfinite(self.limit[base]))
        # Columns of the inverse of all that belong to what is limited.
        taken = own @ (row @ inverse[:, values]).reshape(*shape, -1)
        rest = inverse[:, values] + behind.swapaxes(1, 2) @ taken
        pull = held_by(others[:, values], rest[:, values], self.limit[base[values]], hold)
        others += (rest @ pull[:, :, None])[:, :, 0]
        beta -= (taken @ pull[:, :, None])[:, :, 0]
        mixed = self.gram[base[:, None], flat].T.reshape(*shape, -1)
        towards = others @ self.gram[base[:, None], base] + 2 * (beta[:, None] @ mixed)[:, 0]
        found = 2 * others @ self.cross[base] + 2 * (beta * self.cross[further]).sum(axis=1)
        found -= (towards * others).sum(axis=1) + ((self.gram[diagonal] @ beta[:, :, None])[:, :, 0] * beta).sum(axis=1)
        alike = np.maximum(np.abs(own).max(axis=(1, 2)), np.abs(inverse).max(initial=0.0)) > MOST_ALIKE
        return found, alike | (self._noise_share(base, further) > most_noise)

    def _noise_share(self, base: np.ndarray, further: np.ndarray) -> np.ndarray:
        """Shares of all directions of the columns that are noise, added up, (m,)."""
        shape, flat, diagonal = further.shape, further.ravel(), (further[:, :, None], further[:, None, :])
        if not self.noise.any():
            return np.zeros(len(further))
        inverse, noise = np.linalg.inv(self.energy[base[:, None], base]), self.noise[base[:, None], base]
        mixed = self.energy[base[:, None], flat]
        behind = inverse @ mixed
        own = self.energy[diagonal] - mixed.T.reshape(*shape, -1) @ behind.T.reshape(*shape, -1).swapaxes(1, 2)
        # vᵀ noise v of the directions v = (−behind, 1) of the further columns.
        turned = (noise @ behind - 2 * self.noise[base[:, None], flat]).T.reshape(*shape, -1)
        added = self.noise[diagonal] + turned @ behind.T.reshape(*shape, -1).swapaxes(1, 2)
        return (inverse * noise).sum() + np.trace(np.linalg.solve(own, added), axis1=1, axis2=2)


def held_by(at: np.ndarray, inverse: np.ndarray, limit: np.ndarray, hold: float) -> np.ndarray:
    """What pulls at coefficients `at` (m, q) so that none is beyond its limit (q,), (m, q).

    The one that is furthest out is held, until none is out; `inverse` (m, q, q) says what a pull moves.
    """
    held, wanted, pull, moved = np.zeros(at.shape, bool), np.zeros(at.shape), np.zeros(at.shape), at
    for _ in range(at.shape[1]):
        out = np.where(held, 0.0, np.abs(moved) / limit)
        beyond = np.flatnonzero(out.max(axis=1, initial=0.0) > 1.0)
        if not len(beyond):
            break
        worst = out[beyond].argmax(axis=1)
        held[beyond, worst] = True
        wanted[beyond, worst] = np.sign(moved[beyond, worst]) * limit[worst]
        system = np.where(held[:, :, None] & held[:, None], inverse, 0.0)
        system[:, np.arange(len(limit)), np.arange(len(limit))] += np.where(held, 1.0 / hold, 1.0)
        pull = np.linalg.solve(system, np.where(held, wanted - at, 0.0)[:, :, None])
        moved, pull = at + (inverse @ pull)[:, :, 0], pull[:, :, 0]
    return pull
