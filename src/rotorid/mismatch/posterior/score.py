"""Log posterior of a model: which effects are at work, their coefficients integrated out.

    y = X_always a + Σ_j X_j β_j + ε        ε the flight's leftover (`leftover`)

Coefficients are normal within their physical bounds, so a model's log posterior follows from the normal equations.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rotorid.mismatch.plant.regression import limited_bias
from rotorid.mismatch.posterior.leftover import Spectrum
from rotorid.mismatch.posterior.problem import Problem

Model = tuple[str, ...]
"""Keys of the effects at work, sorted."""
_RIDGE = 1e-9
"""Ridge, in units of the diagonal, where the correction for noisy regressors is left out."""


@dataclass(frozen=True)
class _Mode:
    """Most probable coefficients of some columns, scaled, and what they are worth."""

    log_evidence: float
    """Log marginal likelihood, nats, less what is the same for all models."""
    beta: np.ndarray
    """(k,)."""
    covariance: np.ndarray
    """(k, k)."""


@dataclass(frozen=True)
class Scored:
    """A model with its log posterior."""

    log_posterior: float
    """Nats, less a constant; −∞ for a model that has no mode."""
    columns: np.ndarray
    """(k,) of the model."""
    mode: _Mode | None


@dataclass
class Posterior:
    """The log posterior of models of one problem; scores are remembered, to be summed over afterwards."""

    problem: Problem
    visited: dict[Model, float] = field(default_factory=dict)

    def __call__(self, model: Model) -> float:
        """Log posterior of a model, nats."""
        key = tuple(sorted(model))
        if key not in self.visited:
            self.visited[key] = scored(self.problem, key).log_posterior
        return self.visited[key]

    def leftover_of(self, model: Model, spectrum: Spectrum) -> np.ndarray:
        """The variance of each channel's leftover, (C,), that makes what a model leaves most probable."""
        at, beta = scored(self.problem, model), np.zeros(len(spectrum.unit))
        if at.mode is not None:
            beta[at.columns] = at.mode.beta
        return spectrum.variance_of_leftover(beta)


def scored(problem: Problem, model: Model) -> Scored:
    """A model's log posterior and mode."""
    columns = problem.columns(model)
    mode = _mode_of(problem, columns, problem.believed(model))
    if mode is None:
        return Scored(-np.inf, columns, None)
    value = mode.log_evidence + log_prior(problem, model) - _too_small(problem, model, columns, mode)
    return Scored(value, columns, mode)


def log_prior(problem: Problem, model: Model) -> float:
    """Log prior of a model, nats: what one of its effects brings about by itself is free."""
    own = set(model)
    return sum(problem.log_prior_of[key] for key in model if own.isdisjoint(problem.brought_by.get(key, ())))


