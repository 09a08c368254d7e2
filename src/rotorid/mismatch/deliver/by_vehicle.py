"""Numbers of effects for the vehicle that is delivered.

Rows are in the believed vehicle's units: its mass times the specific force, its inertia times the angular acceleration
(`rotorid.mismatch.evidence.rows.residual`). On a vehicle that is heavier by a tenth all that acts is larger by a tenth
than its coefficient there, and a share of a thrust that is larger by a tenth is smaller by one. So each coefficient is
stated as the number by which its form, on the delivered vehicle, accelerates as the fitted contribution did.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from rotorid.effects.contract import Motion
from rotorid.mismatch.decide.problem import Values
from rotorid.mismatch.decide.selected import Factors, as_fitted
from rotorid.mismatch.decide.values import changed_vehicle
from rotorid.mismatch.evidence.motion import Segment
from rotorid.mismatch.evidence.rows import Term
from rotorid.recordings import Vehicle


def acting_over_rows(believed: Vehicle, delivered: Vehicle) -> np.ndarray:
    """Force and moment on the delivered vehicle over those that its rows hold, (6,)."""
    inertia = [np.diag(v.inertia_kg_m2.matrix()) for v in (delivered, believed)]
    return np.append(np.full(3, delivered.mass_kg / believed.mass_kg), inertia[0] / inertia[1])


def on_vehicle(
    term: Term, segments: Sequence[Segment], believed: Vehicle, changed: Values, noise: np.ndarray
) -> Factors:
    """By how much a term's linear coefficients are larger on the vehicle with values `changed`; 1, without a doubt, for
    what acts on sensors alone. `noise` (6 or more) weighs the channels."""
    size = len(term.form.linear)
    segments = [s for s in segments if term.run in ("", s.run)]
    if not changed or not size:
        return as_fitted(term)
    weight = 1.0 / np.square(noise[:6])
    weight = np.where(np.isfinite(weight), weight, 0.0)
    rows = [_columns(term, s.motion, believed) for s in segments]

    def factors(relative: Mapping[str, float]) -> np.ndarray:
        vehicle = changed_vehicle(believed, relative)
        acting, faster = acting_over_rows(believed, vehicle), 1.0 + relative.get("speed", 0.0)
        found, square = np.zeros(size), np.zeros(size)
        for s, own in zip(segments, rows, strict=True):
            turning = s.motion.rotor_speed
            motion = s.motion if turning is None or faster == 1.0 else replace(s.motion, rotor_speed=faster * turning)
            columns = _columns(term, motion, vehicle)
            found += np.einsum("nck,nck,c->k", own, columns, weight * acting)
            square += np.einsum("nck,nck,c->k", columns, columns, weight)
        return np.divide(found, square, out=np.ones(size), where=square > 0)

    middle = {key: change for key, (change, _) in changed.items()}
    at = factors(middle)
    apart = [factors({**middle, key: change + sd}) - at for key, (change, sd) in changed.items() if sd > 0]
    return at, np.sqrt(np.sum(np.square(apart), axis=0)) if apart else np.zeros(size)


def _columns(term: Term, motion: Motion, vehicle: Vehicle) -> np.ndarray:
    """Force and moment of each linear parameter at one along a motion, (n, 6, k)."""
    out = np.zeros((motion.size, 6, len(term.form.linear)))
    for k, index in enumerate(term.form.linear):
        values = np.array(term.values, float)
        values[list(term.form.linear)] = 0.0
        values[index] = 1.0
        added = term.form.contribution(motion, vehicle, values)
        for first, part in ((0, added.force), (3, added.moment)):
            if part is not None:
                out[:, first : first + 3, k] = part
    return out
