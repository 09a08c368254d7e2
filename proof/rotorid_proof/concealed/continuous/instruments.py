"""From a flight to columns: motion capture and tachometers, or an autopilot's log whose estimates an observer makes."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numba import njit
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfilt

from .craft import GRAVITY
from .equations import cross, times, turn_matrix

FINE_HZ = 1000


@dataclass(frozen=True)
class Kit:
    """Instruments: one-sigma noise a sample, columns, and what is wrong with them."""

    name: str  # capture | log
    rate_hz: int
    groups: tuple[str, ...]
    position: float = 0.0005
    velocity: float = 0.015
    attitude: float = 0.0012
    rate: float = 0.008
    force: float = 0.12
    speed: float = 0.003
    vibration: float = 0.0
    force_bias: tuple = (0.0, 0.0, 0.0)
    force_scale: tuple = (1.0, 1.0, 1.0)
    force_turn: tuple = (0.0, 0.0, 0.0)
    rate_bias: tuple = (0.0, 0.0, 0.0)
    rate_scale: tuple = (1.0, 1.0, 1.0)
    arm: tuple = (0.0, 0.0, 0.0)  # accelerometer from the believed origin
    skew: float = 0.0  # rotor columns' clock
    fraction: float = 0.0  # rotor columns late, of a sample


@njit(cache=True)
def observe(force, rates, velocity, heading, q, every, dt):
    """Velocity and attitude as an observer of fixed gains estimates them from noisy sensors (Martin and Salaün 2010).

    `velocity` and `heading` (from a compass) are read every `every` steps. Returns (k, 3) velocities and (k, 4)
    quaternions.
    """
    k = len(force)
    v_out, q_out = np.empty((k, 3)), np.empty((k, 4))
    v, q = velocity[0].copy(), q.copy()
    gap, astray = np.zeros(3), 0.0
    down = np.array([0.0, 0.0, GRAVITY])
    for i in range(k):
        rot = turn_matrix(q)
        pushed = times(rot, force[i])
        if i % every == 0:
            gap = velocity[i] - v
        fix = 0.004 * cross(pushed, gap)
        if i % every == 0:
            seen = np.arctan2(rot[1, 0], rot[0, 0])
            astray = np.sin(heading[i] - seen)
        fix[2] += 0.4 * astray
        w = rates[i] + times(rot.T, fix)
        v_out[i], q_out[i] = v, q
        v = v + dt * (pushed + down + 1.5 * gap)
        gap = gap * (1 - 1.5 * dt)
        step = 0.5 * dt
        q = q + step * np.array(
            [
                -q[1] * w[0] - q[2] * w[1] - q[3] * w[2],
                q[0] * w[0] + q[2] * w[2] - q[3] * w[1],
                q[0] * w[1] + q[3] * w[0] - q[1] * w[2],
                q[0] * w[2] + q[1] * w[1] - q[2] * w[0],
            ]
        )
        q = q / np.sqrt((q * q).sum())
    return v_out, q_out


def mounted(flight: dict, kit: Kit) -> np.ndarray:
    """What the accelerometer feels where and as it is mounted, without noise, (k, 3)."""
    r = np.array(kit.arm)
    f = flight["f"]
    if np.any(r):
        w = flight["w"]
        turning = CubicSpline(flight["t"], w)(flight["t"], 1)
        f = f + np.cross(turning, r) + np.cross(w, np.cross(w, r))
    ax, ay, az = kit.force_turn
    turn = np.array([[1, az, -ay], [-az, 1, ax], [ay, -ax, 1]])
    u, _, vt = np.linalg.svd(turn)
    return (f @ (u @ vt).T) * np.array(kit.force_scale) + np.array(kit.force_bias)


def log_estimates(flight: dict, kit: Kit, hover: float, rng):
    """Accelerometer, gyroscope (both at 1 kHz, as filtered on board), estimated velocity and attitude, per step."""
    k = len(flight["t"])
    dt = 1 / FINE_HZ
    clean = mounted(flight, kit)
    shake = np.zeros((k, 3))
    for i in range(flight["speed"].shape[1]):
        phase = np.cumsum(flight["speed"][:, i]) * dt + rng.uniform(0, 6.283)
        size = (flight["speed"][:, i] / hover) ** 2
        shake += size[:, None] * np.stack([np.cos(phase), np.sin(phase), 0.7 * np.cos(2 * phase)], axis=1)
    raw = clean + kit.vibration * shake + kit.force * np.sqrt(FINE_HZ / 100) * rng.standard_normal((k, 3))
    gyro = flight["w"] * np.array(kit.rate_scale) + np.array(kit.rate_bias)
    gyro = gyro + kit.rate * np.sqrt(FINE_HZ / 100) * rng.standard_normal((k, 3))
    fixes = flight["v"] + kit.velocity * rng.standard_normal((k, 3))
    a, b, c, d = flight["q"].T
    heading = np.arctan2(2 * (b * c + a * d), a * a + b * b - c * c - d * d) + 0.02 * rng.standard_normal(k)
    v, q = observe(raw, gyro, fixes, heading, flight["q"][0], 50, dt)
    sos = butter(2, 45.0, fs=FINE_HZ, output="sos")

    def low(x):
        return sosfilt(sos, x - x[0], axis=0) + x[0]

    return low(clean), low(raw), low(gyro), v, q


def record(flight: dict, kit: Kit, hover: float, rng: np.random.Generator):
    """(ideal, written) tables of one run; `flight` is given at 1 kHz."""
    every = FINE_HZ // kit.rate_hz
    margin = 1000 if kit.name == "log" else 200
    pick = np.arange(margin, len(flight["t"]) - 200, every)
    t = flight["t"][pick]
    k = len(pick)
    ideal, written = {"time_s": t - t[0]}, {"time_s": t - t[0]}

    def put(names, clean, noisy):
        for j, name in enumerate(names):
            ideal[name], written[name] = clean[:, j], noisy[:, j]

    def three(prefix, unit):
        return [f"{prefix}_{a}_{unit}" for a in "xyz"]

    def noise(sigma, columns=3):
        return sigma * rng.standard_normal((k, columns))

    late = t - kit.skew * (t - t[0]) - kit.fraction / kit.rate_hz
    rotors = range(1, flight["speed"].shape[1] + 1)
    if "speed" in kit.groups:
        w = CubicSpline(flight["t"], flight["speed"])(late)
        put([f"rotor_speed_{i}_rad_s" for i in rotors], w, w * (1 + noise(kit.speed, len(rotors))))
    if "command" in kit.groups:
        w = CubicSpline(flight["t"], flight["command"])(late)
        put([f"rotor_command_{i}_rad_s" for i in rotors], w, w)
    p, v, q, w = (flight[c][pick] for c in "pvqw")
    put(three("position", "m"), p, p + noise(kit.position))
    names = [f"quaternion_{c}" for c in "wxyz"]
    if kit.name == "log":
        clean_f, raw_f, gyro, v_hat, q_hat = log_estimates(flight, kit, hover, rng)
        put(three("velocity", "m_s"), v, v_hat[pick])
        put(names, q, q_hat[pick] * np.sign((q_hat[pick] * q).sum(axis=1, keepdims=True)))
        exact = w * np.array(kit.rate_scale) + np.array(kit.rate_bias)
        put(three("angular_velocity", "rad_s"), exact, gyro[pick])
        put(three("specific_force", "m_s2"), clean_f[pick], raw_f[pick])
    else:
        put(three("velocity", "m_s"), v, v + noise(kit.velocity))
        half = 0.5 * noise(kit.attitude)
        a, b, c, d = q.T
        x, y, z = half.T
        off = np.stack([a - b * x - c * y - d * z, b + a * x + c * z - d * y, c + a * y + d * x - b * z,
                        d + a * z + b * y - c * x], axis=1)  # fmt: skip
        put(names, q, off / np.linalg.norm(off, axis=1, keepdims=True))
        exact = w * np.array(kit.rate_scale) + np.array(kit.rate_bias)
        put(three("angular_velocity", "rad_s"), exact, exact + noise(kit.rate))
        f = mounted(flight, kit)[pick]
        put(three("specific_force", "m_s2"), f, f + noise(kit.force))
    if "battery" in kit.groups:
        volts = 16.8 * (1 - flight["sag"] * flight["used"][pick])[:, None]
        put(["battery_voltage_v"], volts, volts + noise(0.01, 1))
    return pd.DataFrame(ideal), pd.DataFrame(written)
