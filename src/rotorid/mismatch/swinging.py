"""How a slung payload hung in each run, read from the run itself.

A load that swings far soon swings otherwise than a pendulum that was started once: after some seconds nothing is left
of its phase. What is left of the sideways force shows where it hung, a few seconds at a time. As the wind of a gust
this belongs to a run and not to the vehicle; the mass, the cable and the damping are the same in all runs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import least_squares

from rotorid.effects.payload import hanging_acceleration
from rotorid.effects.pendulum import cable_pull, swing_states
from rotorid.mismatch.motion import Segment
from rotorid.mismatch.rows import Rows, Term
from rotorid.mismatch.select import COST_PER_EFFECT, COST_PER_PARAMETER
from rotorid.mismatch.wrench import WrenchModel

PIECE_S, PERIODS = 5.0, 2.0
"""A state is read for so long, and for so many swings at least."""
UNKNOWNS_OF_A_STATE = 4
RATE_HZ = 10.0
"""Rate at which the sideways force is looked at: a swing has less than 2 Hz."""
LEAST_SHARE = 0.3
"""Share of the sideways force's squares that a swing must explain: four numbers of five seconds make 0.1 of noise."""
MOST_STEPS = 40
LOUDEST = 3
"""Pieces that are looked at first: most flights have nothing that swings."""

Sideways = tuple[np.ndarray, np.ndarray]
"""Instants (m,), s, and what the other effects leave of the force to the north and east there, (m, 2), N."""


def swinging_term(model: WrenchModel) -> Term | None:
    """The term of what swings that is in a model, else its likeliest; None where there is none."""
    swings = [t for t in model.search.terms.values() if t.form and t.form.swings]
    active = [t for t in swings if t.key in model.selection.active]
    return next(iter([*active, *swings]), None)


def hung(model: WrenchModel, segments: Sequence[Segment], rows: Sequence[Rows], term: Term) -> list[Segment] | None:
    """Stretches that say how a payload with a term's length and damping hung; None where hardly any force does."""
    vehicle = model.prepared.vehicle
    length_m, ratio = (term.values[i] for i in term.form.nonlinear)
    sideways = sideways_force(model, segments, rows)
    if not sideways:
        return None
    hanging = [hanging_acceleration(s.motion) for s in segments]
    asked = [(e, s.motion.time_s, *f) for e, s, f in zip(hanging, segments, sideways, strict=True)]
    cable = length_m, ratio, vehicle.gravity_m_s2
    if not shows(loudest(asked, piece_of(length_m, vehicle.gravity_m_s2)), *cable):
        return None
    found = [states(*a, *cable, None) for a in asked]
    masses = np.concatenate([m for _, m, _ in found])
    mass_kg = float(np.median(masses)) if len(masses) else 0.0
    if mass_kg <= 0.0:
        return None
    found = [states(*a, *cable, mass_kg) for a in asked]
    if sum(rest for _, _, rest in found) > (1.0 - LEAST_SHARE) * sum(float((f**2).sum()) for _, f in sideways):
        return None
    return [replace(s, motion=replace(s.motion, hung=h)) for s, (h, _, _) in zip(segments, found, strict=True)]


def piece_of(length_m: float, gravity_m_s2: float) -> float:
    """How long a state of a cable is read, s."""
    return max(PIECE_S, PERIODS * 2 * np.pi * float(np.sqrt(length_m / gravity_m_s2)))


def loudest(asked, piece_s: float):
    """Of stretches (hanging, time_s, at_s, force) the LOUDEST pieces with the largest force."""
    pieces = []
    for hanging, time_s, at_s, force in asked:
        for start in np.arange(time_s[0], time_s[-1] - piece_s, piece_s):
            inside, seen = ((t >= start) & (t < start + piece_s) for t in (time_s, at_s))
            pieces.append((hanging[inside], time_s[inside], at_s[seen], force[seen]))
    return sorted(pieces, key=lambda p: -float((p[3] ** 2).sum()))[:LOUDEST]


def shows(pieces, length_m: float, ratio: float, gravity_m_s2: float) -> bool:
    """Whether a swing explains enough of the force of pieces, each by itself."""
    left = sum(states(*p, length_m, ratio, gravity_m_s2, None)[2] for p in pieces)
    return left <= (1.0 - LEAST_SHARE) * sum(float((p[3] ** 2).sum()) for p in pieces) and bool(pieces)


def like(segments: Sequence[Segment], noisy: Sequence[Segment]) -> list[Segment]:
    """Noisy copies of stretches with a payload that hung as it did in these."""
    return [replace(n, motion=replace(n.motion, hung=s.motion.hung)) for s, n in zip(segments, noisy, strict=False)]


def price(segments: Sequence[Segment]) -> float:
    """What the states of a payload cost beside the model."""
    return COST_PER_EFFECT + COST_PER_PARAMETER * UNKNOWNS_OF_A_STATE * sum(len(s.motion.hung) for s in segments)


