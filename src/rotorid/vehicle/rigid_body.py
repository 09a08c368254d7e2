"""Newton-Euler equations of a rigid body, thesis eqs 4.1-4.4, by quaternion.

World north-east-down, body forward-right-down. Everything works on batches (..., 3).
"""

from __future__ import annotations

import numpy as np

from rotorid.vehicle.attitude import cross
from rotorid.vehicle.params import RigidBody


def world_acceleration(body: RigidBody, rotation: np.ndarray, force: np.ndarray) -> np.ndarray:
    """dV/dt = R F / m + g e3 (eq. 4.2), (..., 3), m/s2, world; force without weight, N, body axes."""
    out = np.einsum("...ij,...j->...i", rotation, force) / body.mass_kg
    out[..., 2] += body.gravity_m_s2
    return out


def angular_acceleration(body: RigidBody, rates: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """dΩ/dt = J⁻¹ (τ - Ω × J Ω) (eq. 4.4), (..., 3), rad/s2; rates in rad/s, moment in N m, body axes."""
    momentum = rates @ body.inertia_kg_m2.T
    return (moment - cross(rates, momentum)) @ body.inverse_inertia.T
