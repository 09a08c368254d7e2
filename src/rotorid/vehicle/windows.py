"""Simulation run forward in short windows, each restarted from the recording, all windows at once.

A prediction over windows shows what a model is worth without letting its errors pile up over a whole flight.
They fly compiled where every effect has a kernel, else all together by array code; a test holds that both give the
same numbers.

Integration in time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from rotorid.effects.contract import Form
from rotorid.errors import InputError
from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle import fast
from rotorid.vehicle.attitude import normalised, quaternion_rate, rotation_from_quaternion
from rotorid.vehicle.dynamics import Dynamics, check_effects, has_memory
from rotorid.vehicle.kernels import body_of, kernels_of

_LONGEST_STEP_S = 0.01


@dataclass(frozen=True)
class States:
    """States of a batch; None where unknown. Leading axes are free, NaN marks missing samples."""

    angular_velocity: np.ndarray
    """Body rates, (..., 3), rad/s, body axes."""
    quaternion: np.ndarray | None = None
    """Attitude, (..., 4), scalar first, body to world."""
    velocity: np.ndarray | None = None
    """Velocity over ground, (..., 3), m/s, world axes."""
    position: np.ndarray | None = None
    """Position, (..., 3), m, world axes."""


@dataclass(frozen=True)
class Inputs:
    """What drives the simulation, at the n samples of the recording."""

    rotor_speed: np.ndarray
    """(n, k), rad/s."""
    rotor_acceleration: np.ndarray | None = None
    """(n, k), rad/s2; None takes central differences of the speeds."""
    height: np.ndarray | None = None
    """Height above ground, (n,), m: only its value at a window's start is used. None takes it from the
    position and the vehicle's `ground_z_m`."""
    voltage: np.ndarray | None = None
    """Battery voltage, (n,), V."""
    wind: np.ndarray | None = None
    """Velocity of the air over ground, (3,) or (n, 3), m/s, world axes; None for still air."""
    force: np.ndarray | None = None
    """Further force, (n, 3), N, body axes (say of a form with memory, evaluated beforehand)."""
    moment: np.ndarray | None = None
    """Further moment, (n, 3), N m, body axes."""


@dataclass(frozen=True)
class Windows:
    """Predictions of w windows with m samples each, the first sample being the restart itself."""

    sample: np.ndarray
    """Index of each sample into the recording, (w, m)."""
    predicted: States
    """Fields (w, m, ...); None where the recording did not allow it."""


def plan_windows(
    time_s: np.ndarray, window_s: float, step_s: float | None = None, usable: np.ndarray | None = None
) -> np.ndarray:
    """Samples of consecutive windows, (w, m).

    `step_s` is the longest integration step (default 10 ms, or a sample where that is longer): samples in
    between are passed over. `usable` (n,) marks samples that a window may hold; windows over a gap in time or
    an unusable sample are left out.
    """
    time_s = np.asarray(time_s, float)
    if len(time_s) < 2:
        raise InputError(f"a window needs at least 2 samples, the recording has {len(time_s)}")
    dt = np.diff(time_s)
    if not np.all(dt > 0):
        raise InputError("time_s must be strictly increasing")
    period = float(np.median(dt))
    longest = max(_LONGEST_STEP_S if step_s is None else step_s, period)
    stride = max(int(longest / period + 1e-6), 1)
    steps = max(int(round(window_s / (stride * period))), 1)
    length = steps * stride
    starts = np.arange(0, len(time_s) - length, length)
    sample = starts[:, None] + stride * np.arange(steps + 1)
    good = np.ones(len(time_s), bool) if usable is None else np.asarray(usable, bool)
    bad_before = np.concatenate([[0], np.cumsum(~good)])
    gap_before = np.concatenate([[0], np.cumsum(dt > 2.5 * period)])
    last = starts + length
    keep = (bad_before[last + 1] == bad_before[starts]) & (gap_before[last] == gap_before[starts])
    return sample[keep]


def simulate_windows(
    vehicle: Vehicle,
    effects: Sequence[tuple[Form, Sequence[float]]],
    time_s: np.ndarray,
    inputs: Inputs,
    recorded: States,
    window_s: float = 0.5,
    step_s: float | None = None,
    sample: np.ndarray | None = None,
    compiled: bool = True,
) -> Windows:
    """Predict every window of a recording from its start state and the measured rotor speeds.

    `recorded` holds the recorded states at the n samples; where velocity or attitude is missing (None) only
    what does not hang on it is simulated. `effects` are forms with their parameter values; what they add to
    sensor readings is not part of the motion and is left out. `sample` (w, m) takes windows planned before
    (then `window_s` and `step_s` are not used). `compiled` False flies by array code whatever could be flown compiled.
    InputError where an effect needs what is not there.
    """
    time_s = np.asarray(time_s, float)
    if sample is None:
        sample = plan_windows(time_s, window_s, step_s, usable(inputs, recorded))
    flight = _WindowsFlight(vehicle, effects, time_s, inputs, recorded, sample)
    kernels = kernels_of(effects, vehicle) if compiled else None
    if kernels is not None:
        return Windows(sample, flight.states(flight.compiled(kernels)))
    w, m = sample.shape
    state = flight.start()
    flight.settle(state)
    out = np.empty((m, w, state.shape[1]))
    out[0] = state
    for j in range(m - 1):
        step = (time_s[sample[:, j + 1]] - time_s[sample[:, j]])[:, None]
        flight.enter(j)
        state = rk4_step(flight.derivative, 0.0, state, step)
        if flight.attitude:
            state[:, 3:7] = normalised(state[:, 3:7])
        out[j + 1] = state
    return Windows(sample, flight.states(np.moveaxis(out, 0, 1)))


