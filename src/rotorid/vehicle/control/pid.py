"""PID attitude control (thesis eqs 4.29, 4.30, table 4.2); anti-windup and filtered derivative as options.

What an attitude controller is asked to follow: total thrust and Euler angles over time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle.fast import AttitudeLoop
from rotorid.vehicle.mixer import allocation_matrix


@dataclass(frozen=True)
class Gains:
    """Gains about roll, pitch and yaw, each (3,): N m/rad, N m/(rad s), N m s/rad."""

    proportional: tuple[float, float, float]
    integral: tuple[float, float, float]
    derivative: tuple[float, float, float]


THESIS_GAINS = Gains((0.2, 0.2, 4.0), (3.0, 3.0, 0.1), (0.1, 0.1, 0.1))
"""Table 4.2."""


@dataclass(frozen=True)
class AttitudePid:
    """The thesis's attitude controller (fig. 4.8): PID moments and a set thrust, allocated to rotor speeds.

    A `Controller` of `rotorid.vehicle.simulator` for the `vehicle` as believed. Options that the thesis does not have:
    the derivative, a difference over a step, is smoothed by a first-order lag of `derivative_time_s`; moments are held
    within `limit_n_m` (3,), N m, and the integral stands still about an axis that is at its limit and would be driven
    further (anti-windup by conditional integration). `trim_n_m` (3,), N m, is added to the moments, beyond their limit.
    """

    vehicle: Vehicle
    reference: AttitudeReference
    gains: Gains = THESIS_GAINS
    derivative_time_s: float = 0.0
    limit_n_m: tuple[float, float, float] | None = None
    trim_n_m: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def attitude_loop(self, time_s: np.ndarray) -> AttitudeLoop:
        """The controller laid out for instants (m,), s."""
        angles, allocation = self.reference.at(time_s), allocation_matrix(self.vehicle)
        return AttitudeLoop(
            *(np.asarray(g) for g in (self.gains.proportional, self.gains.integral, self.gains.derivative)),
            allocation=allocation,
            reference=np.concatenate([angles, np.full((*angles.shape[:-1], 1), self.reference.thrust_n)], axis=-1),
            derivative_time_s=self.derivative_time_s,
            limit_n_m=None if self.limit_n_m is None else np.asarray(self.limit_n_m, float),
            more=np.tile(allocation[:, 1:] @ self.trim_n_m, (len(time_s), 1)) if any(self.trim_n_m) else None,
        )


@dataclass(frozen=True)
class AttitudeReference:
    """Total thrust, N, and a function of time (s) that gives roll, pitch, yaw (3,), or (n, 3) of n vehicles, rad."""

    name: str
    thrust_n: float
    euler_rad: Callable[[float], np.ndarray]
    at_once: bool = False
    """Whether the function takes many times (m,), too, and gives (m, 3), or (n, m, 3)."""

    def at(self, time_s: np.ndarray) -> np.ndarray:
        """Roll, pitch and yaw at many times, (m, 3) or (n, m, 3), rad."""
        return self.euler_rad(time_s) if self.at_once else np.array([self.euler_rad(t) for t in time_s], float)


def training_reference(thrust_n: float = 5.0) -> AttitudeReference:
    """Thesis eq. 4.28: 5 N; roll and pitch swing by 5 degrees at 4 rad/s, yaw turns at 20 degrees a second.

    5 N is below the vehicle's weight (6.396 N): the thesis simulates attitude, not hover.
    """

    def euler(t: float) -> np.ndarray:
        return np.array([np.pi / 36 * np.sin(4 * t), np.pi / 36 * np.sin(4 * t + np.pi / 2), np.pi / 9 * t])

    return AttitudeReference("eq. 4.28", thrust_n, euler)


def validation_reference(thrust_n: float = 5.0) -> AttitudeReference:
    """Thesis eq. 4.81: 5 N; roll and pitch swing by 4 degrees at 10 rad/s, yaw by 8 degrees at 2 rad/s."""

    def euler(t: float) -> np.ndarray:
        return np.array(
            [
                np.pi / 45 * np.sin(10 * t),
                np.pi / 45 * np.sin(10 * t + np.pi / 2),
                2 * np.pi / 45 * np.sin(2 * t),
            ]
        )

    return AttitudeReference("eq. 4.81", thrust_n, euler)
