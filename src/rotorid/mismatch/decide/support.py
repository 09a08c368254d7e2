"""Whether a name survives the recordings' own doubt: how often it is at work when their seconds are weighed anew.

The posterior of one recording takes its seconds as they are. Where the model is not quite true, as on every real
vehicle, it is then sure of one of several names that explain about as much, and of another one when half a second is
cut off. So the environments of the evidence (about 5 s each) are given random weights, the models about the chosen one
are scored anew, and the posteriors of all draws are averaged: bagged posteriors (Huggins and Miller, Bayesian Analysis
18, 2023) by the Bayesian bootstrap (Rubin, Annals of Statistics 9, 1981). Names that replace each other from draw to
draw are a class; one that comes and goes without another in its place is not established.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from rotorid.mismatch.decide import rules
from rotorid.mismatch.decide.posterior import Found, Posterior, ranked
from rotorid.mismatch.decide.problem import Problem, scaled_apart
from rotorid.mismatch.decide.statements import posterior_at, smallest_class, weights_of
from rotorid.mismatch.evidence.gram import Evidence, Spectrum, evidence_from, spectrum_of
from rotorid.mismatch.evidence.regression import Regression

DRAWS = 20
_NEAR = 60.0
"""Nats below the chosen model up to which a draw may prefer another one."""
_REPLACES = 2.0
"""Times as often as jointly with another that a name must be at work without it, to stand in its place."""


@dataclass(frozen=True)
class Support:
    """Posterior probabilities of sets of ids, averaged over draws."""

    shares: Mapping[frozenset[str], float]
    """Probability of each set of ids to be what is at work; they add up to 1."""

    def of(self, members: Iterable[str]) -> float:
        """Probability that at least one of some ids is at work."""
        members = set(members)
        return sum(share for ids, share in self.shares.items() if ids & members)

    def class_of(self, members: Iterable[str], excluded: Iterable[str] = ()) -> frozenset[str] | None:
        """The fewest ids, `members` among them, that have enough together; None where no class of four has it.

        What is added must be at work where the members are not, and hardly where they are: one that is there anyway
        stands for none of them.
        """
        found, enough = set(members), rules.SUPPORT["share"]
        if not rules.SUPPORT(self.of(found) < enough):
            return frozenset(found)
        there = {ids for ids in self.shares if ids & found}
        present, absent = sum(self.shares[i] for i in there), sum(s for i, s in self.shares.items() if i not in there)

        def replaces(other: str) -> bool:
            jointly = sum(s for i, s in self.shares.items() if i in there and other in i)
            instead = sum(s for i, s in self.shares.items() if i not in there and other in i)
            return instead * present > _REPLACES * jointly * absent

        others = {i for i in frozenset().union(*self.shares) - found - frozenset(excluded) if replaces(i)}
        grown = smallest_class(found, others, self.of, enough)
        return frozenset(grown) if self.of(grown) >= enough else None


@dataclass(frozen=True)
class Chosen:
    """A model that was chosen, by whatever means: the posterior at it, and what it is asked again by."""

    found: Found
    evidence: Evidence
    spectrum: Spectrum

    def support(self) -> Support:
        """How the model's names fare on draws; asked once the rivals are visited (`statements_of`)."""
        return support_of(self.evidence, self.spectrum, self.found)


def chosen_at(regression: Regression, active: Iterable[str]) -> Chosen:
    """The posterior at the model of the effects `active`; the regression keeps its products by channel."""
    evidence = evidence_from(regression)
    spectrum = spectrum_of(evidence)
    return Chosen(posterior_at(evidence, spectrum, active), evidence, spectrum)


def support_of(evidence: Evidence, spectrum: Spectrum, found: Found) -> Support:
    """The support that a flight gives to the names of the model `found`, and to those that would replace them.

    Scored are the models that were visited about it, with the leftover as it is; no draw searches anew
    (docs/decisions/0012-names-that-stay.md).
    """
    near = sorted(m for m, value in found.posterior.visited.items() if value > found.log_posterior - _NEAR)
    terms, shares = found.problem.terms, {}
    # Nats below a draw's best model, as ranked, up to which one is scored exactly: the ranking is off by some five.
    ranked_near = 15.0
    for problem in _drawn(evidence, spectrum, found.problem):
        posterior = Posterior(problem)
        about = ranked(problem, near)
        for m, value in zip(near, about, strict=True):
            if value > about.max() - ranked_near:
                posterior(m)
        best = max(posterior.visited, key=posterior.visited.__getitem__)
        for model, weight in weights_of(Found(posterior, best, posterior(best))).items():
            ids = frozenset(terms[key].effect for key in model if key in problem.effects)
            shares[ids] = shares.get(ids, 0.0) + weight / DRAWS
    return Support(shares)


def _drawn(evidence: Evidence, spectrum: Spectrum, problem: Problem) -> Iterable[Problem]:
    """The problem with its environments weighed anew, DRAWS times; the same numbers at every call."""
    gram, cross = spectrum.by_environment(problem.variance)
    count, random = len(gram), np.random.default_rng(0)
    for _ in range(DRAWS):
        weights = random.standard_exponential(count)
        weights *= count / weights.sum()
        _, gram_apart, cross_apart = scaled_apart(evidence, spectrum.unit, weights)
        yield replace(
            problem,
            gram=np.tensordot(weights, gram, 1),
            cross=weights @ cross,
            gram_apart=gram_apart,
            cross_apart=cross_apart,
        )
