"""Air that moves over the ground: the same flight seen by an observer who moves."""

from __future__ import annotations

import numpy as np

from rotorid.recordings import RecordingSet
from rotorid_proof.plantings.columns import has, of_sensor
from rotorid_proof.plantings.kinds import Kind, Size, both, named

FEELS_THE_AIR = frozenset({"rotor_drag", "frame_drag", "flapping_moment", "translational_lift", "rotor_interference"})


def steady_wind(recordings: RecordingSet, speed_m_s: float, rng: np.random.Generator):
    """Velocities plus w, positions plus w t: by Galileo's principle the same flight in air that moves with w.

    It shows only through what depends on the airspeed.
    """
    angle = rng.uniform(0, 2 * np.pi)
    w = speed_m_s * np.array([np.cos(angle), np.sin(angle), 0.0])
    out = of_sensor(recordings, "velocity", lambda run, values: values + w)
    if has(recordings, "position"):
        out = of_sensor(out, "position", lambda run, values: values + np.outer(run.time_s - run.time_s[0], w))
    sizes = ((Size("steady_wind", "w_north", w[0]), Size("steady_wind", "w_east", w[1])),)
    return out, named("steady_wind", sizes=sizes, shown_by=FEELS_THE_AIR)


KINDS = (
    Kind(
        "air",
        "steady_wind",
        frozenset({"velocity", "position"}),
        both(4.0, 2.0),
        lambda recordings: has(recordings, "velocity", "attitude"),
        steady_wind,
    ),
)
