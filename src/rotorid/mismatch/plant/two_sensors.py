"""An error of a sensor is estimated by the comparison with another sensor, where there is one.

The balance of forces and moments holds it, too, but only as far as the model of them is right. A moment that nobody
modelled, which the controller answers, asks for a gyroscope that reads half of what it does; a cable that pulls at the
tail turns the vehicle and pulls it sideways, as a lever arm of the accelerometer would.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rotorid.effects.catalogue import catalogue
from rotorid.mismatch.plant.rows import Rows, Term

COMPARISONS = range(6, 12)
"""Channels in which two sensors are compared: accelerometer and velocity, gyroscope and attitude."""


def compared_alone(terms: Sequence[Term], rows: Sequence[Rows]) -> tuple[list[int], list[str]]:
    """Channels in which two sensors are compared, and keys of the errors of a sensor that act in them."""
    channels = [c for c in COMPARISONS if np.isfinite(rows[0].y[:, c]).all()]
    sensors = {i for i, effect in catalogue().items() if effect.kind == "sensor"}
    start, keys = 0, []
    for term in terms:
        own = slice(start, start + term.size)
        if term.kind == "effect" and term.effect in sensors and any(r.x[:, channels, own].any() for r in rows):
            keys.append(term.key)
        start += term.size
    return channels, keys
