"""The general simulator: vehicles with motors, effects, disturbances, sensors and a controller, n at a time.

Rigid body by quaternion inside, Euler angles outside. The controller and the disturbance are held over each
step; the motion between is integrated by the classical Runge-Kutta method (`rotorid.vehicle.fast`), as a whole where
commands or the controller's plan are known beforehand. Commands that only a call can give, and what lies between
command and rotor speed (`CommandPath`), are flown a step at a time. Tests hold that both fly alike.
"""

from __future__ import annotations

import copy
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Protocol

import numpy as np
import pandas as pd

from rotorid.effects.contract import DELAY, LAG, Form, Motion, SpeedForm, SpeedPath
from rotorid.effects.instant import body_of
from rotorid.errors import InputError
from rotorid.recordings import Run
from rotorid.recordings import columns as c
from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle import fast
from rotorid.vehicle.attitude import (
    euler_from_quaternion,
    normalised,
    quaternion_from_euler,
    quaternion_rate,
    rotation_from_quaternion,
)
from rotorid.vehicle.fast import Trace

_MEMORY_ROUNDS = 12
"""Flights simulated in a row, at most, where an effect has a memory of its own; each takes its wrench from the last."""
_MEMORY_SETTLED = 1e-7
"""Change of that wrench, as a share of its largest, at which it has settled."""


class Controller(Protocol):
    """Anything that turns time and measured attitude into rotor commands.

    One that is an attitude loop has `attitude_loop(time_s)` in place of `rotor_command`: it lays itself out for the
    instants (m,), s, of a whole flight as a `rotorid.vehicle.fast.AttitudeLoop`.
    """

    def rotor_command(self, time_s: float, euler_rad: np.ndarray) -> np.ndarray:
        """Commanded rotor speeds (n, k), rad/s, from attitudes (n, 3), rad."""


@dataclass(frozen=True)
class Commands:
    """A controller that plays commanded rotor speeds (m, k), rad/s, each held until the next time (m,), s.

    `rotor_acceleration` (m, k), rad/s2, is what effects are given where the motors follow at once; None for zero.
    """

    time_s: np.ndarray
    rotor_speed: np.ndarray
    rotor_acceleration: np.ndarray | None = None

    def rotor_command(self, time_s: float, euler_rad: np.ndarray) -> np.ndarray:
        return np.broadcast_to(self.rotor_speed[self.index(time_s)], (len(euler_rad), self.rotor_speed.shape[1]))

    def acceleration(self, time_s: float) -> np.ndarray | float:
        """Rotor accelerations (k,), rad/s2, that go with the commands."""
        return 0.0 if self.rotor_acceleration is None else self.rotor_acceleration[self.index(time_s)]

    def index(self, time_s: float | np.ndarray) -> np.ndarray:
        """Which command holds at a time, or at each of several, s."""
        return np.maximum(np.searchsorted(self.time_s, np.asarray(time_s) + 1e-9, side="right") - 1, 0)


@dataclass(frozen=True)
class Motors:
    """First-order lag of the rotor speeds behind their commands; 0 follows at once."""

    time_up_s: float = 0.0
    time_down_s: float | None = None
    limits_rad_s: tuple[float, float] | None = None


@dataclass(frozen=True)
class Disturbance:
    """Random force and moment on the airframe: Gauss-Markov, one sigma and correlation time."""

    force_n: float = 0.0
    moment_n_m: float = 0.0
    correlation_s: float = 0.0


@dataclass(frozen=True)
class WhiteNoise:
    """One sigma of white noise on each reading; 0 reads the truth."""

    attitude_rad: float = 0.0
    angular_velocity_rad_s: float = 0.0
    specific_force_m_s2: float = 0.0
    velocity_m_s: float = 0.0
    position_m: float = 0.0
    rotor_speed_relative: float = 0.0


@dataclass(frozen=True)
class Start:
    """States at the beginning, each (n, ...); the attitude as Euler angles, rad."""

    position_m: np.ndarray = field(default_factory=lambda: np.zeros((1, 3)))
    velocity_m_s: np.ndarray = field(default_factory=lambda: np.zeros((1, 3)))
    euler_rad: np.ndarray = field(default_factory=lambda: np.zeros((1, 3)))
    angular_velocity_rad_s: np.ndarray = field(default_factory=lambda: np.zeros((1, 3)))
    rotor_speed_rad_s: np.ndarray | None = None
    """(n, k); None starts at the first command."""

    @property
    def size(self) -> int:
        return len(self.position_m)


