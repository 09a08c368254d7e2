"""One statement of what a form adds at one instant: numba compiles it for flights, numpy runs it on recordings.

A kernel is a plain function `kernel(m, v, p, w)` that adds to `w` (`ADDED`) what a form does at the instant `m`
(`INSTANT`) to the vehicle `v` (`BODY`) with the values `p`. It is arithmetic, loops over rotors and axes, and functions
of numpy (`np.maximum`, `np.where`, …) alone, and asks nothing of `m` by an `if`: then each number of `m` may as well be
that of n instants, (n,).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from rotorid.effects.contract import Contribution, Motion, rotor_thrusts
from rotorid.effects.scale import hover_inflow_m_s, rotor_radius_m
from rotorid.recordings.vehicle import Vehicle

MOST_ROTORS = 8
"""Rotors for which the records have room."""

INSTANT = np.dtype(
    [
        ("time_s", "f8"),
        ("height", "f8"),
        ("on_board", "f8"),
        ("rotor_speed_sum", "f8"),
        ("angular_velocity", "f8", 3),
        ("angular_acceleration", "f8", 3),
        ("specific_force", "f8", 3),
        ("air_velocity", "f8", 3),
        ("rotation", "f8", (3, 3)),
        ("rotor_speed", "f8", MOST_ROTORS),
        ("rotor_acceleration", "f8", MOST_ROTORS),
        ("thrust", "f8", MOST_ROTORS),
        ("hub_velocity", "f8", (MOST_ROTORS, 3)),
    ],
    align=True,
)
"""`m` of a kernel: the fields of `Motion` at one instant, `thrust` being that of each rotor, N, and `hub_velocity` each
hub's velocity through the air, m/s, body axes."""

BODY = np.dtype(
    [
        ("rotors", "i8"),
        ("mass", "f8"),
        ("gravity", "f8"),
        ("radius", "f8"),
        ("hover_inflow", "f8"),
        ("reach", "f8"),
        ("inertia", "f8", (3, 3)),
        ("inverse_inertia", "f8", (3, 3)),
        ("hub", "f8", (MOST_ROTORS, 3)),
        ("thrust_coefficient", "f8", MOST_ROTORS),
        ("torque_coefficient", "f8", MOST_ROTORS),
        ("yaw_sign", "f8", MOST_ROTORS),
        ("mixer", "f8", (4, MOST_ROTORS)),
    ],
    align=True,
)
"""`v` of a kernel: a vehicle's constants, SI; `radius` of a rotor, `hover_inflow` of one rotor in hover, m/s, `reach`
the largest distance of a hub from the body's z axis, m. The last four with `mixer`, inertia and mass are of flights."""

ADDED = np.dtype([("force", "f8", 3), ("moment", "f8", 3), ("hub_force", "f8", (MOST_ROTORS, 3))], align=True)
"""`w` of a kernel: force, N, moment about the believed centre of mass, N m, and a force at each hub, N, body axes."""

Kernel = Callable[..., None]


@dataclass(frozen=True)
class Wrench:
    """The force and moment of a form by its kernel, as its `contribution` to n instants at once."""

    kernel: Kernel
    values: Callable[[np.ndarray], Sequence[float]] | None = None
    """What the kernel takes for its values, from the form's parameter values; None for these themselves."""

    def values_of(self, values: Sequence[float]) -> np.ndarray:
        """The kernel's values of the form's parameter values."""
        values = np.asarray(values, float)
        return values if self.values is None else np.asarray(self.values(values), float)

    def __call__(self, motion: Motion, vehicle: Vehicle, values: Sequence[float]) -> Contribution:
        instants, body, added = _Instants(motion, vehicle), _Body(vehicle), _Added()
        self.kernel(instants, body, self.values_of(values), added)
        for (i, j), pull in added.hub_force.items():
            after, last = (j + 1) % 3, (j + 2) % 3
            added.force[j] += pull
            added.moment[after] += body.hub[i, last] * pull
            added.moment[last] -= body.hub[i, after] * pull
        return Contribution(_stacked(added.force, motion.size), _stacked(added.moment, motion.size))


def _stacked(parts: dict[int, np.ndarray], size: int) -> np.ndarray | None:
    """Components by axis as (n, 3), None for nothing."""
    if not parts:
        return None
    out = np.zeros((size, 3))
    for axis, values in parts.items():
        out[:, axis] = values
    return out


