"""What is delivered: values called wrong, named effects, winds and those nuisances that are sure, and what they leave.

Terms without a name stay out: an improved vehicle cannot hold them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rotorid.mismatch.decide import WIDEST_TRUST, coefficients
from rotorid.mismatch.prepare import Prepared
from rotorid.mismatch.regression import Fit
from rotorid.mismatch.rows import residual
from rotorid.mismatch.wrench import WrenchModel

SURE_Z = 3.0
"""Standard errors by which a nuisance must differ from nothing to be delivered."""

Values = dict[str, tuple[float, float]]
"""Relative change and one-sigma of believed values, by the key of their term."""


def with_sure(model: WrenchModel, keys: Sequence[str], values: Values) -> list[str]:
    """Keys of the terms that are delivered with those of `keys`: winds, and the nuisances that are sure beside them.

    A calm flight does not know the offset between two sensors, and one that is nothing but noise where it was fitted
    is a mismatch in the first turn held out.
    """
    regression = model.regression
    nuisances = regression.keys_of("nuisance")
    always = [*regression.keys_of("wind"), *keys]
    fit = regression.fit([*nuisances, *always], loose=widely(values))
    return [*(k for k in nuisances if surely_there(*coefficients(regression, fit, k))), *always]


def widely(values: Values) -> dict[str, float]:
    """Priors of the values called wrong."""
    return dict.fromkeys(values, WIDEST_TRUST)


def left_out_residuals(model: WrenchModel, keys: Sequence[str], values: Values) -> list[np.ndarray]:
    """What a model of some terms leaves of every stretch where it was not fitted, (n, 12).

    Each environment of the fitted runs is judged by coefficients found without it. Empirical terms stay out.
    """
    regression = model.regression
    cols, betas = regression.left_out(tuple(keys), False, widely(values))
    betas = np.where(model.unnamed(cols), 0.0, betas)
    fold = np.append(regression.folds(False), -1)  # the last stands for rows that are in no block
    added = model.contributions.left_out(cols, betas, [fold[b] for b in regression.blocks_of_rows])
    return [r.y - part for r, part in zip(model.rows, added, strict=True)]


def judged_rows(model: WrenchModel) -> list[np.ndarray]:
    """Mask of the rows of every stretch that are in an environment."""
    return [b >= 0 for b in model.regression.blocks_of_rows]


def surely_there(beta: np.ndarray, covariance: np.ndarray) -> bool:
    """Whether a nuisance is other than nothing."""
    return abs(float(beta[0])) > SURE_Z * float(np.sqrt(covariance[0, 0]))


def residuals_of(model: WrenchModel, fit: Fit) -> list[np.ndarray]:
    """What values and named effects of a fit leave of every stretch, (n, 12); empirical terms stay out."""
    named = np.where(model.unnamed(fit.columns), 0.0, fit.beta)
    added = model.contributions.of(fit.columns, named)
    return [r.y - part for r, part in zip(model.rows, added, strict=True)]


def believed_residuals(prepared: Prepared, model: WrenchModel, commanded: bool) -> list[np.ndarray]:
    """What the believed vehicle leaves of every stretch, (n, 12); if `commanded`, rotors turn as commanded."""
    if not commanded:
        return [r.y for r in model.rows]
    out = []
    for r, segment in zip(model.rows, prepared.segments, strict=True):
        left, groups = np.full_like(r.y, np.nan), residual(segment, prepared.vehicle)
        for index, group in enumerate(("force", "moment")):
            if group in groups:
                left[:, 3 * index : 3 * index + 3] = prepared.thinner(groups[group])
        out.append(left)
    return out
