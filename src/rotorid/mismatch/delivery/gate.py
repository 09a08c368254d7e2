"""The gate: a model is delivered only as far as it predicts no channel worse where it was not fitted.

Three models are compared channel by channel on environments that each was not fitted on: the believed vehicle, the
same physics with values refitted, and the refitted values with the effects. Refitted values that make a channel worse
fall back to what was believed; effects and values that make one worse than the refitted vehicle keep their status and
are withheld, with the reason. The runs held out take no part: they report.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from rotorid.mismatch.decision.words import channel_words
from rotorid.mismatch.model.delivered import FittedModel, Values, delivered_fit, judged_rows
from rotorid.mismatch.model.within_trust import ways
from rotorid.mismatch.plant.channel_errors import growth
from rotorid.mismatch.plant.regression import Fit
from rotorid.mismatch.plant.rows import CHANNELS
from rotorid.steps import step

WORSE_RATIO = 1.01
"""Error over the other model's from which a channel is predicted worse: a percent is what refitting itself moves."""
WORSE_Z = 3.0
"""Standard errors over blocks of a second of that growth: six channels and a handful of parts are compared, so that two
would withhold a sound effect in one set of eight."""

Residuals = list[np.ndarray]
"""What a model leaves of every stretch where it was not fitted, (n, channels)."""


@dataclass(frozen=True)
class Worse:
    """A channel that a model predicts worse than another."""

    channel: str
    ratio: float

    def __str__(self) -> str:
        """In words: `the error of the vertical force is 12 % larger`."""
        return f"the error of the {channel_words(self.channel)} is {100 * (self.ratio - 1):.0f} % larger"


@dataclass(frozen=True)
class Offer:
    """What might be delivered: values called wrong, and the terms of effects."""

    values: Values
    active: tuple[str, ...]


@dataclass(frozen=True)
class Settled:
    """An offer fitted: its fit, values moved within their trust, and what it leaves where it was not fitted."""

    offer: Offer
    fit: Fit
    moved: Values
    left: Residuals


@dataclass(frozen=True)
class Gated:
    """What passes the gate."""

    settled: Settled
    refitted: Settled
    withheld: Mapping[str, str] = field(default_factory=dict)
    """Id of an effect to the reason why it is not delivered."""
    withheld_values: Mapping[str, str] = field(default_factory=dict)
    """Key of a value called wrong to the same."""
    fell_back: Mapping[str, str] = field(default_factory=dict)
    """Key of a value of the refitted vehicle that is as believed to the reason."""

    def worse(self, model: FittedModel) -> list[Worse]:
        """Channels that what passes predicts worse than the refitted vehicle: none."""
        return worse_than(model, self.refitted.left, self.settled.left)

    @property
    def passes_whole(self) -> bool:
        """Whether nothing was kept out."""
        return not (self.withheld or self.withheld_values or self.fell_back)


def settle(model: FittedModel, offer: Offer, reference: Residuals | None = None) -> Settled:
    """An offer with the other values as believed, or moved within their trust where that pays.

    With a `reference` the way is taken by which no channel is worse than it, if one of the two is such.
    """
    found = ways(model, offer.values, list(offer.active))
    way = found[0]
    if reference is not None and worse_than(model, reference, way.left):
        way = min(found, key=lambda w: excess(worse_than(model, reference, w.left)))
    return Settled(offer, way.fit, way.moved, way.left)


def worse_than(model: FittedModel, reference: Residuals, left: Residuals) -> list[Worse]:
    """Channels of force and moment that are predicted worse than by a reference, where neither was fitted."""
    ratio, z = growth(reference, left, judged_rows(model), model.rows_per_block)
    found = np.flatnonzero((ratio > WORSE_RATIO) & (z > WORSE_Z))
    return [Worse(CHANNELS[c], float(ratio[c])) for c in found]


def excess(worse: Sequence[Worse]) -> float:
    """How much worse channels are in all: the sum of their logarithms."""
    return float(sum(np.log(w.ratio) for w in worse))