@dataclass(frozen=True)
class CommandPath:
    """From command to rotor speed one step at a time, for flights whose commands nobody knows beforehand.

    Under a controller the next command hangs on the flight so far, so that speed forms cannot be given the whole
    series. Each is applied to the shortest series that has its law in it: a static one to the command of the instant, a
    lag to a held command over one step; a delay keeps what was asked before. The speeds are those that
    `rotorid.vehicle.improved.speeds_of_commands` makes of the same commands once they are known.
    """

    forms: tuple[tuple[SpeedForm, np.ndarray], ...]
    """In the order in which they act, with their values."""
    full_speed: float
    """Rotor speed of the full command, rad/s."""
    voltage: np.ndarray | None = None
    """Battery voltage at each step, (m,), V; None for the full one throughout."""
    full_voltage: float = 1.0
    """Voltage at which commands are right, V."""

    def steady(self, command: np.ndarray) -> np.ndarray:
        """Rotor speeds (..., k), rad/s, that commands (..., k) lead to when they are held, at the first voltage."""
        speed = np.asarray(command, float)
        for form, values in self.forms:
            if form.stage < DELAY:
                speed = self.static(form, values, speed, 0, 0.0)
        return speed

    def static(self, form: SpeedForm, values: np.ndarray, speed: np.ndarray, step: int, time_s: float) -> np.ndarray:
        """What a form without memory makes of speeds (..., k) that hold from the start of the run until a time."""
        voltage = np.full(2, self.full_voltage if self.voltage is None else self.voltage[step])
        held = np.stack([speed.ravel(), speed.ravel()])
        path = SpeedPath(held, np.array([0.0, time_s]), self.full_speed, voltage, self.full_voltage)
        return form.apply(path, values)[-1].reshape(speed.shape)


class _Stepper:
    """Where a flight is on its path: call `speed` once for every step, in order."""

    def __init__(self, path: CommandPath, step_s: float, rotor_speed: np.ndarray | None) -> None:
        """A lag starts at `rotor_speed` (n, k), rad/s, if that is given."""
        self.path, self.step_s, self.rotor_speed, self.step = path, step_s, rotor_speed, 0
        # By place in the path what a delay was asked before, the latest first; speed of a lag and what it was asked.
        self._past: dict[int, deque] = {}
        self._lagging: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def speed(self, command: np.ndarray) -> np.ndarray:
        """Rotor speeds (n, k), rad/s, at this step under commands (n, k) that hold until the next."""
        speed = np.asarray(command, float)
        for place, (form, values) in enumerate(self.path.forms):
            if form.stage == DELAY:
                speed = self._delayed(place, float(values[0]) / self.step_s, speed)
            elif form.stage == LAG:
                speed = self._lagged(place, form, values, speed)
            else:
                speed = self.path.static(form, values, speed, self.step, self.step * self.step_s)
        self.step += 1
        return speed

    def _delayed(self, place: int, steps: float, asked: np.ndarray) -> np.ndarray:
        """What was asked `steps` before, between two steps the mean over a step; the first holds for all time before.

        A negative delay would need what is asked later: it is taken as none.
        """
        steps = max(steps, 0.0)
        whole = int(np.floor(steps))
        part = steps - whole
        past = self._past.setdefault(place, deque(maxlen=whole + 2))
        past.appendleft(asked)
        later, earlier = (past[min(back, len(past) - 1)] for back in (whole, whole + 1))
        return (1.0 - part) * later + part * earlier

    def _lagged(self, place: int, form: SpeedForm, values: np.ndarray, asked: np.ndarray) -> np.ndarray:
        """The lag's exact step under what was asked at the step before."""
        if place in self._lagging:
            before, held = self._lagging[place]
            # The last sample shows only where the lag is none.
            series = np.stack([before.ravel(), held.ravel(), asked.ravel()])
            path = SpeedPath(series, self.step_s * np.arange(3), self.path.full_speed)
            speed = form.apply(path, values)[-1].reshape(asked.shape)
        else:
            speed = asked if self.rotor_speed is None else np.broadcast_to(self.rotor_speed, asked.shape)
        self._lagging[place] = speed, asked
        return speed


