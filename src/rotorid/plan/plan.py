"""The flight that settles what a set left open: manoeuvres chosen one after the other by what they separate a second.

Every candidate is flown in simulation; one that leaves the limits is out. Then the manoeuvre that brings the open
questions and wishes furthest towards their goals for its time is taken, and again, until all are reached or no time is
left. What the others make needless is dropped. Next to that flight stand the best one without its first manoeuvre and
the standard flight of the same length. Each is flown once more by every competing model; these predictions are the ones
stated, and by them the best of the three is the plan, with the widths of the intervals that it will leave.

What a step by hand (HANDLING_S) and a hover after it would separate is predicted as flights are. Where two propellers
are swapped the flight after it is of the same believed vehicle, with the propellers' coefficients in other places; with
a known mass attached it is of another one (`rotorid.plan.simulate`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.mismatch.decide.select import VALUE_FLOOR
from rotorid.mismatch.decide.statements import PROBABILITY, drawn
from rotorid.mismatch.evidence.comparison import ENVIRONMENT_S, LEAST_ENVIRONMENTS
from rotorid.mismatch.evidence.regression import NEVER_EXCITED, ridge_inverse
from rotorid.mismatch.evidence.rows import PARAMETER_NAMES
from rotorid.mismatch.evidence.unknowns import UNKNOWNS
from rotorid.plan.candidates import STANDARD, Limits, ManoeuvrePiece, Reference, candidates, joined, smaller, standard
from rotorid.plan.questions import FittedSet, Hypothesis, Question
from rotorid.plan.separation import (
    Information,
    Questions,
    asked_terms,
    chain_separations,
    expecting,
    flown,
    of_flights,
    of_set,
    separation_of,
    separations,
    step_of,
    world_of,
)
from rotorid.plan.simulate import (
    OF_CENTRE,
    OF_PROPELLER,
    WITH_MASS_OF_ITS_OWN,
    ChangedVehicle,
    CompetingModel,
    SimulatedFlight,
    masses,
    swaps,
)
from rotorid.recordings import Vehicle
from rotorid.steps import step

SHARE = "of the weight"
"""Unit of an upper limit."""
SIZES = (1.0, 0.75, 0.5)
"""Sizes of a manoeuvre that are tried, the largest that keeps the limits is taken."""
_QUICK = ("shake all to 2 Hz", "shake all to 4 Hz")
NOTHING = Reference(np.zeros(1), np.zeros((1, 3)), np.zeros(1))
"""Of a flight without pieces."""
BETWEEN_S = 1.0
"""At rest between manoeuvres."""
_LEAST_S = LEAST_ENVIRONMENTS * ENVIRONMENT_S
_MOST_PIECES = 12
_LEAST_PROGRESS = 0.01
"""Share of the way to the goal that a further manoeuvre must bring."""


def _smallest_separation(questions: Questions) -> float | None:
    """Smallest separation expected over all questions; None where nothing is compared."""
    return min((s.sigma for _, found in questions for s in found), default=None)


@dataclass(frozen=True)
class Handled:
    """A step by hand with the hover after it, and what is expected of both next to the set at hand."""

    change: ChangedVehicle
    hover_s: float
    questions: Questions
    """Of the questions that the step is there for: ids, and how far apart their models will be."""

    @property
    def minutes(self) -> float:
        """The work and the hover, min."""
        handling_s = 300.0  # A step by hand takes this long: land, work, take off.
        return (handling_s + self.hover_s) / 60.0

    @property
    def sigma(self) -> float | None:
        """Smallest separation expected; None where nothing is compared."""
        return _smallest_separation(self.questions)


def _steps_for(known: FittedSet) -> list[tuple[list[ChangedVehicle], list[Question]]]:
    """Choices of each kind of step with the questions that it is there for."""
    vehicle, out = known.prepared.vehicle, []
    present = {known.model.search.terms[k].effect for k in known.model.selection.active}

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


def _handled(
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
    known: FittedSet, limits: Limits, reference: Reference, change: ChangedVehicle, questions: list[Question]
) -> Questions:
    """Separations of each question's models with the flight after a change."""
    base = of_set(known)
    known = expecting(known, [])
    terms, before = asked_terms(known), of_set(known)
    effect_of = {id(t.form): t.effect for t in (*known.model.search.terms.values(), *known.regression.terms)}

    def after(question: Question, hypothesis: Hypothesis) -> Information:
        world = change.world(world_of(known, question, hypothesis), effect_of)
        return before + of_flights(known, flown(world, reference, limits), world, terms, change)

    return _by_each_model(known, questions, base, after)


