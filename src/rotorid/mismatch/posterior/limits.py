"""How large each id that was not found may be all the same: upper limits at 95 %.

The limit of an id is that of its form which may be largest: with it added to the most probable model, the size that its
coefficients have with 95 % probability at most. The leftover is part of their covariance: where a flight is not
understood, little is excluded.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rotorid.mismatch.plant.unknowns import UNKNOWNS
from rotorid.mismatch.posterior.leftover import TINY
from rotorid.mismatch.posterior.score import places, scored
from rotorid.mismatch.posterior.search import Found
from rotorid.mismatch.posterior.statements import POSSIBLE, by_id

PROBABILITY = 0.95
_DRAWS = 400
_LEAST_KNOWN = 1e-9
"""Least variance of scaled coefficients in any direction."""


@dataclass(frozen=True)
class UpperLimit:
    """The largest that an id may be which was tested and not found."""

    id: str
    symbol: str
    """Of the parameter; empty of a form whose size has none of its own."""
    at_most: float | None
    """Of its magnitude, in `unit`."""
    unit: str
    share: float
    """Root mean square of its contribution over the fitted runs, in the unit of `size_of`."""


def limits_of(found: Found, squares: Mapping[str, np.ndarray]) -> tuple[UpperLimit, ...]:
    """Limits of the ids that are not at work, the largest share first.

    `squares` holds to a term's key what its columns amount to, (k, k): βᵀ S β is the square of the share that
    coefficients β, in their units, contribute.
    """
    problem, probability = found.problem, by_id(found)
    named = {t.effect for t in problem.terms.values() if t.kind == "effect" and not t.run} - UNKNOWNS.keys()
    at_work = {problem.terms[key].effect for key in found.model}
    out = []
    for effect in sorted(named - at_work):
        if probability.get(effect, 0.0) >= POSSIBLE:
            continue
        forms = [k for k, t in problem.terms.items() if t.effect == effect and not t.run and k in squares]
        limits = [limit for key in forms if (limit := _limit_of(found, key, squares[key])) is not None]
        if limits:
            out.append(max(limits, key=lambda limit: limit.share))
    return tuple(sorted(out, key=lambda limit: -limit.share))


def _limit_of(found: Found, key: str, squares: np.ndarray) -> UpperLimit | None:
    """The limit of one form; None where its columns are not excited, or with which the model has no mode."""
    problem, term = found.problem, found.problem.terms[key]
    own = problem.columns_of[key]
    if not problem.unit[own].any():
        return None
    at = scored(problem, tuple(sorted((*found.model, key))))
    if at.mode is None:
        return None
    where, unit = places(at.columns, own), problem.unit[own]
    beta = drawn(at.mode.beta[where], at.mode.covariance[np.ix_(where, where)], problem.low[own], problem.high[own])
    beta = beta * unit
    share = np.sqrt(np.maximum(np.einsum("di,ij,dj->d", beta, squares, beta), 0.0))
    if not term.linear:
        return UpperLimit(term.effect, "", None, "", float(np.quantile(share, PROBABILITY)))
    main = int(np.argmax(np.diag(squares) * np.median(beta**2, axis=0)))
    most = float(np.quantile(np.abs(beta[:, main]), PROBABILITY))
    parameter = term.linear[main]
    return UpperLimit(term.effect, parameter.symbol, most, parameter.unit, float(np.quantile(share, PROBABILITY)))


def drawn(mean: np.ndarray, covariance: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Draws of coefficients (DRAWS, k) from a normal distribution, moved to their bounds where they lie beyond.

    The same numbers at every call: a verdict does not change from one run to the next, nor by rounding, as it would by
    the signs of eigenvectors.
    """
    unit = np.sqrt(np.maximum(np.diag(covariance), TINY))
    values, vectors = np.linalg.eigh(covariance / np.outer(unit, unit))
    root = unit[:, None] * np.linalg.cholesky((vectors * np.maximum(values, _LEAST_KNOWN)) @ vectors.T)
    normal = np.random.default_rng(0).standard_normal((_DRAWS, len(mean)))
    return np.clip(mean + normal @ root.T, low, high)
