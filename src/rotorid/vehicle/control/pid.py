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
class Memory:
    """What the controller carries from one call to the next; arrays (n, 3) for n vehicles."""

    integral: np.ndarray
    """∫ error dt, rad s."""
    error: np.ndarray | None = None
    """Error at the last call, rad; None before the first."""
    slope: np.ndarray | float = 0.0
    """Filtered derivative of the error, rad/s."""


def pid_step(
    gains: Gains,
    error: np.ndarray,
    memory: Memory,
    dt_s: float,
    derivative_time_s: float = 0.0,
    limit_n_m: np.ndarray | None = None,
) -> tuple[np.ndarray, Memory]:
    """Moments (n, 3), N m, for errors (n, 3), rad, and the new memory.

    The derivative is a difference over the last `dt_s`, smoothed by a first-order lag of `derivative_time_s`
    (0: none). With a limit (3,), N m, the moments are held within it and the integral stands still about an
    axis that is at its limit and would be driven further (anti-windup by conditional integration).
    """
    kp, ki, kd = (np.asarray(g) for g in (gains.proportional, gains.integral, gains.derivative))
    raw = np.zeros_like(error) if memory.error is None else (error - memory.error) / dt_s
    keep = np.exp(-dt_s / derivative_time_s) if derivative_time_s > 0 else 0.0
    slope = keep * memory.slope + (1.0 - keep) * raw
    integral = memory.integral + error * dt_s
    moment = kp * error + ki * integral + kd * slope
    if limit_n_m is not None:
        held = np.clip(moment, -limit_n_m, limit_n_m)
        winding = (held != moment) & (np.sign(error) == np.sign(moment))
        integral = np.where(winding, memory.integral, integral)
        moment = held
    return moment, Memory(integral, error, slope)


class AttitudePid:
    """The thesis's attitude controller (fig. 4.8): PID moments and a set thrust, allocated to rotor speeds.

    Implements `Controller` of `rotorid.vehicle.simulator`. `derivative_time_s` and `limit_n_m` are the
    options of `pid_step`; the thesis has neither. `trim_n_m` (3,), N m, is added to the moments, beyond their limit.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        reference: AttitudeReference,
        gains: Gains = THESIS_GAINS,
        derivative_time_s: float = 0.0,
        limit_n_m: tuple[float, float, float] | None = None,
        trim_n_m: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ):
        self.reference = reference
        self.gains = gains
        self.derivative_time_s = derivative_time_s
        self.limit_n_m = None if limit_n_m is None else np.asarray(limit_n_m, float)
        self._allocation = allocation_matrix(vehicle).T
        self._trim = np.array([0.0, *trim_n_m]) @ self._allocation
        self._memory: Memory | None = None
        self._time_s: float | None = None

    def rotor_command(self, time_s: float, euler_rad: np.ndarray) -> np.ndarray:
        """Commanded rotor speeds (n, k), rad/s, from measured attitudes (n, 3), rad."""
        error = self.reference.euler_rad(time_s) - euler_rad
        # The short way round: a yaw reference that keeps turning passes ±π.
        error = (error + np.pi) % (2 * np.pi) - np.pi
        if self._memory is None:
            # No time has passed yet: the integral is empty and the derivative unknown.
            self._memory, moment = (
                Memory(np.zeros_like(error), error),
                np.asarray(self.gains.proportional) * error,
            )
        else:
            moment, self._memory = pid_step(
                self.gains, error, self._memory, time_s - self._time_s, self.derivative_time_s, self.limit_n_m
            )
        self._time_s = time_s
        wanted = np.concatenate([np.full((len(error), 1), self.reference.thrust_n), moment], axis=1)
        return np.sqrt(np.maximum(np.maximum(wanted @ self._allocation, 0.0) + self._trim, 0.0))

    def attitude_loop(self, time_s: np.ndarray) -> AttitudeLoop | None:
        """The controller laid out for instants (m,), s, so that it flies compiled; None once it has been called."""
        if self._memory is not None:
            return None
        angles = self.reference.at(time_s)
        return AttitudeLoop(
            *(np.asarray(g) for g in (self.gains.proportional, self.gains.integral, self.gains.derivative)),
            allocation=self._allocation.T,
            reference=np.concatenate([angles, np.full((*angles.shape[:-1], 1), self.reference.thrust_n)], axis=-1),
            derivative_time_s=self.derivative_time_s,
            limit_n_m=self.limit_n_m,
            more=np.tile(self._trim, (len(time_s), 1)) if self._trim.any() else None,
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
