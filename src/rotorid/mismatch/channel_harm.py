"""Nothing is delivered that makes a channel worse on the held-out part than the believed vehicle leaves it, as it is or
with its values refitted, and no effect that makes none of its channels better there.

The search weighs all channels together, each by its noise: where a smooth moment seems to be known to a thousandth, it
may buy a tilt of twenty degrees at the cost of the force. What is delivered is therefore looked at as its reader will:
channel by channel, with the values that are called wrong and the named effects alone. For the same reason an effect
may win the search by what it does where noise is low, and be of no use to its reader: what is established lowers an
error.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from rotorid.mismatch.channel_errors import (
    CHANNELS_OF_WRENCH,
    about_means,
    growth,
    harmed,
    helps,
    long_enough,
    smaller,
)
from rotorid.mismatch.decide import coefficients, estimates, main_channels, suggested
from rotorid.mismatch.delivered import Values, believed_residuals, delivered_residuals, judged_rows, nuisances_in
from rotorid.mismatch.findings import Reason
from rotorid.mismatch.prepare import Prepared
from rotorid.mismatch.refitted import refitted_left_out
from rotorid.mismatch.unknowns import UNKNOWNS
from rotorid.mismatch.wrench import WrenchModel

HELP_Z = 0.5
"""Standard errors by which the squares of one channel that an effect acts in must grow without it: it has been found
already, in the runs fitted, so doubt is not held against it beyond the coin's."""
REASON = Reason(
    "harm",
    "where it was not fitted, what is delivered with it is worse than the believed vehicle, or that one refitted",
)
USELESS = Reason("use", "where it was not fitted, the error without it is no larger in any channel that it acts in")
UNSURE = Reason("unsure", "none of it at all is within its interval")

ValuesOf = Callable[[WrenchModel, Sequence[str]], Values]
"""The believed values that a model's recordings contradict, less those refused."""


def without(model: WrenchModel, key: str, reason: str = REASON) -> WrenchModel:
    """The model with one effect less, all else fitted anew."""
    fewer = fitted_anew(model, [k for k in model.selection.active if k != key])
    reasons = {**fewer.selection.not_established, model.search.terms[key].effect: reason}
    return replace(fewer, selection=replace(fewer.selection, not_established=reasons))


def fitted_anew(model: WrenchModel, active: list[str]) -> WrenchModel:
    """The model with the terms of `active` alone."""
    search = model.search
    regression = search.regression
    fit = regression.fit(search.always + active, jackknife=True)
    p_values = {k: regression.wald(fit, regression.columns([k]), search.blocks) for k in active}
    return replace(model, selection=replace(model.selection, active=active, fit=fit, p_values=p_values))


def without_nuisance(model: WrenchModel, key: str) -> WrenchModel:
    """The model with a nuisance held at nothing, all else fitted anew."""
    search = copy(model.search)
    search.regression = search.regression.holding(key)
    return fitted_anew(replace(model, regression=model.regression.holding(key), search=search), model.selection.active)


def without_harm(
    prepared: Prepared, model: WrenchModel, values_of: ValuesOf, commanded: bool
) -> tuple[WrenchModel, Values, ValuesOf, bool]:
    """The model less what makes a channel worse on the held-out part, its wrong values, and whether harm is left.

    Worse than the believed vehicle leaves it, or than that vehicle does with values refitted: physics that costs more
    than it brings is not delivered for what the values beside it bring. What goes is the effect, the wrong value or the
    nuisance without which the channels are best: a loop that answers the gyroscope's noise makes an offset in time of
    it, which the next turn contradicts. `values_of` is returned without the values that went. What is left worse than
    the believed vehicle is of what lies between command and speed.
    """
    values = values_of(model, ())
    believed = believed_residuals(prepared, model, commanded)
    held = judged_rows(model)
    per = max(2, int(prepared.thinner.rate_hz))
    before = smaller(believed, refitted_left_out(prepared, model), held)
    refused: tuple[str, ...] = ()
    while True:
        after = delivered_residuals(model, values)
        ratio, z = growth(before, after, held, per)
        worse = harmed(ratio, z)
        if not worse.any():
            return model, values, less(values_of, refused), False
        options = []
        for key in model.selection.active:
            term = model.search.terms[key]
            if term.effect in UNKNOWNS or term.run:
                continue
            options.append((without(model, key), values, refused))
        options += [(model, {k: v for k, v in values.items() if k != key}, (*refused, key)) for key in values]
        options += [(without_nuisance(model, key), values, refused) for key in nuisances_in(model, values)]
        left = [growth(before, delivered_residuals(*option[:2]), held, per)[0][worse].sum() for option in options]
        if not options or min(left) >= ratio[worse].sum():
            return model, values, less(values_of, refused), bool(harmed(*growth(believed, after, held, per)).any())
        model, _, refused = options[int(np.argmin(left))]
        values = values_of(model, refused)


