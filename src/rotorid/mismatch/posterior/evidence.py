"""What a decision needs of a flight: Gram matrices of the whitened columns, and what each column stands for.

`Evidence` holds them block by block (about 1 s each), as the engine's last search saw them; it needs no recording and
no code of an effect, so it can be kept in a file and decided on anew. `Sums` holds the same by environment (about 5 s).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rotorid.mismatch.comparison import environments
from rotorid.mismatch.fitted import Fitted
from rotorid.mismatch.regression import Apart
from rotorid.mismatch.rows import Term


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
    compound: bool = False
    """Whether the form could be two effects."""
    resolution: float = 1.0
    """How many times the size that matters elsewhere its contribution must have."""
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
    """Products of whitened columns (K) and residual over blocks of time, and the engine's own choice from them."""

    terms: tuple[EvidenceTerm, ...]
    start: Mapping[str, int]
    """Key of a term to its first column."""
    gram: np.ndarray
    """(blocks, K, K), each in the units of its coefficients to the power −1."""
    cross: np.ndarray
    """(blocks, K)."""
    square: np.ndarray
    """(blocks,) whitened squares of the believed vehicle's residual."""
    run: np.ndarray
    """(blocks,) number of the run."""
    training: np.ndarray
    """(blocks,) mask of the blocks fitted."""
    precision: np.ndarray
    """(K,) prior precision that the engine uses."""
    bias_gram: np.ndarray
    """(K, K) what the noise of the regressors adds to the sum of `gram` over all blocks."""
    bias_cross: np.ndarray
    """(K,) the same of `cross`."""
    limit: np.ndarray
    """(K,) how far the engine lets a coefficient move; infinite for all but believed values."""
    block_s: float
    """Length of a block, s."""
    apart: Apart | None
    """Products of the channels that alone estimate some terms; None where all channels estimate all."""
    active: tuple[str, ...]
    """Keys of the effects that the engine selected."""
    trail: tuple[str, ...]
    """Steps of its search."""
    not_established: Mapping[str, str]
    """Ids that it looked at and dropped, with the reason."""
    values: Mapping[str, tuple[float, float]]
    """Believed values that it calls wrong: relative change and one-sigma."""


def term_of(term: Term) -> EvidenceTerm:
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
        compound=term.form.compound,
        resolution=float(term.form.resolution),
        of_reading=tuple((linear.index(p), linear.index(s)) for p, s in term.form.of_reading),
    )


def evidence_of(found: Fitted) -> Evidence:
    """What the last search on a flight saw, and what it chose."""
    regression, selection = found.model.search.regression, found.model.selection
    return Evidence(
        terms=tuple(term_of(t) for t in regression.terms),
        start=dict(regression.start),
        gram=regression.gram,
        cross=regression.cross,
        square=regression.square,
        run=regression.run,
        training=regression.training,
        precision=regression.precision,
        bias_gram=regression.bias_gram,
        bias_cross=regression.bias_cross,
        limit=regression.limit,
        block_s=float(regression.block_s),
        apart=regression.apart,
        active=tuple(selection.active),
        trail=tuple(selection.trail),
        not_established={k: str(v) for k, v in selection.not_established.items()},
        values={k: (float(a), float(b)) for k, (a, b) in found.values.items()},
    )


@dataclass(frozen=True)
class ApartSums:
    """Sums over the fitted blocks of the products that alone estimate some columns (`Regression.Apart`)."""

    columns: np.ndarray
    """(m,) columns estimated so."""
    gram: np.ndarray
    """(m, K) less the noise of the regressors."""
    cross: np.ndarray
    """(m,) less the same."""


@dataclass(frozen=True)
class Sums:
    """Evidence summed over the environments of the fitted blocks."""

    gram: np.ndarray
    """(environments, K, K)."""
    cross: np.ndarray
    """(environments, K)."""
    square: np.ndarray
    """(environments,)."""
    blocks: np.ndarray
    """(environments,) number of blocks."""
    bias_gram: np.ndarray
    """(K, K) noise of the regressors in the sum of `gram`."""
    bias_cross: np.ndarray
    """(K,)."""
    apart: ApartSums | None


def sums_of(evidence: Evidence) -> Sums:
    """Evidence by environment: stretches of five seconds within a run, shorter where the flight is short."""
    fitted = evidence.training
    environment = environments(evidence.run[fitted], evidence.block_s)
    count, share = int(environment.max()) + 1, float(fitted.mean())

    def summed(blocks: np.ndarray) -> np.ndarray:
        return np.array([blocks[fitted][environment == e].sum(axis=0) for e in range(count)])

    apart = evidence.apart
    return Sums(
        gram=summed(evidence.gram),
        cross=summed(evidence.cross),
        square=summed(evidence.square),
        blocks=np.bincount(environment),
        bias_gram=evidence.bias_gram * share,
        bias_cross=evidence.bias_cross * share,
        apart=None
        if apart is None or not len(apart.columns)
        else ApartSums(
            columns=apart.columns,
            gram=apart.gram[fitted].sum(axis=0) - apart.bias_gram * share,
            cross=apart.cross[fitted].sum(axis=0) - apart.bias_cross * share,
        ),
    )
