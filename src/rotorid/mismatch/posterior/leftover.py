"""The leftover of a flight: what no model of the catalogue explains, and how it differs from an effect.

What is left of a real flight is not white. It looks like physics that is nearly right: a thrust that is a little off in
one turn and not in the next. So it is a sum of the catalogue's own columns with coefficients that are new in every
environment e and channel c, of variance t_c:

    ε_ce ~ N(0, I + t_c X_ce X_ceᵀ)

An effect has one coefficient for all environments, the leftover has none that lasts: a column is evidence of an
effect as far as its coefficient is the same wherever it is excited (the random effects of meta-analysis, DerSimonian
and Laird, Controlled Clinical Trials 7, 1986; cluster-robust errors have the same covariance). With G = VΛVᵀ of each
channel and environment everything follows from

    G̃ = V Λ/(1 + tΛ) Vᵀ        c̃ = V 1/(1 + tΛ) Vᵀc

and t_c is the most probable one given what the best model leaves.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rotorid.mismatch.plant.regression import NEVER_EXCITED, making_room
from rotorid.mismatch.posterior.evidence import Evidence

TINY = 1e-300
_FEWEST_ROWS = 50.0
"""Rows that a flight is taken to have at least."""
FULL_RIDGE = 1e-6
"""Ridge of the model of all columns, in units of their length."""
VARIANCES = np.concatenate([[0.0], np.geomspace(1e-1, 1e11, 49)])
"""Variances of the leftover that are tried, of scaled coefficients: as large as white noise is the number of rows."""


@dataclass(frozen=True)
class Weighed:
    """Products summed over channels and environments, less what the leftover explains."""

    gram: np.ndarray
    """(K, K)."""
    cross: np.ndarray
    """(K,)."""
    bias: np.ndarray
    """(K, K) what the noise of the regressors adds to `gram`."""
    kept: np.ndarray
    """(C,) share of each channel's energy that is kept. One number for all columns of a channel: the noise of their
    regressors cancels in some of their sums, and has to go on doing so."""


@dataclass(frozen=True)
class _ChannelSpectrum:
    """Products of one channel in the eigenvectors of each environment's Gram matrix, of the columns that act in it."""

    columns: np.ndarray
    """(k,) numbers of the columns."""
    values: np.ndarray
    """(E, k) eigenvalues, of columns of unit length."""
    vectors: np.ndarray
    """(E, k, k) eigenvectors in columns."""
    turned: np.ndarray
    """(E, k) cross products along them."""


_MOST_REMEMBERED = 64
"""Variances of the leftover of which a spectrum remembers the sums: they are of a few (VARIANCES)."""


@dataclass(frozen=True)
class Spectrum:
    """The evidence of a flight in the eigenvectors of each channel's and environment's Gram matrix."""

    unit: np.ndarray
    """(K,) coefficient in its own unit of a scaled one of 1; 0 for a column that is never excited."""
    channels: tuple[_ChannelSpectrum, ...]
    bias: np.ndarray
    """(C, K, K) what the noise of the regressors adds to the products."""
    rows: float
    """Whitened squares that the model of all columns leaves: the number of rows, as the whitening counts them."""

    _weighed: dict[bytes, Weighed] = field(default_factory=dict, compare=False, repr=False)

    def weighed(self, variance: np.ndarray) -> Weighed:
        """Sums over channels with a leftover of `variance` (C,) taken out; remembered, not to be written to."""
        asked = np.asarray(variance, float).tobytes()
        if asked not in self._weighed:
            making_room(self._weighed, _MOST_REMEMBERED)[asked] = self._sums(variance)
        return self._weighed[asked]

    def _sums(self, variance: np.ndarray) -> Weighed:
        size = len(self.unit)
        gram, cross, kept = np.zeros((size, size)), np.zeros(size), np.ones(len(self.channels))
        for c, (own, t) in enumerate(zip(self.channels, variance, strict=True)):
            shrunk = 1.0 / (1.0 + t * own.values)
            root = own.vectors * np.sqrt(own.values * shrunk)[:, None, :]
            gram[np.ix_(own.columns, own.columns)] += np.tensordot(root, root, axes=([0, 2], [0, 2]))
            cross[own.columns] += np.einsum("eik,ek->i", own.vectors, shrunk * own.turned)
            kept[c] = (own.values * shrunk).sum() / max(own.values.sum(), TINY)
        return Weighed(gram, cross, np.tensordot(kept, self.bias, 1), kept)

    def evidence_of(self, variance: np.ndarray) -> float:
        """Log marginal likelihood of a leftover of `variance` (C,) where no model explains anything, nats, less a
        constant."""
        out = 0.0
        for own, t in zip(self.channels, variance, strict=True):
            grown = 1.0 + t * own.values
            out += 0.5 * float((t / grown * own.turned**2 - np.log(grown)).sum())
        return out

    def variance_of_leftover(self, beta: np.ndarray) -> np.ndarray:
        """The variance of each channel's leftover that makes what coefficients (K,) leave most probable, (C,)."""
        return VARIANCES[np.argmax(self.gains_of_leftover(beta), axis=1)]

    def gains_of_leftover(self, beta: np.ndarray) -> np.ndarray:
        """Twice the log likelihood of each of VARIANCES in each channel, given what coefficients (K,) leave, (C, V)."""
        out = np.zeros((len(self.channels), len(VARIANCES)))
        for c, own in enumerate(self.channels):
            left = own.turned - own.values * np.einsum("eik,i->ek", own.vectors, beta[own.columns])
            values, squares = own.values.ravel(), (left**2).ravel()
            grown = [1.0 + t * values for t in VARIANCES]
            out[c] = [(t / g * squares - np.log(g)).sum() for t, g in zip(VARIANCES, grown, strict=True)]
        return out


def unit_of(*evidence: Evidence) -> np.ndarray:
    """Coefficients (K,) with which columns have unit length in all of some evidence; 0 of one never excited."""
    energy = sum(np.einsum("cekk->k", own.gram) for own in evidence)
    return np.where(energy > NEVER_EXCITED, 1.0 / np.sqrt(np.maximum(energy, TINY)), 0.0)


def spectrum_of(evidence: Evidence, unit: np.ndarray | None = None) -> Spectrum:
    """The spectrum of a flight's evidence, with columns in units of `unit` (K,), by default of unit length."""
    energies = np.einsum("cekk->ck", evidence.gram)
    unit = unit_of(evidence) if unit is None else unit
    channels = []
    for own, gram, cross in zip(energies, evidence.gram, evidence.cross, strict=True):
        columns = np.flatnonzero((own > 0) & (unit > 0))
        at = unit[columns]
        values, vectors = np.linalg.eigh(gram[:, columns[:, None], columns] * np.outer(at, at))
        turned = np.einsum("eik,ei->ek", vectors, cross[:, columns] * at)
        channels.append(_ChannelSpectrum(columns, np.maximum(values, 0.0), vectors, turned))
    gram = evidence.gram.sum(axis=(0, 1)) * np.outer(unit, unit)
    total = evidence.cross.sum(axis=(0, 1)) * unit
    left = evidence.square.sum() - total @ np.linalg.solve(gram + FULL_RIDGE * np.eye(len(unit)), total)
    bias = evidence.bias_gram * np.outer(unit, unit)
    return Spectrum(unit, tuple(channels), bias, max(float(left), _FEWEST_ROWS))
