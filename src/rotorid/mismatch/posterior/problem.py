"""The evidence of a flight in the coordinates of the decision: columns of unit length, with their prior and bounds."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from rotorid.mismatch.posterior.evidence import Evidence, EvidenceTerm, Sums, sums_of
from rotorid.mismatch.posterior.prior import Prior
from rotorid.mismatch.regression import NEVER_EXCITED
from rotorid.mismatch.unknowns import UNKNOWNS

TINY = 1e-300
FEWEST_ROWS = 50.0
"""Rows that a flight is taken to have at least."""
FULL_RIDGE = 1e-6
"""Ridge of the model of all columns, in units of their length."""
ALWAYS = ("value", "nuisance", "wind")
"""Kinds of terms that are in every model."""


@dataclass(frozen=True)
class Problem:
    """Sums of products of K columns over E environments, scaled to unit length, and what is believed of them."""

    terms: Mapping[str, EvidenceTerm]
    columns_of: Mapping[str, np.ndarray]
    """Key of a term to its columns."""
    always: np.ndarray
    """Columns that are in every model."""
    effects: Mapping[str, str]
    """Key of an effect's term to what can be in a model only once: its id, or of one window its key."""
    log_prior_of: Mapping[str, float]
    """Key of an effect's term to its log prior, nats."""
    unit: np.ndarray
    """(K,) coefficient in its own unit of a scaled one of 1; 0 for a column that is never excited."""
    gram: np.ndarray
    """(E, K, K)."""
    cross: np.ndarray
    """(E, K)."""
    square: np.ndarray
    """(E,)."""
    share: np.ndarray
    """(E,) share of the blocks in each environment."""
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
    power: float
    """What whitened squares are divided by: the leftover's power over white noise."""
    prior: Prior
    total_gram: np.ndarray
    """(K, K) sum of `gram`."""
    total_cross: np.ndarray
    """(K,) sum of `cross`."""

    def columns(self, keys: Iterable[str]) -> np.ndarray:
        """Columns of the model with the effects `keys`: those that are always there, then theirs."""
        return np.concatenate([self.always, *(self.columns_of[k] for k in keys)]).astype(int)

    def with_power(self, power: float) -> Problem:
        """The same with another power of the leftover."""
        return replace(self, power=power)


def problem_of(evidence: Evidence, power: float, prior: Prior) -> Problem:
    """The problem that a flight's evidence poses.

    Parameters
    ----------
    evidence
        Gram matrices of the flight, by block.
    power
        What whitened squares are divided by, 1.
    prior
        The numbers of the decision.
    """
    sums = sums_of(evidence)
    terms = {t.key: t for t in evidence.terms}
    columns_of = {t.key: evidence.start[t.key] + np.arange(t.size) for t in evidence.terms}
    always = [columns_of[t.key] for kind in ALWAYS for t in evidence.terms if t.kind == kind]
    unit = units(sums)
    gram, cross = sums.gram * np.outer(unit, unit), sums.cross * unit
    total_gram, total_cross = gram.sum(axis=0), cross.sum(axis=0)
    bias = sums.bias_gram * np.outer(unit, unit)
    root = np.sqrt(np.minimum(1.0, prior.attenuation / np.maximum(np.diag(bias), TINY)))
    rows = max(leftover(total_gram, total_cross, sums.square.sum()), FEWEST_ROWS)
    place, gram_apart, cross_apart = scaled_apart(sums, unit)
    sd, low, high, is_value = believed(evidence.terms, columns_of, unit, rows, prior)
    effects = {t.key: t.key if t.run else t.effect for t in evidence.terms if t.kind == "effect"}
    return Problem(
        terms=terms,
        columns_of=columns_of,
        always=np.concatenate(always) if always else np.zeros(0, int),
        effects=effects,
        log_prior_of=log_priors(effects, terms, prior),
        unit=unit,
        gram=gram,
        cross=cross,
        square=sums.square,
        share=sums.blocks / sums.blocks.sum(),
        bias=bias,
        limited_bias=bias * np.outer(root, root),
        limited_bias_cross=sums.bias_cross * unit * root,
        place_apart=place,
        gram_apart=gram_apart,
        cross_apart=cross_apart,
        prior_sd=sd,
        low=low,
        high=high,
        is_value=is_value,
        rows=rows,
        power=power,
        prior=prior,
        total_gram=total_gram,
        total_cross=total_cross,
    )


def units(sums: Sums) -> np.ndarray:
    """One over the length of every column (K,); 0 for one that is never excited."""
    energy = np.diag(sums.gram.sum(axis=0))
    return np.where(energy > NEVER_EXCITED, 1.0 / np.sqrt(np.maximum(energy, TINY)), 0.0)


def leftover(gram: np.ndarray, cross: np.ndarray, square: float) -> float:
    """Whitened squares that the model of all columns leaves."""
    full = gram + FULL_RIDGE * np.eye(len(gram))
    return float(square - cross @ np.linalg.solve(full, cross))


def scaled_apart(sums: Sums, unit: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Place of the columns that some channels alone estimate, and those channels' products, scaled."""
    place = np.full(len(unit), -1)
    if sums.apart is None:
        return place, np.zeros((0, len(unit))), np.zeros(0)
    own = unit[sums.apart.columns]
    place[sums.apart.columns] = np.arange(len(own))
    return place, sums.apart.gram * np.outer(own, unit), sums.apart.cross * own


def log_priors(effects: Mapping[str, str], terms: Mapping[str, EvidenceTerm], prior: Prior) -> dict[str, float]:
    """Log prior of every effect's term: of its id, shared evenly by the id's forms."""
    forms = list(effects.values())
    return {
        key: -prior.effect_nats
        - float(np.log(forms.count(once)))
        - (prior.nameless_nats if terms[key].effect in UNKNOWNS else 0.0)
        for key, once in effects.items()
    }


def believed(
    terms: Iterable[EvidenceTerm],
    columns_of: Mapping[str, np.ndarray],
    unit: np.ndarray,
    rows: float,
    prior: Prior,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """One-sigma, lower and upper bound of every scaled coefficient, and whether it is a believed value, (K,) each.

    Effects have unit information (one-sigma √rows: what one row alone would tell), nuisances what is stated of them,
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
            is_value[at] = True
            low[at], high[at] = -prior.value_reach * sd[at], prior.value_reach * sd[at]
        for column, parameter in zip(at, term.linear, strict=False):  # the gain of a form has no parameter of its own
            length = max(unit[column], TINY)
            low[column], high[column] = parameter.low / length, parameter.high / length
    sd[unit == 0] = 1.0
    return sd, low, high, is_value
