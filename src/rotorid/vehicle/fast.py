"""Compiled flight of plain rigid bodies with rotors: known commands, one vehicle or thousands of parameter
sets.

The same equations as `rotorid.vehicle.simulator` without effects, disturbance and controller, written as
loops for numba because a profile of the array code showed its time to go into calls on small arrays.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numba import njit

from rotorid.recordings.vehicle import Vehicle
from rotorid.vehicle.mixer import wrench_matrix

STATE = "rates 0:3, quaternion 3:7, velocity 7:10, position 10:13, rotor speeds 13:"


@njit(cache=True, error_model="numpy")
def _derivative(s, command, push, mass, gravity, inertia, inverse, mixer, up, down, out):
    p, q, r = s[0], s[1], s[2]
    w, x, y, z = s[3], s[4], s[5], s[6]
    thrust = roll = pitch = yaw = 0.0
    for i in range(command.shape[0]):
        square = s[13 + i] * s[13 + i]
        thrust += mixer[0, i] * square
        roll += mixer[1, i] * square
        pitch += mixer[2, i] * square
        yaw += mixer[3, i] * square
        gap = command[i] - s[13 + i]
        out[13 + i] = gap * (up if gap > 0 else down)
    hx = inertia[0, 0] * p + inertia[0, 1] * q + inertia[0, 2] * r
    hy = inertia[1, 0] * p + inertia[1, 1] * q + inertia[1, 2] * r
    hz = inertia[2, 0] * p + inertia[2, 1] * q + inertia[2, 2] * r
    mx = push[3] + roll - (q * hz - r * hy)
    my = push[4] + pitch - (r * hx - p * hz)
    mz = push[5] + yaw - (p * hy - q * hx)
    for i in range(3):
        out[i] = inverse[i, 0] * mx + inverse[i, 1] * my + inverse[i, 2] * mz
    out[3] = -0.5 * (x * p + y * q + z * r)
    out[4] = 0.5 * (w * p + y * r - z * q)
    out[5] = 0.5 * (w * q + z * p - x * r)
    out[6] = 0.5 * (w * r + x * q - y * p)
    fx, fy, fz = push[0] / mass, push[1] / mass, (push[2] - thrust) / mass
    out[7] = (1.0 - 2.0 * (y * y + z * z)) * fx + 2.0 * (x * y - w * z) * fy + 2.0 * (x * z + w * y) * fz
    out[8] = 2.0 * (x * y + w * z) * fx + (1.0 - 2.0 * (x * x + z * z)) * fy + 2.0 * (y * z - w * x) * fz
    out[9] = 2.0 * (x * z - w * y) * fx + 2.0 * (y * z + w * x) * fy + (1.0 - 2.0 * (x * x + y * y)) * fz
    out[9] += gravity
    out[10], out[11], out[12] = s[7], s[8], s[9]


@njit(cache=True, error_model="numpy")
def _fly(start, commands, push, step, every, mass, gravity, inertia, inverse, mixer, up, down, out):
    size = start.shape[1]
    k1, k2, k3, k4 = np.empty(size), np.empty(size), np.empty(size), np.empty(size)
    trial = np.empty(size)
    for v in range(start.shape[0]):
        s = start[v].copy()
        a = (mass[v], gravity[v], inertia[v], inverse[v], mixer[v], up[v], down[v])
        c = v if commands.shape[0] > 1 else 0
        out[v, 0] = s
        for j in range(commands.shape[1]):
            command = commands[c, j]
            if a[5] == 0.0:
                for i in range(command.shape[0]):
                    s[13 + i] = command[i]
            _derivative(s, command, push[v], a[0], a[1], a[2], a[3], a[4], a[5], a[6], k1)
            for i in range(size):
                trial[i] = s[i] + 0.5 * step * k1[i]
            _derivative(trial, command, push[v], a[0], a[1], a[2], a[3], a[4], a[5], a[6], k2)
            for i in range(size):
                trial[i] = s[i] + 0.5 * step * k2[i]
            _derivative(trial, command, push[v], a[0], a[1], a[2], a[3], a[4], a[5], a[6], k3)
            for i in range(size):
                trial[i] = s[i] + step * k3[i]
            _derivative(trial, command, push[v], a[0], a[1], a[2], a[3], a[4], a[5], a[6], k4)
            length = 0.0
            for i in range(size):
                s[i] += step / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i])
            for i in range(3, 7):
                length += s[i] * s[i]
            length = np.sqrt(length)
            for i in range(3, 7):
                s[i] /= length
            if (j + 1) % every == 0:
                out[v, (j + 1) // every] = s


def fly(
    vehicles: Sequence[Vehicle],
    start: np.ndarray,
    commands_rad_s: np.ndarray,
    step_s: float,
    motor_time_s: float = 0.0,
    every: int = 1,
) -> np.ndarray:
    """States (n, m // every + 1, 13 + k) of n vehicles under commands held over each of m steps.

    Parameters
    ----------
    vehicles
        n vehicles (parameter sets) with k rotors each, or a single one for all n starts.
    start
        States at the beginning, (n, 13 + k): rates, quaternion, velocity (world), position, rotor speeds, SI.
    commands_rad_s
        Rotor speeds commanded, (m, k) for all, or (n, m, k).
    step_s
        Step of the Runge-Kutta method.
    motor_time_s
        Time constant of the rotors' first-order lag; 0 follows the command at once.
    every
        Keep each `every`-th state.
    """
    start = np.ascontiguousarray(start, float)
    commands = np.ascontiguousarray(commands_rad_s, float)
    commands = commands[None] if commands.ndim == 2 else commands
    n = len(start)
    chosen = list(vehicles) * n if len(vehicles) == 1 else list(vehicles)
    k = chosen[0].rotor_count
    if len(chosen) != n or start.shape[1] != 13 + k or commands.shape[2] != k or len(commands) not in (1, n):
        raise ValueError(
            f"{len(vehicles)} vehicles with {k} rotors, start {start.shape} and commands {commands.shape} "
            "do not belong together"
        )
    lag = np.full(n, 0.0 if motor_time_s == 0 else 1.0 / motor_time_s)
    out = np.empty((n, commands.shape[1] // every + 1, 13 + k))
    _fly(start, commands, np.zeros((n, 6)), step_s, every, *_constants(tuple(vehicles), n), lag, lag, out)
    return out


class Stepper:
    """One step at a time for n alike vehicles, for whoever has to decide between steps (a controller)."""

    def __init__(self, vehicle: Vehicle, size: int, time_up_s: float, time_down_s: float | None = None):
        down = time_up_s if time_down_s is None else time_down_s
        self._constants = _constants((vehicle,), size)
        self._lags = tuple(np.full(size, 0.0 if t == 0 else 1.0 / t) for t in (time_up_s, down))
        self._out = np.empty((size, 2, 13 + vehicle.rotor_count))

    def step(self, state: np.ndarray, command: np.ndarray, push: np.ndarray, step_s: float) -> np.ndarray:
        """States (n, 13 + k) after a step under commands (n, k), rad/s, and a body wrench (n, 6), N, N m."""
        _fly(state, command[:, None, :], push, step_s, 1, *self._constants, *self._lags, self._out)
        return self._out[:, 1].copy()


def _constants(vehicles: tuple[Vehicle, ...], n: int) -> tuple[np.ndarray, ...]:
    inertia = np.array([v.inertia_kg_m2.matrix() for v in vehicles])
    parts = (
        np.array([v.mass_kg for v in vehicles]),
        np.array([v.gravity_m_s2 for v in vehicles]),
        inertia,
        np.linalg.inv(inertia),
        np.array([wrench_matrix(v) for v in vehicles]),
    )
    return tuple(np.ascontiguousarray(np.repeat(p, n, axis=0)) if len(p) == 1 < n else p for p in parts)
