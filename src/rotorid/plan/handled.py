"""What a step by hand and a hover after it would separate, predicted as flights are.

Where two propellers are swapped the flight after it is of the same believed vehicle, with the propellers' coefficients
in other places; with a known mass attached it is of another one (`rotorid.plan.changed`). A step takes HANDLING_S.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rotorid.errors import InputError
from rotorid.plan.candidates import ManoeuvrePiece, joined
from rotorid.plan.changed import OF_CENTRE, OF_PROPELLER, WITH_MASS_OF_ITS_OWN, ChangedVehicle, masses, swaps
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
from rotorid.steps import step

_HANDLING_S = 300.0
"""A step by hand takes this long: land, work, take off."""


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
