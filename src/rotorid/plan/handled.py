"""What a step by hand and a hover after it would separate, predicted as flights are.

Where two propellers are swapped the flight after it is of the same believed vehicle, with the propellers' coefficients
in other places; with a known mass attached it is of another one (`rotorid.plan.simulate`). A step takes HANDLING_S.

Widths of the intervals that a planned flight will leave, and how large an effect may then be that is not found.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rotorid.errors import InputError
from rotorid.mismatch.decide.select import VALUE_FLOOR
from rotorid.mismatch.decide.statements import PROBABILITY, drawn
from rotorid.mismatch.evidence.regression import NEVER_EXCITED, ridge_inverse
from rotorid.mismatch.evidence.rows import PARAMETER_NAMES
from rotorid.mismatch.evidence.unknowns import UNKNOWNS
from rotorid.plan.candidates import ManoeuvrePiece, joined
from rotorid.plan.limits import Limits
from rotorid.plan.questions import FittedSet, Question
from rotorid.plan.separation import (
    Information,
    Questions,
    asked_terms,
    expecting,
    flown,
    of_flights,
    of_set,
    separations,
    smallest_separation,
    step_of,
    world_of,
)
from rotorid.plan.simulate import OF_CENTRE, OF_PROPELLER, WITH_MASS_OF_ITS_OWN, ChangedVehicle, masses, swaps
from rotorid.steps import step

_HANDLING_S = 300.0
"""A step by hand takes this long: land, work, take off."""
SHARE = "of the weight"
"""Unit of an upper limit."""


@dataclass(frozen=True)
class Handled:
    """A step by hand with the hover after it, and what is expected of both next to the set at hand."""

    change: ChangedVehicle
    hover_s: float
    questions: Questions
    """Of the questions that the step is there for: ids, and how far apart their models will be."""

    @property
    def of(self) -> str:
        """The effect that the step is there for."""
        return self.change.of

    @property
    def words(self) -> str:
        """What to do."""
        return self.change.words

    @property
    def minutes(self) -> float:
        """The work and the hover, min."""
        return (_HANDLING_S + self.hover_s) / 60.0

    @property
    def sigma(self) -> float | None:
        """Smallest separation expected; None where nothing is compared."""
        return smallest_separation(self.questions)


def _steps_for(known: FittedSet) -> list[tuple[list[ChangedVehicle], list[Question]]]:
    """Choices of each kind of step with the questions that it is there for."""
    vehicle, out = known.prepared.vehicle, []
    present = {known.fitted.model.search.terms[k].effect for k in known.fitted.model.selection.active}

    def asking(effects) -> list[Question]:
        return [q for q in known.questions if set(q.ids) & set(effects)]

    # From commands alone a difference may as well be the motor's, which stays.
    if known.fitted.measured and (questions := asking(OF_PROPELLER)):
        out.append((swaps(vehicle), questions))
    heavy = set(WITH_MASS_OF_ITS_OWN)
    questions = [q for q in asking([OF_CENTRE]) if not heavy & {*q.ids, *present}]
    if questions:
        out.append((masses(vehicle), questions))
    return [(choices, questions) for choices, questions in out if choices]


def handled(
    known: FittedSet, limits: Limits, hover: ManoeuvrePiece, least_s: float, still_s: float
) -> tuple[Handled, ...]:
    """The best choice of each kind of step, the one with the largest smallest separation first.

    The piece `hover` is flown for `least_s` at least, `still_s` at rest before and after; `known` is the set alone.
    """
    found = []
    reference = joined([hover] * int(np.ceil(least_s / (hover.duration_s + still_s))), step_of(known), still_s)
    for choices, questions in _steps_for(known):
        made = []
        for change in choices:
            try:
                own = _of_change(known, limits, reference, change, questions)
            except InputError:
                continue
            made.append(Handled(change, reference.duration_s, own))
        if made:
            found.append(max(made, key=lambda h: -1.0 if h.sigma is None else h.sigma))
    return tuple(sorted(found, key=lambda h: -(h.sigma or 0.0)))


@step("predicting what is changed by hand")
def _of_change(
    known: FittedSet, limits: Limits, reference, change: ChangedVehicle, questions: list[Question]
) -> Questions:
    """Separations of each question's models with the flight after a change."""
    base = of_set(known)
    known = expecting(known, [])
    terms, before = asked_terms(known), of_set(known)
    effect_of = {id(t.form): t.effect for t in (*known.fitted.model.search.terms.values(), *known.regression.terms)}
    out = []
    for question in questions:
        separated = []
        for hypothesis in question.hypotheses:
            world = change.world(world_of(known, question, hypothesis if hypothesis.keys else None), effect_of)
            more: Information = of_flights(known, flown(world, reference, limits), world, terms, change)
            separated += [s for s in separations(known, question, base, before + more) if s.true == hypothesis.id]
        out.append((question.ids, tuple(separated)))
    return tuple(out)


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
