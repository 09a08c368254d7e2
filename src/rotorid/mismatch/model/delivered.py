"""What is delivered: values called wrong, named effects, winds and nuisances, and what they leave of the rows.

Terms without a name stay out: an improved vehicle cannot hold them. The same for flights, stands and benches.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from rotorid.mismatch.decision.decide import WIDEST_TRUST
from rotorid.mismatch.decision.select import Search, Selection
from rotorid.mismatch.model.prepare import Prepared
from rotorid.mismatch.plant.contributions import Contributions
from rotorid.mismatch.plant.regression import Fit, Regression
from rotorid.mismatch.plant.rows import Rows, residual
from rotorid.mismatch.posterior.values import Values


class FittedModel(Protocol):
    """What is asked of the model of a flight or of an instrument's reading once it is fitted."""

    rows: list[Rows]
    regression: Regression
    search: Search
    selection: Selection
    contributions: Contributions

    @property
    def rows_per_block(self) -> int:
        """Rows over which residuals are compared as one."""

    def unnamed(self, columns: np.ndarray) -> np.ndarray:
        """Mask of the columns of terms without a name."""

    def delivered_with(self, keys: Sequence[str], loose: dict[str, float]) -> list[str]:
        """Keys of the terms that are delivered with those of `keys`."""

    def values_beside(self, active: Sequence[str]) -> list[str]:
        """Keys of the believed values that are free given the terms at work."""

    def change(self, key: str, coefficient: float, sd: float) -> tuple[float, float]:
        """Relative change of a believed value and its one-sigma from its coefficient."""

    def coefficient(self, key: str, change: float) -> float:
        """Coefficient of a relative change of a believed value."""


def _widely(values: Values) -> dict[str, float]:
    """Priors of the values called wrong."""
    return dict.fromkeys(values, WIDEST_TRUST)


def delivered_fit(model: FittedModel, keys: Sequence[str], values: Values) -> tuple[list[str], Fit]:
    """Keys of all that is delivered with the terms `keys`, and their fit with the wrong values at their stated numbers.

    What the whole balance would make of those values is another number where slow moments of the air bias it, and
    effects fitted given that number would be those of a vehicle that nobody states.
    """
    delivered = model.delivered_with(keys, _widely(values))
    known, cols, beta = _at_stated_numbers(model, delivered, values)
    fit = known.fit([k for k in delivered if k not in values])
    size = len(fit.beta)
    covariance = np.zeros((size + len(cols), size + len(cols)))
    covariance[:size, :size] = fit.covariance
    return delivered, replace(
        fit, columns=np.append(fit.columns, cols), beta=np.append(fit.beta, beta), covariance=covariance
    )


def _at_stated_numbers(
    model: FittedModel, keys: Sequence[str], values: Values
) -> tuple[Regression, np.ndarray, np.ndarray]:
    """The regression in which the wrong values among `keys` are known, their columns and their coefficients."""
    stated = [k for k in keys if k in values]
    cols = model.regression.columns(stated)
    beta = np.array([model.coefficient(k, values[k][0]) for k in stated])
    return (model.regression.given(cols, beta) if stated else model.regression), cols, beta


def left_out_residuals(model: FittedModel, keys: Sequence[str], values: Values) -> list[np.ndarray]:
    """What a model of some terms leaves of every stretch where it was not fitted, (n, channels).

    Each environment of the fitted runs is judged by coefficients found without it.
    """
    regression = model.regression
    known, stated, beta = _at_stated_numbers(model, keys, values)
    cols, betas = known.left_out(tuple(k for k in keys if k not in values), regression.leaves_runs)
    cols, betas = np.append(cols, stated), np.column_stack([betas, np.tile(beta, (len(betas), 1))])
    betas = np.where(model.unnamed(cols), 0.0, betas)
    added = model.contributions.left_out(cols, betas, regression.of_rows(regression.folds()))
    return [r.y - part for r, part in zip(model.rows, added, strict=True)]


def judged_rows(model: FittedModel) -> list[np.ndarray]:
    """Mask of the rows of every stretch that are in an environment."""
    return [b >= 0 for b in model.regression.blocks_of_rows]


def residuals_of(model: FittedModel, fit: Fit) -> list[np.ndarray]:
    """What values and named effects of a fit leave of every stretch, (n, channels)."""
    named = np.where(model.unnamed(fit.columns), 0.0, fit.beta)
    added = model.contributions.of(fit.columns, named)
    return [r.y - part for r, part in zip(model.rows, added, strict=True)]


def believed_residuals(prepared: Prepared, rows: list[Rows], commanded: bool) -> list[np.ndarray]:
    """What the believed vehicle leaves of every stretch of a flight, (n, 12); if `commanded`, rotors turn as
    commanded."""
    if not commanded:
        return [r.y for r in rows]
    out = []
    for r, segment in zip(rows, prepared.segments, strict=True):
        left, groups = np.full_like(r.y, np.nan), residual(segment, prepared.vehicle)
        for index, group in enumerate(("force", "moment")):
            if group in groups:
                left[:, 3 * index : 3 * index + 3] = prepared.thinner(groups[group])
        out.append(left)
    return out
