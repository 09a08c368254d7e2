"""The most probable model and its posterior: one move at a time, ranked at the present mode, the best scored exactly.

Moves: an id or a believed value that may be wrong more or less, another form of one; where none of these helps one
for another, or two for none.

Log posterior of a model: which effects are at work, their coefficients integrated out.

    y = X_always a + Σ_j X_j β_j + ε        ε the flight's leftover (`evidence.gram`)

Coefficients are normal within their physical bounds, so a model's log posterior follows from the normal equations.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from rotorid.mismatch.decide.problem import Prior, Problem, problem_of
from rotorid.mismatch.evidence.gram import Evidence, Spectrum, spectrum_of
from rotorid.mismatch.evidence.regression import limited_bias

Model = tuple[str, ...]
"""Keys of the effects at work, sorted."""


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


def _log_evidences(
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
    ridge = 1e-9  # Ridge, in units of the diagonal, where the correction for noisy regressors is left out.
    try:
        triangle = np.linalg.cholesky(normal * units)
    except np.linalg.LinAlgError:
        if count > 1:
            return one_by_one()
        # The correction for noisy regressors may overshoot: without it.
        normal = gram.copy()
        normal[at] += ridge * gram[at] + 1.0 / sd**2
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


@dataclass(frozen=True)
class Found:
    """The most probable model that was found, and the posterior that remembers all visited on the way."""

    posterior: Posterior
    model: Model
    log_posterior: float

    @property
    def problem(self) -> Problem:
        """What was decided on."""
        return self.posterior.problem


def decide(evidence: Evidence, prior: Prior, *starts: Iterable[str]) -> Found:
    """The most probable model of a flight with its leftover, which is learnt from the flight itself.

    The search starts from nothing and from the effects of each of `starts`. What its best model leaves says how large
    the leftover is, and with that the search goes on, until the leftover stays as it is. That is done twice, from no
    leftover and from all being leftover; where both ends are about as probable the larger leftover is believed.
    """
    there = {term.key for term in evidence.terms if term.kind == "effect"}
    spectrum, known = spectrum_of(evidence), [tuple(sorted(there & set(start))) for start in starts]
    all_of_it = spectrum.variance_of_leftover(np.zeros(len(spectrum.unit)))
    small, large = (_settled(evidence, spectrum, prior, v, known) for v in (np.zeros(len(all_of_it)), all_of_it))
    gain = joint(spectrum, small) - joint(spectrum, large)
    return small if gain > prior.leftover_nats else large


def joint(spectrum: Spectrum, found: Found) -> float:
    """Log posterior of a model and its leftover together, nats, less a constant."""
    return found.log_posterior + spectrum.evidence_of(found.problem.variance)


def _settled(
    evidence: Evidence, spectrum: Spectrum, prior: Prior, variance: np.ndarray, known: Iterable[Model]
) -> Found:
    """The most probable model and its leftover, from a leftover of `variance` (C,) and each of the models `known`."""
    starts: dict[Model, None] = dict.fromkeys([(), *known])
    leftover_rounds = 5  # Rounds of model and leftover at most, should the two go on in a circle.
    for _ in range(leftover_rounds):
        found = most_probable(problem_of(evidence, spectrum, variance, prior), starts)
        before, variance = variance, found.posterior.leftover_of(found.model, spectrum)
        starts = dict.fromkeys([found.model, *starts])
        if np.array_equal(before, variance):
            break
    return found


def most_probable(problem: Problem, starts: Iterable[Model]) -> Found:
    """The best of the models that searches from several starts end in."""
    posterior = Posterior(problem)
    ends = [_climbed(posterior, start) for start in starts]
    best = max(ends, key=posterior)
    return Found(posterior, best, posterior(best))


def _climbed(posterior: Posterior, start: Model) -> Model:
    """The model in which a search ends that starts from another; from nothing where that one has no mode."""
    model = tuple(sorted(start)) if np.isfinite(posterior(start)) else ()
    most_moves = 60
    for _ in range(most_moves):
        better = _best_of(posterior, model, _single_moves(posterior.problem, model))
        better = better or _best_of(posterior, model, _exchanges(posterior.problem, model))
        if better is None:
            break
        model = better
    return model


def ranked(problem: Problem, models: Sequence[Model]) -> np.ndarray:
    """About the log posterior of each model (m,), nats, less a constant; −∞ where it has no mode."""
    out = np.empty(len(models))
    alike: dict[tuple[int, tuple[str, ...]], list[tuple[int, np.ndarray]]] = {}
    for i, model in enumerate(models):
        columns = problem.columns(model)
        freed = tuple(k for k in model if k in problem.freed)
        alike.setdefault((len(columns), freed), []).append((i, columns))
    at_once = 64  # Models that are ranked in one call: what stays in the processor's memory.
    for (_, freed), own in alike.items():
        for first in range(0, len(own), at_once):
            at, columns = zip(*own[first : first + at_once], strict=True)
            out[list(at)] = _log_evidences(problem, np.array(columns), problem.believed(freed))
    return out + np.array([log_prior(problem, model) for model in models])


def _best_of(posterior: Posterior, model: Model, moves: Sequence[Model]) -> Model | None:
    """The best of the most promising moves; None where none is better than the present model."""
    here, *others = ranked(posterior.problem, [model, *moves])
    gains = [value - here for value in others]
    best, found = posterior(model), None
    most_scored = 8  # Moves of a kind that are scored exactly.
    least_gain = 0.05  # Nats by which a move must be better, so that the search ends.
    # Nats below the present model, as ranked, from which a move is not scored: the ranking is off by less.
    worst_ranked = -5.0
    for k in sorted(range(len(moves)), key=lambda k: (gains[k], k), reverse=True)[:most_scored]:
        if gains[k] < worst_ranked:
            break
        if (value := posterior(moves[k])) > best + least_gain:
            best, found = value, moves[k]
    return found


def _single_moves(problem: Problem, model: Model) -> list[Model]:
    """Models with one id more or less, or with another form of one."""
    choices = problem.choices
    of_id = {choices[key]: key for key in model}
    out = []
    for key, once in choices.items():
        if key not in model:
            out.append(tuple(sorted({*model, key} - {of_id.get(once)})))
    return out + [without(model, key) for key in model]


def _exchanges(problem: Problem, model: Model) -> list[Model]:
    """Models with one id in another's place, or with two less."""
    choices = problem.choices
    taken = {choices[key] for key in model}
    others = [key for key, once in choices.items() if once not in taken]
    out = [tuple(sorted((*without(model, gone), key))) for gone in model for key in others]
    return out + [without(model, a, b) for i, a in enumerate(model) for b in model[i + 1 :]]


def without(model: Model, *gone: str) -> Model:
    """A model less some of its keys."""
    return tuple(key for key in model if key not in gone)