def _by_each_model(
    known: FittedSet,
    questions: Iterable[Question],
    before: Information,
    after: Callable[[Question, Hypothesis], Information],
) -> Questions:
    """How far apart the models of each question will be, each by what recordings hold (`after`) where it is true."""
    out = []
    for question in questions:
        found = (separation_of(known, question, h, before, after(question, h)) for h in question.hypotheses)
        out.append((question.ids, tuple(s for s in found if s is not None)))
    return tuple(out)


@dataclass(frozen=True)
class _Width:
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
    search, active = known.model.search, known.model.selection.active
    out = {PARAMETER_NAMES[key]: (key,) for key in search.regression.keys_of("value")}
    at_work = {search.terms[k].effect for k in active}
    for key, term in search.terms.items():
        if term.kind == "effect" and not term.run and term.effect not in (at_work | UNKNOWNS.keys()):
            out[term.effect] = (*out.get(term.effect, ()), key)
    return out


def _check_wishes(known: FittedSet, wishes: dict[str, float]) -> None:
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


def widths(known: FittedSet, before: Information, after: Information, wishes: dict[str, float]) -> list[_Width]:
    """Half widths and limits that are wished for, and half widths of the parameters of the effects in the model.

    A doubt that the engine found beyond the usual one (blocks that differ more than their noise) is taken to stay. Of
    the loops that the flight may be flown with the worse counts.
    """
    model, regression, names = known.model, known.regression, _able(known)
    out = []
    for name, wished in wishes.items():
        if name in PARAMETER_NAMES.values():
            (column,) = regression.columns(names[name])
            sizes = [_half(known, before, i, int(column), VALUE_FLOOR) for i in (before, after)]
            out.append(_Width(name, "relative", *sizes, wished))
        else:
            sizes = [max(_limit(known, i, after, key) for key in names[name]) for i in (before, after)]
            out.append(_Width(name, SHARE, *sizes, wished))
    for key in model.selection.active:
        term = model.search.terms[key]
        if not term.form.linear or term.run or term.effect in UNKNOWNS:
            continue
        for index, column in zip(term.form.linear, regression.columns([key]), strict=True):
            parameter = term.form.parameters[index]
            sizes = [_half(known, before, i, int(column)) for i in (before, after)]
            out.append(_Width(f"{term.effect} {parameter.symbol}", parameter.unit, *sizes))
    return out


def _half(known: FittedSet, before: Information, information: Information, column: int, floor: float = 0.0) -> float:
    """Half the 95 % interval of a column of the model."""
    fit, at = known.model.selection.fit, np.array([column])
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
    model, regression = known.model, known.regression
    every = np.union1d(regression.columns([*model.search.always, *model.selection.active]), columns)
    inverse = ridge_inverse(gram[np.ix_(every, every)] + np.diag(regression.precision[every]))
    where = np.searchsorted(every, columns)
    return inverse[np.ix_(where, where)]


@dataclass(frozen=True)
class Tried:
    """A candidate and what it does: the information it brings, or why it cannot be flown."""

    piece: ManoeuvrePiece
    information: Information | None
    flown_s: float
    reason: str = ""
    progress: float = 0.0
    """Share of the way to the goal that it brings alone."""


@dataclass(frozen=True)
class Forecast:
    """A flight, or a session of a stand or bench, and what is expected of it next to the set at hand."""

    name: str
    """`chosen`, `second` (the best without the chosen one's first manoeuvre), or `standard`."""
    pieces: tuple[ManoeuvrePiece, ...]
    """Of a session its steps."""
    reference: Reference | None
    """From the middle of the volume; none of a session."""
    flight: SimulatedFlight | None
    """As the vehicle would fly it."""
    questions: Questions
    """Ids of each open question, and how far apart their models will be."""
    widths: tuple[_Width, ...]

    @property
    def duration_s(self) -> float:
        """In the air, without take-off and landing; of all steps of a session, without the time that mounting takes."""
        return sum(p.duration_s for p in self.pieces) if self.reference is None else self.reference.duration_s

    @property
    def sigma(self) -> float | None:
        """Smallest separation expected over all questions; None where nothing is compared."""
        return _smallest_separation(self.questions)

    def reached(self, target_sigma: float) -> float:
        """Share of the way to all goals."""
        return _share_reached([s.sigma for _, found in self.questions for s in found], self.widths, target_sigma)


