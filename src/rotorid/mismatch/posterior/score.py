"""Log posterior of a model: which effects are at work, their coefficients integrated out.

    y = X_always a + Σ_j X_j β_j + Σ_e Σ_j η_je X_j^(e) β_j + ε,   η_je ~ N(0, σ²),   ε ~ N(0, φ)

Every contribution may be wrong by its own factor 1 + η in each environment e. With B = [X_j β_j] at the mode (two
rounds) these factors are integrated out, so that all follows from the environments' Gram matrices.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from rotorid.mismatch.posterior.problem import TINY, Problem
from rotorid.mismatch.regression import limited_bias

Model = tuple[str, ...]
"""Keys of the effects at work, sorted."""
ROUNDS = 2
"""Rounds in which the contributions' own errors follow the mode."""
RIDGE = 1e-9
"""Ridge, in units of the diagonal, where the correction for noisy regressors is left out."""


@dataclass(frozen=True)
class Weighted:
    """Sums over all environments, less what the contributions' own errors explain."""

    gram: np.ndarray
    """(K, K)."""
    cross: np.ndarray
    """(K,)."""
    square: float
    log_determinant: float
    """Σ_e log |I + σ² M_e / φ|: the price of these errors, in nats times two."""


@dataclass(frozen=True)
class Mode:
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
    mode: Mode | None
    weighted: Weighted


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


def scored(problem: Problem, model: Model) -> Scored:
    """A model's log posterior, mode and weighted sums."""
    columns = problem.columns(model)
    sums = weighted(problem, np.zeros((len(problem.unit), 0)))
    mode = mode_of(problem, columns, sums)
    for _ in range(ROUNDS):
        if mode is not None:
            sums = weighted(problem, contributions(problem, model, columns, mode.beta))
            mode = mode_of(problem, columns, sums)
    if mode is None:
        return Scored(-np.inf, columns, None, sums)
    value = mode.log_evidence - 0.5 * sums.square / problem.power - 0.5 * sums.log_determinant
    return Scored(value + log_prior(problem, model) - too_small(problem, model, columns, mode), columns, mode, sums)


def log_prior(problem: Problem, model: Model) -> float:
    """Log prior of a model, nats."""
    return sum(problem.log_prior_of[key] for key in model)


