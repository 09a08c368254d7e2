"""The posterior at a model that was chosen from a regression by other means."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from rotorid.mismatch.plant.regression import Regression
from rotorid.mismatch.posterior.evidence import evidence_from
from rotorid.mismatch.posterior.leftover import spectrum_of
from rotorid.mismatch.posterior.prior import Prior
from rotorid.mismatch.posterior.problem import problem_of
from rotorid.mismatch.posterior.score import Posterior, scored
from rotorid.mismatch.posterior.search import Found, joint
from rotorid.mismatch.posterior.statements import squares_of

FORM_SD = 0.02
"""Share of what effects contribute that their forms are wrong by."""
ROUNDS = 3
"""Rounds in which the leftover is learnt from what the model leaves."""


def posterior_at(regression: Regression, active: Iterable[str]) -> Found:
    """The posterior at the model of the effects `active`, with the leftover that it leaves.

    The leftover is learnt from none and from all being leftover, as in a search (`search.decide`): where both ends are
    about as probable the larger is believed. What the effects' forms are wrong by, in nats half its whitened squares,
    says nothing for the larger. The regression keeps its products by channel.
    """
    evidence, chosen, prior = evidence_from(regression), tuple(sorted(active)), Prior()
    spectrum = spectrum_of(evidence)

    def settled(variance: np.ndarray) -> Found:
        for _ in range(ROUNDS):
            posterior = Posterior(problem_of(evidence, spectrum, variance, prior))
            variance = posterior.leftover_of(chosen, spectrum)
        return Found(posterior, chosen, posterior(chosen))

    all_of_it = spectrum.variance_of_leftover(np.zeros(len(spectrum.unit)))
    small, large = settled(np.zeros(len(all_of_it))), settled(all_of_it)
    gain = joint(spectrum, small) - joint(spectrum, large) + 0.5 * FORM_SD**2 * contributed(small)
    return small if gain > prior.leftover_nats else large


def contributed(found: Found) -> float:
    """Whitened squares of what the effects of a model contribute."""
    at = scored(found.problem, found.model)
    if at.mode is None:
        return 0.0
    return float(sum(squares_of(found, at, k).sum() for k in found.model if k in found.problem.effects))
