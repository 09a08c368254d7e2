"""Gains of a reading that only look wrong because its characteristic is curved."""

from __future__ import annotations

import numpy as np

from rotorid.effects.catalogue import ids_of
from rotorid.mismatch.decision import rules
from rotorid.mismatch.decision.decide import SMALLEST_CHANGE
from rotorid.mismatch.instrument.model import ReadingModel
from rotorid.mismatch.instrument.setup import averaged, pieces_of
from rotorid.mismatch.model.delivered import Values

SMALL_LOADS = 0.3
"""Share of the largest load up to which a load is small."""


def curved_gains(model: ReadingModel, values: Values) -> set[str]:
    """Gains called wrong given a curved characteristic that is right at small loads, or right over all of them.

    The gain of a curve is a convention: a reading that saturates is right at small loads, one with a dead band nearly
    so over all, and the slope that a polynomial has at no load is neither. A wrong calibration is off in both.
    """
    instrument = model.setup.instrument
    if not any(model.search.terms[k].effect in characteristics() for k in model.selection.active):
        return set()
    out = set()
    for key, (change, _) in values.items():
        of_key = [c for c in instrument.loaded if c < 3 and key in ("gain", f"gain_{'xyz'[c]}")]
        for share in (SMALL_LOADS, 1.0) if of_key else ():
            # Channels may curve to either side: what they have in common is the gain.
            slope = np.mean([slope_of(model, c, share * instrument.largest[c]) for c in of_key])
            if np.sign(change) * slope < SMALLEST_CHANGE:
                out.add(key)
    return out if rules.CURVED_GAIN(bool(out)) else set()


def characteristics() -> frozenset[str]:
    """Ids of a sensor's curves."""
    return ids_of("curve_of_load") & ids_of("kind", "sensor")


def slope_of(model: ReadingModel, channel: int, most: float) -> float:
    """Slope, less one, of a reading over loads up to `most` in size, less all effects but a curved characteristic."""
    fit, search = model.selection.fit, model.search
    others = [k for k in model.selection.active if search.terms[k].effect not in characteristics()]
    known = np.isin(fit.columns, model.regression.columns(others))
    load, left = [], []
    for rows, loads in zip(model.rows, loads_of_rows(model), strict=True):
        used = np.abs(loads[:, channel]) < most
        load.append(loads[used, channel])
        left.append((rows.y[:, channel] - rows.x[:, channel][:, fit.columns[known]] @ fit.beta[known])[used])
    columns = np.stack([np.concatenate(load), np.ones(sum(map(len, load)))], axis=1)
    return float(np.linalg.lstsq(columns, np.concatenate(left), rcond=1e-9)[0][0])


def loads_of_rows(model: ReadingModel) -> list[np.ndarray]:
    """Loads (n, 6) of every part that has rows, in their order."""
    count = model.setup.average
    return [averaged(x.load, count)[p] for x in model.loadings for p in pieces_of(x, count)]
