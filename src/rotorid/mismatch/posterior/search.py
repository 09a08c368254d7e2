"""The most probable model: one move at a time from a start, moves ranked at the present mode, the best scored exactly.

Moves: an id more or less, another form of one; where none of these helps one id for another, or two for none.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from rotorid.mismatch.posterior.evidence import Evidence
from rotorid.mismatch.posterior.prior import Prior
from rotorid.mismatch.posterior.problem import Problem, problem_of
from rotorid.mismatch.posterior.score import (
    Model,
    Posterior,
    Scored,
    error_cost,
    log_prior,
    mode_of,
    power_of_leftover,
    scored,
)

MOST_SCORED = 8
"""Moves of a kind that are scored exactly."""
MOST_MOVES = 60
LEAST_GAIN = 0.05
"""Nats by which a move must be better, so that the search ends."""
WORST_RANKED = -5.0
"""Nats below the present model, as ranked, from which a move is not scored: the ranking is off by less."""


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


def decide(evidence: Evidence, prior: Prior) -> Found:
    """The most probable model of a flight, the leftover's power taken from the flight itself.

    A first mode is found under a high power, from nothing and from what the engine selected; what it leaves says how
    far the leftover is from white noise. Under that power the search goes on from this mode, and from the engine's.
    """
    first = problem_of(evidence, prior.first_power, prior)
    engine = tuple(sorted(key for key in evidence.active if key in first.effects))
    mode = most_probable(first, [(), engine]).model
    power = np.clip(power_of_leftover(first.with_power(prior.judged_power), mode), *prior.powers)
    return most_probable(first.with_power(float(power)), [mode, engine])


def most_probable(problem: Problem, starts: Iterable[Model]) -> Found:
    """The best of the models that searches from several starts end in."""
    posterior = Posterior(problem)
    ends = [climbed(posterior, start) for start in starts]
    best = max(ends, key=posterior)
    return Found(posterior, best, posterior(best))


def climbed(posterior: Posterior, start: Model) -> Model:
    """The model in which a search ends that starts from another; from nothing where that one has no mode."""
    model = tuple(sorted(start)) if np.isfinite(posterior(start)) else ()
    for _ in range(MOST_MOVES):
        ranked = Ranking(posterior.problem, model)
        better = best_of(posterior, ranked, single_moves(posterior.problem, model))
        better = better or best_of(posterior, ranked, exchanges(posterior.problem, model))
        if better is None:
            break
        model = better
    return model


class Ranking:
    """About how much better than a model others are, with the contributions' errors as they are at its mode."""

    def __init__(self, problem: Problem, model: Model) -> None:
        self.problem = problem
        self.at: Scored = scored(problem, model)
        self.here = self.value(model)

    def value(self, model: Model) -> float:
        """About a model's log posterior, nats, less a constant; −∞ where it has no mode."""
        columns = self.problem.columns(model)
        mode = mode_of(self.problem, columns, self.at.weighted, exact=False)
        if mode is None:
            return -np.inf
        return mode.log_evidence + log_prior(self.problem, model) - error_cost(self.problem, model, columns, mode.beta)


def best_of(posterior: Posterior, ranking: Ranking, moves: Sequence[Model]) -> Model | None:
    """The best of the most promising moves; None where none is better than the present model."""
    gains = [ranking.value(move) - ranking.here for move in moves]
    best, found = ranking.at.log_posterior, None
    for k in sorted(range(len(moves)), key=lambda k: (gains[k], k), reverse=True)[:MOST_SCORED]:
        if gains[k] < WORST_RANKED:
            break
        if (value := posterior(moves[k])) > best + LEAST_GAIN:
            best, found = value, moves[k]
    return found


def single_moves(problem: Problem, model: Model) -> list[Model]:
    """Models with one id more or less, or with another form of one."""
    of_id = {problem.effects[key]: key for key in model}
    out = []
    for key, once in problem.effects.items():
        if key not in model:
            out.append(tuple(sorted({*model, key} - {of_id.get(once)})))
    return out + [without(model, key) for key in model]


def exchanges(problem: Problem, model: Model) -> list[Model]:
    """Models with one id in another's place, or with two less."""
    taken = {problem.effects[key] for key in model}
    others = [key for key, once in problem.effects.items() if once not in taken]
    out = [tuple(sorted((*without(model, gone), key))) for gone in model for key in others]
    return out + [without(model, a, b) for i, a in enumerate(model) for b in model[i + 1 :]]


def without(model: Model, *gone: str) -> Model:
    """A model less some of its keys."""
    return tuple(key for key in model if key not in gone)
