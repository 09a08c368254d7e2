"""How probable each effect of the chosen model is, and the status that this leaves it.

The posterior is taken at the model that was chosen, and at its neighbours: without each effect, and with each other
effect in its place (`posterior`). What the regression does not decide (chain, wind, mistakes) has no probability here.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from rotorid.mismatch.decision.findings import Finding, not_held
from rotorid.mismatch.posterior.search import Found
from rotorid.mismatch.posterior.statements import LIKELY, SURE, Statement, share_of, statements_of, weights_of
from rotorid.mismatch.posterior.status import CLAIMED


def with_probabilities(findings: Iterable[Finding], found: Found) -> list[Finding]:
    """The findings with the posterior probability of each, of a class that one of it is at work.

    A claim below 0.99 becomes the smallest class of which one is at work with 0.99; without such a class it is
    `suggested`, below 0.5 `not_established`. `found` is the posterior at the model that the findings are of.
    """
    stated = {s.id: s for s in statements_of(found)}  # first: it visits every rival
    weights = weights_of(found)
    decided = {found.problem.terms[key].effect for key in found.model if key in found.problem.effects}

    def weighed(one: Finding) -> Finding:
        if not decided & members(one):
            return one
        probability = min(1.0, share_of(found, weights, members(one)))
        return with_probability(one, probability, stated.get(one.id))

    return [weighed(one) for one in findings]


def members(finding: Finding) -> set[str]:
    """The ids of a claim: its own, and its class."""
    return {finding.id, *finding.alternatives} if finding.status in CLAIMED else set()


def with_probability(claim: Finding, probability: float, stated: Statement | None) -> Finding:
    """A claim with its probability, and with the status that this leaves it; `stated` is the posterior's own word."""
    if probability >= SURE:
        return replace(claim, probability=probability)
    if stated is not None and stated.status == "ambiguous":
        return replace(claim, probability=stated.probability, status="ambiguous", alternatives=stated.alternatives)
    reason = f"its probability is {100 * probability:.0f} %"
    if probability >= LIKELY:
        return replace(claim, probability=probability, status="suggested", objection=reason)
    return not_held(claim.id, reason, rule="probability", probability=probability)
