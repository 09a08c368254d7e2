"""Widths of the intervals that a planned flight will leave, from the normal equations of the set and of the flight."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rotorid.errors import InputError
from rotorid.mismatch.regression import ridge_inverse
from rotorid.mismatch.rows import PARAMETER_NAMES
from rotorid.mismatch.select import VALUE_FLOOR
from rotorid.plan.questions import Known
from rotorid.plan.separation import Information


@dataclass(frozen=True)
class Width:
    """Half the 95 % interval of a believed value (relative) or of an effect's parameter (its own unit)."""

    name: str
    unit: str
    before: float
    after: float
    wished: float | None = None


def widths(known: Known, before: Information, after: Information, wishes: dict[str, float]) -> list[Width]:
    """Half widths of what is wished for, and of the parameters of the effects in the model.

    A doubt that the engine found beyond the plain one (blocks that differ more than their noise) is taken to stay.
    """
    model, regression = known.fitted.model, known.regression
    names = {v: k for k, v in PARAMETER_NAMES.items()}
    keys = [*model.search.always, *model.selection.active]
    cols = regression.columns(keys)
    covariances = [
        ridge_inverse(i.gram[np.ix_(cols, cols)] + np.diag(regression.precision[cols])) for i in (before, after)
    ]
    fit = model.selection.fit
    at = {c: i for i, c in enumerate(cols)}
    out = []

    def half(column: int, which: int, floor: float = 0.0) -> float:
        plain = covariances[0][at[column], at[column]]
        robust = fit.covariance[fit.places(np.array([column]))[0], fit.places(np.array([column]))[0]]
        more = max(1.0, float(robust / max(plain, 1e-300)))
        return 1.96 * float(np.sqrt(more * covariances[which][at[column], at[column]] + floor**2))

    for name, wished in wishes.items():
        key = names.get(name)
        if key is None or key not in keys:
            able = [PARAMETER_NAMES[k] for k in keys if k in PARAMETER_NAMES]
            raise InputError(f"--want {name}: no value that these recordings show; expected one of {', '.join(able)}")
        column = int(regression.columns([key])[0])
        out.append(Width(name, "relative", half(column, 0, VALUE_FLOOR), half(column, 1, VALUE_FLOOR), wished))
    for key in model.selection.active:
        term = model.search.terms[key]
        if not term.form.linear or term.run:
            continue
        for index, column in zip(term.form.linear, regression.columns([key]), strict=True):
            parameter = term.form.parameters[index]
            out.append(
                Width(f"{term.effect} {parameter.symbol}", parameter.unit, half(int(column), 0), half(int(column), 1))
            )
    return out
