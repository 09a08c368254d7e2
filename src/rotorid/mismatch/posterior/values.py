"""Which believed values of a vehicle are wrong, given the gains that its flights show.

A flight knows four gains, not seven values: ln(C_F/m), along the thrust, and about each axis the logarithm of the
moment over the inertia. With δ = ln(true / believed) of the values and A from values to gains,

    g = A δ + e        δ_k ~ N(0, spike²) where value k is right, N(0, slab²) where it is wrong        e ~ t(ν; V)

so that the evidence of every small subset of wrong values is a multivariate t density of the gains (O'Hagan and
Forster, Kendall's Advanced Theory of Statistics 2B, 2004, 9.7). Values of one ratio have the same gains: a class.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from rotorid.mismatch.posterior.problem import Prior

GAINS = ("mass", "inertia_xx", "inertia_yy", "inertia_zz")
"""To each gain the value that stands in its denominator."""
_OF_GAINS: Mapping[str, tuple[float, float, float, float]] = {
    "mass": (-1, 0, 0, 0),
    "thrust": (1, 1, 1, 0),
    "torque": (0, 0, 0, 1),
    "inertia_xx": (0, -1, 0, 0),
    "inertia_yy": (0, 0, -1, 0),
    "inertia_zz": (0, 0, 0, -1),
    "arm": (0, 1, 1, 0),
}
"""To each value what a larger logarithm of it adds to each gain."""


Values = dict[str, tuple[float, float]]
"""Relative change and one-sigma of believed values, by the key of their term."""


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