@dataclass(frozen=True)
class Plan(Forecast):
    """What to fly or record next, and what else was considered."""

    set: str
    limits: Limits
    others: tuple[Forecast, ...] = ()
    """What else was considered as a whole, the better one first."""
    by_hand: tuple[Handled, ...] = ()
    """Steps by hand whose separation is predicted, the better one first."""
    tried: tuple[Tried, ...] = ()
    unanswerable: tuple[tuple[tuple[str, ...], str], ...] = ()
    not_testable: tuple[tuple[str, str], ...] = ()
    kind: str = "flight"
    """Of the set: of a `stand` or `bench` a session is planned."""
    table: pd.DataFrame | None = None
    """What a session loads, throttles and tilts."""

    @property
    def settles(self) -> bool:
        """Whether every question is expected to be settled."""
        return self.sigma is not None and self.sigma >= self.limits.target_sigma


def yaw_acceleration(vehicle: Vehicle) -> float:
    """Yaw acceleration, rad/s2, that a share of the hovering rotors' torque makes."""
    # Share of the hovering rotors' torque that a planned turn may ask for: the rest is kept for roll and pitch.
    yaw_share = 0.2
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    torque = weight * vehicle.torque_coefficients_n_m_s2().sum() / vehicle.thrust_coefficients_n_s2().sum()
    return yaw_share * torque / vehicle.inertia_kg_m2.zz


def broken(flight: SimulatedFlight, limits: Limits, vehicle: Vehicle) -> str:
    """Which limit a flight does not keep, in words; empty where it keeps all."""
    north, east, height = flight.motion.position[:, 0], flight.motion.position[:, 1], flight.motion.height
    climb = float(np.abs(flight.world_velocity[:, 2]).max())
    tilt = float(np.degrees(flight.tilt_rad))
    margin = limits.wall_margin_m
    top = vehicle.rotor_speed_limits_rad_s
    for what, value, low, high in (
        ("speed_m_s", flight.speed_m_s, 0.0, limits.speed_m_s),
        ("climb_m_s", climb, 0.0, limits.climb_m_s),
        ("tilt_deg", tilt, 0.0, limits.tilt_deg),
        ("x_m", float(north.min()), limits.x_m[0] + margin, np.inf),
        ("x_m", float(north.max()), -np.inf, limits.x_m[1] - margin),
        ("y_m", float(east.min()), limits.y_m[0] + margin, np.inf),
        ("y_m", float(east.max()), -np.inf, limits.y_m[1] - margin),
        ("height_m", float(height.min()), limits.height_m[0], np.inf),
        ("height_m", float(height.max()), -np.inf, limits.height_m[1] - margin),
        ("rotor speed", float(flight.motion.rotor_speed.max()), 0.0, top[1] if top else np.inf),
    ):
        slack = 0.02 * max(abs(value), 0.1)
        if not low - slack <= value <= high + slack:
            return f"{what} would be {value:.3g}"
    return ""


def _by_size(known: FittedSet, limits: Limits) -> list[dict[str, ManoeuvrePiece]]:
    """Every candidate by its name in each of SIZES."""
    most = yaw_acceleration(known.prepared.vehicle)
    return [{p.name: p for p in candidates(smaller(limits, s), s * most)} for s in SIZES]


def _flown_alone(
    known: FittedSet, world: CompetingModel, limits: Limits, piece: ManoeuvrePiece
) -> tuple[tuple[SimulatedFlight, ...], list[str]]:
    """A piece flown with each of the loops, and which limit each flight does not keep, in words; empty for none."""
    try:
        flights = flown(world, joined([piece], step_of(known), BETWEEN_S), limits)
    except InputError as error:
        return (), [str(error)]
    return flights, [broken(f, limits, known.prepared.vehicle) for f in flights]


