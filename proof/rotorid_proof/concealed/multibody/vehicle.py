"""Quadrotors of drawn size: geometry and inertia from a frame of point masses and a box, rotors from hover."""

from dataclasses import dataclass

import numpy as np

GRAVITY = 9.81
RHO = 1.2
"""Air density, kg/m³ (20 °C at sea level)."""


@dataclass(frozen=True)
class Quad:
    """A quadrotor; arrays in body axes (forward, right, down), origin at the centre of mass."""

    mass: float
    inertia: np.ndarray  # (3, 3)
    hubs: np.ndarray  # (4, 3)
    spin: np.ndarray  # (4,) +1 counter-clockwise seen from above
    thrust: float  # N s²
    torque: float  # N m s²
    radius: float
    rotor_inertia: float
    top: float  # highest speed, rad/s

    @property
    def hover(self) -> float:
        """Rotor speed at hover, rad/s."""
        return float(np.sqrt(self.mass * GRAVITY / (len(self.hubs) * self.thrust)))

    @property
    def arm(self) -> float:
        """Distance of a hub from the middle, m."""
        return float(np.linalg.norm(self.hubs[0, :2]))


def drawn(rng: np.random.Generator) -> Quad:
    """A quadrotor of 0.35 to 2.6 kg: arms with the cube root of the mass, motors as points, the rest a box."""
    mass = float(np.exp(rng.uniform(np.log(0.35), np.log(2.6))))
    arm = 0.15 * mass ** (1 / 3) * rng.uniform(0.85, 1.15)
    half = np.deg2rad(rng.uniform(40, 52))  # between an arm and the nose
    x, y = arm * np.cos(half), arm * np.sin(half)
    z = -rng.uniform(0.0, 0.12) * arm  # the discs a little above the centre of mass
    hubs = np.array([[x, y, z], [x, -y, z], [-x, -y, z], [-x, y, z]])
    spin = np.array([1.0, -1.0, 1.0, -1.0]) * rng.choice([-1.0, 1.0])
    motor = 0.09 * mass
    box = mass - 4 * motor
    side, tall = 0.8 * arm, 0.7 * arm
    inertia = np.diag([box * (side**2 + tall**2) / 12, box * (1.3 * side**2 + tall**2) / 12, box * 2.3 * side**2 / 12])
    for r in hubs:
        r = np.array([r[0], r[1], 0.0])
        inertia = inertia + motor * (r @ r * np.eye(3) - np.outer(r, r))
    radius = 0.58 * arm
    hover = 70.0 / radius * rng.uniform(0.85, 1.15)  # tip speeds of 60 to 80 m/s
    thrust = mass * GRAVITY / (4 * hover**2)
    blade = 0.012 * mass  # both blades of a propeller
    return Quad(
        mass=mass,
        inertia=inertia,
        hubs=hubs,
        spin=spin,
        thrust=thrust,
        torque=thrust * radius * rng.uniform(0.17, 0.25),
        radius=radius,
        rotor_inertia=blade * (2 * radius) ** 2 / 12,
        top=hover * rng.uniform(1.8, 2.2),
    )
