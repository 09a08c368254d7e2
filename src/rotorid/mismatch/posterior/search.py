"""The most probable model: one move at a time from a start, moves ranked at the present mode, the best scored exactly.

Moves: an id or a believed value that may be wrong more or less, another form of one; where none of these helps one
for another, or two for none.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from rotorid.mismatch.posterior.evidence import Evidence
from rotorid.mismatch.posterior.leftover import Spectrum, spectrum_of
from rotorid.mismatch.posterior.problem import Prior, Problem, problem_of
from rotorid.mismatch.posterior.score import (
    Model,
    Posterior,
    log_evidences,
    log_prior,
)

_MOST_SCORED = 8
"""Moves of a kind that are scored exactly."""
_MOST_MOVES = 60
_AT_ONCE = 64
"""Models that are ranked in one call: what stays in the processor's memory."""
_LEFTOVER_ROUNDS = 5
"""Rounds of model and leftover at most, should the two go on in a circle."""
_LEAST_GAIN = 0.05
"""Nats by which a move must be better, so that the search ends."""
_WORST_RANKED = -5.0
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


def decide(evidence: Evidence, prior: Prior, *starts: Iterable[str]) -> Found:
    """The most probable model of a flight with its leftover, which is learnt from the flight itself.

    The search starts from nothing and from the effects of each of `starts`. What its best model leaves says how large
    the leftover is, and with that the search goes on, until the leftover stays as it is. That is done twice, from no
    leftover and from all being leftover; where both ends are about as probable the larger leftover is believed.
    """
    there = {term.key for term in evidence.terms if term.kind == "effect"}
    spectrum, known = spectrum_of(evidence), [tuple(sorted(there & set(start))) for start in starts]
    all_of_it = spectrum.variance_of_leftover(np.zeros(len(spectrum.unit)))
    small, large = (settled(evidence, spectrum, prior, v, known) for v in (np.zeros(len(all_of_it)), all_of_it))
    gain = joint(spectrum, small) - joint(spectrum, large)
    return small if gain > prior.leftover_nats else large


def joint(spectrum: Spectrum, found: Found) -> float:
    """Log posterior of a model and its leftover together, nats, less a constant."""
    return found.log_posterior + spectrum.evidence_of(found.problem.variance)


def settled(
    evidence: Evidence, spectrum: Spectrum, prior: Prior, variance: np.ndarray, known: Iterable[Model]
) -> Found:
    """The most probable model and its leftover, from a leftover of `variance` (C,) and each of the models `known`."""
    starts: dict[Model, None] = dict.fromkeys([(), *known])
    for _ in range(_LEFTOVER_ROUNDS):
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
    for _ in range(_MOST_MOVES):
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
    for (_, freed), own in alike.items():
        for first in range(0, len(own), _AT_ONCE):
            at, columns = zip(*own[first : first + _AT_ONCE], strict=True)
            out[list(at)] = log_evidences(problem, np.array(columns), problem.believed(freed))
    return out + np.array([log_prior(problem, model) for model in models])


def _best_of(posterior: Posterior, model: Model, moves: Sequence[Model]) -> Model | None:
    """The best of the most promising moves; None where none is better than the present model."""
    here, *others = ranked(posterior.problem, [model, *moves])
    gains = [value - here for value in others]
    best, found = posterior(model), None
    for k in sorted(range(len(moves)), key=lambda k: (gains[k], k), reverse=True)[:_MOST_SCORED]:
        if gains[k] < _WORST_RANKED:
            break
        if (value := posterior(moves[k])) > best + _LEAST_GAIN:
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
