"""How probable each effect of the chosen model is, and the status that this leaves it.

The posterior is taken at the model that was chosen, and at its neighbours: without each effect, and with each other
effect in its place (`posterior`). What the regression does not decide (chain, wind, mistakes) has no probability here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.findings import CLAIMED, Finding
from rotorid.mismatch.posterior.score import Model
from rotorid.mismatch.posterior.search import Found
from rotorid.mismatch.posterior.statements import LIKELY, SURE, share_of, statements_of, weights_of


def with_probabilities(findings: Iterable[Finding], found: Found) -> list[Finding]:
    """The findings with the posterior probability of each, of a class that one of it is at work.

    A claim below 0.99 becomes `suggested`, one below 0.5 `not_established`. `found` is the posterior at the model that
    the findings are of.
    """
    statements_of(found)  # visits every rival; only then are shares of what was visited probabilities
    weights = weights_of(found)
    decided = {found.problem.terms[key].effect for key in found.model if key in found.problem.effects}
    return [one if not decided & members(one) else weighed(one, found, weights) for one in findings]


def members(finding: Finding) -> set[str]:
    """The ids of a claim: its own, and its class."""
    return {finding.id, *finding.alternatives} if finding.status in CLAIMED else set()


def weighed(finding: Finding, found: Found, weights: Mapping[Model, float]) -> Finding:
    """A claim with its probability, and with the status that this leaves it."""
    probability = min(1.0, share_of(found, weights, members(finding)))
    reason = f"its probability is {100 * probability:.0f} %"
    if probability >= SURE:
        return replace(finding, probability=probability)
    if probability >= LIKELY:
        return replace(finding, probability=probability, status="suggested", objection=reason)
    sentence = f"{catalogue()[finding.id].name} did not hold: {reason}"
    return Finding(finding.id, "not_established", sentence=sentence, rule="probability", probability=probability)
