"""How a slung payload hung in each run, read from the run itself.

A load that swings far soon swings otherwise than a pendulum that was started once: after some seconds nothing is left
of its phase. What is left of the sideways force shows where it hung, a few seconds at a time. As the wind of a gust
this belongs to a run and not to the vehicle; the mass, the cable and the damping are the same in all runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares, minimize_scalar

from rotorid.effects.payload import hanging_acceleration
from rotorid.effects.pendulum import cable_pull, moved, swing_states
from rotorid.mismatch.decision.select import COST_PER_EFFECT, COST_PER_PARAMETER
from rotorid.mismatch.model.wrench import WrenchModel
from rotorid.mismatch.plant.motion import Segment
from rotorid.mismatch.plant.rows import UNKNOWNS_OF_A_STATE, Rows, Term

PIECE_S, PERIODS = 5.0, 2.0
"""A state is read for so long, and for so many swings at least."""
RATE_HZ = 10.0
"""Rate at which the sideways force is looked at: a swing has less than 2 Hz."""
LEAST_SHARE = 0.3
"""Share of the sideways force's squares that a swing must explain: four numbers of five seconds make 0.1 of noise."""
MOST_STEPS = 40
LENGTHS_APART, LENGTH_TO = 0.08, 0.002
"""Logarithm of how far from its start the length is looked for with the states free, and how finely."""
LARGEST = 3
"""Pieces that are looked at first: most flights have nothing that swings."""


@dataclass(frozen=True)
class Cable:
    """What a payload hangs by."""

    length_m: float
    damping_ratio: float
    gravity_m_s2: float

    @property
    def rate(self) -> float:
        """Of small swings, rad/s."""
        return float(np.sqrt(self.gravity_m_s2 / self.length_m))

    @property
    def piece_s(self) -> float:
        """How long a state of it is read, s."""
        return max(PIECE_S, PERIODS * 2 * np.pi / self.rate)


@dataclass(frozen=True)
class HangingStretch:
    """What a payload hung by, and the sideways force that other effects leave."""

    hanging: np.ndarray
    """(n, 3), m/s2, world axes."""
    time_s: np.ndarray
    at_s: np.ndarray
    """Instants of the force, (m,), s."""
    force: np.ndarray
    """To the north and east, (m, 2), N."""

    @property
    def squares(self) -> float:
        return float((self.force**2).sum())

    def part(self, start_s: float, stop_s: float) -> HangingStretch:
        """What lies from `start_s` to before `stop_s`."""
        inside, seen = ((t >= start_s) & (t < stop_s) for t in (self.time_s, self.at_s))
        return HangingStretch(self.hanging[inside], self.time_s[inside], self.at_s[seen], self.force[seen])

    def pull(self, cable: Cable, state: np.ndarray) -> np.ndarray:
        """Sideways pull of a kilogram that sets out from a state (6,) on this cable, (m, 2), N."""
        hung = np.array([[self.time_s[0], *state]])
        own = cable_pull(self.hanging, self.time_s, cable.length_m, cable.damping_ratio, cable.gravity_m_s2, hung)
        return np.stack([np.interp(self.at_s, self.time_s, column) for column in own[:, :2].T], axis=1)

    def end(self, cable: Cable, state: np.ndarray) -> np.ndarray:
        """The state (6,) in which what sets out from `state` ends."""
        hung = np.array([[self.time_s[0], *state]])
        found = swing_states(self.hanging, self.time_s, cable.length_m, cable.damping_ratio, cable.gravity_m_s2, hung)
        return found[-1, [0, 1, 2, 4, 5, 6]]


@dataclass(frozen=True)
class Swing:
    """How a payload hung in a stretch."""

    states: np.ndarray
    """As `Motion.hung`."""
    masses_kg: np.ndarray
    """What each piece suggests."""
    left_n2: float
    """Squares of the force that are left."""


def swinging_term(model: WrenchModel) -> Term | None:
    """The term of what swings that is in a model, else its likeliest; None where there is none."""
    swings = [t for t in model.search.terms.values() if t.form and t.form.swings]
    active = [t for t in swings if t.key in model.selection.active]
    return next(iter([*active, *swings]), None)


def hung(model: WrenchModel, segments: Sequence[Segment], rows: Sequence[Rows], term: Term) -> list[Segment] | None:
    """Stretches that say how a payload with a term's length and damping hung; None where hardly any force does."""
    cable = cable_of(model, term)
    stretches = stretches_of(model, segments, rows)
    masses = np.concatenate([swing_in(s, cable, None).masses_kg for s in stretches])
    mass_kg = float(np.median(masses)) if len(masses) else 0.0
    if mass_kg <= 0.0:
        return None
    found = [swing_in(s, cable, mass_kg) for s in stretches]
    if sum(f.left_n2 for f in found) > (1.0 - LEAST_SHARE) * sum(s.squares for s in stretches):
        return None
    return [replace(s, motion=replace(s.motion, hung=f.states)) for s, f in zip(segments, found, strict=True)]


def cable_of(model: WrenchModel, term: Term) -> Cable:
    """What a payload hangs by with a term's values."""
    return Cable(*(term.values[i] for i in term.form.nonlinear), model.prepared.vehicle.gravity_m_s2)


