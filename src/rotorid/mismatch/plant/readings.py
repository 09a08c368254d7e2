"""What a form adds to the reading of a stand's or bench's instrument."""

from __future__ import annotations

import numpy as np

from rotorid.effects.contract import Contribution, Form
from rotorid.effects.loading import Loading, at_sensor
from rotorid.recordings import Vehicle


def reading_of(added: Contribution, loading: Loading, vehicle: Vehicle) -> np.ndarray:
    """What a contribution adds to the reading, (n, 6)."""
    if added.reading is not None:
        return added.reading
    return at_sensor(added.force, added.moment, loading.motion, vehicle)


def form_reading(form: Form, values, loading: Loading, vehicle: Vehicle) -> np.ndarray:
    """Reading that a form adds at parameter values, (n, 6); forms for a flight act through the motion."""
    values = np.asarray(values, float)
    subject = loading if form.on_loading else loading.motion
    return reading_of(form.contribution(subject, vehicle, values), loading, vehicle)