def _tried(known: FittedSet, limits: Limits, wishes: Iterable[str] = ()) -> list[Tried]:
    """Every candidate flown in simulation by the model as fitted, as large as the limits allow it to be flown.

    The controller makes some motions larger than they are asked for: where a limit would be broken a smaller size of
    the same manoeuvre is tried.
    """
    world, terms, sizes = world_of(known), asked_terms(known, wishes), _by_size(known, limits)
    out = []
    for name in sizes[0]:
        for piece in (options[name] for options in sizes if name in options):
            flights, reasons = _flown_alone(known, world, limits, piece)
            reason = next(filter(None, reasons), "")
            if not reason:
                break
        information = None if reason else of_flights(known, flights, world, terms)
        out.append(Tried(piece, information, piece.duration_s + BETWEEN_S, reason))
    return out


def _share_reached(sigmas: Iterable[float], wished: Iterable[_Width], target_sigma: float) -> float:
    """Share of the way to the goals: the mean over all models and wishes of what is reached of each."""
    found = [min(s / target_sigma, 1.0) for s in sigmas]
    found += [min(w.wished / w.after, 1.0) for w in wished if w.wished]
    return float(np.mean(found)) if found else 1.0


@step("choosing")
def chosen_pieces(
    known: FittedSet,
    limits: Limits,
    options: list[Tried],
    most: int = _MOST_PIECES,
    wishes: dict[str, float] | None = None,
) -> tuple[list[Tried], list[Tried]]:
    """The manoeuvres to fly, `most` at most, and all options with their progress."""
    base = of_set(known)

    def share_of(information: Information) -> float:
        """Share of the way to the goals with the set (`base`) and more."""
        sigmas = [s.sigma for q in known.questions for s in separations(known, q, base, information)]
        sigmas += [s.sigma for _, own in chain_separations(known, information) for s in own]
        wished = widths(known, base, information, wishes) if wishes else ()
        return _share_reached(sigmas, wished, limits.target_sigma)

    start = share_of(base)
    judged = [
        t if t.information is None else replace(t, progress=share_of(base + t.information) - start) for t in options
    ]
    usable = [t for t in judged if t.information is not None]
    taken: list[Tried] = []
    now, share = base, start
    while len(taken) < most and share < 1.0 - 1e-9:
        left = limits.duration_s - BETWEEN_S - sum(t.flown_s for t in taken)
        offers = []
        for t in usable:
            if t.flown_s <= left:
                then = share_of(now + t.information)
                offers.append(((then - share) / t.flown_s, then, t))
        if not offers:
            break
        _, then, best = max(offers, key=lambda o: o[0])
        if then - share < _LEAST_PROGRESS and then < 1.0 - 1e-9:
            break
        taken.append(best)
        now, share = now + best.information, then
    for t in sorted(list(taken), key=lambda t: -t.flown_s):
        rest = [o for o in taken if o is not t]
        total = sum((o.information for o in rest), base)
        if rest and share_of(total) >= share - _LEAST_PROGRESS / 2:
            taken = rest
    return taken, judged


def first_and_second(
    known: FittedSet,
    limits: Limits,
    options: list[Tried],
    expected: Callable[[str, list[Tried]], Forecast],
    most: int = _MOST_PIECES,
    wishes: dict[str, float] | None = None,
) -> tuple[list[Forecast], list[Tried]]:
    """What is `expected` of the best choice and of the best one without its first piece, and all options with their
    progress."""
    taken, judged = chosen_pieces(known, limits, options, most, wishes)
    found = [expected("chosen", taken)]
    rest = [t for t in options if taken and t.piece is not taken[0].piece]
    if rest and (second := chosen_pieces(known, limits, rest, most, wishes)[0]):
        found.append(expected("second", second))
    return found, judged


def better_first(found: list[Forecast], target_sigma: float) -> list[Forecast]:
    """What reaches more of the goals first, of those alike the shorter."""
    return sorted(found, key=lambda f: (-round(f.reached(target_sigma), 2), f.duration_s))


def _expecting_quick(known: FittedSet, limits: Limits) -> FittedSet:
    """The set as the engine would whiten it next to a quick flight: the first of QUICK that the limits allow."""
    world = world_of(known)
    for options in _by_size(known, limits):
        for piece in (options[n] for n in _QUICK if n in options):
            flights, reasons = _flown_alone(known, world, limits, piece)
            if not reasons[0]:
                return expecting(known, [(flights[0], world)])
    return known