def with_likely_length(model: WrenchModel, term: Term) -> Term | None:
    """A term with the length near its own that explains most, the states free; None where nothing seems to swing."""
    cable = cable_of(model, term)
    stretches = stretches_of(model, model.segments, model.rows)
    if not shows(largest_pieces(stretches, cable), cable):
        return None

    def left(change: float) -> float:
        other = replace(cable, length_m=cable.length_m * float(np.exp(change)))
        return sum(swing_in(s, other, None).left_n2 for s in stretches)

    reach = -LENGTHS_APART, LENGTHS_APART
    change = minimize_scalar(left, bounds=reach, method="bounded", options={"xatol": LENGTH_TO}).x
    values = list(term.values)
    values[term.form.nonlinear[0]] *= float(np.exp(change))
    return replace(term, values=tuple(values))


def like(segments: Sequence[Segment], noisy: Sequence[Segment]) -> list[Segment]:
    """Noisy copies of stretches with a payload that hung as it did in these."""
    return [replace(n, motion=replace(n.motion, hung=s.motion.hung)) for s, n in zip(segments, noisy, strict=False)]


def price(segments: Sequence[Segment]) -> float:
    """What the states of a payload cost in addition to the model."""
    return COST_PER_EFFECT + COST_PER_PARAMETER * UNKNOWNS_OF_A_STATE * sum(len(s.motion.hung) for s in segments)


def stretches_of(model: WrenchModel, segments: Sequence[Segment], rows: Sequence[Rows]) -> list[HangingStretch]:
    """Every stretch with what effects that do not swing leave of its sideways force; empty where it is not known."""
    terms, fit = model.search.terms, model.selection.fit
    if any(s.motion.rotation is None for s in segments) or not all(np.isfinite(r.y[:, :3]).all() for r in rows):
        return []
    others = [k for k in model.selection.active if not terms[k].form.swings and not terms[k].run]
    cols = model.regression.columns(others)
    beta, out = fit.beta[fit.places(cols)], []
    per = max(1, round(model.prepared.thinner.rate_hz / RATE_HZ))
    for s, r in zip(segments, rows, strict=True):
        index = np.searchsorted(s.motion.time_s, r.time_s).clip(0, s.motion.size - 1)
        left = r.y[:, :3] - r.x[:, :3][:, :, cols] @ beta
        world = np.einsum("nij,nj->ni", s.motion.rotation[index], left)[:, :2]
        count = len(world) // per
        at_s = r.time_s[: count * per].reshape(count, per).mean(axis=1)
        force = world[: count * per].reshape(count, per, 2).mean(axis=1)
        out.append(HangingStretch(hanging_acceleration(s.motion), s.motion.time_s, at_s, force))
    return out


def largest_pieces(stretches: Sequence[HangingStretch], cable: Cable) -> list[HangingStretch]:
    """The LARGEST pieces of stretches with the largest force."""
    pieces = [
        s.part(start, start + cable.piece_s)
        for s in stretches
        for start in np.arange(s.time_s[0], s.time_s[-1] - cable.piece_s, cable.piece_s)
    ]
    return sorted(pieces, key=lambda p: -p.squares)[:LARGEST]


def shows(pieces: Sequence[HangingStretch], cable: Cable) -> bool:
    """Whether a swing explains enough of the force of pieces, each by itself."""
    left = sum(swing_in(p, cable, None).left_n2 for p in pieces)
    return bool(pieces) and left <= (1.0 - LEAST_SHARE) * sum(p.squares for p in pieces)


def swing_in(stretch: HangingStretch, cable: Cable, mass_kg: float | None) -> Swing:
    """How a payload hung in a stretch; its mass is free in each piece where it is None.

    Each piece starts from where the one before ends and is moved to what explains most of its force.
    """
    start, stop = stretch.time_s[0], stretch.time_s[-1]
    edges = np.linspace(start, stop + 1e-9, max(1, int((stop - start) / cable.piece_s)) + 1)
    state, states, masses, left = at_rest(stretch.hanging[0]), [], [], 0.0
    for first, last in zip(edges[:-1], edges[1:], strict=True):
        piece = stretch.part(first, last)
        if len(piece.at_s) > 2 * UNKNOWNS_OF_A_STATE and len(piece.time_s) > 2:
            state, mass, rest = fitted_piece(piece, cable, state, mass_kg)
            masses.append(mass)
            left += rest
            states.append([first, *state])
            state = piece.end(cable, state)
        else:
            states.append([first, *state])
    return Swing(np.array(states), np.array(masses), left)


def fitted_piece(piece: HangingStretch, cable: Cable, state: np.ndarray, mass_kg: float | None):
    """The state near `state` whose swing explains most of a piece's force; its mass, kg, and the squares left, N2.

    One-sigma of the state is a radian, and a radian in 1/ω: what is not excited stays where it was.
    """
    size = max(float(np.sqrt(np.mean(piece.force**2))), 1e-9)

    def mass_of(pull: np.ndarray) -> float:
        if mass_kg is not None:
            return mass_kg
        return max(float((pull * piece.force).sum()) / max(float((pull**2).sum()), 1e-12), 0.0)

    def left(move: np.ndarray) -> np.ndarray:
        pull = piece.pull(cable, moved(state, move, cable.rate))
        return np.append(((piece.force - mass_of(pull) * pull) / size).ravel(), move)

    found = least_squares(left, np.zeros(UNKNOWNS_OF_A_STATE), method="lm", max_nfev=MOST_STEPS).x
    own = moved(state, found, cable.rate)
    pull = piece.pull(cable, own)
    return own, mass_of(pull), float(((piece.force - mass_of(pull) * pull) ** 2).sum())


def at_rest(hanging: np.ndarray) -> np.ndarray:
    """The state (6,) of what hangs at rest along `hanging` (3,)."""
    return np.array([*hanging / max(np.linalg.norm(hanging), 1e-9), 0.0, 0.0, 0.0])
