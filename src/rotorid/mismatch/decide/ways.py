"""What is delivered: values called wrong, named effects, winds and nuisances, and what they leave of the rows.

Terms without a name stay out: an improved vehicle cannot hold them. The same for flights, stands and benches. With them
go believed values as the recordings have them, where they stay within what was believed: no laboratory knows its thrust
coefficient to a percent, and a percent of the weight is ten times a good sensor's noise. Such a value is not wrong and
is not called so; all of them move at once, each held by its trust.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from rotorid.mismatch.decide import rules
from rotorid.mismatch.decide.problem import Values
from rotorid.mismatch.decide.select import Search, Selection
from rotorid.mismatch.decide.selected import WIDEST_TRUST, coefficients
from rotorid.mismatch.decide.words import parameter_words
from rotorid.mismatch.evidence.comparison import growth
from rotorid.mismatch.evidence.regression import Fit, Regression
from rotorid.mismatch.evidence.rows import PARAMETER_NAMES, Contributions, Rows


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


def _delivered_fit(model: FittedModel, keys: Sequence[str], values: Values) -> tuple[list[str], Fit]:
    """Keys of all that is delivered with the terms `keys`, and their fit with the wrong values at their stated numbers.

    What the whole balance would make of those values is another number where slow moments of the air bias it, and
    effects fitted given that number would be those of a vehicle that nobody states.
    """
    delivered = model.delivered_with(keys, dict.fromkeys(values, WIDEST_TRUST))
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


def beyond_trust(model: FittedModel, values: Values, active: Sequence[str]) -> bool:
    """Whether the recordings ask a value not called wrong to move further than its trust allows."""
    return _pushed_beyond_trust(model, changes(model, values, active, all_free(model, values, active)[1]))


def all_free(model: FittedModel, values: Values, active: Sequence[str]) -> tuple[list[str], Fit]:
    """What is delivered with every value free: those called wrong widely, the others within their trust."""
    return _delivered_fit(model, [*model.values_beside(active), *active], values)


def _pushed_beyond_trust(model: FittedModel, moved: Values) -> bool:
    """Whether one of the changes of values not called wrong is beyond its trust."""
    trust = {t.key: t.prior_sd[0] for t in model.regression.terms if t.kind == "value"}
    # Standard deviations of trust up to which a value may move: beyond, something else is missing that pulls at it.
    beyond_trust = 2.0
    return any(abs(change) > beyond_trust * trust[k] for k, (change, _) in moved.items())


def changes(model: FittedModel, values: Values, active: Sequence[str], fit: Fit) -> Values:
    """Relative change and one-sigma of every believed value in a fit, those called wrong aside."""
    out = {}
    for key in model.values_beside(active):
        if key not in values:
            beta, covariance = coefficients(model.regression, fit, key)
            out[key] = model.change(key, float(beta[0]), float(np.sqrt(covariance[0, 0])))
    return out


@dataclass(frozen=True)
class _Way:
    """A fit of what may be delivered: values not called wrong as believed, or moved within their trust."""

    model: FittedModel
    keys: list[str]
    values: Values
    fit: Fit
    moved: Values
    """What it changes of values that are not called wrong."""

    @cached_property
    def left(self) -> list[np.ndarray]:
        """What it leaves of every stretch where it was not fitted, (n, channels)."""
        return left_out_residuals(self.model, self.keys, self.values)


def ways(model: FittedModel, values: Values, active: Sequence[str]) -> list[_Way]:
    """The fits that may be delivered with the terms of `active`, the one to deliver first.

    Values not called wrong move together, and only if where it was not fitted the error falls by it in some channel,
    grows in none, and none of them would move beyond its trust.
    """
    plain, as_believed = _delivered_fit(model, [*values, *active], values)
    held = _Way(model, plain, values, as_believed, {})
    free, fit = all_free(model, values, active)
    moved = changes(model, values, active, fit)
    if _pushed_beyond_trust(model, moved):
        return [held]
    loose = _Way(model, free, values, fit, moved)
    better = _pays(held.left, loose.left, judged_rows(model), model.rows_per_block)
    return [loose, held] if better else [held, loose]


def settled(model: FittedModel, values: Values, active: Sequence[str]) -> tuple[Fit, Values]:
    """The fit to deliver with the terms of `active`, and what it changes of values that are not called wrong."""
    best = ways(model, values, active)[0]
    return best.fit, best.moved


def _pays(plain: list[np.ndarray], free: list[np.ndarray], held: list[np.ndarray], per: int) -> bool:
    """Whether values that move lower the held-out error of some channel and raise that of none.

    Residuals (n, 6 or more) of every stretch without and with it, masks of the held-out rows, rows of a block.
    """
    ratio, z = growth(plain, free, held, per)
    # Held-out error over that with the values as believed which some channel must reach for the values to move.
    better_ratio = 0.95
    worse_ratio = 1.01
    least_z = 2.0  # Standard errors over blocks of a second by which squares must have changed, either way.
    worse, better = (ratio > worse_ratio) & (z > least_z), (ratio < better_ratio) & (z < -least_z)
    return rules.SETTLED(bool(better.any() and not worse.any()))


def in_words(moved: Values, names: Mapping[str, str] = PARAMETER_NAMES) -> tuple[str, ...]:
    """Changes that are worth a word: `thrust coefficient −0.7 ± 0.2 %`."""
    worth_a_word = 0.002
    return tuple(
        f"{parameter_words(names[k])[0]} {100 * change:+.1f} ± {196 * sd:.1f} %".replace("-", "−")
        for k, (change, sd) in moved.items()
        if abs(change) > max(worth_a_word, sd)
    )