def _standard_piece(known: FittedSet, limits: Limits, options: list[Tried], duration_s: float) -> ManoeuvrePiece | None:
    """The standard flight of that length as large as the limits allow; None where they allow none."""
    world, able = world_of(known), {t.piece.name: t.piece for t in options if t.information is not None}
    for parts in (able, *_by_size(known, limits)):
        if set(STANDARD) <= set(parts):
            piece = standard(parts, duration_s)
            if not any(_flown_alone(known, world, limits, piece)[1]):
                return piece
    return None


@step("predicting a flight")
def _forecast(
    known: FittedSet, limits: Limits, name: str, pieces: tuple[ManoeuvrePiece, ...], wishes: dict[str, float]
) -> Forecast:
    """What is expected of a flight of these pieces; without any, what the set holds. `known` is the set alone.

    Every competing model flies it, as it would be flown if that model were the true one.
    """
    alone, base = known, of_set(known)
    if not pieces:
        questions = [(q.ids, tuple(separations(known, q, base, base))) for q in known.questions]
        questions += chain_separations(known, base)
        return Forecast(name, (), NOTHING, None, tuple(questions), tuple(widths(known, base, base, wishes)))
    reference, world = joined(pieces, step_of(known), BETWEEN_S), world_of(known)
    flights = flown(world, reference, limits)
    known = expecting(known, [(flights[0], world)])
    terms, before = asked_terms(known, wishes), of_set(known)
    after = before + of_flights(known, flights, world, terms)

    def after_of(question: Question, hypothesis: Hypothesis) -> Information:
        if not hypothesis.keys:
            return after
        try:
            by = world_of(known, question, hypothesis)
            return before + of_flights(known, flown(by, reference, limits), by, terms)
        except InputError:
            return after

    questions = (*_by_each_model(known, known.questions, base, after_of), *chain_separations(known, after))
    return Forecast(name, pieces, reference, flights[0], questions, tuple(widths(alone, base, after, wishes)))


def _expected(known: FittedSet, limits: Limits, wishes: dict[str, float], name: str, taken: list[Tried]) -> Forecast:
    """What is expected of manoeuvres taken; flown again and again where they do not suffice and time is left.

    They are flown for LEAST_S at least: an effect that one pass shows is none that the engine finds wherever it looks.
    """
    pieces = tuple(t.piece for t in taken)
    most = int((limits.duration_s - BETWEEN_S) / max(sum(t.flown_s for t in taken), BETWEEN_S)) if taken else 1
    least = int(np.ceil((_LEAST_S - BETWEEN_S) / sum(t.flown_s for t in taken))) if taken else 1
    times = max(1, min(least, most))
    made = _forecast(known, limits, name, pieces * times, wishes)
    if most > times and made.reached(limits.target_sigma) < 1.0:
        return _forecast(known, limits, name, pieces * most, wishes)
    return made


def plan(known: FittedSet, limits: Limits, wishes: dict[str, float] | None = None) -> Plan:
    """The flight to fly next; without anything to settle, or any manoeuvre that helps, one without pieces."""
    wishes = wishes or {}
    _check_wishes(known, wishes)
    reasons = tuple(sorted(known.prepared.not_testable.items()))
    about = {"set": known.recordings.name, "limits": limits, "unanswerable": known.unanswerable}
    if not known.questions and not known.chains and not wishes:
        return Plan(**vars(_forecast(known, limits, "chosen", (), {})), **about, not_testable=reasons)
    quick = _expecting_quick(known, limits)
    options = _tried(quick, limits, wishes)
    expected = partial(_expected, known, limits, wishes)
    found, judged = first_and_second(quick, limits, options, expected, wishes=wishes)
    longest = found[0].duration_s or limits.duration_s
    if (piece := _standard_piece(known, limits, options, longest - 2 * BETWEEN_S)) is not None:
        found.append(_forecast(known, limits, "standard", (piece,), wishes))
    best, *others = better_first(found, limits.target_sigma)
    hover = next((t.piece for t in options if t.piece.name == "hover" and t.information is not None), None)
    hands = () if hover is None else _handled(known, limits, hover, _LEAST_S, BETWEEN_S)
    about |= {"others": tuple(others), "by_hand": hands, "tried": tuple(judged), "not_testable": reasons}
    return Plan(**vars(best), **about)