def less(values_of: ValuesOf, refused: tuple[str, ...]) -> ValuesOf:
    """The function of a model and refused values that gives its wrong values, with these refused always."""
    return lambda model, more: values_of(model, (*refused, *more))


def without_unsure(model: WrenchModel, values: Values, values_of: ValuesOf) -> tuple[WrenchModel, Values]:
    """The model less the effects of which every parameter may be zero, and its wrong values; the least sure goes first.

    An interval takes in what an effect too weak to be stated would make of it.
    """
    while True:
        selection, search = model.selection, model.search
        beside = suggested(search, selection.active)
        unsure = []
        for key in selection.active:
            term = search.terms[key]
            if term.effect in UNKNOWNS or term.run or not term.form.linear or term.form.nonlinear:
                continue
            found = estimates(model.regression, selection.fit, search, key, beside)
            if all(e.low <= 0.0 <= e.high for e in found):
                unsure.append(key)
        if not unsure:
            return model, values
        model = without(model, max(unsure, key=lambda k: selection.p_values[k]), UNSURE)
        values = values_of(model, ())


def costs_more(
    without: tuple[np.ndarray, np.ndarray], with_it: tuple[np.ndarray, np.ndarray], channels: list[int]
) -> bool:
    """Whether an effect makes held-out errors worse: one that it acts in, or any by more than it betters its own.

    `without` and `with_it` are how errors grow (`growth`) where it is left out, and where it is taken in again. What is
    right about yaw may be bought by a tilt that costs the force, where others then no longer fit.
    """
    worse = harmed(*with_it)
    gained = max((float(without[0][c]) for c in channels), default=np.inf)
    return bool(worse[channels].any() or (with_it[0][worse] > gained).any())


def within_bounds(model: WrenchModel) -> bool:
    """Whether every effect's coefficients are possible for what it says of itself."""
    search = model.search
    for key in model.selection.active:
        beta, covariance = coefficients(model.regression, model.selection.fit, key)
        if not search.within_bounds(search.terms[key], beta, np.sqrt(np.diag(covariance))):
            return False
    return True


def without_useless(
    prepared: Prepared, model: WrenchModel, values: Values, values_of: ValuesOf
) -> tuple[WrenchModel, Values]:
    """The model less the effects that lower the held-out error of no channel that they act in, and its wrong values.

    An error counts as it is or about its mean in each run: what differs between flights is told by itself, and must
    not decide about an effect that is right about everything else. Where it makes an error worse (`costs_more`) it
    does: what is delivered would be worse with the effect than without. An effect without which another would be
    beyond its bounds is of use: an accelerometer that seems to read twice what is there hides the drag. The least
    useful goes first, and the others are looked at again without it.
    Where too little is held out to say anything, or an effect hardly acts (no landing, no turn), nothing goes.
    """
    held = judged_rows(model)
    per = max(2, int(prepared.thinner.rate_hz))
    runs = [r.run for r in model.rows]
    if not long_enough(held, per):
        return model, values
    while True:
        with_it = delivered_residuals(model, values)
        options = []
        for key in model.selection.active:
            term = model.search.terms[key]
            if term.effect in UNKNOWNS or term.run:
                continue
            beta, _ = coefficients(model.regression, model.selection.fit, key)
            cols = model.regression.columns([key])
            wrench = [c for c in main_channels(model.rows, cols, beta, model.noise) if c < CHANNELS_OF_WRENCH]
            fewer = without(model, key, USELESS)
            left = delivered_residuals(fewer, values)
            pairs = (with_it, left), tuple(about_means(runs, part, held) for part in (with_it, left))
            use = max(helps(*growth(*pair, held, per), wrench) for pair in pairs)
            if costs_more(growth(with_it, left, held, per), growth(left, with_it, held, per), wrench):
                use = -np.inf
            elif not within_bounds(fewer):
                use = np.inf
            options.append((use, key, fewer))
        least = min(options, key=lambda o: o[0], default=None)
        if least is None or least[0] >= HELP_Z:
            return model, values
        model = least[2]
        values = values_of(model, ())