def simulate(
    vehicle: Vehicle,
    controller: Controller,
    duration_s: float,
    step_s: float = 0.001,
    start: Start | None = None,
    motors: Motors | None = None,
    effects: Sequence[tuple[Form, Sequence[float]]] = (),
    disturbance: Disturbance | None = None,
    noise: WhiteNoise | None = None,
    rng: np.random.Generator | None = None,
    wind_m_s: np.ndarray | None = None,
    voltage_v: float | None = None,
    path: CommandPath | None = None,
) -> Trace:
    """Fly n vehicles (as many as `start` has) for `duration_s` in steps of `step_s`.

    `effects` as from `rotorid.vehicle.improved.active_forms`. `noise` reaches the controller through the
    measured attitude; readings with noise are made of the trace by `recording`. `rng` is needed with noise or
    disturbance. `wind_m_s` (3,) is the velocity of the air, world axes. Heights come from the vehicle's
    `ground_z_m`. `path` makes rotor speeds of the commands, which then hold over each step, in place of the motors'
    lag; the limits of `motors` hold for commands and for speeds.
    """
    start, motors = start or Start(), motors or Motors()
    noise, disturbance = noise or WhiteNoise(), disturbance or Disturbance()
    random = noise.attitude_rad > 0 or disturbance.force_n > 0 or disturbance.moment_n_m > 0
    if random and rng is None:
        raise InputError("a simulation with noise or disturbance needs a random generator (rng)")
    steps = int(round(duration_s / step_s))
    if steps < 1:
        raise InputError(f"duration_s {duration_s} is shorter than one step of {step_s} s")
    instant = [(form, values) for form, values in effects if not form.memory]
    slow = [(form, values) for form, values in effects if form.memory]
    known = {"rotation", "velocity", "position", "rotor_acceleration"}
    known |= {"height"} if vehicle.ground_z_m is not None else set()
    known |= {"voltage"} if voltage_v is not None else set()
    fast.check_effects(effects, known)
    pushes = _pushes(disturbance, start.size, steps, step_s, rng)
    readings = np.zeros((steps + 1, start.size, 3))
    if noise.attitude_rad > 0:
        readings = rng.normal(0.0, noise.attitude_rad, readings.shape)

    def flown(pushes: np.ndarray) -> Trace:
        # A controller may remember: each flight has a copy of its own.
        flight = _Flight(vehicle, instant, motors, start, step_s, wind_m_s, path)
        return flight.fly(copy.deepcopy(controller), pushes, readings)

    trace = flown(pushes)
    # A load as heavy as the vehicle would make plain repetition diverge: Aitken's relaxation (Küttler and Wall,
    # Computational Mechanics 43, 2008) takes the step from how the last one turned out.
    added, last, share = np.zeros_like(pushes), None, 1.0
    for _ in range(_MEMORY_ROUNDS if slow else 0):
        wrench = _wrench_of_memory(trace, vehicle, slow, wind_m_s, voltage_v)
        gap = wrench - added
        if np.abs(gap).max() <= _MEMORY_SETTLED * np.abs(wrench).max():
            break
        if last is not None:
            change = gap - last
            share *= -float((last * change).sum() / (change**2).sum())
        added, last = added + share * gap, gap
        trace = flown(pushes + added)
    return trace


def _pushes(disturbance: Disturbance, n: int, steps: int, step_s: float, rng) -> np.ndarray:
    """Force and moment of the disturbance, (steps + 1, n, 6), N and N m, body axes, held over each step."""
    out = np.zeros((steps + 1, n, 6))
    sigma = np.repeat([disturbance.force_n, disturbance.moment_n_m], 3)
    if not sigma.any():
        return out
    keep = np.exp(-step_s / disturbance.correlation_s) if disturbance.correlation_s > 0 else 0.0
    white = rng.normal(size=out.shape) * sigma
    out[0] = white[0]
    for i in range(steps):
        out[i + 1] = keep * out[i] + np.sqrt(1 - keep**2) * white[i + 1]
    return out