def places(columns: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Where some columns stand among those of a model."""
    at = {column: i for i, column in enumerate(columns)}
    return np.array([at[c] for c in wanted], int)


def _mode_of(
    problem: Problem, columns: np.ndarray, believed: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> _Mode | None:
    """The mode of some columns within their bounds; None where the normal equations have none.

    `believed` are one-sigma and bounds of every column (`Problem.believed`). The noise of the regressors is limited in
    every direction of these columns.
    """
    grid = np.ix_(columns, columns)
    bias = limited_bias(problem.gram[grid], problem.bias[grid])
    return _modes(problem, columns[None], bias[None], believed)[0]


def log_evidences(
    problem: Problem, columns: np.ndarray, believed: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> np.ndarray:
    """About the log evidence of each of many sets of columns (m, k); −∞ where there is no mode.

    The noise of the regressors is limited column by column: faster, to rank moves by.
    """
    bias = problem.limited_bias[columns[:, :, None], columns[:, None, :]]
    return np.array([-np.inf if m is None else m.log_evidence for m in _modes(problem, columns, bias, believed)])


def _modes(
    problem: Problem, columns: np.ndarray, bias: np.ndarray, believed: tuple[np.ndarray, np.ndarray, np.ndarray]
) -> list[_Mode | None]:
    """The modes of many sets of columns (m, k) at once, whose regressors' noise is `bias` (m, k, k)."""
    count, size = columns.shape
    if not size:
        return [_Mode(0.0, np.zeros(0), np.zeros((0, 0)))] * count

    def one_by_one() -> list[_Mode | None]:
        return [m for c, b in zip(columns, bias, strict=True) for m in _modes(problem, c[None], b[None], believed)]

    gram, (sd, low, high) = problem.gram[columns[:, :, None], columns[:, None, :]], (own[columns] for own in believed)
    right = problem.cross[columns] - problem.limited_bias_cross[columns]
    units, at = sd[:, :, None] * sd[:, None, :], (slice(None), np.arange(size), np.arange(size))
    normal = gram - bias
    normal[at] += 1.0 / sd**2
    try:
        triangle = np.linalg.cholesky(normal * units)
    except np.linalg.LinAlgError:
        if count > 1:
            return one_by_one()
        # The correction for noisy regressors may overshoot: without it.
        normal = gram.copy()
        normal[at] += _RIDGE * gram[at] + 1.0 / sd**2
        try:
            triangle = np.linalg.cholesky(normal * units)
        except np.linalg.LinAlgError:
            return [None]
    covariance = np.linalg.inv(normal * units) * units
    errors = np.sqrt(np.maximum(covariance[at], 0.0))
    slack = np.where(problem.is_value[columns], 0.0, problem.prior.slack * errors)
    own, asked = _with_apart(problem, columns, normal, right, sd)
    try:
        free = np.linalg.solve(own * sd[:, None, :], asked[:, :, None])[:, :, 0] * sd
    except np.linalg.LinAlgError:
        return one_by_one() if count > 1 else [None]
    out = []
    for i, beta in enumerate(free):
        beta = _within_bounds(own[i], asked[i], low[i], high[i], sd[i], slack[i], beta)
        if beta is None:
            out.append(None)
            continue
        value = right[i] @ beta - 0.5 * beta @ normal[i] @ beta - np.log(np.diag(triangle[i])).sum()
        out.append(_Mode(float(value), beta, covariance[i]))
    return out


def _with_apart(
    problem: Problem, columns: np.ndarray, normal: np.ndarray, right: np.ndarray, sd: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The normal equations (m, k, k), (m, k), in which columns that some channels alone estimate have their rows."""
    place = problem.place_apart[columns]
    model, at = np.nonzero(place >= 0)
    if not len(at):
        return normal, right
    normal, right, own = normal.copy(), right.copy(), place[model, at]
    normal[model, at] = problem.gram_apart[own[:, None], columns[model]]
    normal[model, at, at] += 1.0 / sd[model, at] ** 2
    right[model, at] = problem.cross_apart[own]
    return normal, right


def _within_bounds(
    normal: np.ndarray,
    right: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    sd: np.ndarray,
    slack: np.ndarray,
    beta: np.ndarray,
) -> np.ndarray | None:
    """Solution of normal equations within the bounds: the furthest out is held there, until none is out.

    `beta` is the solution without bounds; each may lie beyond its bounds by `slack` (k,).
    """
    held, at = np.zeros(len(right), bool), np.zeros(len(right))
    for _ in range(len(right)):
        out = np.maximum(low - slack - beta, beta - high - slack)
        out[held] = -1.0
        worst = int(np.argmax(out / sd))
        if out[worst] <= 0:
            break
        held[worst], at[worst] = True, low[worst] if beta[worst] < low[worst] else high[worst]
        free, beta = ~held, at.copy()
        try:
            rest = right[free] - normal[np.ix_(free, held)] @ at[held]
            beta[free] = np.linalg.solve(normal[np.ix_(free, free)] * sd[free][None, :], rest) * sd[free]
        except np.linalg.LinAlgError:
            return None
    return beta


def _too_small(problem: Problem, model: Model, columns: np.ndarray, mode: _Mode) -> float:
    """Nats that forms cost which are negligible, or do not show what makes them that form."""
    prior, cost = problem.prior, 0.0
    for key in (k for k in model if k in problem.effects):
        term, own = problem.terms[key], problem.columns_of[key]
        at, unit = places(columns, own), problem.unit[own]
        size = np.abs(mode.beta[at]) * unit
        error = np.sqrt(np.maximum(np.diag(mode.covariance)[at], 0.0)) * unit
        if term.linear and all(s <= p.negligible for s, p in zip(size, term.linear, strict=True)):
            cost += prior.small_nats
        cost += prior.small_nats * sum(size[i] <= prior.shown * error[i] for i in term.must_show)
    return cost