class _Added:
    """`w` of a kernel that runs on n instants: by axis, or by rotor and axis, arrays (n,); what is not added is not
    there."""

    def __init__(self):
        self.force, self.moment, self.hub_force = defaultdict(float), defaultdict(float), defaultdict(float)


_UNKNOWN = {
    "rotation": np.eye(3),
    "on_board": 1.0,
    "angular_velocity": np.zeros(3),
    "angular_acceleration": np.zeros(3),
}


class _Instants:
    """`m` of a kernel that runs on n instants: the fields of INSTANT, the instants last in each."""

    def __init__(self, motion: Motion, vehicle: Vehicle):
        self._motion, self._vehicle = motion, vehicle

    def __getattr__(self, name: str) -> np.ndarray:
        """A field of the motion, or what a form that does not require it takes in its place."""
        value = getattr(self._motion, name)
        if value is None:
            value = _UNKNOWN[name]
        else:
            value = np.ascontiguousarray(np.moveaxis(value, 0, -1)).view()
            # What is added up in place must not begin as one of these.
            value.flags.writeable = False
        setattr(self, name, value)
        return value

    @cached_property
    def rotor_speed_sum(self) -> np.ndarray:
        return sum(self.rotor_speed)

    @cached_property
    def air_velocity(self) -> np.ndarray:
        return np.ascontiguousarray(self._motion.air_velocity.T)

    @cached_property
    def thrust(self) -> np.ndarray:
        return np.ascontiguousarray(rotor_thrusts(self._motion, self._vehicle).T)

    @cached_property
    def hub_velocity(self) -> _HubVelocity:
        return _HubVelocity(self.air_velocity, self.angular_velocity, self._vehicle.rotor_positions_m())


@dataclass(frozen=True)
class _HubVelocity:
    """v + Ω × r_i, m/s, (n,) of a rotor and axis."""

    air_velocity: np.ndarray
    angular_velocity: np.ndarray
    hub: np.ndarray

    def __getitem__(self, place: tuple[int, int]) -> np.ndarray:
        i, j = place
        after, last = (j + 1) % 3, (j + 2) % 3
        turning = self.angular_velocity[after] * self.hub[i, last] - self.angular_velocity[last] * self.hub[i, after]
        return self.air_velocity[j] + turning


class _Body:
    """The constants of a vehicle by the names of BODY, each computed when it is asked for: a stand lacks some."""

    def __init__(self, vehicle: Vehicle):
        self._vehicle = vehicle

    rotors = cached_property(lambda self: self._vehicle.rotor_count)
    mass = cached_property(lambda self: self._vehicle.mass_kg)
    gravity = cached_property(lambda self: self._vehicle.gravity_m_s2)
    radius = cached_property(lambda self: rotor_radius_m(self._vehicle))
    hover_inflow = cached_property(lambda self: hover_inflow_m_s(self._vehicle))
    hub = cached_property(lambda self: self._vehicle.rotor_positions_m())
    reach = cached_property(lambda self: np.linalg.norm(self.hub[:, :2], axis=1).max() or 1.0)
    inertia = cached_property(lambda self: self._vehicle.inertia_kg_m2.matrix())
    inverse_inertia = cached_property(lambda self: np.linalg.inv(self.inertia))
    thrust_coefficient = cached_property(lambda self: self._vehicle.thrust_coefficients_n_s2())
    torque_coefficient = cached_property(lambda self: self._vehicle.torque_coefficients_n_m_s2())
    yaw_sign = cached_property(lambda self: self._vehicle.yaw_signs())

    @cached_property
    def mixer(self) -> np.ndarray:
        """Total thrust (up) and moments = mixer @ ω²: F_i acts along -z at r_i, r × (0, 0, -F) = (-y F, x F, 0)."""
        thrust, hub = self.thrust_coefficient, self.hub
        return np.stack([thrust, -hub[:, 1] * thrust, hub[:, 0] * thrust, self.yaw_sign * self.torque_coefficient])


def body_of(vehicle: Vehicle) -> np.ndarray:
    """The constants of a vehicle, (1,) of BODY."""
    record, body = np.zeros(1, BODY), _Body(vehicle)
    for name in BODY.names:
        value = np.asarray(getattr(body, name))
        record[name][(0, *(slice(length) for length in value.shape))] = value
    return record
