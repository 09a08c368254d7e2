"""Flights and windows written down once more in numpy: what the compiled ones are compared with."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from rotorid.effects.contract import Motion
from rotorid.effects.instant import Wrench
from rotorid.vehicle import fast, simulator
from rotorid.vehicle.attitude import euler_from_quaternion, quaternion_rate, rotation_from_quaternion
from rotorid.vehicle.fast import AttitudeLoop, Kernels, Trace
from rotorid.vehicle.mixer import wrench_matrix


@contextmanager
def by_numpy(vehicle) -> Iterator[None]:
    """Within, `vehicle` flies by this module, a step at a time."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulator._Flight, "_at_once", lambda self, own, known, *rest: self._by_steps(own, *rest))
        patch.setattr(fast, "commanding", _commanding)
        patch.setattr(fast, "fly", partial(_fly, vehicle))
        patch.setattr(fast, "fly_windows", partial(_fly_windows, vehicle))
        yield


def accelerations(vehicle, kernels: Kernels, motion: Motion, push: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Angular acceleration and specific force, (n, 3) each, as the fixed point of what reads them."""
    rotors = motion.rotor_speed**2 @ wrench_matrix(vehicle).T
    inertia, rates = vehicle.inertia_kg_m2.matrix(), motion.angular_velocity
    turning, felt = np.zeros_like(rates), np.zeros_like(rates)
    for _ in range(500):
        motion = replace(motion, angular_acceleration=turning, specific_force=felt)
        force, moment = push[:, :3].copy(), push[:, 3:] + rotors[:, 1:] - np.cross(rates, rates @ inertia)
        force[:, 2] -= rotors[:, 0]
        for form, first in zip(kernels.forms, kernels.offsets, strict=True):
            added = Wrench(form.contribution.kernel)(motion, vehicle, kernels.values[first:])
            force += 0.0 if added.force is None else added.force
            moment += 0.0 if added.moment is None else added.moment
        before = np.hstack([turning, felt])
        turning, felt = moment @ np.linalg.inv(inertia), force / vehicle.mass_kg
        if np.abs(np.hstack([turning, felt]) - before).max() <= 1e-13 * max(1.0, np.abs(before).max()):
            break
    return turning, felt


def _commanding(loop: AttitudeLoop, size: int, step_s: float):
    """As `rotorid.vehicle.fast.commanding`."""
    keep = np.exp(-step_s / loop.derivative_time_s) if loop.derivative_time_s > 0 else 0.0
    integral, slope, last = np.zeros((size, 3)), np.zeros((size, 3)), None

    def command(j, states, attitude_errors):
        nonlocal integral, slope, last
        euler_rad = euler_from_quaternion(states[:, 3:7]) + attitude_errors
        wanted = np.broadcast_to(loop.reference[..., j, :], (size, 4))
        error = (wanted[:, :3] - euler_rad + np.pi) % (2 * np.pi) - np.pi
        moment = loop.proportional * error
        if last is not None:
            slope = keep * slope + (1.0 - keep) * (error - last) / step_s
            grown = integral + error * step_s
            asked = moment + loop.integral * grown + loop.derivative * slope
            moment = asked if loop.limit_n_m is None else np.clip(asked, -loop.limit_n_m, loop.limit_n_m)
            integral = np.where((moment != asked) & (np.sign(error) == np.sign(asked)), integral, grown)
        last = error
        square = np.maximum(np.hstack([wanted[:, 3:], moment]) @ loop.allocation.T, 0.0)
        square = square if loop.more is None else np.maximum(square + loop.more[j], 0.0)
        return np.clip(np.sqrt(square), *loop.limits_rad_s)

    return command


def _motion(state, time_s, rotor_speed, rotor_acceleration, wind, height_offset) -> Motion:
    size = state.shape[1]
    rotation = rotation_from_quaternion(state[:, 3:7]) if size > 3 else None
    return Motion(
        time_s=time_s, rotor_speed=rotor_speed, rotor_acceleration=rotor_acceleration, angular_velocity=state[:, 0:3],
        rotation=rotation, velocity=np.einsum("nji,nj->ni", rotation, state[:, 7:10]) if size > 7 else None,
        wind=wind, height=height_offset - state[:, 12] if size > 7 else None,
    )  # fmt: skip


def _rates(vehicle, state, motion, turning, felt) -> np.ndarray:
    """Time derivative of the rigid body's state, (n, 3, 7 or 13)."""
    out = [turning]
    if state.shape[1] > 3:
        out.append(quaternion_rate(state[:, 3:7], state[:, 0:3]))
    if state.shape[1] > 7:
        gravity = np.array([0.0, 0.0, vehicle.gravity_m_s2])
        out += [np.einsum("nij,nj->ni", motion.rotation, felt) + gravity, state[:, 7:10]]
    return np.hstack(out)


def rk4_step(derivative, state, step_s):
    """One step of the classical Runge-Kutta method; `derivative(share, state)` at shares of the step."""
    k1 = derivative(0.0, state)
    k2 = derivative(0.5, state + (0.5 * step_s) * k1)
    k3 = derivative(0.5, state + (0.5 * step_s) * k2)
    out = state + (step_s / 6.0) * (k1 + 2 * (k2 + k3) + derivative(1.0, state + step_s * k3))
    if out.shape[1] > 3:
        out[:, 3:7] /= np.linalg.norm(out[:, 3:7], axis=1, keepdims=True)
    return out


def _fly(vehicle, body, kernels, start, steps, step_s, commands, **given) -> Trace:
    """One step, as `rotorid.vehicle.fast.fly`."""
    assert steps == 1
    command, following, push = commands[:, 0], given["following"][:, 0], given["pushes"][:, 0]
    up, down = given["lags_s"]
    ground = np.nan if given["ground_z_m"] is None else given["ground_z_m"]

    def motion_of(share, state):
        gap = command - state[:, 13:]
        turning_up = gap / np.where(gap > 0, up, down) if up > 0 else following
        time_s = np.full(len(state), given["first_s"] + share * step_s)
        return _motion(state, time_s, state[:, 13:], turning_up, given["wind_m_s"], ground)

    def derivative(share, state):
        motion = motion_of(share, state)
        rates = _rates(vehicle, state, motion, *accelerations(vehicle, kernels, motion, push))
        return np.hstack([rates, motion.rotor_acceleration if up > 0 else 0.0 * command])

    first = np.hstack(accelerations(vehicle, kernels, motion_of(0.0, start), push))
    after = rk4_step(derivative, start, step_s)
    time_s = given["first_s"] + step_s * np.arange(2)
    return Trace(time_s, np.stack([start, after], axis=1), first[:, None], commands)


def _fly_windows(vehicle, body, kernels, start, time_s, *driven) -> np.ndarray:
    """As `rotorid.vehicle.fast.fly_windows`."""
    *series, height_offset = driven
    states = [start]
    for j in range(time_s.shape[1] - 1):
        step_s = time_s[:, j + 1] - time_s[:, j]

        def derivative(share, state, j=j, step_s=step_s):
            speed, turning_up, wind, push = (values[:, int(2 * (j + share))] for values in series)
            motion = _motion(state, time_s[:, j] + share * step_s, speed, turning_up, wind, height_offset)
            return _rates(vehicle, state, motion, *accelerations(vehicle, kernels, motion, push))

        states.append(rk4_step(derivative, states[-1], step_s[:, None]))
    return np.stack(states, axis=1)