def places(columns: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Where some columns stand among those of a model."""
    at = {column: i for i, column in enumerate(columns)}
    return np.array([at[c] for c in wanted], int)


def contributions(problem: Problem, model: Model, columns: np.ndarray, beta: np.ndarray) -> np.ndarray:
    """Coefficients of all columns (K, effects), one column for what each effect of a model contributes."""
    out = np.zeros((len(problem.unit), len(model)))
    for j, key in enumerate(model):
        own = problem.columns_of[key]
        out[own, j] = beta[places(columns, own)]
    return out


def weighted(problem: Problem, parts: np.ndarray) -> Weighted:
    """Sums of all columns where each contribution in `parts` (K, J) may be wrong by a factor in every environment.

    With M_e = BᵀG_eB and R_e = φI + σ²M_e: G̃ = Σ_e (G_e − σ² G_eB R_e⁻¹ BᵀG_e), and so on.
    """
    error = problem.prior.form_error
    whole = float(problem.square.sum())
    if not parts.shape[1] or not error:
        return Weighted(problem.total_gram, problem.total_cross, whole, 0.0)
    pulls = problem.gram @ parts
    own = np.einsum("kj,ekl->ejl", parts, pulls)
    noise = problem.power * np.eye(parts.shape[1]) + error**2 * own
    inverse = np.linalg.inv(noise) * error**2
    explained = problem.cross @ parts
    turned = pulls @ inverse
    return Weighted(
        problem.total_gram - np.tensordot(turned, pulls, axes=([0, 2], [0, 2])),
        problem.total_cross - np.einsum("ekj,ej->k", turned, explained),
        whole - float(np.einsum("ej,ejl,el->", explained, inverse, explained)),
        float(np.linalg.slogdet(noise / problem.power)[1].sum()),
    )


def mode_of(problem: Problem, columns: np.ndarray, sums: Weighted, exact: bool = True) -> Mode | None:
    """The mode of some columns within their bounds; None where the normal equations have none.

    `exact` limits the noise of the regressors in every direction of these columns, else column by column: faster, to
    rank moves by.
    """
    power, grid = problem.power, np.ix_(columns, columns)
    gram, sd = sums.gram[grid], problem.prior_sd[columns]
    # What a contribution's own error takes of a column it takes of its noise, too.
    kept = np.clip(np.diag(gram) / np.maximum(np.diag(problem.total_gram)[columns], TINY), 0.0, 1.0)
    bias = limited_bias(problem.total_gram[grid], problem.bias[grid]) if exact else problem.limited_bias[grid]
    bias = bias * np.outer(np.sqrt(kept), np.sqrt(kept))
    right = (sums.cross[columns] - problem.limited_bias_cross[columns] * kept) / power
    found = factorised([gram - bias, gram + RIDGE * np.diag(np.diag(gram))], power, sd)
    if found is None:
        return None
    normal, triangle = found
    covariance = np.linalg.inv(normal * np.outer(sd, sd)) * np.outer(sd, sd)
    beta = within_bounds(problem, columns, *with_apart(problem, columns, normal, right, sd), covariance)
    if beta is None:
        return None
    value = right @ beta - 0.5 * beta @ normal @ beta - np.log(np.diag(triangle)).sum()
    return Mode(float(value), beta, covariance)


def factorised(grams: list[np.ndarray], power: float, sd: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Normal matrix of the first Gram matrix that makes a positive one, and its triangle in units of the prior.

    The correction for noisy regressors may overshoot; the second is without it.
    """
    for gram in grams:
        normal = gram / power + np.diag(1.0 / sd**2)
        try:
            return normal, np.linalg.cholesky(normal * np.outer(sd, sd))
        except np.linalg.LinAlgError:
            continue
    return None


def with_apart(
    problem: Problem, columns: np.ndarray, normal: np.ndarray, right: np.ndarray, sd: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """The normal equations in which the columns that some channels alone estimate have those channels' rows."""
    place = problem.place_apart[columns]
    at = np.flatnonzero(place >= 0)
    if not len(at):
        return normal, right
    normal, right, own = normal.copy(), right.copy(), place[at]
    normal[at] = problem.gram_apart[np.ix_(own, columns)] / problem.power
    normal[at, at] += 1.0 / sd[at] ** 2
    right[at] = problem.cross_apart[own] / problem.power
    return normal, right


def within_bounds(
    problem: Problem, columns: np.ndarray, normal: np.ndarray, right: np.ndarray, covariance: np.ndarray
) -> np.ndarray | None:
    """Solution of normal equations within the bounds: the furthest out is held there, until none is out."""
    low, high, sd = problem.low[columns], problem.high[columns], problem.prior_sd[columns]
    errors = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    slack = np.where(problem.is_value[columns], 0.0, problem.prior.slack * errors)
    held, at = np.zeros(len(columns), bool), np.zeros(len(columns))
    for _ in range(len(columns) + 1):
        free, beta = ~held, at.copy()
        try:
            rest = right[free] - normal[np.ix_(free, held)] @ at[held]
            beta[free] = np.linalg.solve(normal[np.ix_(free, free)] * sd[free][None, :], rest) * sd[free]
        except np.linalg.LinAlgError:
            return None
        out = np.maximum(low - slack - beta, beta - high - slack)
        out[held] = -1.0
        worst = int(np.argmax(out / sd))
        if out[worst] <= 0:
            break
        held[worst], at[worst] = True, low[worst] if beta[worst] < low[worst] else high[worst]
    return beta


def too_small(problem: Problem, model: Model, columns: np.ndarray, mode: Mode) -> float:
    """Nats that forms cost which are negligible, or do not show what makes them that form."""
    prior, cost = problem.prior, 0.0
    for key in model:
        term, own = problem.terms[key], problem.columns_of[key]
        at, unit = places(columns, own), problem.unit[own]
        size = np.abs(mode.beta[at]) * unit
        error = np.sqrt(np.maximum(np.diag(mode.covariance)[at], 0.0)) * unit
        if term.linear and all(s <= p.negligible for s, p in zip(size, term.linear, strict=True)):
            cost += prior.small_nats
        cost += prior.small_nats * sum(size[i] <= prior.shown * error[i] for i in term.must_show)
    return cost


def error_cost(problem: Problem, model: Model, columns: np.ndarray, beta: np.ndarray) -> float:
    """About what the contributions' own errors cost, nats: each alone, to rank moves by."""
    cost = 0.0
    for key in model:
        own = problem.columns_of[key]
        part = beta[places(columns, own)]
        energy = np.maximum((problem.gram[:, own[:, None], own] @ part) @ part, 0.0)
        cost += 0.5 * float(np.log1p(problem.prior.form_error**2 * energy / problem.power).sum())
    return cost


def power_of_leftover(problem: Problem, model: Model) -> float:
    """How many times more than white noise a model leaves: robust over model covariance of the environments' scores.

    z_e = c_e − G_e β at the mode, less each environment's share of their sum: tr(G⁻¹ Σ z_e z_eᵀ)/k · E/(E − 1).
    """
    found = scored(problem, model)
    columns = found.columns
    left = problem.cross[:, columns] - problem.gram[:, columns[:, None], columns] @ found.mode.beta
    left = left - left.sum(axis=0) * problem.share[:, None]
    gram = problem.total_gram[np.ix_(columns, columns)] + 1e-6 * np.eye(len(columns))
    ratio = np.einsum("ei,ei->", left, np.linalg.solve(gram, left.T).T) / len(columns)
    return float(ratio / (1.0 - 1.0 / len(problem.square)))
