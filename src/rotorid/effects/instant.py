"""One statement of what a form adds at one instant: numba compiles it for flights, numpy runs it on recordings.

A kernel is a plain function `kernel(m, v, p, w)` that adds to `w` what a form does at the instant `m` to the vehicle
`v` (`records`) with the values `p`. It is arithmetic, loops over rotors and axes, and functions of numpy (`np.maximum`,
`np.exp`, …) alone, and asks nothing of `m` by an `if`: then each number of `m` may as well be that of n instants, (n,).
What several kernels of a file share is a function with numba's `register_jitable`: plain Python, compiled with them.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from types import SimpleNamespace

import numpy as np

from rotorid.effects.contract import Contribution, Motion, rotor_thrusts
from rotorid.effects.scale import hover_inflow_m_s, rotor_radius_m
from rotorid.recordings.vehicle import Vehicle

_ROOM = 8
"""Rotors for which the records have room, or a multiple of it: code is compiled once for each."""


def room_for(rotors: int) -> int:
    """Rotors for which a vehicle's records have room."""
    return _ROOM * -(-rotors // _ROOM)


@cache
def records(room: int) -> tuple[np.dtype, np.dtype, np.dtype]:
    """Types of a kernel's `m`, `v` and `w` with room for so many rotors.

    `m`: the fields of `Motion` at one instant, `thrust` being that of each rotor, N, and `hub_velocity` each hub's
    velocity through the air, m/s, body axes. `v`: a vehicle's constants, SI; `radius` of a rotor, `hover_inflow` of one
    rotor in hover, m/s, `reach` the largest distance of a hub from the body's z axis, m; inertia and `mixer` are for
    flights. `w`: force, N, moment about the believed centre of mass, N m, and a force at each hub, N, body axes.
    """
    shapes = (
        {
            **dict.fromkeys(("time_s", "height", "on_board", "rotor_speed_sum"), ()),
            **dict.fromkeys(("angular_velocity", "angular_acceleration", "specific_force", "air_velocity"), 3),
            "rotation": (3, 3),
            **dict.fromkeys(("rotor_speed", "rotor_acceleration", "thrust"), room),
            "hub_velocity": (room, 3),
        },
        {
            **dict.fromkeys(("rotors", "mass", "gravity", "radius", "hover_inflow", "reach"), ()),
            **dict.fromkeys(("inertia", "inverse_inertia"), (3, 3)),
            "hub": (room, 3),
            **dict.fromkeys(("thrust_coefficient", "torque_coefficient", "yaw_sign"), room),
            "mixer": (4, room),
        },
        {"force": 3, "moment": 3, "hub_force": (room, 3)},
    )
    return tuple(
        np.dtype([(name, "i8" if name == "rotors" else "f8", shape) for name, shape in fields.items()], align=True)
        for fields in shapes
    )


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
        instants, body = Instants(motion, vehicle), Constants(vehicle)
        # By axis, or by rotor and axis, (n,) each; what is not added is not there.
        added = SimpleNamespace(**{name: defaultdict(float) for name in ("force", "moment", "hub_force")})
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


_UNKNOWN = {
    "rotation": np.eye(3),
    "on_board": 1.0,
    "angular_velocity": np.zeros(3),
    "angular_acceleration": np.zeros(3),
}


class Instants:
    """`m` of a kernel that runs on n instants: the fields of its record, the instants last in each."""

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


class Constants:
    """The constants of a vehicle by the names of its record, each computed when it is asked for: a stand lacks some."""

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
        """(4, k): total thrust (N, up) and moments (N m) = mixer @ ω²; C_A of eq. 4.31 for the thesis's geometry."""
        # F_i acts along -z at r_i: r × (0, 0, -F) = (-y F, x F, 0).
        thrust, hub = self.thrust_coefficient, self.hub
        return np.stack([thrust, -hub[:, 1] * thrust, hub[:, 0] * thrust, self.yaw_sign * self.torque_coefficient])


def body_of(vehicle: Vehicle) -> np.ndarray:
    """The constants of a vehicle as a record, (1,)."""
    constants, record = Constants(vehicle), np.zeros(1, records(room_for(vehicle.rotor_count))[1])
    for name in record.dtype.names:
        value = np.asarray(getattr(constants, name))
        record[name][(0, *(slice(length) for length in value.shape))] = value
    return record
