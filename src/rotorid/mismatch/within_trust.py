"""Believed values as the recordings have them, where they stay within what was believed.

No laboratory knows its thrust coefficient to a percent, and a percent of the weight is ten times a good sensor's noise.
Such a value is not wrong and is not called so; what is delivered holds it as the recordings do, all values at once and
each held by its trust.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from rotorid.mismatch import rules
from rotorid.mismatch.channel_errors import growth
from rotorid.mismatch.decide import coefficients, relative_change
from rotorid.mismatch.delivered import (
    Values,
    judged_rows,
    left_out_residuals,
    widely,
    with_sure,
)
from rotorid.mismatch.prepare import Prepared
from rotorid.mismatch.regression import Fit
from rotorid.mismatch.rows import PARAMETER_NAMES
from rotorid.mismatch.words import parameter_words
from rotorid.mismatch.wrench import WrenchModel

BEYOND_TRUST = 2.0
"""Standard deviations of trust up to which a value may move: beyond, something else is missing that pulls at it."""
BETTER_RATIO = 0.95
"""Held-out error beside that with the values as believed which some channel must reach for the values to move."""
WORSE_RATIO = 1.01
LEAST_Z = 2.0
"""Standard errors over blocks of a second by which squares must have changed, either way."""
WORTH_A_WORD = 0.002


def all_values(model: WrenchModel, values: Values, active: Sequence[str]) -> Fit:
    """The fit with every value free: those called wrong (`values`) widely, the others within their trust."""
    keys = with_sure(model, [*model.regression.keys_of("value"), *active], values)
    return model.regression.fit(keys, loose=widely(values))


def beyond_trust(model: WrenchModel, values: Values, active: Sequence[str]) -> bool:
    """Whether the recordings ask a value not called wrong to move further than its trust allows."""
    return strained(model, values, changes(model, all_values(model, values, active)))


def strained(model: WrenchModel, values: Values, moved: Values) -> bool:
    """Whether one of the changes of values not called wrong is beyond its trust."""
    trust = {t.key: t.prior_sd[0] for t in model.regression.terms if t.kind == "value"}
    return any(abs(change) > BEYOND_TRUST * trust[k] for k, (change, _) in moved.items() if k not in values)


def changes(model: WrenchModel, fit: Fit) -> Values:
    """Relative change and one-sigma of every believed value in a fit."""
    out = {}
    for key in model.regression.keys_of("value"):
        beta, covariance = coefficients(model.regression, fit, key)
        out[key] = relative_change(key, float(beta[0]), float(np.sqrt(covariance[0, 0])))
    return out


def settled(prepared: Prepared, model: WrenchModel, values: Values, active: Sequence[str]) -> tuple[Fit, Values]:
    """The fit to deliver with the terms of `active`, and what it changes of values that are not called wrong.

    Those values move together, and only if where it was not fitted the error falls by it in some channel, grows in
    none, and none of them would move beyond its trust.
    """
    plain = with_sure(model, [*values, *active], values)
    free = with_sure(model, [*model.regression.keys_of("value"), *active], values)
    fits = [model.regression.fit(keys, loose=widely(values)) for keys in (plain, free)]
    moved = changes(model, fits[1])
    if strained(model, values, moved):
        return fits[0], {}
    per = max(2, int(prepared.thinner.rate_hz))
    left = (left_out_residuals(model, keys, values) for keys in (plain, free))
    if not pays(*left, judged_rows(model), per):
        return fits[0], {}
    return fits[1], {k: change for k, change in moved.items() if k not in values}


def pays(plain: list[np.ndarray], free: list[np.ndarray], held: list[np.ndarray], per: int) -> bool:
    """Whether values that move lower the held-out error of some channel and raise that of none.

    Residuals (n, 6 or more) of every stretch without and with it, masks of the held-out rows, rows of a block.
    """
    ratio, z = growth(plain, free, held, per)
    worse, better = (ratio > WORSE_RATIO) & (z > LEAST_Z), (ratio < BETTER_RATIO) & (z < -LEAST_Z)
    return rules.SETTLED(bool(better.any() and not worse.any()))


def in_words(moved: Values, names: Mapping[str, str] = PARAMETER_NAMES) -> tuple[str, ...]:
    """Changes that are worth a word: `thrust coefficient −0.7 ± 0.2 %`."""
    return tuple(
        f"{parameter_words(names[k])[0]} {100 * change:+.1f} ± {196 * sd:.1f} %".replace("-", "−")
        for k, (change, sd) in moved.items()
        if abs(change) > max(WORTH_A_WORD, sd)
    )
