"""The posterior at a model that was chosen from a regression by other means."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from rotorid.mismatch.posterior.evidence import evidence_from
from rotorid.mismatch.posterior.leftover import spectrum_of
from rotorid.mismatch.posterior.prior import Prior
from rotorid.mismatch.posterior.problem import problem_of
from rotorid.mismatch.posterior.score import Posterior
from rotorid.mismatch.posterior.search import Found
from rotorid.mismatch.regression import Regression

ROUNDS = 3
"""Rounds in which the leftover is learnt from what the model leaves."""


def posterior_at(regression: Regression, active: Iterable[str]) -> Found:
    """The posterior at the model of the effects `active`, with the leftover that it leaves.

    The regression keeps its products by channel.
    """
    evidence, chosen, prior = evidence_from(regression), tuple(sorted(active)), Prior()
    spectrum = spectrum_of(evidence)
    variance = spectrum.variance_of_leftover(np.zeros(len(spectrum.unit)))
    for _ in range(ROUNDS):
        posterior = Posterior(problem_of(evidence, spectrum, variance, prior))
        variance = posterior.leftover_of(chosen, spectrum)
    return Found(posterior, chosen, posterior(chosen))
