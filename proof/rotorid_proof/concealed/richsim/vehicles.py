"""Airframes that the simulator flies. Axes: x forward, y right, z down; SI units."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Airframe:
    """What a careful owner would believe about the vehicle.

    positions_m has shape (n, 3); spin is +1 for counter-clockwise seen from above (reaction: positive yaw).
    """

    name: str
    mass_kg: float
    inertia_kg_m2: tuple[float, float, float]
    positions_m: tuple[tuple[float, float, float], ...]
    spin: tuple[int, ...]
    thrust_coefficient: float
    torque_coefficient: float
    rotor_radius_m: float
    rotor_inertia_kg_m2: float
    max_speed_rad_s: float
    cells: int
    step_s: float
    gravity_m_s2: float = 9.81

    @property
    def n(self) -> int:
        return len(self.spin)

    @property
    def hover_speed_rad_s(self) -> float:
        return float(np.sqrt(self.mass_kg * self.gravity_m_s2 / (self.n * self.thrust_coefficient)))

    @property
    def hover_inflow_m_s(self) -> float:
        """Induced speed of momentum theory at hover, sqrt(T / (2 rho A))."""
        thrust = self.mass_kg * self.gravity_m_s2 / self.n
        return float(np.sqrt(thrust / (2 * 1.225 * np.pi * self.rotor_radius_m**2)))


def _hexagon(radius: float) -> tuple[tuple[float, float, float], ...]:
    angles = np.deg2rad([30, 90, 150, 210, 270, 330])
    return tuple((float(radius * np.cos(a)), float(radius * np.sin(a)), 0.0) for a in angles)


AIRFRAMES = {
    "thesis": Airframe(
        name="x250",
        mass_kg=0.652,
        inertia_kg_m2=(2.489e-3, 2.5743e-3, 4.6838e-3),
        positions_m=(
            (0.0884, 0.0884, 0.0),
            (0.0884, -0.0884, 0.0),
            (-0.0884, -0.0884, 0.0),
            (-0.0884, 0.0884, 0.0),
        ),
        spin=(1, -1, 1, -1),
        thrust_coefficient=1.3877e-6,
        torque_coefficient=1.8558e-8,
        rotor_radius_m=0.0635,
        rotor_inertia_kg_m2=8.5e-6,
        max_speed_rad_s=2400.0,
        cells=3,
        step_s=1e-3,
    ),
    "racer": Airframe(
        name="five-inch",
        mass_kg=0.772,
        inertia_kg_m2=(2.5e-3, 2.1e-3, 4.3e-3),
        positions_m=((-0.075, 0.10, 0.0), (0.075, 0.10, 0.0), (-0.075, -0.10, 0.0), (0.075, -0.10, 0.0)),
        spin=(-1, 1, 1, -1),
        thrust_coefficient=1.5625e-6,
        torque_coefficient=3.4375e-8,
        rotor_radius_m=0.0648,
        rotor_inertia_kg_m2=9.3e-6,
        max_speed_rad_s=2800.0,
        cells=4,
        step_s=1e-3,
    ),
    "crazyflie": Airframe(
        name="nano",
        mass_kg=0.032,
        inertia_kg_m2=(1.66e-5, 1.67e-5, 2.93e-5),
        positions_m=(
            (0.0325, 0.0325, 0.0),
            (-0.0325, 0.0325, 0.0),
            (-0.0325, -0.0325, 0.0),
            (0.0325, -0.0325, 0.0),
        ),
        spin=(1, -1, 1, -1),
        thrust_coefficient=2.5e-8,
        torque_coefficient=1.6e-10,
        rotor_radius_m=0.0231,
        rotor_inertia_kg_m2=1.6e-8,
        max_speed_rad_s=3000.0,
        cells=1,
        step_s=5e-4,
    ),
    "hexarotor": Airframe(
        name="hexa",
        mass_kg=2.1,
        inertia_kg_m2=(0.028, 0.029, 0.05),
        positions_m=_hexagon(0.275),
        spin=(1, -1, 1, -1, 1, -1),
        thrust_coefficient=8.5e-6,
        torque_coefficient=1.4e-7,
        rotor_radius_m=0.127,
        rotor_inertia_kg_m2=9.0e-5,
        max_speed_rad_s=1300.0,
        cells=4,
        step_s=1e-3,
    ),
}
