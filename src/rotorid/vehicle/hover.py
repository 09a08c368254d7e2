"""What a vehicle with its effects must be asked for to hover, found at rest in still air.

A controller that knows the believed vehicle asks for a thrust and moments; a curve between command and speed, a payload
or unequal rotors make others of them. A pilot trims his vehicle until it hovers level, and so does this.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq, least_squares

from rotorid.effects.contract import Motion
from rotorid.effects.instant import body_of
from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle import fast
from rotorid.vehicle.improved import active_forms
from rotorid.vehicle.mixer import allocation_matrix
from rotorid.vehicle.simulator import CommandPath

_LARGEST_SHARE = 10.0
"""Thrust, over the weight, up to which is asked where the file states no limits of the rotor speed."""
_SLOPE_SHARE = 0.02
"""Change of the thrust asked for, as a share of it, over which the gain is measured."""
_HUNG_S, _HUNG_SAMPLES = 2.0, 100
"""Time at rest over which the force of what has a memory (a slung payload) is averaged, and its instants."""
_CLOSE = 1e-9
"""Share of the weight (and of the weight on a rotor's arm) within which a force or moment counts as none."""


@dataclass(frozen=True)
class _Hover:
    """What to ask for."""

    thrust_n: float
    moments_n_m: tuple[float, float, float]
    """About roll, pitch and yaw."""
    gain: float
    """Force, N, that a further newton of thrust makes."""
    supported: float = 1.0
    """Upward force over what hover needs; below 1 where all that the rotors can do does not support the vehicle."""


def hover(vehicle: Vehicle, path: CommandPath | None, height_m: float) -> _Hover:
    """The hover of a vehicle with the effects that its file states, at a height above its ground, m.

    `path` is what lies between its command and rotor speed. Where the rotors cannot balance every moment, what is
    asked for leaves the least of them.
    """
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    units = weight * np.array([1.0, *np.repeat(np.linalg.norm(vehicle.rotor_positions_m(), axis=1).mean(), 3)])
    limits = vehicle.rotor_speed_limits_rad_s
    most = _LARGEST_SHARE * weight
    if limits is not None:
        most = float((vehicle.thrust_coefficients_n_s2() * limits[1] ** 2).sum())

    def missing(asked: np.ndarray) -> np.ndarray:
        """Force and moments beyond those of a level hover, over `units`, for thrust and moments over them."""
        return wrench_at_rest(vehicle, path, asked * units, height_m) / units - [1.0, 0.0, 0.0, 0.0]

    def rising(share: float) -> float:
        return float(missing(np.array([share, 0.0, 0.0, 0.0]))[0])

    share = 1.0
    if abs(rising(share)) > _CLOSE:
        if (highest := rising(most / weight)) <= 0:
            return _Hover(most, (0.0, 0.0, 0.0), 1.0, 1.0 + highest)
        if rising(0.0) < 0:
            share = brentq(rising, 0.0, most / weight, xtol=_CLOSE)
    asked = np.array([share, 0.0, 0.0, 0.0])
    if np.abs(missing(asked)).max() > _CLOSE:
        asked = least_squares(missing, asked).x
    less = asked - [_SLOPE_SHARE * asked[0], 0.0, 0.0, 0.0]
    gain = float((missing(asked) - missing(less))[0] / (_SLOPE_SHARE * asked[0]))
    thrust, *moments = (float(v) for v in asked * units)
    return _Hover(thrust, tuple(moments), gain if gain > 0 else 1.0)


def wrench_at_rest(vehicle: Vehicle, path: CommandPath | None, asked: np.ndarray, height_m: float) -> np.ndarray:
    """Upward force, N, and moments, N m, (4,), on the level vehicle at rest where a believed wrench (4,) is asked for.

    They are the accelerations times the believed mass and inertia.
    """
    command = np.sqrt(np.maximum(allocation_matrix(vehicle) @ asked, 0.0))
    limits = vehicle.rotor_speed_limits_rad_s or (0.0, np.inf)
    return wrench_of_command(vehicle, path, np.clip(command, *limits), height_m)


def wrench_of_command(vehicle: Vehicle, path: CommandPath | None, command: np.ndarray, height_m: float) -> np.ndarray:
    """The same where rotor speeds (k,), rad/s, are commanded."""
    command, limits = command[None], vehicle.rotor_speed_limits_rad_s or (0.0, np.inf)
    speed = command if path is None else np.clip(path.steady(command), *limits)
    every = active_forms(vehicle)
    instant = fast.kernels_of([pair for pair in every if not pair[0].memory], vehicle)
    level = np.concatenate([np.zeros(3), [1.0], np.zeros(9), speed[0]])[None]
    flown = fast.fly(body_of(vehicle), instant, level, 0, 1.0, speed, ground_z_m=height_m)
    turning, specific_force = np.split(flown.accelerations[0, 0], 2)
    up = -vehicle.mass_kg * specific_force[2]
    moments = turning @ vehicle.inertia_kg_m2.matrix().T
    time_s = np.linspace(0.0, _HUNG_S, _HUNG_SAMPLES)
    hanging = Motion(
        rotor_speed=np.repeat(speed, len(time_s), axis=0),
        angular_velocity=np.zeros((len(time_s), 3)),
        angular_acceleration=np.zeros((len(time_s), 3)),
        specific_force=np.repeat([[0.0, 0.0, -vehicle.gravity_m_s2]], len(time_s), axis=0),
        time_s=time_s,
        rotation=np.repeat(np.eye(3)[None], len(time_s), axis=0),
        velocity=np.zeros((len(time_s), 3)),
        position=np.zeros((len(time_s), 3)),
        rotor_acceleration=np.zeros((len(time_s), vehicle.rotor_count)),
        height=np.full(len(time_s), height_m),
    )
    for form, values in every:
        if form.memory and (added := form.contribution(hanging, vehicle, values)).force is not None:
            up -= added.force[:, 2].mean()
    return np.array([up, *moments])
