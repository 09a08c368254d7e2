"""By how much flights of one vehicle differ in which nothing changed: the yardstick of a change.

- A believed value differs a little from flight to flight (air, battery, temperature), and so does the zero of a sensor
  (`Effect.between_flights`).
- The form of an effect is a few per cent wrong; seen at other speeds that looks like a little of another effect.
- What differs between the good flights themselves (a load that swings, a hand that moved the battery) may differ again
  by as much. It is found by the very decision that finds changes, one good flight against the others.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.plant.regression import NEVER_EXCITED
from rotorid.mismatch.posterior.evidence import Evidence
from rotorid.mismatch.posterior.leftover import FULL_RIDGE, TINY
from rotorid.mismatch.posterior.score import places, scored
from rotorid.mismatch.posterior.search import Found
from rotorid.mismatch.posterior.statements import FORM_SD, statements_of

_SAME_SD, _SAME_BODY_SD = 0.01, 0.003
"""Relative one-sigma between two flights in which nothing changed of a rotor's coefficient (3 K of air change
its density by a hundredth), and of mass, inertia and arm."""
_OF_THE_AIR = ("thrust", "torque")
"""Values that the air's density changes."""
_DERIVED = "rotor_acceleration"
"""What is a derivative of recorded speeds: how much of it is noise depends on the flight, and is not known."""
_FEWEST_FLIGHTS = 3
"""Two good flights give one difference alone, of which no variance is known."""


def usual_spread(
    base: Evidence, new: Evidence, known: np.ndarray, inertia: np.ndarray, form_sd: float = FORM_SD
) -> np.ndarray:
    """One-sigma (K,) of each coefficient between two flights by values, noise and forms alone, in its unit.

    `known` (K,) are the coefficients of the effects that the first set's model holds; `inertia` (C,) is the mass, or
    the inertia, of the second vehicle.yaml over the first one's in each channel: residual noise grows with it.
    `form_sd` is the share of what effects contribute that their forms are wrong by.
    """
    hidden = _hidden_by_noise(new, inertia) - _hidden_by_noise(base, np.ones(len(inertia)))
    out = form_spread(base, known, form_sd)
    forms = Counter((t.effect, p.symbol) for t in base.terms for p in t.linear)
    for term in base.terms:
        at = base.start[term.key] + np.arange(term.size)
        if term.kind == "value":
            out[at] = np.hypot(_SAME_SD if term.key in _OF_THE_AIR else _SAME_BODY_SD, hidden[at])
        elif term.effect in catalogue() and term.linear:
            effect = catalogue()[term.effect]
            usual = np.array([effect.between_flights.get(p.unit, 0.0) for p in term.linear])
            if _DERIVED in effect.excited_by:
                usual = np.hypot(usual, hidden_in(base, known)[at])
            # Several forms have the same parameter, and with it the same column.
            out[at] = np.hypot(out[at], usual / np.sqrt([forms[term.effect, p.symbol] for p in term.linear]))
    return out


def hidden_in(evidence: Evidence, known: np.ndarray) -> np.ndarray:
    """What noise of its own column may hide of each effect's coefficient (K,) at most, in its unit.

    The coefficient is that of the column by itself, given the effects `known` (K,).
    """
    own = np.maximum(np.einsum("cekk->k", evidence.gram), NEVER_EXCITED)
    left = evidence.cross.sum(axis=(0, 1)) - evidence.gram.sum(axis=(0, 1)) @ known
    size = np.abs(known + left / own)
    noise = left_by_all(evidence)[np.argmax(np.einsum("cekk->ck", evidence.gram), axis=0)]
    return np.minimum(size, noise / np.maximum(own * size, TINY))


def form_spread(evidence: Evidence, known: np.ndarray, form_sd: float) -> np.ndarray:
    """One-sigma (K,) of each effect's coefficient, in its unit, that other effects' forms look like.

    Effects of coefficients `known` (K,) are wrong by a share `form_sd` of what they contribute to each channel.
    """
    gram = evidence.gram.sum(axis=1)
    own = np.einsum("ckk->ck", gram)
    explained = np.einsum("k,ckl,l->c", known, gram, known)
    total = np.maximum(own.sum(axis=0), TINY)
    form = form_sd * np.sqrt((own * explained[:, None]).sum(axis=0)) / total
    out = np.zeros(len(known))
    for term in evidence.terms:
        if term.kind == "effect":
            at = evidence.start[term.key] + np.arange(term.size)
            out[at] = form[at]
    return share_of_form(evidence) * out


def share_of_form(evidence: Evidence) -> np.ndarray:
    """What part of an effect's one-sigma each coefficient (K,) has: of its forms one is at work, no matter which.

    Forms of one effect look alike. Were each to differ by the whole, the effect would by the root of their number more.
    """
    forms = Counter(t.effect for t in evidence.terms if t.kind == "effect")
    out = np.ones(evidence.gram.shape[-1])
    for term in evidence.terms:
        if term.kind == "effect":
            out[evidence.start[term.key] + np.arange(term.size)] = forms[term.effect] ** -0.5
    return out


