"""Where an error leads: metres that it alone carries a vehicle off within half a second of simulation.

The simulation run forward drifts by all errors together, and needs a recorded position. Here the residual of one
channel acts for half a second on a vehicle that is right otherwise: a force moves it, a roll or pitch moment tilts it
and gravity does the rest. To first order in the tilt,

    x(T) = ∫ (T − t) f / m dt,    x(T) = g ∫ (T − t)³ / 6 · M / J dt.

A yaw moment moves nothing.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from rotorid.mismatch.decision.findings import rms
from rotorid.recordings import Vehicle

WINDOW_S = 0.5
_AXES = {"moment_x": "xx", "moment_y": "yy"}


def drift_m(vehicle: Vehicle, channel: str, stretches: Iterable[tuple[np.ndarray, np.ndarray]]) -> float | None:
    """Root mean square, over windows of half a second, of the metres off at their ends.

    `stretches` are instants (n,), s, evenly spaced, and errors (n,), N or N m; what is missing or left out is NaN, and
    no window holds any. None for a channel that moves nothing, and where no window is whole.
    """
    if channel.startswith("force_"):
        power, scale = 1, 1.0 / vehicle.mass_kg
    elif channel in _AXES:
        inertia = getattr(vehicle.inertia_kg_m2, _AXES[channel])
        power, scale = 3, vehicle.gravity_m_s2 / (6.0 * inertia)
    else:
        return None
    found = rms(scale * _ends(time_s, error, power) for time_s, error in stretches)
    return None if np.isnan(found) else found


def _ends(time_s: np.ndarray, error: np.ndarray, power: int) -> np.ndarray:
    """∫ (T − t)^power · error dt over every window of a stretch, by the rule of midpoints; NaN where any is missing."""
    if len(time_s) < 2:
        return np.zeros(0)
    step = float(np.median(np.diff(time_s)))
    per = max(round(WINDOW_S / step), 1)
    count = len(error) // per
    windows = error[: count * per].reshape(count, per)
    left = WINDOW_S * (1.0 - (np.arange(per) + 0.5) / per)
    return windows @ left**power * (WINDOW_S / per)
