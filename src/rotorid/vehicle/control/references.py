"""What an attitude controller is asked to follow: total thrust and Euler angles over time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class AttitudeReference:
    """Total thrust, N, and a function of time (s) that gives roll, pitch, yaw (3,), rad."""

    name: str
    thrust_n: float
    euler_rad: Callable[[float], np.ndarray]
    at_once: bool = False
    """Whether the function takes many times (m,), too, and gives (m, 3)."""

    def at(self, time_s: np.ndarray) -> np.ndarray:
        """Roll, pitch and yaw at many times, (m, 3), rad."""
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
