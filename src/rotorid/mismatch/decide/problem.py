"""The evidence of a flight in the coordinates of the decision: columns of unit length with prior and bounds, the
constants of the decision, and which believed values are wrong given the gains that flights show.

The numbers of the decision, each with its unit and its reason.

Cost of an id, leftover and least size were chosen among a few on the bench for decisions (`snakemake decisions`), by
what is new and lost in planted flights and wrong in drawn ones; the others are those of a first sketch. How many of the
statements hold that they make is for the bench to measure (docs/proof/README.md).

Which believed values of a vehicle are wrong, given the gains that its flights show.

A flight knows four gains, not seven values: ln(C_F/m), along the thrust, and about each axis the logarithm of the
moment over the inertia. With δ = ln(true / believed) of the values and A from values to gains,

    g = A δ + e        δ_k ~ N(0, spike²) where value k is right, N(0, slab²) where it is wrong        e ~ t(ν; V)

so that the evidence of every small subset of wrong values is a multivariate t density of the gains (O'Hagan and
Forster, Kendall's Advanced Theory of Statistics 2B, 2004, 9.7). Values of one ratio have the same gains: a class.

Where commands alone say how fast rotors turn, C_F is taken as what carries the believed mass: the first gain is not
known, and a wrong mass (`lifted`) is in the other three.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations

import numpy as np

from rotorid.mismatch.evidence.gram import TINY, Evidence, EvidenceTerm, Spectrum
from rotorid.mismatch.evidence.unknowns import UNKNOWNS

GAINS = ("mass", "inertia_xx", "inertia_yy", "inertia_zz")
"""To each gain the value that stands in its denominator."""
_OF_GAINS: Mapping[str, tuple[float, float, float, float]] = {
    "mass": (-1, 0, 0, 0),
    "lifted": (0, 1, 1, 1),
    "thrust": (1, 1, 1, 0),
    "torque": (0, 0, 0, 1),
    "inertia_xx": (0, -1, 0, 0),
    "inertia_yy": (0, 0, -1, 0),
    "inertia_zz": (0, 0, 0, -1),
    "arm": (0, 1, 1, 0),
}
"""To each value what a larger logarithm of it adds to each gain; `lifted` where commands alone are known."""


Values = dict[str, tuple[float, float]]
"""Relative change and one-sigma of believed values, by the key of their term."""
_RATIOS = {
    "mass": ("thrust",),
    "lifted": ("torque", "arm"),
    "arm": ("inertia_xx", "inertia_yy"),
    "torque": ("inertia_zz",),
}
"""Believed values of which a flight knows no more than the ratio to others. Were both free, noise alone would say what
they have in common (the residual is itself their sum): the first stay as believed, their doubt is the others'."""
_HELD_SD = 1e-4
"""Relative one-sigma of a value that stays as believed."""
_ALWAYS = ("value", "nuisance", "wind")
"""Kinds of terms that are in every model."""


@dataclass(frozen=True)
class Prior:
    """What is believed before a recording is looked at."""

    effect_nats: float = 6.0
    """Nats that an id costs in addition to the logarithm of its number of forms: one of the catalogue's in four hundred
    is at work by belief, so that the fifty of them together are found by chance in one flight of eight."""
    nameless_nats: float = 6.0
    """Further nats of an empirical term without a name: one of the catalogue explains as much more often."""
    value_reach: float = 3.0
    """Trusts (the user's one-sigma) that a believed value may move as long as it is not called wrong."""
    freed_nats: float = 2.0
    """Nats that a believed value costs which may be wrong by more than that."""
    freed_sd: tuple[float, float] = (0.15, 0.5)
    """Least and largest relative one-sigma of such a value, else `value_reach` times its trust."""
    right_sd: float = 0.004
    """Relative one-sigma of a believed value that is right: nobody knows one better."""
    most_freed: int = 3
    """Values that are called wrong at once at most."""
    gain_bias: tuple[float, float] = (0.14, 0.10)
    """One-sigma that a gain between force or moment and motion is biased by, over √(residual / own part of its column),
    where all of the residual is leftover: of all frequencies, and of those of `model.gains.VALUE_BAND`. Measured on 44
    sets: right values are biased by 0.2 % (rms) where that root is below 0.03, by 3 % up to 0.3, by 25 % above."""
    gain_freedom: float = 30.0
    """Degrees of freedom of a gain's variance."""
    freed_reach: float = 0.6
    """Relative change that such a value may have at most: one further off is a mistake of its own (`doubts`)."""
    change_reach: float = 5.0
    """One-sigma of a change between two sets of flights at least, in units of what it looks like where nothing changed:
    an estimate that nothing else limits shrinks by four hundredths. Ten lets large changes be found that cancel."""
    slack: float = 1.5
    """Standard errors by which a coefficient may lie beyond its physical bound, as an estimate of one on the bound."""
    shown: float = 2.0
    """Standard errors from zero of a parameter without which its form is another effect."""
    small_nats: float = 20.0
    """Nats that a form costs with every parameter negligible, or with one that must show and does not."""
    attenuation: float = 0.3
    """Largest share of a column's energy that is taken for the noise of its regressor."""
    leftover_nats: float = 10.0
    """Nats by which a smaller leftover must be more probable to be believed: of a few environments its size is hardly
    known, and every real flight has one."""
    least_size: float = 0.03
    """Squares of a contribution over those of the noise above which it matters: less changes an error by one and a half
    percent at most."""
    form_error: float = 0.15
    """Share of an effect's contribution that its form is wrong by: what is less than that of another one in the same
    channel may be what is wrong with that one's form. Chosen on 22 drawn flights (docs/proof/README.md)."""
    open_nats: float = 5.0
    """Nats that a model with another id in its place may be worse for that id to be looked at."""


