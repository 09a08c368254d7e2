"""What a decision needs of a flight: Gram matrices of the whitened columns, and the leftover that no model explains.

`Evidence` holds them channel by channel and environment by environment (about 5 s each), as the engine's last search
saw them; it needs no recording and no code of an effect, so it can be kept in a file and decided on anew.

The leftover of a flight: what no model of the catalogue explains, and how it differs from an effect.

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

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from rotorid.mismatch.evidence.regression import NEVER_EXCITED, Regression, making_room
from rotorid.mismatch.evidence.rows import Term

TINY = 1e-300
FULL_RIDGE = 1e-6
"""Ridge of the model of all columns, in units of their length."""
VARIANCES = np.concatenate([[0.0], np.geomspace(1e-1, 1e11, 49)])
"""Variances of the leftover that are tried, of scaled coefficients: as large as white noise is the number of rows."""


@dataclass(frozen=True)
class LinearParameter:
    """A coefficient's symbol and unit, the physical bounds and the size up to which it is negligible, in that unit."""

    symbol: str
    unit: str
    low: float
    high: float
    negligible: float


@dataclass(frozen=True)
class EvidenceTerm:
    """A block of columns that enters or leaves a model together, without the code that computes it."""

    key: str
    """Unique: `id/form` of an effect, the name of a believed value, or of a nuisance."""
    kind: str
    """`effect`, `value`, `nuisance` or `wind`."""
    effect: str
    """Id of an effect; empty for another kind."""
    size: int
    """Number of columns."""
    prior_sd: tuple[float, ...]
    """One-sigma of each coefficient, in its unit; infinite where nothing is known."""
    run: str = ""
    """Only run that it acts in; empty for all."""
    window: tuple[str, float, float] | None = None
    """(run, start_s, stop_s) of an effect in part of a run."""
    values: tuple[float, ...] = ()
    """Parameter values of the form at which its columns are linearised."""
    form: str = ""
    linear: tuple[LinearParameter, ...] = ()
    """One for each column of an effect; empty where its only column is the gain of a form without linear ones."""
    nonlinear: tuple[str, ...] = ()
    """Symbols of the parameters that the columns depend on nonlinearly."""
    must_show: tuple[int, ...] = ()
    """Places in `linear` of parameters without which the form is another effect."""
    brings: tuple[str, ...] = ()
    """Believed values (the contract's names) that it changes as well where it is new in a vehicle."""
    resolution: float = 1.0
    """How many times the size that matters elsewhere its contribution must have."""
    of_change: bool = False
    """Whether the bounds in `linear` are those of a change between two sets, and not of the parameters themselves."""
    alone: bool = False
    """Whether of two sets only the second can have it."""
    of_reading: tuple[tuple[int, int], ...] = ()
    """Places in `linear` of parameters stated as p/(1 − s), each with the place of its s (`Form.stated`)."""

    def stated(self, fitted: np.ndarray) -> np.ndarray:
        """Parameters as the form's equation has them, from fitted coefficients, each (k,)."""
        out = np.array(fitted, float)
        for place, scale in self.of_reading:
            out[place] /= 1.0 - fitted[scale]
        return out


@dataclass(frozen=True)
class Evidence:
    """Products of K whitened columns and the residual in C channels over E environments of the fitted blocks, and the
    engine's own choice from them."""

    terms: tuple[EvidenceTerm, ...]
    start: Mapping[str, int]
    """Key of a term to its first column."""
    channels: np.ndarray
    """(C,) numbers of the channels: force, moment, accelerometer, gyroscope, three axes each."""
    gram: np.ndarray
    """(C, E, K, K), each in the units of its coefficients to the power −1."""
    cross: np.ndarray
    """(C, E, K)."""
    square: np.ndarray
    """(C, E) whitened squares of the believed vehicle's residual."""
    blocks: np.ndarray
    """(E,) number of blocks of about a second."""
    bias_gram: np.ndarray
    """(C, K, K) what the noise of the regressors adds to the sum of `gram`."""
    bias_cross: np.ndarray
    """(C, K) the same of `cross`."""
    apart_columns: np.ndarray
    """(m,) columns that some of the channels alone estimate (`Regression.apart`); none where all estimate all."""
    apart_channels: np.ndarray
    """Numbers of those channels."""
    active: tuple[str, ...] = ()
    """Keys of the effects that the engine selected."""


def _term_of(term: Term) -> EvidenceTerm:
    """What is kept of a term of a regression."""
    prior = tuple(float(sd) for sd in np.broadcast_to(np.asarray(term.prior_sd, float), (term.size,)))
    if term.form is None:
        return EvidenceTerm(term.key, term.kind, term.effect, term.size, prior, term.run, term.window, term.values)
    parameters, linear = term.form.parameters, term.form.linear
    return EvidenceTerm(
        key=term.key,
        kind=term.kind,
        effect=term.effect,
        size=term.size,
        prior_sd=prior,
        run=term.run,
        window=term.window,
        values=tuple(float(v) for v in term.values),
        form=term.form.name,
        linear=tuple(
            LinearParameter(p.symbol, p.unit, float(p.low), float(p.high), float(p.negligible))
            for p in (parameters[i] for i in linear)
        ),
        nonlinear=tuple(parameters[i].symbol for i in term.form.nonlinear),
        must_show=tuple(linear.index(i) for i in term.form.must_show if i in linear),
        brings=term.form.brings,
        resolution=float(term.form.resolution),
        of_reading=tuple((linear.index(p), linear.index(s)) for p, s in term.form.of_reading),
    )


def evidence_from(regression: Regression) -> Evidence:
    """What a regression holds, its products kept by channel."""
    kept, apart = regression.by_channel, regression.apart
    share = float(regression.training.mean())
    return Evidence(
        terms=tuple(_term_of(t) for t in regression.terms),
        start=dict(regression.start),
        channels=kept.channels,
        gram=kept.gram,
        cross=kept.cross,
        square=kept.square,
        blocks=np.bincount(kept.environment[kept.environment >= 0], minlength=kept.square.shape[1]),
        bias_gram=kept.bias_gram * share,
        bias_cross=kept.bias_cross * share,
        apart_columns=np.zeros(0, int) if apart is None else apart.columns,
        apart_channels=np.zeros(0, int) if apart is None else apart.channels,
    )


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
            # Variances of the leftover of which a spectrum remembers the sums: they are of a few (VARIANCES).
            most_remembered = 64
            making_room(self._weighed, most_remembered)[asked] = self._sums(variance)
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

    def by_environment(self, variance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """What `weighed` sums up, of each environment: products (E, K, K) and (E, K) over all channels."""
        size, count = len(self.unit), len(self.channels[0].values)
        gram, cross = np.zeros((count, size, size)), np.zeros((count, size))
        for own, t in zip(self.channels, variance, strict=True):
            shrunk = 1.0 / (1.0 + t * own.values)
            root = own.vectors * np.sqrt(own.values * shrunk)[:, None, :]
            gram[:, own.columns[:, None], own.columns] += root @ root.transpose(0, 2, 1)
            cross[:, own.columns] += np.einsum("eik,ek->ei", own.vectors, shrunk * own.turned)
        return gram, cross

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
    fewest_rows = 50.0  # Rows that a flight is taken to have at least.
    return Spectrum(unit, tuple(channels), bias, max(float(left), fewest_rows))
