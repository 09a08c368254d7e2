"""What the posterior says of each id: at work, how sure, in place of which others; else how large it may be at most.

The posterior is taken at the model that was chosen, by whatever means. The upper limit of an id that was not found is
that of its form which may be largest: with it added to the most probable model, the size that its coefficients have
with 95 % probability at most. The leftover is part of their covariance: where a flight is not understood, little is
excluded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import chain

import numpy as np

from rotorid.mismatch.decide.posterior import Found, Model, Posterior, Scored, joint, places, ranked, scored, without
from rotorid.mismatch.decide.problem import Prior, Problem, problem_of
from rotorid.mismatch.decide.status import CLAIMED, Estimate, Status
from rotorid.mismatch.evidence.gram import TINY, Evidence, Spectrum
from rotorid.mismatch.evidence.unknowns import UNKNOWNS

PROBABILITY = 0.95
FORM_SD = 0.02
"""Share of what effects contribute that their forms are wrong by."""
_ROUNDS = 3
"""Rounds of learning the leftover from what the model leaves, and of looking at better models nearby."""
SURE, LIKELY, _POSSIBLE = 0.99, 0.5, 0.05
"""Probabilities from which an id (a class) is established (ambiguous), suggested, or looked at and not established."""


@dataclass(frozen=True)
class Statement:
    """What is said of one effect of the most probable model."""

    key: str
    """Key of its term."""
    id: str
    status: Status
    alternatives: tuple[str, ...]
    """For `ambiguous`: the whole class, itself included; the fewest ids of which one is surely at work."""
    probability: float
    """Share of the models with at least one of the class at work, among all that were visited."""
    odds: float
    """Log odds against the best model without it, nats."""
    parameters: tuple[Estimate, ...]
    """Linear parameters with 95 % intervals."""
    window: tuple[str, float, float] | None
    """(run, start_s, stop_s) of one in part of a run."""

    @property
    def objection(self) -> str:
        """Why it is not established or one of a class; empty where it is."""
        if self.status in CLAIMED:
            return ""
        if self.probability >= SURE:
            return "it is too small to matter, by itself or next to a larger effect"
        return f"its probability is {100 * self.probability:.0f} %"


def statements_of(found: Found, of_change: bool = False, form_sd: float = 0.0) -> tuple[Statement, ...]:
    """A statement for each named effect of the most probable model, the surest first.

    Of a change a class may hold an effect that explains alone what several do together: an offset of the centre of
    mass and a weaker thrust are a payload. Its numbers are stated with a wide prior: the one that models are compared
    by, of what one row determines, would shrink large changes. `form_sd` is the share of itself that each number is
    wrong by for its equation alone, one sigma.
    """
    at = scored(found.problem, found.model)
    numbers = widened(found.problem) if of_change else found.problem
    # Everything is visited before shares are taken over what was visited.
    instead = _instead_of_each(found)
    seen = [(key, instead[found.problem.terms[key].effect], _odds_of(found, key)) for key in _named(found)]
    weights = weights_of(found)
    if of_change:
        more = visited_instead(found, weights)
        seen = [(key, (*others, *more), odds) for key, others, odds in seen]
    known = scored(numbers, found.model)
    stated = [
        _statement(found, at, weights, key, others, odds, parameters(numbers, known, key, form_sd))
        for key, others, odds in seen
    ]
    return tuple(sorted(stated, key=lambda s: -s.odds))


def widened(problem: Problem) -> Problem:
    """A problem with priors of all effects that are wide enough to state their numbers with."""
    sd = problem.prior_sd.copy()
    # Times as wide a prior as models are compared by, for the numbers of a change: they shrink by a percent at most
    # where they did by a half.
    stated_reach = 10.0
    for key in problem.effects:
        sd[problem.columns_of[key]] *= stated_reach
    return replace(problem, prior_sd=sd)


def _statement(
    found: Found,
    at: Scored,
    weights: Mapping[Model, float],
    key: str,
    others: Sequence[str],
    odds: float,
    numbers: tuple[Estimate, ...],
) -> Statement:
    """What is said of one effect of the most probable model, given the ids that could stand in its place."""
    effect = found.problem.terms[key].effect
    members = smallest_class({effect}, others, partial(share_of, found, weights), SURE)
    alone, joint = (share_of(found, weights, own) for own in ({effect}, members))
    if not _matters(found, at, key):
        status: Status = "not_established"  # sure or not, it is too small to matter
    elif joint >= SURE:
        status = "established" if len(members) == 1 else "ambiguous"
    else:
        status = "suggested" if alone >= LIKELY else "not_established"
    return Statement(
        key=key,
        id=effect,
        status=status,
        alternatives=tuple(sorted(members)) if status == "ambiguous" else (),
        probability=joint if status == "ambiguous" else alone,
        odds=odds,
        parameters=numbers,
        window=found.problem.terms[key].window,
    )


def visited_instead(found: Found, weights: Mapping[Model, float]) -> set[str]:
    """Named ids of other visited models that the most probable one has not: of a class with one that it has, that one
    is at work anyway."""
    own, visited = ({found.problem.terms[k].effect for k in keys} for keys in (found.model, chain(*weights)))
    return visited - own - {"", *UNKNOWNS}


def smallest_class(
    members: Iterable[str], others: Iterable[str], share: Callable[[set[str]], float], enough: float
) -> set[str]:
    """The fewest ids, `members` and some of `others`, of which one is at work by a share that is enough; of four at
    most, as sure as it gets."""
    found, left = set(members), set(others) - set(members)
    most_members = 4  # Ids of a class at most: more say no more than that something is off.
    while left and share(found) < enough and len(found) < most_members:
        best = max(sorted(left), key=lambda other: share({*found, other}))
        found.add(best)
        left.remove(best)
    return found


def weights_of(found: Found) -> dict[Model, float]:
    """Probability of every visited model that is near the best."""
    considered = 10.0  # Nats below the best model up to which others count: together they hold less than a percent.
    near = {m: v for m, v in found.posterior.visited.items() if v > found.log_posterior - considered}
    weight = {m: float(np.exp(v - found.log_posterior)) for m, v in near.items()}
    total = sum(weight.values())
    return {m: w / total for m, w in weight.items()}


def _by_id(found: Found) -> dict[str, float]:
    """Probability of every id in some visited model."""
    out: dict[str, float] = {}
    for model, weight in weights_of(found).items():
        for effect in {found.problem.terms[key].effect for key in model if key in found.problem.effects}:
            out[effect] = out.get(effect, 0.0) + weight
    return out


def _odds_of(found: Found, key: str) -> float:
    """Log odds of the best model against the same without a term, nats."""
    return found.log_posterior - found.posterior(without(found.model, key))


def _named(found: Found) -> list[str]:
    """Keys of the terms of a model that have a name."""
    return [key for key in found.model if found.problem.terms[key].effect not in {"", *UNKNOWNS}]


def _instead_of_each(found: Found) -> dict[str, set[str]]:
    """To every named id of a model, and of better ones met on the way, those that could stand in its place."""
    out: dict[str, set[str]] = {}
    here = found
    for _ in range(_ROUNDS):
        for key in _named(here):
            here.posterior(without(here.model, key))
            out.setdefault(here.problem.terms[key].effect, set()).update(_substitutes(here, key))
        best = max(here.posterior.visited, key=here.posterior.visited.__getitem__)
        if here.posterior(best) <= here.log_posterior:
            break
        here = Found(here.posterior, best, here.posterior(best))
    return out


def _substitutes(found: Found, key: str) -> tuple[str, ...]:
    """Named ids with which in a term's place the model is nearly as probable."""
    problem = found.problem
    instead = _instead(problem, found.model, key)
    here, *others = ranked(problem, [found.model, *instead])
    gains = {trial: value - here for trial, value in zip(instead, others, strict=True)}
    out = set()
    most_substitutes = 6  # Ids that are tried exactly in another's place, the most promising first.
    worst_substitute = -8.0  # Nats, as ranked, from which one is not tried.
    for trial in sorted(instead, key=lambda t: -gains[t])[:most_substitutes]:
        if gains[trial] <= worst_substitute:
            break
        if found.posterior(trial) - found.log_posterior > -problem.prior.open_nats:
            out.add(instead[trial])
    return tuple(sorted(out - set(UNKNOWNS)))