def _hidden_by_noise(evidence: Evidence, inertia: np.ndarray) -> np.ndarray:
    """The share (K,) of each coefficient that noise of its own column may hide at most, 0 to 1.

    At worst all that the model of all columns leaves in the channel is noise of that column: errors in variables reduce
    a coefficient by the share that noise has of the column's squares (Fuller, Measurement Error Models, 1987, 1.1.1).
    """
    own = np.einsum("cekk->ck", evidence.gram)
    left = left_by_all(evidence) / inertia**2
    main = np.argmax(own, axis=0)
    column = np.arange(own.shape[1])
    return np.clip(left[main] / np.maximum(own[main, column], NEVER_EXCITED), 0.0, 1.0)


def feigned(base: Evidence, new: Evidence, inertia: np.ndarray) -> np.ndarray:
    """One-sigma (K,) of what a closed loop feigns of a change of each coefficient, where commands alone tell it.

    Commands answer to what no model explains: with it a delay is found where none is, the same in both sets. What the
    second set has more of is at most all in step with the column (Cauchy and Schwarz): two standard errors. `inertia`
    (C,) as of `usual_spread`.
    """
    own = np.einsum("cekk->ck", new.gram) / new.blocks.sum()
    left = left_by_all(new) / inertia**2 / new.blocks.sum() - left_by_all(base) / base.blocks.sum()
    most = np.sqrt(own * np.maximum(left, 0.0)[:, None]).sum(axis=0)
    return 0.5 * most / np.maximum(own.sum(axis=0), NEVER_EXCITED)


def left_by_all(evidence: Evidence) -> np.ndarray:
    """Whitened squares (C,) that the model of all columns leaves in each channel."""
    gram, cross = evidence.gram.sum(axis=1), evidence.cross.sum(axis=1)
    out = np.empty(len(gram))
    for c, own in enumerate(np.einsum("ckk->ck", gram)):
        unit = np.where(own > NEVER_EXCITED, 1.0 / np.sqrt(np.maximum(own, NEVER_EXCITED)), 0.0)
        scaled = gram[c] * np.outer(unit, unit) + FULL_RIDGE * np.eye(len(unit))
        out[c] = evidence.square[c].sum() - (cross[c] * unit) @ np.linalg.solve(scaled, cross[c] * unit)
    return out


def spread_of_flights(flights: Sequence[Evidence], decide: Callable[[Evidence, Evidence], Found]) -> np.ndarray | float:
    """One-sigma (K,) of each coefficient by which the good flights differ among themselves, in its unit; 0 of too few.

    Of a class each member gets what makes it contribute as much. A variance of n flights is widened by (n + 1)/(n − 1).
    """
    number = len(flights)
    if number < _FEWEST_FLIGHTS:
        return 0.0
    squares = np.zeros(flights[0].gram.shape[-1])
    for k, flight in enumerate(flights):
        others = joined([f for j, f in enumerate(flights) if j != k])
        squares += differences(decide(others, flight), len(squares))
    return np.sqrt(squares / (number - 1) * (number + 1) / (number - 1))


def differences(found: Found, count: int) -> np.ndarray:
    """Squares (count,) of the changes in a model, each member of a class as large as what it would contribute."""
    problem, at, out = found.problem, scored(found.problem, found.model), np.zeros(count)
    for said in statements_of(found):
        own = problem.columns_of[said.key]
        beta = at.mode.beta[places(at.columns, own)]
        out[own] = np.maximum(out[own], (beta * problem.unit[own]) ** 2)
        size = beta @ problem.channel_gram[:, own[:, None], own].sum(axis=0) @ beta
        for key, term in problem.terms.items():
            if term.effect in said.alternatives and key != said.key:
                others = problem.columns_of[key]
                energy = np.maximum(np.einsum("ckk->k", problem.channel_gram[:, others[:, None], others]), TINY)
                out[others] = np.maximum(out[others], size / energy * problem.unit[others] ** 2)
    return out


def joined(flights: Sequence[Evidence]) -> Evidence:
    """The evidence of several flights as one."""
    parts = {
        name: np.concatenate([getattr(f, name) for f in flights], axis=axis)
        for name, axis in (("gram", 1), ("cross", 1), ("square", 1), ("blocks", 0))
    }
    return replace(flights[0], **parts, bias_gram=sum(f.bias_gram for f in flights))


def of_environments(evidence: Evidence, chosen: np.ndarray) -> Evidence:
    """Evidence of some environments, a mask (E,)."""
    return replace(
        evidence,
        gram=evidence.gram[:, chosen],
        cross=evidence.cross[:, chosen],
        square=evidence.square[:, chosen],
        blocks=evidence.blocks[chosen],
        bias_gram=evidence.bias_gram * evidence.blocks[chosen].sum() / max(evidence.blocks.sum(), 1),
    )
