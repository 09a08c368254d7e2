"""Whether what is left of a channel depends on what was recorded: by a test, and by what a flexible regression still
explains."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from scipy.stats import f as f_distribution

from rotorid.mismatch.evidence.regression import at_least, quadratic_form, spread_of
from rotorid.recordings import Split
from rotorid.recordings.signal.kernels import causal

ALARM_P = 1e-5
"""A residual depends on the inputs where the p-value is below this."""
SMALLEST_SHARE_OF_NOISE = 0.3
"""A left-over dependence below this share of the noise is not worth a word."""


def with_products(z: np.ndarray) -> np.ndarray:
    """Inputs and their pairwise products, (n, p + p(p+1)/2)."""
    i, j = np.triu_indices(z.shape[1])
    return np.concatenate([z, z[:, i] * z[:, j]], axis=1)


class Flexible:
    """A ridge regression on features that stands for whatever could be explained: fitted on training runs, judged on
    those held out; on all where no run is."""

    def __init__(self, features: Sequence[np.ndarray], runs: Sequence[str], split: Split):
        """`features` (n, p) of every stretch, and its run."""
        self._features = features
        self._fitted = [split.training == split.held_out or run in split.training for run in runs]
        self.judged = [i for i, fitted in enumerate(self._fitted) if not fitted] or list(range(len(runs)))
        """Numbers of the stretches that are judged."""
        gram, size = self._products(features), features[0].shape[1]
        self._weights = gram + 1e-2 * np.trace(gram) / size * np.eye(size)

    def _products(self, other: Sequence[np.ndarray]) -> np.ndarray:
        return sum(f.T @ x for f, x, fitted in zip(self._features, other, self._fitted, strict=True) if fitted)

    def energies(self, left: Sequence[np.ndarray]) -> tuple[float, float]:
        """Energy of residuals (n,) of every stretch where it is judged, and what the regression leaves of it."""
        beta = np.linalg.solve(self._weights, self._products(left))
        energy = energy_of(left[i] for i in self.judged)
        return energy, min(energy_of(left[i] - self._features[i] @ beta for i in self.judged), energy)


def standardised(
    parts: Sequence[Mapping[str, np.ndarray]], count: int | None = None
) -> tuple[list[str], list[np.ndarray]]:
    """Names of the inputs that vary, and per stretch their values (n, p), of mean 0 and deviation 1 over the first
    `count` stretches (default all): the others follow on the same scale."""
    names = [n for n in parts[0] if all(n in z for z in parts)]
    stacked = [np.stack([z[n] for n in names], axis=1) for z in parts]
    every = np.concatenate(stacked[:count])
    mean, spread = every.mean(axis=0), every.std(axis=0)
    keep = spread > 1e-9
    scaled = [((z - mean) / np.where(keep, spread, 1))[:, keep] for z in stacked]
    return [n for n, k in zip(names, keep, strict=True) if k], scaled


def wald(parts, inputs, taps, rate_hz, shared=None, most=1.0, memory=0):
    """Block-robust Hotelling test of a regression of the whitened residual on the whitened inputs.

    `shared` holds per stretch what one more draw of the sensors' noise changes in residual (n,) and inputs (n, p);
    once to `most` times that is taken away, as much as explains most. Blocks up to `memory` apart may have noise alike.
    """
    size = inputs[0].shape[1]
    blocks, stretches, noise = [], [], np.zeros(size)
    block_s = 2.0
    per = max(2, int(block_s * rate_hz))
    for k, (y, z) in enumerate(zip(parts, inputs, strict=True)):
        yw, zw = _whitened(y, taps), _whitened(z, taps)
        y_noise, z_noise = (0 * yw, 0 * zw) if shared is None else (_whitened(x, taps) for x in shared[k])
        for i in np.array_split(np.arange(len(yw)), max(1, len(yw) // per)):
            blocks.append((zw[i].T @ zw[i], zw[i].T @ yw[i], len(i)))
            stretches.append(k)
        noise = noise + z_noise.T @ y_noise
    gram = sum(b[0] for b in blocks)
    inverse = np.linalg.pinv(gram, rcond=1e-9, hermitian=True)
    cross = sum(b[1] for b in blocks)
    scale = float(noise @ inverse @ noise)
    noise = noise * float(np.clip(noise @ inverse @ cross / scale, 1.0, most)) if scale > 0 else noise
    beta = inverse @ (cross - noise)
    each = noise / sum(b[2] for b in blocks)
    scores = np.array([c - n * each - g @ beta for g, c, n in blocks])
    plain = inverse
    robust = inverse @ spread_of(scores, np.array(stretches), memory) @ inverse
    covariance = at_least(robust, plain)
    statistic = quadratic_form(beta, covariance)
    count = len(blocks)
    if count - size < 3:
        return 1.0, np.zeros(size)
    p = float(f_distribution.sf(statistic * (count - size) / (size * (count - 1)), size, count - size))
    return p, beta / np.sqrt(np.maximum(np.diag(covariance), 1e-300))


def _whitened(x: np.ndarray, taps: np.ndarray) -> np.ndarray:
    return causal(taps, x)[len(taps) - 1 :]


def energy_of(parts: Iterable[np.ndarray]) -> float:
    return sum(float(x @ x) for x in parts)
