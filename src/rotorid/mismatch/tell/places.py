"""A place of a mismatch (a regime, else a stretch of a run) and the believed model's own error there."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from rotorid.mismatch.decide.findings import Analysis, ChannelTrace, rms
from rotorid.mismatch.decide.sizes import Size, drift_m, fitted_part, scales
from rotorid.mismatch.decide.words import number, regime_words

if TYPE_CHECKING:
    from rotorid.mismatch.tell.verdict import Location, Regime


def in_a_regime(place: Location) -> bool:
    """Whether a place is said by what was flown, and not by the time."""
    regime = place.regime
    return regime is not None and regime.variable != "time_s" and None not in (regime.low, regime.high)


def range_words(regime: Regime) -> str:
    """`airspeed 3 to 7 m/s`."""
    name, unit = regime_words(regime.variable, regime.either_sign)
    return f"{name} {number(regime.low)} to {number(regime.high)} {unit}".strip()


def regime_values(known: Mapping[str, np.ndarray], regime: Regime) -> np.ndarray:
    """A regime's variable on the instants of a run, its magnitude where the range is one of magnitudes."""
    values = known[regime.variable]
    return np.abs(values) if regime.either_sign else values


def size_at(analysis: Analysis, place: Location) -> Size | None:
    """The believed model's error in a place; None where no sample lies there or the channel has no scale.

    Of a regime over the runs held out, where these go there at all, else over the fitted ones; of a stretch in its run.
    """
    own = [(t, _inside(analysis, place, t)) for t in analysis.traces if t.channel == place.channel]
    if in_a_regime(place):
        part = fitted_part(analysis)
        signed = [(t, inside, part(t.run, t.time_s)) for t, inside in own]
        held = any((inside & (sign < 0)).any() for _, inside, sign in signed)
        own = [(t, inside & (sign < 0 if held else sign > 0)) for t, inside, sign in signed]
    value, known = rms([t.before[inside] for t, inside in own]), scales(analysis)
    if np.isnan(value) or place.channel not in known:
        return None
    scale, unit = known[place.channel], own[0][0].unit
    metres = None
    if analysis.instrument is None:
        alone = [(t.time_s, np.where(inside, t.before, np.nan)) for t, inside in own]
        metres = drift_m(analysis.believed, place.channel, alone)
    return Size(place.channel, value, unit, value / scale.value, scale.words, metres)


def _inside(analysis: Analysis, place: Location, trace: ChannelTrace) -> np.ndarray:
    """Mask of a trace's samples that lie in a place."""
    if not in_a_regime(place):
        return (trace.run == place.run) & (trace.time_s >= place.start_s) & (trace.time_s <= place.stop_s)
    known = analysis.regimes.get(trace.run, {})
    if place.regime.variable not in known:
        return np.zeros(len(trace.time_s), bool)
    value = np.interp(trace.time_s, known["time_s"], regime_values(known, place.regime))
    return (value >= place.regime.low) & (value <= place.regime.high)
