"""Believed values as the recordings have them, where they stay within what was believed.

No laboratory knows its thrust coefficient to a percent, and a percent of the weight is ten times a good sensor's noise.
Such a value is not wrong and is not called so; what is delivered holds it as the recordings do, all values at once and
each held by its trust.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rotorid.mismatch.decision import rules
from rotorid.mismatch.decision.decide import coefficients
from rotorid.mismatch.decision.words import parameter_words
from rotorid.mismatch.model.delivered import FittedModel, Values, delivered_fit, judged_rows, left_out_residuals
from rotorid.mismatch.plant.comparison import growth
from rotorid.mismatch.plant.regression import Fit
from rotorid.mismatch.plant.rows import PARAMETER_NAMES

_BEYOND_TRUST = 2.0
"""Standard deviations of trust up to which a value may move: beyond, something else is missing that pulls at it."""
_BETTER_RATIO = 0.95
"""Held-out error over that with the values as believed which some channel must reach for the values to move."""
_WORSE_RATIO = 1.01
_LEAST_Z = 2.0
"""Standard errors over blocks of a second by which squares must have changed, either way."""
_WORTH_A_WORD = 0.002


def beyond_trust(model: FittedModel, values: Values, active: Sequence[str]) -> bool:
    """Whether the recordings ask a value not called wrong to move further than its trust allows."""
    return _pushed_beyond_trust(model, changes(model, values, active, all_free(model, values, active)[1]))


def all_free(model: FittedModel, values: Values, active: Sequence[str]) -> tuple[list[str], Fit]:
    """What is delivered with every value free: those called wrong widely, the others within their trust."""
    return delivered_fit(model, [*model.values_beside(active), *active], values)


def _pushed_beyond_trust(model: FittedModel, moved: Values) -> bool:
    """Whether one of the changes of values not called wrong is beyond its trust."""
    trust = {t.key: t.prior_sd[0] for t in model.regression.terms if t.kind == "value"}
    return any(abs(change) > _BEYOND_TRUST * trust[k] for k, (change, _) in moved.items())


def changes(model: FittedModel, values: Values, active: Sequence[str], fit: Fit) -> Values:
    """Relative change and one-sigma of every believed value in a fit, those called wrong aside."""
    out = {}
    for key in model.values_beside(active):
        if key not in values:
            beta, covariance = coefficients(model.regression, fit, key)
            out[key] = model.change(key, float(beta[0]), float(np.sqrt(covariance[0, 0])))
    return out


@dataclass(frozen=True)
class Way:
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


def ways(model: FittedModel, values: Values, active: Sequence[str]) -> list[Way]:
    """The fits that may be delivered with the terms of `active`, the one to deliver first.

    Values not called wrong move together, and only if where it was not fitted the error falls by it in some channel,
    grows in none, and none of them would move beyond its trust.
    """
    plain, as_believed = delivered_fit(model, [*values, *active], values)
    held = Way(model, plain, values, as_believed, {})
    free, fit = all_free(model, values, active)
    moved = changes(model, values, active, fit)
    if _pushed_beyond_trust(model, moved):
        return [held]
    loose = Way(model, free, values, fit, moved)
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
    worse, better = (ratio > _WORSE_RATIO) & (z > _LEAST_Z), (ratio < _BETTER_RATIO) & (z < -_LEAST_Z)
    return rules.SETTLED(bool(better.any() and not worse.any()))


def in_words(moved: Values, names: Mapping[str, str] = PARAMETER_NAMES) -> tuple[str, ...]:
    """Changes that are worth a word: `thrust coefficient −0.7 ± 0.2 %`."""
    return tuple(
        f"{parameter_words(names[k])[0]} {100 * change:+.1f} ± {196 * sd:.1f} %".replace("-", "−")
        for k, (change, sd) in moved.items()
        if abs(change) > max(_WORTH_A_WORD, sd)
    )
