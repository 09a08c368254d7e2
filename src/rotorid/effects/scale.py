"""Sizes of a vehicle from which the catalogue's physical bounds follow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rotorid.effects.contract import Parameter
from rotorid.recordings.vehicle import Vehicle

_AIR_DENSITY_KG_M3 = 1.2
_FASTEST_DECAY_1_S = 5.0
"""Drag stops no multirotor within less than a fifth of a second (published: 0.2 to 0.6 1/s)."""
_LEAST_ROTOR_SHARE = 2e-5
"""No rotor's inertia is a smaller share of its vehicle's (2e-3 in the example of the recording contract)."""
_MOST_OF_STATED = 4.0
"""A rotor's inertia is at most so many times the one stated."""
_FASTEST_DAMPING_1_S = 20.0
"""Nor does air stop its turning within less than a twentieth."""


def rotor_radius_m(vehicle: Vehicle) -> float:
    """Rotor radius, m; where none is stated, 0.45 of the smallest distance between two hubs."""
    if vehicle.rotor_radius_m is not None:
        return vehicle.rotor_radius_m
    hubs = vehicle.rotor_positions_m()
    if len(hubs) < 2:
        return 0.1
    apart = np.linalg.norm(hubs[:, None] - hubs[None], axis=2)
    return 0.45 * float(apart[apart > 0].min())


@dataclass(frozen=True)
class _Scale:
    """What a vehicle weighs, how fast its rotors turn in hover, and how far out they sit."""

    mass_kg: float
    weight_n: float
    hover_speed_rad_s: float
    rotors: int
    arm_m: float
    """Largest distance of a hub from the centre of mass, at least a rotor radius."""
    inertia_kg_m2: float
    """Largest moment of inertia."""

    @property
    def thrust_n(self) -> float:
        """Hover thrust of one rotor."""
        return self.weight_n / self.rotors

    @property
    def drag_per_speed(self) -> float:
        """Largest drag per airspeed of the whole vehicle, N s/m."""
        return _FASTEST_DECAY_1_S * self.mass_kg

    @property
    def drag_per_rotor_speed(self) -> float:
        """Largest drag per airspeed and rotor speed of one rotor, N s2/(rad m)."""
        return self.drag_per_speed / (self.rotors * self.hover_speed_rad_s)

    @property
    def damping(self) -> float:
        """Largest damping moment per body rate, N m s/rad."""
        return _FASTEST_DAMPING_1_S * self.inertia_kg_m2


def scale(vehicle: Vehicle) -> _Scale:
    """Sizes of a vehicle; what it does not state is taken as one, so that bounds stay finite."""
    mass = vehicle.mass_kg or 1.0
    weight = mass * vehicle.gravity_m_s2
    lift = float(vehicle.thrust_coefficients_n_s2().sum()) if vehicle.rotors else 0.0
    inertia = vehicle.inertia_kg_m2
    hubs = vehicle.rotor_positions_m() if vehicle.rotors else np.zeros((1, 3))
    return _Scale(
        mass_kg=mass,
        weight_n=weight,
        hover_speed_rad_s=float(np.sqrt(weight / lift)) if lift > 0 else 1.0,
        rotors=max(1, vehicle.rotor_count),
        arm_m=max(float(np.linalg.norm(hubs, axis=1).max()), rotor_radius_m(vehicle)),
        inertia_kg_m2=1.0 if inertia is None else float(np.linalg.eigvalsh(inertia.matrix()).max()),
    )


def hover_inflow_m_s(vehicle: Vehicle, density_kg_m3: float = _AIR_DENSITY_KG_M3) -> float:
    """Momentum theory: v_h = sqrt(T / (2 ρ π R²)) of one rotor in hover, m/s."""
    thrust = vehicle.mass_kg * vehicle.gravity_m_s2 / vehicle.rotor_count
    return float(np.sqrt(thrust / (2 * density_kg_m3 * np.pi * rotor_radius_m(vehicle) ** 2)))


def rotor_inertia(vehicle: Vehicle) -> Parameter:
    """The moment of inertia of one rotor about its axis, J_r.

    No more than a quarter of the vehicle's, which on a stand nobody needs to state rightly, or MOST_OF_STATED times the
    one that is stated.
    """
    inertia = scale(vehicle).inertia_kg_m2
    least = _LEAST_ROTOR_SHARE * inertia
    most = max(inertia / 4, _MOST_OF_STATED * (vehicle.rotor_inertia_kg_m2 or 0.0))
    return Parameter("J_r", "kg m2", 0.0, most, meaning="inertia of one rotor", negligible=least)