class _Flight:
    """One simulation: state columns rates 0:3, quaternion 3:7, velocity 7:10, position 10:13, rotors 13:."""

    def __init__(self, vehicle, effects, motors: Motors, start: Start, step_s, wind_m_s, path):
        self.vehicle, self.motors, self.step_s = vehicle, motors, step_s
        self.path = None if path is None else _Stepper(path, step_s, start.rotor_speed_rad_s)
        self.start, self.size = start, start.size
        up, down = motors.time_up_s, motors.time_down_s
        self._fly = partial(
            fast.fly,
            body_of(vehicle),
            fast.kernels_of(effects, vehicle),
            lags_s=(up, up if down is None else down),
            wind_m_s=None if wind_m_s is None else np.asarray(wind_m_s, float),
            ground_z_m=vehicle.ground_z_m,
        )

    def fly(self, controller: Controller, pushes: np.ndarray, attitude_errors: np.ndarray) -> Trace:
        """The flight under a controller, a disturbance (steps + 1, n, 6) and errors of attitude (steps + 1, n, 3)."""
        time_s, known = self.step_s * np.arange(len(pushes)), None
        if not hasattr(controller, "rotor_command"):  # an attitude loop lays itself out
            known = controller.attitude_loop(time_s)
            command = fast.commanding(known, self.size, self.step_s)
        else:
            if isinstance(controller, Commands):
                known = controller.rotor_speed[controller.index(time_s)]

            def command(j: int, states: np.ndarray, errors: np.ndarray) -> np.ndarray:
                return controller.rotor_command(time_s[j], euler_from_quaternion(states[:, 3:7]) + errors)

        if known is None or self.path is not None:
            trace = self._by_steps(controller, command, pushes, attitude_errors)
        else:
            trace = self._at_once(controller, known, command, pushes, attitude_errors)
        if not np.isfinite(trace.states).all():
            raise InputError(
                "the simulation ran away (values not finite): check gains, inertia and the size of the step"
            )
        return trace

    def _start(self) -> np.ndarray:
        """States at the beginning, (n, 13 + k), rotors at rest."""
        state = np.zeros((self.size, 13 + self.vehicle.rotor_count))
        state[:, 0:3] = self.start.angular_velocity_rad_s
        state[:, 3:7] = quaternion_from_euler(self.start.euler_rad)
        state[:, 7:10] = self.start.velocity_m_s
        state[:, 10:13] = self.start.position_m
        return state

    def _at_once(self, controller, commands, command, pushes, attitude_errors) -> Trace:
        steps, limits = len(pushes) - 1, self.motors.limits_rad_s
        state = self._start()
        if self.start.rotor_speed_rad_s is not None:
            state[:, 13:] = self.start.rotor_speed_rad_s
        else:
            first = np.asarray(command(0, state, attitude_errors[0]), float)
            state[:, 13:] = first if limits is None else np.clip(first, *limits)
        following = None
        if isinstance(controller, Commands) and controller.rotor_acceleration is not None:
            following = controller.acceleration(self.step_s * np.arange(steps + 1))
        return self._fly(
            state,
            steps,
            self.step_s,
            commands,
            limits_rad_s=limits,
            following=following,
            reading_errors=np.moveaxis(attitude_errors, 0, 1) if attitude_errors.any() else None,
            pushes=np.moveaxis(pushes, 0, 1) if pushes.any() else None,
        )

    def _by_steps(self, controller, command_at, pushes, attitude_errors) -> Trace:
        """The same a step at a time, the controller called at each."""
        steps, k = len(pushes) - 1, self.vehicle.rotor_count
        state = self._start()
        states = np.empty((steps + 1, self.size, 13 + k))
        accelerations = np.empty((steps + 1, self.size, 6))
        commands = np.empty((steps + 1, self.size, k))
        limits = self.motors.limits_rad_s
        for i in range(steps + 1):
            time_s = i * self.step_s
            command = np.asarray(command_at(i, state, attitude_errors[i]), float)
            if command.shape != (self.size, k):
                raise InputError(f"the controller gave commands {command.shape}, expected {(self.size, k)}")
            if limits is not None:
                command = np.clip(command, *limits)
            speed = command
            if self.path is not None:
                speed = self.path.speed(command)
                speed = speed if limits is None else np.clip(speed, *limits)
            if i == 0 and self.start.rotor_speed_rad_s is not None:
                state[:, 13:] = self.start.rotor_speed_rad_s
            elif i == 0 or self.motors.time_up_s == 0.0:
                state[:, 13:] = speed
            following = np.zeros((self.size, k))
            if isinstance(controller, Commands):
                following += controller.acceleration(time_s)
            elif self.path is not None and i > 0:
                following = (state[:, 13:] - states[i - 1][:, 13:]) / self.step_s
            states[i], commands[i] = state, command
            over_step, following, push = (np.repeat(v[:, None], 2, axis=1) for v in (speed, following, pushes[i]))
            flown = self._fly(state, 1, self.step_s, over_step, following=following, pushes=push, first_s=time_s)
            accelerations[i], state = flown.accelerations[:, 0], flown.states[:, 1]
        series = (np.moveaxis(values, 0, 1) for values in (states, accelerations, commands))
        return Trace(self.step_s * np.arange(steps + 1), *series)


