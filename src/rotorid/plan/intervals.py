"""Widths of the intervals that a planned flight will leave, and how large an effect may then be that is not found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rotorid.errors import InputError
from rotorid.mismatch.decision.select import VALUE_FLOOR
from rotorid.mismatch.plant.regression import NEVER_EXCITED, ridge_inverse
from rotorid.mismatch.plant.rows import PARAMETER_NAMES
from rotorid.mismatch.plant.unknowns import UNKNOWNS
from rotorid.mismatch.posterior.limits import PROBABILITY, drawn
from rotorid.plan.questions import FittedSet
from rotorid.plan.separation import Information

SHARE = "of the weight"
"""Unit of an upper limit."""


@dataclass(frozen=True)
class Width:
    """Half the 95 % interval of a believed value (relative) or of an effect's parameter (its own unit); of an effect
    that is not at work its upper limit (share of the weight, as the verdict's `absent`)."""

    name: str
    unit: str
    before: float
    after: float
    """Infinite where nothing is known."""
    wished: float | None = None


def _able(known: FittedSet) -> dict[str, tuple[str, ...]]:
    """To everything that can be wished for its terms: believed values, and effects that are not at work."""
    search, active = known.fitted.model.search, known.fitted.model.selection.active
    out = {name: (key,) for key, name in PARAMETER_NAMES.items() if key in search.always}
    at_work = {search.terms[k].effect for k in active}
    for key, term in search.terms.items():
        if term.kind == "effect" and not term.run and term.effect not in (at_work | UNKNOWNS.keys()):
            out[term.effect] = (*out.get(term.effect, ()), key)
    return out


def check_wishes(known: FittedSet, wishes: dict[str, float]) -> None:
    """InputError where something is wished for that these recordings do not show."""
    names = _able(known)
    for name in wishes:
        if reason := known.prepared.not_testable.get(name):
            raise InputError(f"--want {name}: not testable on this set: {reason}")
        if name not in names:
            raise InputError(
                f"--want {name}: no value that these recordings show, nor an effect that is not at work; "
                f"expected one of {', '.join(names)}"
            )


def widths(known: FittedSet, before: Information, after: Information, wishes: dict[str, float]) -> list[Width]:
    """Half widths and limits that are wished for, and half widths of the parameters of the effects in the model.

    A doubt that the engine found beyond the usual one (blocks that differ more than their noise) is taken to stay. Of
    the loops that the flight may be flown with the worse counts.
    """
    model, regression, names = known.fitted.model, known.regression, _able(known)
    out = []
    for name, wished in wishes.items():
        if name in PARAMETER_NAMES.values():
            (column,) = regression.columns(names[name])
            sizes = [_half(known, before, i, int(column), VALUE_FLOOR) for i in (before, after)]
            out.append(Width(name, "relative", *sizes, wished))
        else:
            sizes = [max(_limit(known, i, after, key) for key in names[name]) for i in (before, after)]
            out.append(Width(name, SHARE, *sizes, wished))
    for key in model.selection.active:
        term = model.search.terms[key]
        if not term.form.linear or term.run or term.effect in UNKNOWNS:
            continue
        for index, column in zip(term.form.linear, regression.columns([key]), strict=True):
            parameter = term.form.parameters[index]
            sizes = [_half(known, before, i, int(column)) for i in (before, after)]
            out.append(Width(f"{term.effect} {parameter.symbol}", parameter.unit, *sizes))
    return out


def _half(known: FittedSet, before: Information, information: Information, column: int, floor: float = 0.0) -> float:
    """Half the 95 % interval of a column of the model."""
    fit, at = known.fitted.model.selection.fit, np.array([column])
    plain = float(_covariance(known, before.each[0], at)[0, 0])
    own = max(float(_covariance(known, gram, at)[0, 0]) for gram in information.each)
    (place,) = fit.places(at)
    more = max(1.0, float(fit.covariance[place, place]) / max(plain, 1e-300))
    return 1.96 * float(np.sqrt(more * own + floor**2))


def _limit(known: FittedSet, information: Information, flown: Information, key: str) -> float:
    """What an absent effect's term may be at most with 95 % probability, a share of the weight (root mean square over
    `flown`); infinite where it is never excited."""
    columns = known.regression.columns([key])
    squares = flown.shares[np.ix_(columns, columns)] / flown.seconds
    bound, zero = np.full(len(columns), np.inf), np.zeros(len(columns))
    sizes = []
    for gram in information.each:
        if (np.diag(gram)[columns] <= NEVER_EXCITED).any():
            return np.inf
        beta = drawn(zero, _covariance(known, gram, columns), -bound, bound)
        sizes.append(np.quantile(np.sqrt(np.maximum(np.einsum("di,ij,dj->d", beta, squares, beta), 0.0)), PROBABILITY))
    return float(max(sizes))


def _covariance(known: FittedSet, gram: np.ndarray, columns: np.ndarray) -> np.ndarray:
    """Plain covariance (k, k) of some columns next to the model, from normal equations (K, K)."""
    model, regression = known.fitted.model, known.regression
    every = np.union1d(regression.columns([*model.search.always, *model.selection.active]), columns)
    inverse = ridge_inverse(gram[np.ix_(every, every)] + np.diag(regression.precision[every]))
    where = np.searchsorted(every, columns)
    return inverse[np.ix_(where, where)]
