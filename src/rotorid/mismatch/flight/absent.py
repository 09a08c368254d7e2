"""What was tested and not found in a flight, and how large it may be all the same.

A size is a share of the weight: root mean square force over the weight, and moment over the weight at the rotors' mean
distance from the centre of mass.

Effects that look significant while wrong values are held at their belief, and vanish with the right ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rotorid.mismatch.decide.posterior import Found
from rotorid.mismatch.decide.statements import UpperLimit, limits_of
from rotorid.mismatch.decide.support import Chosen, chosen_at
from rotorid.mismatch.evidence.gram import Evidence, evidence_from
from rotorid.mismatch.evidence.regression import Regression
from rotorid.mismatch.evidence.rows import Rows, Term
from rotorid.mismatch.flight.wrench import WrenchModel, whitened
from rotorid.recordings import Vehicle


def absent(model: WrenchModel, found: Found) -> tuple[UpperLimit, ...]:
    """Upper limits of the ids that the fitted runs were tested for and that are not at work, the largest first.

    `found` is the posterior at the chosen model (`chosen_already`).
    """
    effects = [t for t in model.regression.terms if t.kind == "effect"]
    return limits_of(found, squares_of(model, effects))


def chosen_already(model: WrenchModel) -> Chosen:
    """The model of a flight that was chosen, with its posterior and support."""
    return chosen_at(_by_channel(model), model.selection.active)


def evidence_of(model: WrenchModel) -> Evidence:
    """What a decision on a flight needs, and what was chosen."""
    return replace(evidence_from(_by_channel(model)), active=tuple(model.selection.active))


def _by_channel(model: WrenchModel) -> Regression:
    """The regression of a flight with its products channel by channel."""
    filters, noisy = model.regression.filters, model.contributions.noisy
    every = whitened(
        model.prepared, model.rows, model.terms, filters, model.segments, noisy, apart=True, by_channel=True
    )
    return every.without_winds()


def squares_of(model: WrenchModel, terms: Sequence[Term]) -> dict[str, np.ndarray]:
    """To the key of each term what its columns amount to (k, k), as mean squares of shares of the weight."""
    return mean_squares(model.rows, model.regression, terms, scales(model.prepared.vehicle))


def mean_squares(
    rows: Sequence[Rows], regression: Regression, terms: Sequence[Term], scale: np.ndarray
) -> dict[str, np.ndarray]:
    """To the key of each term the mean squares of its columns (k, k), in units of `scale` (6,) of force and moment."""
    out = {t.key: np.zeros((t.size, t.size)) for t in terms}
    count = sum(len(r.y) for r in rows)
    for part in rows:
        for term in terms:
            x = np.nan_to_num(part.x[:, :6, regression.columns([term.key])]) / scale[:, None]
            out[term.key] += np.einsum("nci,ncj->ij", x, x) / count
    return out


def scales(vehicle: Vehicle) -> np.ndarray:
    """The weight, N, and the weight at the rotors' mean distance, N m, of each channel of force and moment, (6,)."""
    weight_n = vehicle.mass_kg * vehicle.gravity_m_s2
    arm_m = float(np.linalg.norm(vehicle.rotor_positions_m()[:, :2], axis=1).mean())
    return np.repeat([weight_n, weight_n * arm_m if arm_m > 0 else np.inf], 3)
