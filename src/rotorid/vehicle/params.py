"""The constants of a rigid vehicle with rotors, as arrays that the equations of motion use."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rotorid.recordings.vehicle import Vehicle


@dataclass(frozen=True)
class RigidBody:
    """Mass and inertia: what turns force and moment into motion."""

    mass_kg: float
    inertia_kg_m2: np.ndarray
    """Matrix J about the body origin, (3, 3), kg m2."""
    inverse_inertia: np.ndarray
    """J⁻¹, (3, 3), 1/(kg m2)."""
    gravity_m_s2: float = 9.81

    @classmethod
    def of(cls, mass_kg: float, inertia_kg_m2: np.ndarray, gravity_m_s2: float = 9.81) -> RigidBody:
        inertia = np.asarray(inertia_kg_m2, float)
        if inertia.ndim == 1:
            inertia = np.diag(inertia)
        return cls(float(mass_kg), inertia, np.linalg.inv(inertia), float(gravity_m_s2))

    @classmethod
    def of_vehicle(cls, vehicle: Vehicle) -> RigidBody:
        return cls.of(vehicle.mass_kg, vehicle.inertia_kg_m2.matrix(), vehicle.gravity_m_s2)
