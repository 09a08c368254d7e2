"""Simulation run forward in short windows, each restarted from the recording, all windows at once.

A prediction over windows shows what a model is worth without letting its errors pile up over a whole flight.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rotorid.effects.contract import Form
from rotorid.effects.instant import body_of
from rotorid.errors import InputError
from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle import fast
from rotorid.vehicle.attitude import normalised

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
) -> Windows:
    """Predict every window of a recording from its start state and the measured rotor speeds.

    `recorded` holds the recorded states at the n samples; where velocity or attitude is missing (None) only
    what does not hang on it is simulated. `effects` are forms with their parameter values; what they add to
    sensor readings is not part of the motion and is left out. `sample` (w, m) takes windows planned before
    (then `window_s` and `step_s` are not used). InputError where an effect needs what is not there.
    """
    time_s = np.asarray(time_s, float)
    if sample is None:
        sample = plan_windows(time_s, window_s, step_s, usable(inputs, recorded))
    (w, m), first, k = sample.shape, sample[:, 0], vehicle.rotor_count
    attitude = recorded.quaternion is not None
    translation = attitude and recorded.velocity is not None
    given = _given(vehicle, effects, time_s, inputs)
    height_offset = _height_offset(vehicle, inputs.height, recorded, first) if translation else None
    known = {"rotation"} if attitude else set()
    known |= {"velocity"} if translation else set()
    known |= {"height"} if height_offset is not None else set()
    if memory := [form.name for form, _ in effects if form.memory]:
        raise InputError(f"effect form {memory[0]!r} has a memory of its own: give its wrench in inputs.force")
    fast.check_effects(effects, known | given.keys())
    start = [recorded.angular_velocity[first]]
    if attitude:
        start.append(normalised(recorded.quaternion[first]))
    if translation:
        start.append(recorded.velocity[first])
        start.append(np.zeros((w, 3)) if recorded.position is None else recorded.position[first])
    driven = [
        _with_halves(given[name], time_s, sample) if name in given else np.zeros((w, 2 * m - 1, axes))
        for name, axes in (("rotor_speed", k), ("rotor_acceleration", k), ("wind", 3), ("push", 6))
    ]
    out = fast.fly_windows(
        body_of(vehicle),
        fast.kernels_of(effects, vehicle),
        np.concatenate(start, axis=1),
        time_s[sample],
        *driven,
        np.full(w, np.nan) if height_offset is None else height_offset,
    )
    predicted = States(
        angular_velocity=out[..., 0:3],
        quaternion=out[..., 3:7] if attitude else None,
        velocity=out[..., 7:10] if translation else None,
        position=out[..., 10:13] if translation and recorded.position is not None else None,
    )
    return Windows(sample, predicted)


def _given(vehicle: Vehicle, effects, time_s: np.ndarray, inputs: Inputs) -> dict[str, np.ndarray]:
    """What is given at every sample, (n, ...), by name; force and moment together as a push (n, 6)."""
    n = len(time_s)
    if inputs.rotor_speed.shape != (n, vehicle.rotor_count):
        raise InputError(f"rotor_speed has shape {inputs.rotor_speed.shape}, expected ({n}, {vehicle.rotor_count})")
    acceleration = inputs.rotor_acceleration
    if acceleration is None and any("rotor_acceleration" in form.requires for form, _ in effects):
        acceleration = np.gradient(inputs.rotor_speed, time_s, axis=0)
    push = None
    if inputs.force is not None or inputs.moment is not None:
        push = np.hstack([np.zeros((n, 3)) if one is None else one for one in (inputs.force, inputs.moment)])
    wind = None if inputs.wind is None else np.broadcast_to(np.asarray(inputs.wind, float), (n, 3))
    found = {
        "rotor_speed": inputs.rotor_speed,
        "rotor_acceleration": acceleration,
        "voltage": inputs.voltage,
        "wind": wind,
        "push": push,
    }
    return {name: values for name, values in found.items() if values is not None}


def _height_offset(vehicle: Vehicle, height, recorded: States, first: np.ndarray) -> np.ndarray | None:
    """Height plus world z of the simulated position, (w,), m; None where no height can be had."""
    if height is not None:
        return height[first] + (0.0 if recorded.position is None else recorded.position[first, 2])
    if vehicle.ground_z_m is not None and recorded.position is not None:
        return np.full(len(first), vehicle.ground_z_m)
    return None


def usable(inputs: Inputs, recorded: States) -> np.ndarray:
    """Samples at which every input and state that is there has a value, (n,)."""
    good = np.isfinite(inputs.rotor_speed).all(axis=1)
    fields = (inputs.rotor_acceleration, inputs.height, inputs.voltage, inputs.force, inputs.moment, inputs.wind)
    for values in (*fields, *vars(recorded).values()):
        if values is not None and len(values) == len(good):
            good &= np.isfinite(values.reshape(len(good), -1)).all(axis=1)
    return good


def _with_halves(values: np.ndarray, time_s: np.ndarray, sample: np.ndarray) -> np.ndarray:
    """Values at window samples and half way between them, (w, 2 m - 1, ...), of values (n, ...).

    Half way the recorded sample where one lies there, else the cubic through the four nearest samples (a straight line
    would lose a share (2π f dt)²/12 of a signal at frequency f); linear at the ends and where samples are uneven.
    """
    out = np.empty((len(sample), 2 * sample.shape[1] - 1, *values.shape[1:]))
    out[:, ::2] = values[sample]
    first, last = sample[:, :-1], sample[:, 1:]
    stride = int(last.flat[0] - first.flat[0]) if sample.size > 1 else 1
    if stride % 2 == 0:
        out[:, 1::2] = values[first + stride // 2]
        return out
    left, right = (first + last) // 2, (first + last + 1) // 2
    before, after = np.maximum(left - 1, 0), np.minimum(right + 1, len(values) - 1)
    linear = 0.5 * (values[left] + values[right])
    bend = (values[left] + values[right] - values[before] - values[after]) / 16.0
    gap = time_s[right] - time_s[left]
    even = (np.abs(time_s[left] - time_s[before] - gap) < 0.1 * gap) & (
        np.abs(time_s[after] - time_s[right] - gap) < 0.1 * gap
    )
    out[:, 1::2] = linear + np.where(even.reshape(even.shape + (1,) * (values.ndim - 1)), bend, 0.0)
    return out
