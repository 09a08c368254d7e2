"""PID attitude control (thesis eqs 4.29, 4.30, table 4.2), what it follows, and swings for a first look at a vehicle.

The pilot of these flights knows the believed vehicle alone. As a pilot does, he finds the throttle that carries what he
flies, and turns his gains down where the rotors answer more strongly or later than believed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from rotorid.effects.contract import DELAY, LAG
from rotorid.errors import InputError
from rotorid.recordings import RecordingSet, Run
from rotorid.recordings import columns as c
from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle.fast import AttitudeLoop
from rotorid.vehicle.improved import (
    active_speed_forms,
    all_forms,
    command_path,
    flyable,
    hover,
    record_as_stated,
    simulate_as_stated,
)
from rotorid.vehicle.mixer import allocation_matrix
from rotorid.vehicle.simulator import Start, WhiteNoise

_STIFFNESS_RAD_S, _DAMPING = 10.0, 0.8
"""Natural frequency and damping of the attitude loop that flies the vehicle."""
_DERIVATIVE_S = 0.02
"""Time over which the pilot's rate of turn is smoothed."""
_LATE_RAD = 0.4
"""Natural frequency times all that comes late, at most: at the crossover of such a loop, twice the natural frequency,
this leaves half of its phase margin of about 70 degrees."""
_MEAN_TILT_COSINE = 0.96
"""Of the swings, roughly."""
SECONDS, FLIGHTS, SEED = 20.0, 2, 1
"""The flights that `rotorid simulate` makes by default, and that a vehicle must stand to be delivered."""
_YAW_SHARE = 0.6
"""Of what each rotor may turn faster or slower than in hover, by its square: what the yaw may ask for.

A yaw that asks for all that the rotors can do leaves nothing to hold roll and pitch: such a pilot turns a sound vehicle
over.
"""
_LEAST_ROOM = 0.05
"""Of the square of the hover's speed: below it a vehicle that is at its limit could not be steered at all."""
START_HEIGHT_M = 100.0
"""Above the ground at the start: out of its effect, and in the air until the end though nobody holds the height."""


def remarks(vehicle: Vehicle) -> tuple[str, ...]:
    """What `swings` flies otherwise than the file says, a sentence each; InputError for what does not fly."""
    flown, said = flyable(vehicle)
    said += tuple(_beyond_their_bounds(flown))
    found = hover(flown, command_path(flown), START_HEIGHT_M)
    if found.supported < 1:
        share = 100 * max(found.supported, 0.0)
        said += (f"The vehicle sinks: all that its rotors can do carries {share:.0f} % of what hover needs.",)
    return said


def _beyond_their_bounds(vehicle: Vehicle) -> Iterator[str]:
    """A sentence for each parameter of an effect that lies beyond the bounds of its entry in the catalogue."""
    digits = 1e-5  # Share of a bound by which a value that lies on it may pass it as a file states it.
    for entry, (form, values) in zip(vehicle.effects, all_forms(vehicle), strict=True):
        for p, value in zip(form.parameters, values, strict=True):
            if p.low - digits * abs(p.low) <= value <= p.high + digits * abs(p.high):
                continue
            bound = f"at least {p.low:.3g}" if value < p.low else f"at most {p.high:.3g}"
            yield (
                f"The {p.symbol} of {entry['id']} ({form.name}) is {value:.4g}, beyond what its entry of the catalogue "
                f"takes for possible ({bound}): look for a wrong unit or decimal point; it is flown all the same."
            )