def _instead(problem: Problem, model: Model, key: str) -> dict[Model, str]:
    """Models without a term, each with the id that takes its place.

    That is another id; another id next to a plainer form of the term's own; or an id that is in the model anyway, in a
    richer form: an offset of the centre of mass and unequal torques are unequal thrusts and torques.
    """
    rest, size = without(model, key), {k: len(problem.columns_of[k]) for k in problem.effects}
    taken = {problem.choices[k] for k in model}
    own = [k for k, once in problem.effects.items() if once == problem.choices[key] and k != key]
    out: dict[Model, str] = {}
    for k, once in problem.effects.items():
        if once not in taken:
            for kept in (rest, *((*rest, form) for form in own if size[form] < size[key])):
                out[tuple(sorted((*kept, k)))] = problem.terms[k].effect
    for other in rest:
        for k, once in problem.effects.items():
            if once == problem.choices[other] and k != other and size[k] >= size.get(other, 0):
                out[tuple(sorted((*without(rest, other), k)))] = problem.terms[k].effect
    return out


def share_of(found: Found, weights: Mapping[Model, float], members: set[str]) -> float:
    """Probability that at least one of some ids is at work."""
    return sum(w for m, w in weights.items() if holds(found, m, members))


def holds(found: Found, model: Model, members: set[str]) -> bool:
    """Whether a model holds one of some ids."""
    return any(found.problem.terms[key].effect in members for key in model)


