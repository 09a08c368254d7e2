"""What a decision needs of a flight: Gram matrices of the whitened columns, and what each column stands for.

`Evidence` holds them channel by channel and environment by environment (about 5 s each), as the engine's last search
saw them; it needs no recording and no code of an effect, so it can be kept in a file and decided on anew.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rotorid.mismatch.plant.regression import Regression
from rotorid.mismatch.plant.rows import Term


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
