"""Accelerations of a vehicle with rotors and effects: what every simulation of this package steps forward.

Newton-Euler equations of a rigid body, thesis eqs 4.1-4.4, by quaternion.

World north-east-down, body forward-right-down. Everything works on batches (..., 3).

The constants of a rigid vehicle with rotors, as arrays that the equations of motion use.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rotorid.effects.contract import LACK, Form, Motion
from rotorid.errors import InputError
from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle.attitude import cross
from rotorid.vehicle.mixer import wrench_matrix

_ALWAYS_KNOWN = frozenset(
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


MOST_ROUNDS = 30
CONVERGED = 1e-10
"""Change of the accelerations, relative to their largest, at which a fixed point is taken as reached."""


class Dynamics:
    """Angular acceleration and specific force of a batch of n vehicles.

    Some effects depend on the accelerations that they change (added mass, products of inertia): these are solved
    for by a fixed point that starts at the last evaluation (it converges while the added mass is below the own).
    """

    def __init__(self, vehicle: Vehicle, effects: Sequence[tuple[Form, Sequence[float]]], size: int):
        self.vehicle = vehicle
        self.body = RigidBody.of_vehicle(vehicle)
        self.effects = [(form, np.asarray(values, float)) for form, values in effects]
        self._matrix = wrench_matrix(vehicle).T
        implicit = {"specific_force", "angular_acceleration", "accelerometer"}
        self.rounds = MOST_ROUNDS if any(implicit & set(form.requires) for form, _ in self.effects) else 1
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
        own_moment = wrench[:, 1:4] if moment is None else wrench[:, 1:4] + moment
        own_force = np.zeros((len(rates), 3))
        own_force[:, 2] = -wrench[:, 0]
        if force is not None:
            own_force += force
        for _ in range(self.rounds):
            before = self.last_acceleration, self.last_specific_force
            total_force, total_moment = self._with_effects(own_force, own_moment, rates, rotor_speed, surroundings)
            self.last_acceleration = angular_acceleration(self.body, rates, total_moment)
            self.last_specific_force = total_force / self.body.mass_kg
            if self.rounds > 1 and _same(before, (self.last_acceleration, self.last_specific_force)):
                break
        return self.last_acceleration, self.last_specific_force

    def _with_effects(self, force, moment, rates, rotor_speed, surroundings) -> tuple[np.ndarray, np.ndarray]:
        """Force and moment with what the effects add at the present accelerations."""
        if not self.effects:
            return force, moment
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
                force = force + added.force
            if added.moment is not None:
                moment = moment + added.moment
        return force, moment


def _same(before: tuple[np.ndarray, ...], after: tuple[np.ndarray, ...]) -> bool:
    """Whether two evaluations are equal for all purposes."""
    return all(np.abs(b - a).max() <= CONVERGED * max(1.0, np.abs(a).max()) for b, a in zip(before, after, strict=True))


def has_memory(form: Form) -> bool:
    """Whether a form needs the past (a pendulum of its own), so that one instant does not give its wrench."""
    return form.memory


def check_effects(effects: Sequence[tuple[Form, Sequence[float]]], known: set[str]) -> None:
    """InputError where a form needs a field of `Motion` that is neither in `known` nor always known."""
    for form, _ in effects:
        for name in form.requires:
            if name not in known and name not in _ALWAYS_KNOWN:
                reason = LACK.get(name, f"no {name}")
                raise InputError(f"effect form {form.name!r} cannot be simulated: {reason}")


def angular_acceleration(body: RigidBody, rates: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """dΩ/dt = J⁻¹ (τ - Ω × J Ω) (eq. 4.4), (..., 3), rad/s2; rates in rad/s, moment in N m, body axes."""
    momentum = rates @ body.inertia_kg_m2.T
    return (moment - cross(rates, momentum)) @ body.inverse_inertia.T


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