def _matters(found: Found, at: Scored, key: str) -> bool:
    """Whether an effect does something of its own in some channel.

    That is more than a share of the noise, and more than what the form of a larger effect there is wrong by.
    """
    prior = found.problem.prior
    own = _squares_of(found, at, key)
    others = [_squares_of(found, at, other) for other in found.model if other in found.problem.effects and other != key]
    known_to = prior.form_error**2 * np.max(others, axis=0, initial=0.0)
    return bool(np.any((own * len(own) > prior.least_size * found.problem.rows) & (own > known_to)))


def _squares_of(found: Found, at: Scored, key: str) -> np.ndarray:
    """Whitened squares of what an effect contributes to each channel, (C,)."""
    own = found.problem.columns_of[key]
    beta = at.mode.beta[places(at.columns, own)]
    return np.einsum("i,cij,j->c", beta, found.problem.channel_gram[:, own[:, None], own], beta)


def parameters(problem: Problem, at: Scored, key: str, form_sd: float = 0.0) -> tuple[Estimate, ...]:
    """Linear parameters of a term as its form states them, with 95 % intervals; none of a form without.

    `form_sd` as of `statements_of`.
    """
    term, own = problem.terms[key], problem.columns_of[key]
    where, unit = places(at.columns, own), problem.unit[own]
    beta = at.mode.beta[where] * unit
    sd = np.sqrt(np.maximum(np.diag(at.mode.covariance)[where], 0.0)) * unit
    z95 = 1.959963984540054
    reach = z95 * np.hypot(sd, form_sd * beta)
    out = []
    for k, parameter in enumerate(term.linear):
        moved = (np.where(np.arange(len(beta)) == k, beta + step, beta) for step in (0.0, -reach, reach))
        value, low, high = (float(term.stated(b)[k]) for b in moved)
        out.append(Estimate(parameter.symbol, value, parameter.unit, low, high))
    return tuple(out)


def posterior_at(evidence: Evidence, spectrum: Spectrum, active: Iterable[str]) -> Found:
    """The posterior at the model of the effects `active`, with the leftover that it leaves.

    The leftover is learnt from none and from all being leftover, as in a search (`posterior.decide`): where both ends
    are about as probable the larger is believed. What the effects' forms are wrong by, in nats half its whitened
    squares, says nothing for the larger.
    """
    chosen, prior = tuple(sorted(active)), Prior()

    def settled(variance: np.ndarray) -> Found:
        for _ in range(_ROUNDS):
            posterior = Posterior(problem_of(evidence, spectrum, variance, prior))
            variance = posterior.leftover_of(chosen, spectrum)
        return Found(posterior, chosen, posterior(chosen))

    all_of_it = spectrum.variance_of_leftover(np.zeros(len(spectrum.unit)))
    small, large = settled(np.zeros(len(all_of_it))), settled(all_of_it)
    gain = joint(spectrum, small) - joint(spectrum, large) + 0.5 * FORM_SD**2 * _contributed(small)
    return small if gain > prior.leftover_nats else large


def _contributed(found: Found) -> float:
    """Whitened squares of what the effects of a model contribute."""
    at = scored(found.problem, found.model)
    if at.mode is None:
        return 0.0
    return float(sum(_squares_of(found, at, k).sum() for k in found.model if k in found.problem.effects))


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
    problem, probability = found.problem, _by_id(found)
    named = {t.effect for t in problem.terms.values() if t.kind == "effect" and not t.run} - UNKNOWNS.keys()
    at_work = {problem.terms[key].effect for key in found.model}
    out = []
    for effect in sorted(named - at_work):
        if probability.get(effect, 0.0) >= _POSSIBLE:
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
    least_known = 1e-9  # Least variance of scaled coefficients in any direction.
    root = unit[:, None] * np.linalg.cholesky((vectors * np.maximum(values, least_known)) @ vectors.T)
    draws = 400
    normal = np.random.default_rng(0).standard_normal((draws, len(mean)))
    return np.clip(mean + normal @ root.T, low, high)
