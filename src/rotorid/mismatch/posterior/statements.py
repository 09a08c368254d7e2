"""What the posterior says of each id at work: how sure, in place of which others, with which parameters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rotorid.mismatch.findings import Estimate, Status
from rotorid.mismatch.posterior.score import Model, Scored, places, scored
from rotorid.mismatch.posterior.search import Found, Ranking, without
from rotorid.mismatch.unknowns import UNKNOWNS

Z95 = 1.959963984540054
CONSIDERED = 10.0
"""Nats below the best model up to which others count: together they hold less than a percent."""
MOST_SUBSTITUTES = 6
"""Ids that are tried exactly in another's place, the most promising first."""
WORST_SUBSTITUTE = -8.0
"""Nats, as ranked, from which one is not tried."""


@dataclass(frozen=True)
class Statement:
    """What is said of one id of the most probable model."""

    id: str
    status: Status
    alternatives: tuple[str, ...]
    """For `ambiguous`: the whole class, itself included; ids that do nearly as well in its place."""
    probability: float
    """Share of the models with at least one of the class at work, among all that were visited."""
    odds: float
    """Log odds against the best model without it, nats."""
    parameters: tuple[Estimate, ...]
    """Linear parameters with 95 % intervals."""
    window: tuple[str, float, float] | None
    """(run, start_s, stop_s) of one in part of a run."""


def statements_of(found: Found) -> tuple[Statement, ...]:
    """A statement for each named id of the most probable model, the surest first."""
    at, ranking = scored(found.problem, found.model), Ranking(found.problem, found.model)
    named = [key for key in found.model if found.problem.terms[key].effect not in UNKNOWNS]
    # Everything is visited before shares are taken over what was visited.
    seen = [(key, substitutes(found, ranking, key), odds_of(found, key)) for key in named]
    return tuple(statement(found, at, *facts) for facts in sorted(seen, key=lambda facts: -facts[2]))


def statement(found: Found, at: Scored, key: str, others: tuple[str, ...], odds: float) -> Statement:
    """What is said of one term of the most probable model, given the ids that could stand in its place."""
    prior, term = found.problem.prior, found.problem.terms[key]
    said = odds > prior.said_nats and own_share(found, at, key) > prior.said_share
    members = {term.effect, *others}
    return Statement(
        id=term.effect,
        status=("ambiguous" if others else "established") if said else "suggested",
        alternatives=tuple(sorted(members)) if said and others else (),
        probability=share_of(found, members if said else {term.effect}),
        odds=odds,
        parameters=parameters(found, at, key),
        window=term.window,
    )


def odds_of(found: Found, key: str) -> float:
    """Log odds of the best model against the same without a term, nats."""
    return found.log_posterior - found.posterior(without(found.model, key))


def substitutes(found: Found, ranking: Ranking, key: str) -> tuple[str, ...]:
    """Named ids with which in a term's place the model is nearly as probable."""
    problem, rest = found.problem, without(found.model, key)
    taken = {problem.effects[k] for k in found.model}
    trials = [tuple(sorted((*rest, k))) for k, once in problem.effects.items() if once not in taken]
    gains = {trial: ranking.value(trial) - ranking.here for trial in trials}
    out = []
    for trial in sorted(trials, key=lambda t: -gains[t])[:MOST_SUBSTITUTES]:
        if gains[trial] <= WORST_SUBSTITUTE:
            break
        if found.posterior(trial) - found.log_posterior > -problem.prior.open_nats:
            (other,) = set(trial) - set(rest)
            out.append(problem.terms[other].effect)
    return tuple(sorted(set(out) - set(UNKNOWNS)))


def share_of(found: Found, members: set[str]) -> float:
    """Share of the visited models, by their posterior, that hold at least one of some ids."""
    near = {m: v for m, v in found.posterior.visited.items() if v > found.log_posterior - CONSIDERED}
    weight = {m: float(np.exp(v - found.log_posterior)) for m, v in near.items()}
    return sum(w for m, w in weight.items() if holds(found, m, members)) / sum(weight.values())


def holds(found: Found, model: Model, members: set[str]) -> bool:
    """Whether a model holds one of some ids."""
    return any(found.problem.terms[key].effect in members for key in model)


def own_share(found: Found, at: Scored, key: str) -> float:
    """Share of the leftover's squares that a term explains which the rest of the model could not take over."""
    where = places(at.columns, found.problem.columns_of[key])
    beta, covariance = at.mode.beta[where], at.mode.covariance[np.ix_(where, where)]
    return float(beta @ np.linalg.solve(covariance, beta)) * found.problem.power / found.problem.rows


def parameters(found: Found, at: Scored, key: str) -> tuple[Estimate, ...]:
    """Linear parameters of a term as its form states them, with 95 % intervals; none of a form without."""
    problem, term = found.problem, found.problem.terms[key]
    own = problem.columns_of[key]
    where, unit = places(at.columns, own), problem.unit[own]
    beta = at.mode.beta[where] * unit
    reach = Z95 * np.sqrt(np.maximum(np.diag(at.mode.covariance)[where], 0.0)) * unit
    out = []
    for k, parameter in enumerate(term.linear):
        moved = (np.where(np.arange(len(beta)) == k, beta + step, beta) for step in (0.0, -reach, reach))
        value, low, high = (float(term.stated(b)[k]) for b in moved)
        out.append(Estimate(parameter.symbol, value, parameter.unit, low, high))
    return tuple(out)
