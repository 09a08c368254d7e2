"""Nothing is delivered that makes a channel worse on the held-out part than the believed vehicle leaves it, and no
effect that makes none of its channels better there.

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

from rotorid.mismatch.decide import WIDEST_TRUST, coefficients, estimates, main_channels, suggested
from rotorid.mismatch.motion import Segment
from rotorid.mismatch.prepare import Prepared, training_rule
from rotorid.mismatch.regression import Fit
from rotorid.mismatch.rows import residual
from rotorid.mismatch.unknowns import UNKNOWNS
from rotorid.mismatch.wrench import WrenchModel

HARM_RATIO = 1.1
"""Held-out error beside the believed vehicle's from which a channel counts as worse."""
HARM_Z = 2.0
"""Standard errors over blocks of a second by which its squares must have grown, too: the burden of proof is the
effect's, and squares of a short flight are widely spread."""
HELP_Z = 0.5
"""Standard errors by which the squares of one channel that an effect acts in must grow without it: it has been found
already, in the runs fitted, so doubt is not held against it beyond the coin's."""
SURE_Z = 3.0
"""Standard errors by which a nuisance must differ from nothing to be delivered."""
LEAST_EXCITED = 0.1
"""Mean square of an effect on the held-out part, beside that on the fitted one, from which the former can judge it."""
LEAST_BLOCKS = 8
CHANNELS_OF_WRENCH = 6
REASON = "what is delivered with it is worse on the held-out runs than the believed vehicle"
USELESS = "without it the held-out error is no larger in any channel that it acts in"
UNSURE = "none of it at all is within its interval"

Values = dict[str, tuple[float, float]]
ValuesOf = Callable[[WrenchModel, Sequence[str]], Values]
"""The believed values that a model's recordings contradict, less those refused."""


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


def held_out_masks(prepared: Prepared, model: WrenchModel, segments: list[Segment]) -> list[np.ndarray]:
    """Mask of the held-out rows of every stretch."""
    rule = training_rule(prepared.split, segments)
    return [np.array([rule(r.run, t) is False for t in r.time_s], bool) for r in model.rows]


def growth(
    before: list[np.ndarray], after: list[np.ndarray], held: list[np.ndarray], per: int
) -> tuple[np.ndarray, np.ndarray]:
    """Ratio of the held-out errors after and before of each wrench channel, and its growth in standard errors.

    Squares are compared by blocks of `per` rows; without LEAST_BLOCKS of them nothing is said (ratio 1, growth 0).
    """
    blocks = []
    for b, a, mask in zip(before, after, held, strict=True):
        rows = np.flatnonzero(mask)
        if len(rows) >= per:
            parts = np.array_split(rows, len(rows) // per)
            squares = [x[:, :CHANNELS_OF_WRENCH] ** 2 for x in (b, a)]
            blocks += [[s[p].mean(axis=0) for s in squares] for p in parts]
    if not long_enough(held, per):
        return np.ones(CHANNELS_OF_WRENCH), np.zeros(CHANNELS_OF_WRENCH)
    was, now = np.array(blocks).transpose(1, 0, 2)
    change = now - was
    doubt = change.std(axis=0, ddof=1) / np.sqrt(len(change))
    ratio = np.sqrt(now.mean(axis=0) / np.maximum(was.mean(axis=0), 1e-300))
    return np.nan_to_num(ratio, nan=1.0), np.nan_to_num(change.mean(axis=0) / np.maximum(doubt, 1e-300))


def excited(parts: list[np.ndarray], held: list[np.ndarray]) -> bool:
    """Whether contributions (n,) to a channel are large enough on the held-out rows beside the others."""
    squares = [
        np.concatenate([p[m] ** 2 for p, m in zip(parts, masks, strict=True)]) for masks in (held, inverted(held))
    ]
    here, there = (float(s.mean()) if len(s) else 0.0 for s in squares)
    return here >= LEAST_EXCITED * there


def inverted(masks: list[np.ndarray]) -> list[np.ndarray]:
    return [~mask for mask in masks]


def about_means(runs: list[str], parts: list[np.ndarray], held: list[np.ndarray]) -> list[np.ndarray]:
    """Residuals (n, 12) of stretches less the mean of the held-out rows of their run."""
    means = {}
    for run in dict.fromkeys(runs):
        rows = [p[mask] for r, p, mask in zip(runs, parts, held, strict=True) if r == run and mask.any()]
        means[run] = np.concatenate(rows).mean(axis=0) if rows else 0.0
    return [p - means[r] for r, p in zip(runs, parts, strict=True)]


def long_enough(held: list[np.ndarray], per: int) -> bool:
    """Whether there are LEAST_BLOCKS of `per` rows held out."""
    return sum(int(mask.sum()) // per for mask in held) >= LEAST_BLOCKS


def harmed(ratio: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Mask of the channels that are worse."""
    return (ratio > HARM_RATIO) & (z > HARM_Z)


def helps(ratio: np.ndarray, z: np.ndarray, channels: list[int]) -> float:
    """How surely the error of one of some channels grows without an effect: `growth` from with it to without.

    Infinite without a channel: what shows in the comparison of two sensors alone is not judged by the wrench, nor what
    does not act on the held-out part.
    """
    return max((float(z[c]) if ratio[c] > 1.0 else 0.0 for c in channels), default=np.inf)


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

    What goes is the effect, the wrong value or the nuisance without which the channels are best: a loop that answers
    the gyroscope's noise makes an offset in time of it, which the next turn contradicts. `values_of` is returned
    without the values that went. Harm that is left is of what lies between command and speed.
    """
    values = values_of(model, ())
    before = believed_residuals(prepared, model, commanded)
    held = held_out_masks(prepared, model, model.segments)
    per = max(2, int(prepared.thinner.rate_hz))
    refused: tuple[str, ...] = ()
    while True:
        ratio, z = growth(before, delivered_residuals(model, values), held, per)
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
            return model, values, less(values_of, refused), True
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
    not decide about an effect that is right about everything else. Beyond HARM_RATIO it does: what is delivered would
    be worse with the effect than without. An effect without which another would be beyond its bounds is of use: an
    accelerometer that seems to read twice what is there hides the drag. The least useful goes first, and the others are
    looked at again without it.
    Where too little is held out to say anything, or an effect hardly acts (no landing, no turn), nothing goes.
    """
    held = held_out_masks(prepared, model, model.segments)
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
            wrench = [c for c in wrench if excited([r.x[:, c, cols] @ beta for r in model.rows], held)]
            fewer = without(model, key, USELESS)
            left = delivered_residuals(fewer, values)
            pairs = (with_it, left), tuple(about_means(runs, part, held) for part in (with_it, left))
            use = max(helps(*growth(*pair, held, per), wrench) for pair in pairs)
            if harmed(*growth(left, with_it, held, per))[wrench].any():
                use = -np.inf
            elif not within_bounds(fewer):
                use = np.inf
            options.append((use, key, fewer))
        least = min(options, key=lambda o: o[0], default=None)
        if least is None or least[0] >= HELP_Z:
            return model, values
        model = least[2]
        values = values_of(model, ())
