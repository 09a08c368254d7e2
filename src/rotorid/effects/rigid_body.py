"""Forces of what is fixed to the airframe."""

from __future__ import annotations

import numpy as np

from rotorid.effects.contract import Motion


def force_of_lever(motion: Motion, first_moment_kg_m: np.ndarray) -> np.ndarray:
    """−(dΩ/dt × l + Ω × (Ω × l)), (n, 3), N, body axes: what turning adds to the force that moves a mass at a lever.

    l is its first moment (3,), kg m. Source: Titterton and Weston, Strapdown Inertial Navigation Technology, ch. 4.
    """
    rate = motion.angular_velocity
    turning = np.cross(motion.angular_acceleration, first_moment_kg_m)
    return -turning - np.cross(rate, np.cross(rate, first_moment_kg_m))
