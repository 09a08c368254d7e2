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


def delivered_fit(model: WrenchModel, values: Values, active: Sequence[str]) -> Fit:
    """The fit of some effects, the wrong values, winds and those nuisances that are sure."""
    return with_sure_nuisances(model, [*values, *active], values)


def with_sure_nuisances(model: WrenchModel, keys: Sequence[str], values: Values) -> Fit:
    """The fit of terms, those of `values` held by the widest trust, beside winds and the nuisances that are sure.

    A calm flight does not know the offset between two sensors, and one that is nothing but noise where it was fitted
    is a mismatch in the first turn held out.
    """
    regression = model.regression
    loose = {k: WIDEST_TRUST for k in values}
    nuisances = regression.keys_of("nuisance")
    always = [*regression.keys_of("wind"), *keys]
    fit = regression.fit([*nuisances, *always], loose=loose)
    sure = [k for k in nuisances if surely_there(*coefficients(regression, fit, k))]
    return fit if sure == nuisances else regression.fit([*sure, *always], loose=loose)


def surely_there(beta: np.ndarray, covariance: np.ndarray) -> bool:
    """Whether a nuisance is other than nothing."""
    return abs(float(beta[0])) > SURE_Z * float(np.sqrt(covariance[0, 0]))


def nuisances_in(model: WrenchModel, values: Values) -> list[str]:
    """The nuisances that are delivered."""
    regression, fit = model.regression, delivered_fit(model, values, model.selection.active)
    return [k for k in regression.keys_of("nuisance") if np.isin(regression.columns([k]), fit.columns).all()]


def residuals_of(model: WrenchModel, fit: Fit) -> list[np.ndarray]:
    """What values and named effects of a fit leave of every stretch, (n, 12); empirical terms stay out."""
    named = np.where(model.unnamed(fit.columns), 0.0, fit.beta)
    added = model.contributions.of(fit.columns, named)
    return [r.y - part for r, part in zip(model.rows, added, strict=True)]


def delivered_residuals(model: WrenchModel, values: Values) -> list[np.ndarray]:
    """What wrong values and named effects leave of every stretch, (n, 12)."""
    return residuals_of(model, delivered_fit(model, values, model.selection.active))


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