@dataclass(frozen=True)
class Problem:
    """Sums of products of K columns, scaled to unit length, and what is believed of them."""

    terms: Mapping[str, EvidenceTerm]
    columns_of: Mapping[str, np.ndarray]
    """Key of a term to its columns."""
    always: np.ndarray
    """Columns that are in every model."""
    effects: Mapping[str, str]
    """Key of an effect's term to what can be in a model only once: its id, or of one window its key."""
    freed: Mapping[str, float]
    """Key of a believed value to its scaled one-sigma where it may be wrong by more: such keys are part of a model."""
    log_prior_of: Mapping[str, float]
    """Key of what a model may hold to its log prior, nats."""
    unit: np.ndarray
    """(K,) coefficient in its own unit of a scaled one of 1; 0 for a column that is never excited."""
    gram: np.ndarray
    """(K, K) products over all environments and channels, the leftover taken out."""
    cross: np.ndarray
    """(K,)."""
    bias: np.ndarray
    """(K, K) what the regressors' noise adds to the sum of `gram`."""
    limited_bias: np.ndarray
    """(K, K) the same, no column's more than a share of its energy."""
    limited_bias_cross: np.ndarray
    """(K,)."""
    place_apart: np.ndarray
    """(K,) place in `gram_apart` of the columns that some channels alone estimate, −1 of the others."""
    gram_apart: np.ndarray
    """(m, K) products of those channels."""
    cross_apart: np.ndarray
    """(m,)."""
    prior_sd: np.ndarray
    """(K,) one-sigma of the scaled coefficients."""
    low: np.ndarray
    """(K,) physical bounds."""
    high: np.ndarray
    is_value: np.ndarray
    """(K,) mask of the believed values, whose bounds have no slack."""
    rows: float
    """Whitened squares that the model of all columns leaves: the number of rows, as the whitening counts them."""
    variance: np.ndarray
    """(C,) variance of the leftover's coefficients in each channel; all products are weighed by it already."""
    prior: Prior
    channel_gram: np.ndarray
    """(C, K, K) products in each channel with the leftover in them: how large a contribution is."""
    brought_by: Mapping[str, frozenset[str]] = field(default_factory=dict)
    """To a key those of which one brings it about: next to it, it costs nothing."""

    def columns(self, keys: Iterable[str]) -> np.ndarray:
        """Columns of the model `keys`: those that are always there, then those of its effects."""
        own = (self.columns_of[k] for k in keys if k in self.effects)
        return np.concatenate([self.always, *own]).astype(int)

    @property
    def choices(self) -> dict[str, str]:
        """Key of all that a model may hold or not, to what it can hold only once."""
        return {**self.effects, **{key: key for key in self.freed}}

    def believed(self, keys: Iterable[str]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """One-sigma, lower and upper bound of every scaled coefficient in the model `keys`, (K,) each."""
        freed = [k for k in keys if k in self.freed]
        if not freed:
            return self.prior_sd, self.low, self.high
        sd, low, high = self.prior_sd.copy(), self.low.copy(), self.high.copy()
        for key in freed:
            (at,) = self.columns_of[key]
            most = self.prior.freed_reach / max(self.unit[at], TINY)
            sd[at], low[at], high[at] = self.freed[key], -most, most
        return sd, low, high


def problem_of(evidence: Evidence, spectrum: Spectrum, variance: np.ndarray, prior: Prior) -> Problem:
    """The problem that a flight's evidence poses.

    Parameters
    ----------
    evidence
        Gram matrices of the flight, by channel and environment.
    spectrum
        The same in the eigenvectors of each Gram matrix.
    variance
        Variance of the leftover's coefficients in each channel, scaled as the columns, (C,).
    prior
        The numbers of the decision.
    """
    terms = {t.key: t for t in evidence.terms}
    columns_of = {t.key: evidence.start[t.key] + np.arange(t.size) for t in evidence.terms}
    always = [columns_of[t.key] for kind in _ALWAYS for t in evidence.terms if t.kind == kind]
    unit = spectrum.unit
    seen = spectrum.weighed(variance)
    bias_cross = (seen.kept @ evidence.bias_cross) * unit
    root = limiting(seen.gram, seen.bias, prior)
    rows = spectrum.rows
    place, gram_apart, cross_apart = scaled_apart(evidence, unit)
    sd, low, high, is_value = believed(evidence.terms, _trusts_of(evidence.terms), columns_of, unit, rows, prior)
    effects = {t.key: t.key if t.run else t.effect for t in evidence.terms if t.kind == "effect"}
    trusts = _trusts_of(evidence.terms)
    freed = {
        key: float(np.clip(prior.value_reach * trust, *prior.freed_sd) / unit[evidence.start[key]])
        for key, trust in trusts.items()
        if trust > _HELD_SD and unit[evidence.start[key]] > 0
    }
    return Problem(
        terms=terms,
        columns_of=columns_of,
        always=np.concatenate(always) if always else np.zeros(0, int),
        effects=effects,
        freed=freed,
        log_prior_of={**log_priors(effects, terms, prior), **dict.fromkeys(freed, -prior.freed_nats)},
        unit=unit,
        gram=seen.gram,
        cross=seen.cross,
        bias=seen.bias,
        limited_bias=seen.bias * np.outer(root, root),
        limited_bias_cross=bias_cross * root,
        place_apart=place,
        gram_apart=gram_apart,
        cross_apart=cross_apart,
        prior_sd=sd,
        low=low,
        high=high,
        is_value=is_value,
        rows=rows,
        variance=variance,
        prior=prior,
        channel_gram=evidence.gram.sum(axis=1) * np.outer(unit, unit),
    )


def limiting(gram: np.ndarray, bias: np.ndarray, prior: Prior) -> np.ndarray:
    """Factor (K,) of each column with which its noise is no more than a share of its energy."""
    energy = np.maximum(np.diag(gram), TINY)
    return np.sqrt(np.minimum(1.0, prior.attenuation * energy / np.maximum(np.diag(bias), TINY)))


def scaled_apart(
    evidence: Evidence, unit: np.ndarray, weights: np.ndarray | None = None
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Place of the columns that some channels alone estimate, and those channels' products, scaled.

    `weights` (E,) are those of the environments, by default 1.
    """
    columns = evidence.apart_columns
    place = np.full(len(unit), -1)
    place[columns] = np.arange(len(columns))
    own = np.isin(evidence.channels, evidence.apart_channels)
    weights = np.ones(evidence.gram.shape[1]) if weights is None else weights
    gram = np.einsum("e,ceij->ij", weights, evidence.gram[own]) - evidence.bias_gram[own].sum(axis=0)
    cross = np.einsum("e,cei->i", weights, evidence.cross[own]) - evidence.bias_cross[own].sum(axis=0)
    return place, (gram * np.outer(unit, unit))[columns], (cross * unit)[columns]


def log_priors(effects: Mapping[str, str], terms: Mapping[str, EvidenceTerm], prior: Prior) -> dict[str, float]:
    """Log prior of every effect's term: of its id, shared evenly by the id's forms."""
    forms = list(effects.values())
    return {
        key: -prior.effect_nats
        - float(np.log(forms.count(once)))
        - (prior.nameless_nats if terms[key].effect in UNKNOWNS else 0.0)
        for key, once in effects.items()
    }


def _trusts_of(terms: Iterable[EvidenceTerm]) -> dict[str, float]:
    """Relative one-sigma of every believed value, those that stay held and their doubt the others'."""
    out = {t.key: float(t.prior_sd[0]) for t in terms if t.kind == "value"}
    for held, others in _RATIOS.items():
        if held in out and any(other in out for other in others):
            for other in others:
                if other in out:
                    out[other] = float(np.hypot(out[other], out[held]))
            out[held] = _HELD_SD
    return out


def believed(
    terms: Iterable[EvidenceTerm],
    trusts: Mapping[str, float],
    columns_of: Mapping[str, np.ndarray],
    unit: np.ndarray,
    rows: float,
    prior: Prior,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """One-sigma, lower and upper bound of every scaled coefficient, and whether it is a believed value, (K,) each.

    Effects have unit information (one-sigma √rows: what one row determines), nuisances what is stated of them,
    values the user's trust.
    """
    count = len(unit)
    sd = np.full(count, np.sqrt(rows))
    low, high, is_value = np.full(count, -np.inf), np.full(count, np.inf), np.zeros(count, bool)
    for term in terms:
        at = columns_of[term.key]
        own = np.maximum(unit[at], TINY)
        if term.kind != "effect":
            stated = np.asarray(term.prior_sd)
            sd[at] = np.where(np.isfinite(stated), stated / own, np.sqrt(rows))
        if term.kind == "value":
            sd[at], is_value[at] = trusts[term.key] / own, True
            low[at], high[at] = -prior.value_reach * sd[at], prior.value_reach * sd[at]
        for column, parameter in zip(at, term.linear, strict=False):  # the gain of a form has no parameter of its own
            length = max(unit[column], TINY)
            low[column], high[column] = parameter.low / length, parameter.high / length
    sd[unit == 0] = 1.0
    return sd, low, high, is_value


@dataclass(frozen=True)
class LogGain:
    """The logarithm of a gain over the believed one, as a flight shows it."""

    log: float
    variance: float


@dataclass(frozen=True)
class _Option:
    """Some values called wrong, the others right."""

    log_posterior: float
    """Nats, less a constant."""
    changes: Values
    """Of the values called wrong."""


_Options = Mapping[frozenset[str], _Option]


def options_of(gains: Mapping[str, LogGain], trust: Mapping[str, float], prior: Prior) -> _Options:
    """Every subset of values that may be wrong.

    `gains` are those known, by the key of GAINS; `trust` is the relative one-sigma that each value was stated with.
    """
    keys = [k for k in _OF_GAINS if k in trust]
    known = [i for i, k in enumerate(GAINS) if k in gains]
    turn = np.array([_OF_GAINS[k] for k in keys], float).reshape(len(keys), len(GAINS))[:, known].T
    log = np.array([gains[GAINS[i]].log for i in known])
    variance = np.diag([gains[GAINS[i]].variance for i in known])
    sd = np.clip([prior.value_reach * trust[k] for k in keys], *prior.freed_sd)
    costs = [prior.freed_nats + np.log(prior.freed_sd[0] / trust[k]) for k in keys]
    out = {}
    for size in range(prior.most_freed + 1):
        for wrong in map(list, combinations(range(len(keys)), size)):
            spread = np.full(len(keys), prior.right_sd**2)
            spread[wrong] = sd[wrong] ** 2
            seen = turn * spread
            covariance = seen @ turn.T + variance
            pull = np.linalg.solve(covariance, np.column_stack([log, seen]))
            mean, own = seen.T @ pull[:, 0], spread - np.einsum("gk,gk->k", seen, pull[:, 1:])
            freedom = prior.gain_freedom
            far = 0.5 * (freedom + len(log)) * np.log1p(log @ pull[:, 0] / freedom)
            evidence = -0.5 * np.linalg.slogdet(covariance)[1] - far - sum(costs[k] for k in wrong)
            changes = {
                keys[k]: (float(np.expm1(mean[k])), float(np.exp(mean[k]) * np.sqrt(max(own[k], 0.0)))) for k in wrong
            }
            out[frozenset(changes)] = _Option(float(evidence), changes)
    return out


def called_wrong(options: _Options, least_nats: float, refused: Sequence[str] = ()) -> frozenset[str]:
    """The most probable subset less each value without which it is hardly less probable (`least_nats`)."""
    possible = [w for w in options if not w.intersection(refused)]
    wrong = max(possible, key=lambda w: options[w].log_posterior)
    while wrong:
        worth = {k: options[wrong].log_posterior - options[wrong - {k}].log_posterior for k in wrong}
        least = min(sorted(worth), key=worth.get)
        if worth[least] >= least_nats:
            break
        wrong -= {least}
    return wrong


def same_ratio(wrong: frozenset[str], known: Mapping[str, float]) -> list[frozenset[str]]:
    """Subsets with one value in place of another of the same gains, this one included; `known` are all values."""
    out = [wrong]
    for key in sorted(wrong):
        for other in known:
            if other not in wrong and _OF_GAINS[other] == tuple(-x for x in _OF_GAINS[key]):
                out.append(wrong - {key} | {other})
    return out


def in_place(options: _Options, wrong: frozenset[str], least_nats: float) -> dict[str, list[Values]]:
    """To each value called wrong what explains as much in its place: the changes of others, one or two of them.

    Two only where no other does so alone (an arm is both inertias as well): they may be less probable by as much again,
    for each costs something by itself.
    """
    out = {}
    for key in sorted(wrong):
        rest = wrong - {key}
        found = [
            w
            for w, o in options.items()
            if key not in w
            and rest < w
            and o.log_posterior >= options[wrong].log_posterior - least_nats * len(w - rest)
        ]
        fewest = min((len(w) for w in found), default=0)
        if fewest:
            own = sorted((w for w in found if len(w) == fewest), key=lambda w: -options[w].log_posterior)
            out[key] = [{k: options[w].changes[k] for k in sorted(w - rest)} for w in own]
    return out