def usable(inputs: Inputs, recorded: States) -> np.ndarray:
    """Samples at which every input and state that is there has a value, (n,)."""
    good = np.isfinite(inputs.rotor_speed).all(axis=1)
    fields = (
        inputs.rotor_acceleration,
        inputs.height,
        inputs.voltage,
        inputs.force,
        inputs.moment,
        inputs.wind,
    )
    for values in (*fields, *vars(recorded).values()):
        if values is not None and len(values) == len(good):
            good &= np.isfinite(values.reshape(len(good), -1)).all(axis=1)
    return good


def halfway(values: np.ndarray, time_s: np.ndarray, sample: np.ndarray) -> np.ndarray:
    """Values half way between successive window samples, (w, m - 1, ...), of values (n, ...).

    The recorded sample where one lies there, else the cubic through the four nearest samples (a straight line
    would lose a share (2π f dt)²/12 of a signal at frequency f); linear at the ends and where samples are
    uneven.
    """
    first, last = sample[:, :-1], sample[:, 1:]
    stride = int(last.flat[0] - first.flat[0]) if sample.size > 1 else 1
    if stride % 2 == 0:
        return values[first + stride // 2]
    left, right = (first + last) // 2, (first + last + 1) // 2
    before, after = np.maximum(left - 1, 0), np.minimum(right + 1, len(values) - 1)
    linear = 0.5 * (values[left] + values[right])
    bend = (values[left] + values[right] - values[before] - values[after]) / 16.0
    gap = time_s[right] - time_s[left]
    even = (np.abs(time_s[left] - time_s[before] - gap) < 0.1 * gap) & (
        np.abs(time_s[after] - time_s[right] - gap) < 0.1 * gap
    )
    return linear + np.where(even.reshape(even.shape + (1,) * (values.ndim - 1)), bend, 0.0)


class _WindowsFlight:
    """Derivative of the state of all windows.

    State columns: rates 0:3, quaternion 3:7, velocity 7:10, position 10:13 (as far as they can be simulated).
    """

    def __init__(self, vehicle, effects, time_s, inputs: Inputs, recorded: States, sample):
        self.vehicle = vehicle
        self.dynamics = Dynamics(vehicle, effects, len(sample))
        self.sample = sample
        self.time_s = time_s
        self.recorded = recorded
        self.attitude = recorded.quaternion is not None
        self.translation = self.attitude and recorded.velocity is not None
        self.inputs = self._inputs_at_samples(inputs)
        self._check_effects(effects)

    def _inputs_at_samples(self, inputs: Inputs) -> dict[str, np.ndarray]:
        """Inputs at the windows' samples, each (w, m, ...)."""
        n, k = inputs.rotor_speed.shape
        if n != len(self.time_s) or k != self.vehicle.rotor_count:
            raise InputError(
                f"rotor_speed has shape {inputs.rotor_speed.shape}, "
                f"expected ({len(self.time_s)}, {self.vehicle.rotor_count})"
            )
        acceleration = inputs.rotor_acceleration
        if acceleration is None and any("rotor_acceleration" in form.requires for form, _ in self.dynamics.effects):
            acceleration = np.gradient(inputs.rotor_speed, self.time_s, axis=0)
        wind = inputs.wind
        if wind is not None:
            wind = np.broadcast_to(np.asarray(wind, float), (n, 3))
        given = {
            "rotor_speed": inputs.rotor_speed,
            "rotor_acceleration": acceleration,
            "voltage": inputs.voltage,
            "wind": wind,
            "force": inputs.force,
            "moment": inputs.moment,
        }
        first = self.sample[:, 0]
        self.height_offset = self._height_offset(inputs.height, first)
        given = {name: values for name, values in given.items() if values is not None}
        self.halfway = {name: halfway(values, self.time_s, self.sample) for name, values in given.items()}
        return {name: values[self.sample] for name, values in given.items()}

    def _height_offset(self, height, first) -> np.ndarray | None:
        """Height plus world z of the simulated position, (w,), m; None where no height can be had."""
        if not self.translation:
            return None
        z = 0.0 if self.recorded.position is None else self.recorded.position[first, 2]
        if height is not None:
            return height[first] + z
        if self.vehicle.ground_z_m is not None and self.recorded.position is not None:
            return np.full(len(first), self.vehicle.ground_z_m)
        return None

    def _check_effects(self, effects) -> None:
        for form, _ in effects:
            if has_memory(form):
                raise InputError(f"effect form {form.name!r} has a memory of its own: give its wrench in inputs.force")
        known = {"rotation"} if self.attitude else set()
        known |= {"velocity"} if self.translation else set()
        known |= {"height"} if self.height_offset is not None else set()
        check_effects(effects, known | self.inputs.keys())

    def start(self) -> np.ndarray:
        """States at the windows' starts, (w, 3, 7 or 13)."""
        first = self.sample[:, 0]
        columns = [self.recorded.angular_velocity[first]]
        if self.attitude:
            columns.append(normalised(self.recorded.quaternion[first]))
        if self.translation:
            columns.append(self.recorded.velocity[first])
            position = self.recorded.position
            columns.append(np.zeros((len(first), 3)) if position is None else position[first])
        return np.concatenate(columns, axis=1)

    def settle(self, state: np.ndarray) -> None:
        """Let the accelerations that effects depend on settle before the first step."""
        if self.dynamics.effects:
            self.enter(0)
            for _ in range(3):
                self.derivative(0.0, state)

    def compiled(self, kernels) -> np.ndarray:
        """States (w, m, 3, 7 or 13) of all windows, by compiled code."""
        w, m = self.sample.shape
        pairs = {}
        for name, axes in (("rotor_speed", None), ("rotor_acceleration", None), ("wind", 3)):
            none = np.zeros((0, m, axes or self.vehicle.rotor_count))
            pairs[name] = (self.inputs.get(name, none), self.halfway.get(name, none))
        push, push_between = (
            np.concatenate([one.get(name, np.zeros((w, count, 3))) for name in ("force", "moment")], axis=2)
            if "force" in one or "moment" in one
            else np.zeros((0, m, 6))
            for one, count in ((self.inputs, m), (self.halfway, m - 1))
        )
        return fast.fly_windows(
            body_of(self.vehicle),
            kernels,
            self.start(),
            self.time_s[self.sample],
            *pairs["rotor_speed"],
            *pairs["rotor_acceleration"],
            *pairs["wind"],
            push,
            push_between,
            np.full(w, np.nan) if self.height_offset is None else self.height_offset,
        )

    def enter(self, j: int) -> None:
        """Go to the step from sample j to j + 1."""
        last = min(j + 1, self.sample.shape[1] - 1)
        self.begin = {name: values[:, j] for name, values in self.inputs.items()}
        self.end = {name: values[:, last] for name, values in self.inputs.items()}
        self.middle = {name: values[:, min(j, values.shape[1] - 1)] for name, values in self.halfway.items()}
        self.step_time = (self.time_s[self.sample[:, j]], self.time_s[self.sample[:, last]])

    def derivative(self, share: float, state: np.ndarray) -> np.ndarray:
        now = self.begin if share == 0.0 else self.middle if share == 0.5 else self.end
        rates = state[:, 0:3]
        rotation = rotation_from_quaternion(state[:, 3:7]) if self.attitude else None
        around = self._surroundings(share, state, rotation, now) if self.dynamics.effects else {}
        out = np.empty_like(state)
        out[:, 0:3], specific_force = self.dynamics.accelerations(
            rates, now["rotor_speed"], around, now.get("force"), now.get("moment")
        )
        if self.attitude:
            out[:, 3:7] = quaternion_rate(state[:, 3:7], rates)
        if self.translation:
            out[:, 7:10] = np.einsum("nij,nj->ni", rotation, specific_force)
            out[:, 9] += self.dynamics.body.gravity_m_s2
            out[:, 10:13] = state[:, 7:10]
        return out

    def _surroundings(self, share, state, rotation, now) -> dict[str, np.ndarray | None]:
        begin, end = self.step_time
        velocity = height = None
        if self.translation:
            velocity = np.einsum("nji,nj->ni", rotation, state[:, 7:10])
        if self.height_offset is not None:
            height = self.height_offset - state[:, 12]
        return dict(
            time_s=begin + share * (end - begin),
            rotor_acceleration=now.get("rotor_acceleration"),
            rotation=rotation,
            velocity=velocity,
            wind=now.get("wind"),
            height=height,
            voltage=now.get("voltage"),
        )

    def states(self, out: np.ndarray) -> States:
        """Predictions (w, m, columns) by name."""
        return States(
            angular_velocity=out[..., 0:3],
            quaternion=out[..., 3:7] if self.attitude else None,
            velocity=out[..., 7:10] if self.translation else None,
            position=out[..., 10:13] if self.translation and self.recorded.position is not None else None,
        )


def rk4_step(
    derivative: Callable[[float, np.ndarray], np.ndarray], share: float, state: np.ndarray, step_s
) -> np.ndarray:
    """One step of the classical Runge-Kutta method (fourth order).

    `derivative(share, state)` is evaluated at the beginning, middle and end of the step: `share` counts
    steps, so that inputs known at samples can be read by index. `step_s` is a number or an array that
    broadcasts with `state`.
    """
    k1 = derivative(share, state)
    k2 = derivative(share + 0.5, state + (0.5 * step_s) * k1)
    k3 = derivative(share + 0.5, state + (0.5 * step_s) * k2)
    k4 = derivative(share + 1.0, state + step_s * k3)
    return state + (step_s / 6.0) * (k1 + 2 * (k2 + k3) + k4)