def at_rest(vehicle: Vehicle, time_s: np.ndarray, rotor_speed: np.ndarray, height_m: float) -> Motion:
    """A level vehicle that stands in the air at instants (n,), its rotors turning at (n, k), rad/s."""
    n, still = len(time_s), np.zeros((len(time_s), 3))
    return Motion(
        time_s=time_s,
        rotor_speed=rotor_speed,
        rotor_acceleration=np.zeros((n, vehicle.rotor_count)),
        angular_velocity=still,
        angular_acceleration=still,
        specific_force=np.tile([0.0, 0.0, -vehicle.gravity_m_s2], (n, 1)),
        rotation=np.tile(np.eye(3), (n, 1, 1)),
        velocity=still,
        position=still,
        height=np.full(n, height_m),
    )


def motion_of(trace: Trace, index: int, vehicle: Vehicle, wind_m_s=None, voltage_v=None) -> Motion:
    """The true flight of one vehicle of a trace as the effects of the catalogue see it."""
    rotation = rotation_from_quaternion(trace.quaternion[index])
    ground = vehicle.ground_z_m
    return Motion(
        time_s=trace.time_s,
        rotor_speed=trace.rotor_speed[index],
        rotor_acceleration=np.gradient(trace.rotor_speed[index], trace.time_s, axis=0),
        angular_velocity=trace.angular_velocity[index],
        angular_acceleration=trace.angular_acceleration[index],
        specific_force=trace.specific_force[index],
        accelerometer=trace.specific_force[index],
        gyroscope=trace.angular_velocity[index],
        rotation=rotation,
        velocity=np.einsum("nji,nj->ni", rotation, trace.velocity[index]),
        position=trace.position[index],
        wind=None if wind_m_s is None else np.asarray(wind_m_s, float),
        height=None if ground is None else ground - trace.position[index, :, 2],
        voltage=None if voltage_v is None else np.full(len(trace.time_s), float(voltage_v)),
    )


def _wrench_of_memory(trace: Trace, vehicle: Vehicle, slow, wind_m_s, voltage_v) -> np.ndarray:
    """Wrench of the forms with memory along a trace, (m + 1, n, 6)."""
    size = len(trace.position)
    out = np.zeros((len(trace.time_s), size, 6))
    for index in range(size):
        motion = motion_of(trace, index, vehicle, wind_m_s, voltage_v)
        for form, values in slow:
            added = form.contribution(motion, vehicle, np.asarray(values, float))
            if added.force is not None:
                out[:, index, :3] += added.force
            if added.moment is not None:
                out[:, index, 3:] += added.moment
    return out


def recording(
    trace: Trace,
    vehicle: Vehicle,
    name: str,
    noise: WhiteNoise | None = None,
    rng: np.random.Generator | None = None,
    index: int = 0,
    effects: Sequence[tuple[Form, Sequence[float]]] = (),
    every: int = 1,
) -> Run:
    """What the sensors wrote of one vehicle of a trace: a run in the contract's columns, every `every`-th
    instant.

    White `noise` on each reading; `effects` that act on sensors (bias, misalignment, lever arm) are added
    first.
    """
    noise = noise or WhiteNoise()
    rng = rng or np.random.default_rng(0)
    specific_force, rates = trace.specific_force[index].copy(), trace.angular_velocity[index].copy()
    motion = motion_of(trace, index, vehicle)
    for form, values in effects:
        added = form.contribution(motion, vehicle, np.asarray(values, float))
        if added.specific_force is not None:
            specific_force += added.specific_force
        if added.angular_velocity is not None:
            rates += added.angular_velocity

    def read(values, sigma):
        values = values[::every]
        return values + rng.normal(0.0, 1.0, values.shape) * sigma

    k = vehicle.rotor_count
    speeds = read(trace.rotor_speed[index], noise.rotor_speed_relative * trace.rotor_speed[index][::every])
    euler = rng.normal(0.0, 1.0, (len(trace.time_s[::every]), 3)) * noise.attitude_rad
    quaternion = trace.quaternion[index][::every]
    quaternion = normalised(quaternion + quaternion_rate(quaternion, euler))
    columns = {
        (c.TIME,): trace.time_s[::every, None],
        c.rotor_columns("rotor_speed", k): speeds,
        c.rotor_columns("rotor_command", k): trace.rotor_command[index][::every],
        c.POSITION: read(trace.position[index], noise.position_m),
        c.VELOCITY: read(trace.velocity[index], noise.velocity_m_s),
        c.QUATERNION: quaternion,
        c.ANGULAR_VELOCITY: read(rates, noise.angular_velocity_rad_s),
        c.SPECIFIC_FORCE: read(specific_force, noise.specific_force_m_s2),
    }
    table = {n: values[:, i] for names, values in columns.items() for i, n in enumerate(names)}
    return Run(name, pd.DataFrame(table))