def sideways_force(model: WrenchModel, segments: Sequence[Segment], rows: Sequence[Rows]) -> list[Sideways]:
    """What effects that do not swing leave of the sideways force of every stretch; empty where it is not known."""
    terms, regression, fit = model.search.terms, model.regression, model.selection.fit
    if any(s.motion.rotation is None for s in segments) or not all(np.isfinite(r.y[:, :3]).all() for r in rows):
        return []
    others = [k for k in model.selection.active if not terms[k].form.swings and not terms[k].run]
    cols = regression.columns(others)
    beta, out = fit.beta[fit.places(cols)], []
    for s, r in zip(segments, rows, strict=True):
        index = np.searchsorted(s.motion.time_s, r.time_s).clip(0, s.motion.size - 1)
        left = r.y[:, :3] - r.x[:, :3][:, :, cols] @ beta
        world = np.einsum("nij,nj->ni", s.motion.rotation[index], left)[:, :2]
        per = max(1, round(model.prepared.thinner.rate_hz / RATE_HZ))
        count = len(world) // per
        out.append(
            (
                r.time_s[: count * per].reshape(count, per).mean(axis=1),
                world[: count * per].reshape(count, per, 2).mean(axis=1),
            )
        )
    return out


def states(hanging, time_s, at_s, force, length_m: float, ratio: float, gravity_m_s2: float, mass_kg: float | None):
    """States of a payload in a stretch, as `Motion.hung`; the mass that each piece suggests, kg; the squares left, N2.

    Each piece starts from where the one before ends and is moved to what explains most of its force; the mass is free
    in each where it is None.
    """
    if len(at_s) == 0:
        return np.array([[time_s[0], *hanging[0], 0.0, 0.0, 0.0]]), np.zeros(0), 0.0
    omega = np.sqrt(gravity_m_s2 / length_m)
    count = max(1, int((time_s[-1] - time_s[0]) / piece_of(length_m, gravity_m_s2)))
    edges = np.linspace(time_s[0], time_s[-1] + 1e-9, count + 1)
    state, out, masses, rest = np.array([*hanging[0] / np.linalg.norm(hanging[0]), 0.0, 0.0, 0.0]), [], [], 0.0
    for start, stop in zip(edges, edges[1:], strict=False):
        inside, seen = (time_s >= start) & (time_s < stop), (at_s >= start) & (at_s < stop)
        e, t, wanted = hanging[inside], time_s[inside], force[seen]
        if seen.sum() <= 2 * UNKNOWNS_OF_A_STATE or inside.sum() < 3:
            out.append([start, *state])
            continue
        size = max(float(np.sqrt(np.mean(wanted**2))), 1e-9)

        def pulled(move, e=e, t=t, state=state, seen=seen):
            own = np.array([[t[0], *moved(state, move, omega)]])
            pull = cable_pull(e, t, length_m, ratio, gravity_m_s2, own)[:, :2]
            return np.stack([np.interp(at_s[seen], t, column) for column in pull.T], axis=1)

        def gain(pull, wanted=wanted):
            free = float((pull * wanted).sum() / max(float((pull**2).sum()), 1e-12))
            return max(free, 0.0) if mass_kg is None else mass_kg

        def left(move, wanted=wanted, size=size):
            pull = pulled(move)
            return np.append(((wanted - gain(pull) * pull) / size).ravel(), move)

        found = least_squares(left, np.zeros(UNKNOWNS_OF_A_STATE), method="lm", max_nfev=MOST_STEPS)
        pull = pulled(found.x)
        masses.append(gain(pull))
        rest += float(((wanted - masses[-1] * pull) ** 2).sum())
        own = moved(state, found.x, omega)
        out.append([start, *own])
        state = end_of(e, t, own, length_m, ratio, gravity_m_s2)
    return np.array(out), np.array(masses), rest


def moved(state: np.ndarray, move: np.ndarray, omega: float) -> np.ndarray:
    """A state (direction, rate) turned by two angles, and two rates in units of ω added to its own; `move` is (4,)."""
    along = state[:3] / np.linalg.norm(state[:3])
    first = np.cross(along, [1.0, 0.0, 0.0] if abs(along[0]) < 0.7 else [0.0, 1.0, 0.0])
    first /= np.linalg.norm(first)
    second = np.cross(along, first)
    direction = along + move[0] * first + move[1] * second
    direction /= np.linalg.norm(direction)
    rate = state[3:] + omega * (move[2] * first + move[3] * second)
    return np.concatenate([direction, rate - (rate @ direction) * direction])


def end_of(hanging, time_s, state, length_m: float, ratio: float, gravity_m_s2: float) -> np.ndarray:
    """Direction and rate in which a piece ends, (6,)."""
    own = np.array([[time_s[0], *state]])
    return swing_states(hanging, time_s, length_m, ratio, gravity_m_s2, own)[-1, [0, 1, 2, 4, 5, 6]]
