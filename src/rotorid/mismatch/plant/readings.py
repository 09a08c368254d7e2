"""What a form adds to the reading of a stand's or bench's instrument."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from rotorid.effects.contract import Contribution, Form
from rotorid.effects.loading import Loading, at_sensor
from rotorid.recordings import Vehicle


def _reading_of(added: Contribution, loading: Loading, vehicle: Vehicle) -> np.ndarray:
    """What a contribution adds to the reading, (n, 6)."""
    if added.reading is not None:
        return added.reading
    return at_sensor(added.force, added.moment, loading.motion, vehicle)


def _contribution_of(form: Form, values, loading: Loading, vehicle: Vehicle) -> Contribution:
    """What a form adds at parameter values; forms for a flight act through the motion."""
    return form.contribution(loading if form.on_loading else loading.motion, vehicle, np.asarray(values, float))


def form_reading(form: Form, values, loading: Loading, vehicle: Vehicle) -> np.ndarray:
    """Reading that a form adds at parameter values, (n, 6)."""
    return _reading_of(_contribution_of(form, values, loading, vehicle), loading, vehicle)


def forms_reading(acting: Iterable, loading: Loading, vehicle: Vehicle) -> np.ndarray:
    """Reading that all (form, values) add, (n, 6): wrenches on the body are summed before they are read."""
    added = [_contribution_of(form, values, loading, vehicle) for form, values in acting]
    on_body = [
        sum(parts) if (parts := [part for a in added if (part := getattr(a, kind)) is not None]) else None
        for kind in ("force", "moment")
    ]
    return sum((a.reading for a in added if a.reading is not None), at_sensor(*on_body, loading.motion, vehicle))
