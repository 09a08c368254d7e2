"""Vehicles of three makes: micro quadrotor, hexarotor, heavy quadrotor; each with drawn scatter."""

from dataclasses import dataclass

import numpy as np

GRAVITY = 9.80665


@dataclass(frozen=True)
class Craft:
    """A multirotor; body axes forward, right, down, origin at the centre of mass."""

    name: str
    mass: float
    inertia: np.ndarray  # (3, 3)
    hubs: np.ndarray  # (n, 3)
    spin: np.ndarray  # (n,)
    thrust: float
    torque: float
    radius: float
    lag_s: float  # of its motors
    slow: float  # bandwidth of the attitude loop over 10 rad/s

    @property
    def n(self) -> int:
        return len(self.hubs)

    @property
    def hover(self) -> float:
        return float(np.sqrt(self.mass * GRAVITY / (self.n * self.thrust)))

    @property
    def arm(self) -> float:
        return float(np.hypot(*self.hubs[0, :2]))


def ring(count, arm, first, up):
    """Hubs on a circle, clockwise seen from above from the angle `first` (rad from the nose)."""
    angle = first + 2 * np.pi * np.arange(count) / count
    return np.stack([arm * np.cos(angle), arm * np.sin(angle), np.full(count, -up)], axis=1)


def drawn(rng: np.random.Generator) -> Craft:
    """One of the three makes, its figures scattered by a tenth."""

    def about(x):
        return float(x * rng.uniform(0.9, 1.1))

    make = str(rng.choice(["micro", "hexa", "heavy"]))
    if make == "micro":
        mass, arm, radius, hover, lag = about(0.034), about(0.046), about(0.0235), about(2150.0), about(0.045)
        inertia = np.diag([1.65e-5, 1.7e-5, 2.95e-5]) * mass / 0.034
        hubs, share, slow = ring(4, arm, np.pi / 4, 0.002), about(0.005), 1.0
    elif make == "hexa":
        mass, arm, radius, hover, lag = about(3.2), about(0.37), about(0.165), about(430.0), about(0.04)
        inertia = np.diag([0.062, 0.069, 0.115]) * mass / 3.2
        hubs, share, slow = ring(6, arm, rng.choice([0.0, np.pi / 6]), 0.03), about(0.018), 0.9
    else:
        mass, arm, radius, hover, lag = about(9.5), about(0.58), about(0.28), about(270.0), about(0.055)
        inertia = np.diag([0.36, 0.41, 0.66]) * mass / 9.5
        hubs, share, slow = ring(4, arm, np.pi / 4, 0.05), about(0.025), 0.7
    n = len(hubs)
    spin = np.where(np.arange(n) % 2 == 0, 1.0, -1.0)
    thrust = mass * GRAVITY / (n * hover**2)
    return Craft(make, mass, inertia, hubs, spin, thrust, thrust * share, radius, lag, slow)