def swings(vehicle: Vehicle, name: str, seconds: float, flights: int, seed: int, every: int = 2) -> RecordingSet:
    """`flights` simulated flights of a vehicle with the effects that it states, as noisy sensors record them.

    Every how many steps of 2 ms a sample is kept is `every`. The set's vehicle is the one without the effects.
    InputError for what does not fly, or where a number makes no flight.
    """
    if not seconds > 0 or flights < 1:
        raise InputError("seconds must be more than 0 and flights at least 1")
    vehicle, _ = flyable(vehicle)
    steady = hover(vehicle, command_path(vehicle), START_HEIGHT_M)
    late_s = sum(float(max(values)) for form, values in active_speed_forms(vehicle) if form.stage in (DELAY, LAG))
    stiffness = min(_STIFFNESS_RAD_S, _LATE_RAD / (_DERIVATIVE_S + late_s))
    # Tilted by the swings a vehicle needs a little more than level.
    tilted = (1 / _MEAN_TILT_COSINE - 1) * vehicle.mass_kg * vehicle.gravity_m_s2
    thrust_n = steady.thrust_n + tilted / steady.gain
    j = np.diag(vehicle.inertia_kg_m2.matrix()) / steady.gain
    gains = (j * stiffness**2, np.zeros(3), 2 * _DAMPING * stiffness * j)
    most = (np.inf, np.inf, _most_yaw_n_m(vehicle, np.array([thrust_n, *steady.moments_n_m])))
    noise = WhiteNoise(
        angular_velocity_rad_s=0.01,
        specific_force_m_s2=0.1,
        velocity_m_s=0.02,
        position_m=0.01,
        rotor_speed_relative=0.003,
    )
    start = np.zeros((flights, 3))
    if vehicle.ground_z_m is not None:
        start[:, 2] = vehicle.ground_z_m - START_HEIGHT_M
    drawn = [np.random.default_rng([seed, number]) for number in range(flights)]
    phases = np.array([rng.uniform(0, 2 * np.pi, 3) for rng in drawn])
    slow, middle, fast, sizes = np.array([[0.9, 0.7, 0.5], [3.1, 3.7, 1.3], [9.1, 11.3, 7.1], [0.25, 0.25, 0.4]])

    def wanted(t: float | np.ndarray) -> np.ndarray:
        """Angles of all flights, (flights, 3), or at instants (m,) (flights, m, 3)."""
        t = np.asarray(t)[..., None]
        phase = phases.reshape(flights, *[1] * (t.ndim - 1), 3)
        swing = np.sin(slow * t + phase) + 0.5 * np.sin(middle * t)
        return sizes * (swing + 0.3 * np.sin(fast * t + phase[..., ::-1]))

    reference = AttitudeReference("swings", thrust_n, wanted, at_once=True)
    pilot = AttitudePid(vehicle, reference, gains, _DERIVATIVE_S, most, steady.moments_n_m)
    trace = simulate_as_stated(vehicle, pilot, seconds, 0.002, start=Start(position_m=start))
    runs: list[Run] = []
    believed = vehicle
    for number, rng in enumerate(drawn):
        made = record_as_stated(trace, vehicle, f"flight_{number + 1}", noise, rng, number, every)
        believed = made.vehicle
        runs += made.runs
    return RecordingSet(name, believed, tuple(runs))


def _most_yaw_n_m(vehicle: Vehicle, hovering: np.ndarray) -> float:
    """Yaw moment, N m, that the pilot asks for at most, beyond the wrench (4,) of the hover."""
    asked, yaw = allocation_matrix(vehicle) @ hovering, allocation_matrix(vehicle)[:, 3]
    limits = vehicle.rotor_speed_limits_rad_s
    room = asked if limits is None else np.minimum(asked - limits[0] ** 2, limits[1] ** 2 - asked)
    room = np.maximum(room, _LEAST_ROOM * asked.mean())
    return float(_YAW_SHARE * (room / np.abs(yaw)).min())


def turned_over(recordings: RecordingSet) -> tuple[str, ...]:
    """A sentence where a vehicle that nothing held upright turned over, by the attitude that was recorded."""
    names = []
    for run in recordings.runs:
        _, x, y, _ = run.array(c.QUATERNION).T
        if (2 * (x**2 + y**2) > 1.0).any():  # 1 − 2 (x² + y²) is the cosine of the tilt
            names.append(run.name)
    if not names:
        return ()
    return (f"The vehicle turned over in {', '.join(names)}: its attitude controller does not hold it.",)


Gains = Sequence[Sequence[float]]
"""Proportional, integral and derivative gains about roll, pitch and yaw, (3, 3): N m/rad, N m/(rad s), N m s/rad."""
THESIS_GAINS: Gains = ((0.2, 0.2, 4.0), (3.0, 3.0, 0.1), (0.1, 0.1, 0.1))
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
            *(np.asarray(g) for g in self.gains),
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
        four = np.pi / 45
        return np.array([four * np.sin(10 * t), four * np.sin(10 * t + np.pi / 2), 2 * four * np.sin(2 * t)])

    return AttitudeReference("eq. 4.81", thrust_n, euler)
