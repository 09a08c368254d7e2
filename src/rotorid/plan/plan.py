"""The flight that settles what a set left open: manoeuvres chosen one after the other by what they separate a second.

Every candidate is flown in simulation; one that leaves the limits is out. Then the manoeuvre that brings the open
questions furthest towards the wanted separation for its time is taken, and again, until all are settled or no time is
left. What the others make needless is dropped. The flight as a whole is then flown once more by each competing model,
and these predictions are the ones stated.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rotorid.errors import InputError
from rotorid.plan.candidates import Piece, Reference, candidates, joined, smaller
from rotorid.plan.intervals import Width, widths
from rotorid.plan.limits import Limits
from rotorid.plan.questions import Known
from rotorid.plan.separation import (
    Information,
    Separation,
    asked_terms,
    chain_separations,
    expecting,
    flown,
    left_overs,
    of_flight,
    of_set,
    separations,
    smallest_separation,
    step_of,
    world_of,
)
from rotorid.plan.simulate import Flown
from rotorid.recordings import Vehicle

YAW_SHARE = 0.2
"""Share of the hovering rotors' torque that a planned turn may ask for: the rest is kept for roll and pitch."""
SIZES = (1.0, 0.75, 0.5)
"""Sizes of a manoeuvre that are tried, the largest that keeps the limits is taken."""
QUICK = ("shake all to 2 Hz", "shake all to 4 Hz")
BETWEEN_S = 1.0
"""At rest between manoeuvres."""
MOST_PIECES = 12
LEAST_PROGRESS = 0.01
"""Share of the way to the goal that a further manoeuvre must bring."""


@dataclass(frozen=True)
class Tried:
    """A candidate and what it does: the information it brings, or why it cannot be flown."""

    piece: Piece
    information: Information | None
    flown_s: float
    reason: str = ""
    progress: float = 0.0
    """Share of the way to the goal that it brings alone."""


@dataclass(frozen=True)
class Plan:
    """A flight to fly next, and what is expected of it."""

    set: str
    limits: Limits
    pieces: tuple[Piece, ...]
    reference: Reference
    """From the middle of the volume."""
    flight: Flown | None
    """As the vehicle would fly it."""
    questions: tuple[tuple[tuple[str, ...], tuple[Separation, ...]], ...]
    """Ids of each open question, and how far apart their models will be."""
    widths: tuple[Width, ...]
    tried: tuple[Tried, ...]
    unanswerable: tuple[tuple[tuple[str, ...], str], ...] = ()
    not_testable: tuple[tuple[str, str], ...] = ()

    @property
    def duration_s(self) -> float:
        """In the air, without take-off and landing."""
        return self.reference.duration_s if self.pieces else 0.0

    @property
    def sigma(self) -> float | None:
        """Smallest separation expected over all questions; None where nothing is compared."""
        return smallest_separation(self.questions)

    @property
    def settles(self) -> bool:
        """Whether every question is expected to be settled."""
        return self.sigma is not None and self.sigma >= self.limits.target_sigma


def yaw_acceleration(vehicle: Vehicle) -> float:
    """Yaw acceleration, rad/s2, that a share of the hovering rotors' torque makes."""
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    torque = weight * vehicle.torque_coefficients_n_m_s2().sum() / vehicle.thrust_coefficients_n_s2().sum()
    return YAW_SHARE * torque / vehicle.inertia_kg_m2.zz


def broken(flight: Flown, limits: Limits, vehicle: Vehicle) -> str:
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


def tried(known: Known, limits: Limits, progress: Callable[[str], None] = lambda text: None) -> list[Tried]:
    """Every candidate flown in simulation by the model as fitted, as large as the limits allow it to be flown.

    The controller makes some motions larger than they are asked for: where a limit would be broken a smaller size of
    the same manoeuvre is tried.
    """
    world, terms, step = world_of(known, None, None), asked_terms(known), step_of(known)
    vehicle = known.prepared.vehicle
    most = yaw_acceleration(vehicle)
    sizes = [{p.name: p for p in candidates(smaller(limits, s), s * most)} for s in SIZES]
    out = []
    for name in sizes[0]:
        for options in sizes:
            if name not in options:
                continue
            piece, reason, flight = options[name], "", None
            try:
                flight = flown(known, world, joined([piece], step, BETWEEN_S), limits)
                reason = broken(flight, limits, vehicle)
            except InputError as error:
                reason = str(error)
            if not reason:
                break
        seconds = piece.duration_s + BETWEEN_S
        information = None if reason else of_flight(known, flight, world, terms)
        out.append(Tried(piece, information, seconds, reason))
        progress(f"flown in simulation: {name}")
    return out


def reached(known: Known, information: Information, target: float) -> float:
    """Share of the way to the goal: the mean over all models and rivals of their separation over that wanted."""
    found = [min(s / target, 1.0) for q in known.questions for s in left_overs(known, q, information)]
    for _, own in chain_separations(known, information):
        found += [min(s.sigma / target, 1.0) for s in own]
    return float(np.mean(found)) if found else 1.0


