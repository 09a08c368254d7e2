"""Believed values that only look wrong because an effect at work has a form that is too narrow.

On a stand that was not zeroed with the vehicle on, the weight acts on the force along z and, at its lever arm, on the
moments. A centre of mass that is also higher than believed then looks like another mass, whose force a tare offset
takes away again: two wrong things in place of one. A value is called wrong only if it stays so with the effects at
work in their richer forms.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from rotorid.mismatch import rules
from rotorid.mismatch.decide import SMALLEST_CHANGE, WIDEST_TRUST, coefficients
from rotorid.mismatch.instrument.model import ReadingModel, block_length, kept_values
from rotorid.mismatch.instrument.setup import averaged, pieces_of
from rotorid.mismatch.regression import Fit
from rotorid.mismatch.select import Selection
from rotorid.mismatch.unknowns import UNKNOWNS
from rotorid.mismatch.within_trust import pays, strained

Values = Mapping[str, tuple[float, float]]
"""Relative change of believed values and its one-sigma."""

MOST_MORE = 3
"""Parameters that a richer form may have more."""
MAY_LOSE = 20.0
"""Whitened squares, less what parameters cost, that a model with one wrong value less may explain less."""
SMALL_LOADS = 0.3
"""Share of the largest load up to which a load is small."""


def without_needless(
    model: ReadingModel, values_of: Callable[[Selection], Values]
) -> tuple[ReadingModel, dict[str, tuple[float, float]]]:
    """The model with richer forms where they make a wrong value needless, and the values that stay wrong.

    Parameters
    ----------
    model
        As the search left it.
    values_of
        The wrong values beside a selection: relative change and one-sigma.
    """
    values = dict(values_of(model.selection))
    while values:
        richer = [(s, v) for s in richer_forms(model) if len(v := values_of(s)) < len(values)]
        if not rules.NEEDLESS_VALUE(bool(richer)):
            break
        selection, found = max(richer, key=lambda pair: model.search.worth(pair[0].active))
        model, values = replace(model, selection=selection), dict(found)
    return model, values


def curved_gains(model: ReadingModel, values: Values) -> set[str]:
    """Gains called wrong beside a curved characteristic that is right at small loads, or right over all of them.

    The gain of a curve is a convention: a reading that saturates is right at small loads, one with a dead band nearly
    so over all, and the slope that a polynomial has at no load is neither. A wrong calibration is off in both.
    """
    instrument = model.setup.instrument
    if not any(model.search.terms[k].effect == "load_nonlinearity" for k in model.selection.active):
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


def slope_of(model: ReadingModel, channel: int, most: float) -> float:
    """Slope, less one, of a reading over loads up to `most` in size, less all effects but a curved characteristic."""
    fit, search = model.selection.fit, model.search
    others = [k for k in model.selection.active if search.terms[k].effect != "load_nonlinearity"]
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


def richer_forms(model: ReadingModel) -> list[Selection]:
    """Selections in which one effect has another form with more parameters and explains about as much or more."""
    search, active = model.search, model.selection.active
    least, out = search.worth(active) - MAY_LOSE, []
    for place, key in enumerate(active):
        own = search.terms[key]
        for term in search.terms.values():
            if term.kind != "effect" or term.effect != own.effect:
                continue
            trial = [*active[:place], term.key, *active[place + 1 :]]
            if own.size < term.size <= own.size + MOST_MORE and search.worth(trial) >= least:
                out.append(selection_of(model, trial))
    return out


def selection_of(model: ReadingModel, active: list[str]) -> Selection:
    """A selection of other terms, fitted and tested as the search does in the end."""
    search = model.search
    fit = search.regression.fit(kept_values(search, active) + active, jackknife=True)
    p_values = {k: search.judge(k, active, search.without(k, active), jackknife=True).p_value for k in active}
    return replace(model.selection, active=active, fit=fit, p_values=p_values)


def settled(model: ReadingModel, values: Values, active: list[str]) -> tuple[Fit, dict[str, tuple[float, float]]]:
    """The fit to deliver with the terms of `active`, and what it changes of values that are not called wrong.

    As for flights (`within_trust.settled`): those move together, within their trust, and only if it pays.
    """
    regression, kept = model.regression, kept_values(model.search, active)
    loose = {k: WIDEST_TRUST for k in values}
    keys_of_both = [[*regression.keys_of("nuisance"), *values, *active], kept + active]
    plain, free = (regression.fit(keys, loose=loose) for keys in keys_of_both)
    moved = {}
    for key in (k for k in regression.keys_of("value") if k in kept and k not in values):
        beta, covariance = coefficients(regression, free, key)
        moved[key] = (float(beta[0]), float(np.sqrt(covariance[0, 0])))
    if strained(model, values, moved):
        return plain, {}
    left = [left_out_residuals(model, keys, loose) for keys in keys_of_both]
    if not pays(*left, judged_rows(model), block_length(model.setup, model.rows)):
        return plain, {}
    return free, moved


def delivered(model: ReadingModel, fit: Fit) -> list[np.ndarray]:
    """What values and named effects of a fit leave of every part, (n, 6).

    What has no name is in the fit, so that nothing else takes it up, and not in what is delivered.
    """
    unnamed = [k for k in model.selection.active if model.search.terms[k].effect in UNKNOWNS]
    beta = np.where(np.isin(fit.columns, model.regression.columns(unnamed)), 0.0, fit.beta)
    return [np.nan_to_num(r.y) - r.x[:, :, fit.columns] @ beta for r in model.rows]


def left_out_residuals(model: ReadingModel, keys: list[str], loose: Mapping[str, float]) -> list[np.ndarray]:
    """What values and named effects leave of every part where they were not fitted, (n, 6).

    Each environment is judged by coefficients found without it.
    """
    regression = model.regression
    cols, betas = regression.left_out(tuple(keys), False, dict(loose))
    unnamed = [k for k in model.selection.active if model.search.terms[k].effect in UNKNOWNS]
    betas = np.where(np.isin(cols, regression.columns(unnamed)), 0.0, betas)
    fold = np.append(regression.folds(False), -1)  # the last stands for rows that are in no block
    return [
        np.nan_to_num(r.y) - np.einsum("nck,nk->nc", r.x[:, :, cols], betas[fold[block]])
        for r, block in zip(model.rows, regression.blocks_of_rows, strict=True)
    ]


def judged_rows(model: ReadingModel) -> list[np.ndarray]:
    """Mask of the rows of every part that are in an environment."""
    return [b >= 0 for b in model.regression.blocks_of_rows]