@step("what may be delivered")
def gate(
    model: FittedModel,
    offer: Offer,
    plain: Values,
    believed: Residuals,
    unusable: Callable[[Settled], str] = lambda settled: "",
) -> Gated:
    """What of an offer may be delivered.

    Parameters
    ----------
    model
        The fitted runs' model, with `offer.active` among its terms.
    offer, plain
        Values called wrong and terms at work, and the values called wrong where no effect is at work.
    believed
        What the believed vehicle leaves of every stretch, (n, channels).
    unusable
        Why the vehicle of a settled offer is no body that hovers and flies; empty where it is.
    """
    refitted, fell_back = without_worse(model, settle(model, Offer(plain, ()), believed), believed)
    settled, kept_out = without_worse(model, settle(model, offer, refitted.left), refitted.left, refitted)
    settled, unfit = without_unusable(model, settled, refitted, unusable)
    kept_out |= unfit
    names = effect_names(model, offer.active)
    return Gated(
        settled,
        refitted,
        withheld={k: v for k, v in kept_out.items() if k in names},
        withheld_values={k: v for k, v in kept_out.items() if k not in names},
        fell_back=fell_back,
    )


def effect_names(model: FittedModel, active: Sequence[str]) -> dict[str, list[str]]:
    """Ids of the effects at work to their terms."""
    out: dict[str, list[str]] = {}
    for key in active:
        out.setdefault(model.search.terms[key].effect, []).append(key)
    return out


def without_worse(
    model: FittedModel, settled: Settled, reference: Residuals, last: Settled | None = None
) -> tuple[Settled, dict[str, str]]:
    """The offer less the parts without which no channel is worse than the reference.

    One part after the other goes, always the one without which the channels are least worse, until all is well; then
    each that went is tried once more, the last first, for two may only together be to blame. Where nothing is left, it
    is `last` (default the believed vehicle). Ids and value keys that went are given with their reason.
    """
    gone: dict[str, str] = {}
    steps: list[Settled] = []
    while worse := worse_than(model, reference, settled.left):
        parts = parts_of(model, settled)
        if not parts:
            return last or nothing(model, reference), gone
        fewer = [(part, settle(model, less(settled.offer, part, model), reference)) for part in parts]
        best, better = min(fewer, key=lambda p: excess(worse_than(model, reference, p[1].left)))
        gone[best] = f"where it was not fitted, {max(worse, key=lambda w: w.ratio)} with it"
        steps.append(settled)
        settled = better
    for part, before in list(zip(gone, steps, strict=True))[-2::-1]:
        again = settle(model, more(settled.offer, part, before.offer, model), reference)
        if not worse_than(model, reference, again.left):
            settled = again
            del gone[part]
    return settled, gone


def without_unusable(
    model: FittedModel, settled: Settled, refitted: Settled, unusable: Callable[[Settled], str]
) -> tuple[Settled, dict[str, str]]:
    """The offer less the parts that make its vehicle unusable; `refitted`, or as believed, where any part does.

    No part goes whose going makes a channel worse.
    """
    gone: dict[str, str] = {}
    while why := unusable(settled):
        fewer = [
            (part, settle(model, less(settled.offer, part, model), refitted.left)) for part in parts_of(model, settled)
        ]
        sound = [(part, s) for part, s in fewer if not worse_than(model, refitted.left, s.left)]
        fit = next(((part, s) for part, s in sound if not unusable(s)), None)
        if fit is None:
            gone |= {part: why for part, _ in fewer}
            return (nothing(model, refitted.left) if unusable(refitted) else refitted), gone
        gone[fit[0]] = why
        settled = fit[1]
    return settled, gone


def nothing(model: FittedModel, reference: Residuals) -> Settled:
    """The believed vehicle, nuisances aside."""
    return Settled(Offer({}, ()), delivered_fit(model, [], {})[1], {}, reference)


def parts_of(model: FittedModel, settled: Settled) -> list[str]:
    """Ids of effects and keys of values that could be left out of an offer."""
    return [*effect_names(model, settled.offer.active), *settled.offer.values]


def more(offer: Offer, part: str, source: Offer, model: FittedModel) -> Offer:
    """An offer with a part of another one once more, in the other's order."""
    values = {k: v for k, v in source.values.items() if k in offer.values or k == part}
    kept = {*offer.active, *effect_names(model, source.active).get(part, ())}
    return Offer(values, tuple(k for k in source.active if k in kept))


def less(offer: Offer, part: str, model: FittedModel) -> Offer:
    """An offer without an effect, or with a value as believed."""
    if part in offer.values:
        return replace(offer, values={k: v for k, v in offer.values.items() if k != part})
    return replace(offer, active=tuple(k for k in offer.active if model.search.terms[k].effect != part))