def chosen_pieces(
    known: Known, limits: Limits, options: list[Tried], most: int = MOST_PIECES
) -> tuple[list[Tried], list[Tried]]:
    """The manoeuvres to fly, `most` at most, and all options with their progress."""
    base = of_set(known)
    start = reached(known, base, limits.target_sigma)
    judged = [
        t
        if t.information is None
        else Tried(
            t.piece,
            t.information,
            t.flown_s,
            t.reason,
            reached(known, base + t.information, limits.target_sigma) - start,
        )
        for t in options
    ]
    usable = [t for t in judged if t.information is not None]
    taken: list[Tried] = []
    now, share = base, start
    while len(taken) < most and share < 1.0 - 1e-9:
        left = limits.duration_s - BETWEEN_S - sum(t.flown_s for t in taken)
        offers = []
        for t in usable:
            if t.flown_s <= left:
                then = reached(known, now + t.information, limits.target_sigma)
                offers.append(((then - share) / t.flown_s, then, t))
        if not offers:
            break
        _, then, best = max(offers, key=lambda o: o[0])
        if then - share < LEAST_PROGRESS and then < 1.0 - 1e-9:
            break
        taken.append(best)
        now, share = now + best.information, then
    for t in sorted(list(taken), key=lambda t: -t.flown_s):
        rest = [o for o in taken if o is not t]
        total = base
        for o in rest:
            total = total + o.information
        if rest and reached(known, total, limits.target_sigma) >= share - LEAST_PROGRESS / 2:
            taken = rest
    return taken, judged


def expecting_quick(known: Known, limits: Limits) -> Known:
    """The set as the engine would whiten it beside a quick flight: the first of QUICK that the limits allow."""
    world, step, vehicle = world_of(known, None, None), step_of(known), known.prepared.vehicle
    for share in SIZES:
        options = {p.name: p for p in candidates(smaller(limits, share), share * yaw_acceleration(vehicle))}
        for piece in (options[n] for n in QUICK if n in options):
            try:
                flight = flown(known, world, joined([piece], step, BETWEEN_S), limits)
            except InputError:
                continue
            if not broken(flight, limits, vehicle):
                return expecting(known, [(flight, world)])
    return known


def plan(
    known: Known,
    limits: Limits,
    wishes: dict[str, float] | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> Plan:
    """The flight to fly next; without anything to settle, or any manoeuvre that helps, one without pieces."""
    reasons = tuple(sorted(known.prepared.not_testable.items()))
    nothing = Reference(np.zeros(1), np.zeros((1, 3)), np.zeros(1))
    if not known.questions and not known.chains and not wishes:
        return Plan(known.recordings.name, limits, (), nothing, None, (), (), (), known.unanswerable, reasons)
    first, known = known, expecting_quick(known, limits)
    options = tried(known, limits, progress)
    progress("choosing")
    taken, judged = chosen_pieces(known, limits, options) if known.questions or known.chains else ([], options)
    base = of_set(known)
    if wishes:
        taken = with_wishes(known, limits, taken, judged, base, wishes)
    pieces = tuple(t.piece for t in taken)
    reference = joined(pieces, step_of(known), BETWEEN_S) if pieces else nothing
    flight, questions, after = None, [], base
    if pieces:
        world = world_of(known, None, None)
        flight = flown(known, world, reference, limits)
        known = expecting(first, [(flight, world)])
        base = of_set(known)
        after = base + of_flight(known, flight, world, asked_terms(known))
    for question in known.questions:
        progress(f"predicting {' or '.join(question.ids)}")
        found = []
        for hypothesis in question.hypotheses:
            own = after
            if pieces and hypothesis.keys:
                world = world_of(known, question, hypothesis)
                try:
                    flight_h = flown(known, world, reference, limits)
                    own = base + of_flight(known, flight_h, world, asked_terms(known))
                except InputError:
                    own = after
            found += [s for s in separations(known, question, of_set(first), own) if s.true == hypothesis.id]
        questions.append((question.ids, tuple(found)))
    questions += chain_separations(known, after)
    return Plan(
        known.recordings.name,
        limits,
        pieces,
        reference,
        flight,
        tuple(questions),
        tuple(widths(known, base, after, wishes or {})),
        tuple(judged),
        known.unanswerable,
        reasons,
    )


def with_wishes(known, limits, taken, options, base, wishes: dict[str, float]) -> list[Tried]:
    """Manoeuvres added until the wished intervals are reached, or no time or use is left."""
    taken = list(taken)

    def missing(information: Information) -> float:
        found = widths(known, base, information, wishes)
        return sum(max(np.log(w.after / w.wished), 0.0) for w in found if w.wished)

    def total(of: list[Tried]) -> Information:
        out = base
        for t in of:
            out = out + t.information
        return out

    usable = [t for t in options if t.information is not None]
    while len(taken) < MOST_PIECES:
        now = missing(total(taken))
        left = limits.duration_s - BETWEEN_S - sum(t.flown_s for t in taken)
        offers = [((now - missing(total([*taken, t]))) / t.flown_s, t) for t in usable if t.flown_s <= left]
        if now <= 0 or not offers or max(o[0] for o in offers) <= 1e-4:
            break
        taken.append(max(offers, key=lambda o: o[0])[1])
    return taken
