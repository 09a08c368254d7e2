"""Accelerations of a vehicle with rotors and effects: what every simulation of this package steps forward."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from rotorid.effects.contract import LACK, Form, Motion
from rotorid.errors import InputError
from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle.mixer import wrench_matrix
from rotorid.vehicle.params import RigidBody
from rotorid.vehicle.rigid_body import angular_acceleration

ALWAYS_KNOWN = frozenset(
    {
        "rotor_speed",
        "angular_velocity",
        "angular_acceleration",
        "specific_force",
        # A simulated vehicle carries sensors that read the truth.
        "accelerometer",
        "gyroscope",
    }
)


class Dynamics:
    """Angular acceleration and specific force of a batch of n vehicles.

    Some effects depend on the accelerations that they change (added mass, products of inertia). They are
    given those of the last evaluation: a fixed point that converges as the step shrinks.
    """

    def __init__(self, vehicle: Vehicle, effects: Sequence[tuple[Form, Sequence[float]]], size: int):
        self.vehicle = vehicle
        self.body = RigidBody.of_vehicle(vehicle)
        self.effects = [(form, np.asarray(values, float)) for form, values in effects]
        self._matrix = wrench_matrix(vehicle).T
        self.last_acceleration = np.zeros((size, 3))
        self.last_specific_force = np.zeros((size, 3))

    def accelerations(
        self,
        rates: np.ndarray,
        rotor_speed: np.ndarray,
        surroundings: dict[str, np.ndarray | None],
        force: np.ndarray | None = None,
        moment: np.ndarray | None = None,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Angular acceleration (n, 3), rad/s2, and specific force (n, 3), m/s2, both in body axes.

        `rates` (n, 3), rad/s; `rotor_speed` (n, k), rad/s; `surroundings` are the other fields of `Motion`,
        read by the effects; `force` (n, 3), N, and `moment` (n, 3), N m, are added to what rotors and effects
        give.
        """
        wrench = (rotor_speed**2) @ self._matrix
        total_moment = wrench[:, 1:4] if moment is None else wrench[:, 1:4] + moment
        total_force = np.zeros((len(rates), 3))
        total_force[:, 2] = -wrench[:, 0]
        if force is not None:
            total_force += force
        if self.effects:
            motion = Motion(
                rotor_speed=rotor_speed,
                angular_velocity=rates,
                angular_acceleration=self.last_acceleration,
                specific_force=self.last_specific_force,
                accelerometer=self.last_specific_force,
                gyroscope=rates,
                **surroundings,
            )
            for form, values in self.effects:
                added = form.contribution(motion, self.vehicle, values)
                if added.force is not None:
                    total_force = total_force + added.force
                if added.moment is not None:
                    total_moment = total_moment + added.moment
        self.last_acceleration = angular_acceleration(self.body, rates, total_moment)
        self.last_specific_force = total_force / self.body.mass_kg
        return self.last_acceleration, self.last_specific_force


def has_memory(form: Form) -> bool:
    """Whether a form needs the past (a pendulum of its own), so that one instant does not give its wrench."""
    return form.memory


def check_effects(effects: Sequence[tuple[Form, Sequence[float]]], known: set[str]) -> None:
    """InputError where a form needs a field of `Motion` that is neither in `known` nor always known."""
    for form, _ in effects:
        for name in form.requires:
            if name not in known and name not in ALWAYS_KNOWN:
                reason = LACK.get(name, f"no {name}")
                raise InputError(f"effect form {form.name!r} cannot be simulated: {reason}")
