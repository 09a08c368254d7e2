"""Turn a flight into recorded columns: sampling, clocks, latency, errors, coloured noise, quantisation.

`record` returns two tables of the same rows: as an ideal logger would have written it (errors that are
effects included, noise not), and as written.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from .flight import Flight

AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Noise:
    """One-sigma noise of each sensor per sample, the coloured share of its variance, and its memory."""

    specific_force_m_s2: float = 0.15
    angular_velocity_rad_s: float = 0.015
    rotor_speed_relative: float = 0.004
    velocity_m_s: float = 0.02
    position_m: float = 0.001
    attitude_rad: float = 0.002
    height_m: float = 0.01
    voltage_v: float = 0.02
    current_a: float = 0.1
    coloured_share: float = 0.3
    memory_s: float = 0.01
    quantum_rotor_rad_s: float = 0.0
    quantum_force_m_s2: float = 0.0
    quantum_rate_rad_s: float = 0.0


@dataclass(frozen=True)
class Errors:
    """Errors of sensors and logging; all zero is perfect."""

    force_bias: tuple = (0.0, 0.0, 0.0)
    force_scale: tuple = (0.0, 0.0, 0.0)
    force_turn_rad: tuple = (0.0, 0.0, 0.0)  # small rotation of the sensor's axes
    rate_bias: tuple = (0.0, 0.0, 0.0)
    rate_scale: tuple = (0.0, 0.0, 0.0)
    sensor_point_m: tuple = (0.0, 0.0, 0.0)  # where the accelerometer really sits
    late_motor_s: float = 0.0
    late_inertial_s: float = 0.0
    late_pose_s: float = 0.0
    skew_motor: float = 0.0  # motor clock runs (1 + skew) fast
    skew_pose: float = 0.0
    vibration_m_s2: float = 0.0  # amplitude per rotor at hover speed
    rectified_m_s2: float = 0.0


@dataclass(frozen=True)
class Layout:
    """What is recorded and how often."""

    rate_hz: float
    groups: tuple[str, ...]  # speed command throttle position velocity attitude rates force height battery
    start_s: float = 0.0
    jitter_s: float = 0.0
    pose_every: int = 1
    margin_s: float = 0.15


def _coloured(rng, shape, noise: Noise, rate_hz):
    """Unit-variance noise: white plus first-order coloured."""
    white = rng.standard_normal(shape)
    if noise.coloured_share <= 0:
        return white
    a = np.exp(-1 / (rate_hz * noise.memory_s))
    slow = lfilter([np.sqrt(1 - a * a)], [1, -a], rng.standard_normal((shape[0] + 200, *shape[1:])), axis=0)[200:]
    return np.sqrt(1 - noise.coloured_share) * white + np.sqrt(noise.coloured_share) * slow


def _quantise(x, quantum):
    return x if quantum <= 0 else np.round(x / quantum) * quantum


def _names(prefix, unit):
    return [f"{prefix}_{a}_{unit}" for a in AXES]


def record(
    flight: Flight, layout: Layout, noise: Noise, errors: Errors, max_speed: float, rng: np.random.Generator
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """(ideal, written) tables with contract columns."""
    t0, t1 = flight.time_s[0] + layout.margin_s, flight.time_s[-1] - layout.margin_s
    k = int((t1 - t0) * layout.rate_hz)
    t = t0 + np.arange(k) / layout.rate_hz
    if layout.jitter_s > 0:
        t = t + np.clip(rng.normal(0, layout.jitter_s, k), -0.4 / layout.rate_hz, 0.4 / layout.rate_hz)
    t_motor = t - errors.late_motor_s - errors.skew_motor * (t - t0)
    t_inertial = t - errors.late_inertial_s
    t_pose = t - errors.late_pose_s - errors.skew_pose * (t - t0)

    def at(values, times):
        first = max(0, np.searchsorted(flight.time_s, times[0]) - 5)
        last = np.searchsorted(flight.time_s, times[-1]) + 5
        return CubicSpline(flight.time_s[first:last], values[first:last], axis=0)(times)

    n = flight.speed_rad_s.shape[1]
    ideal, written = {}, {}

    def put(names, clean, sigma, quantum=0.0, every=1):
        clean = clean.reshape(k, -1)
        noisy = _quantise(clean + sigma * _coloured(rng, clean.shape, noise, layout.rate_hz), quantum)
        if every > 1:
            keep = np.arange(k) % every == 0
            clean = np.where(keep[:, None], clean, np.nan)
            noisy = np.where(keep[:, None], noisy, np.nan)
        for j, name in enumerate(names):
            ideal[name], written[name] = clean[:, j], noisy[:, j]

    stamp = np.round(t + layout.start_s, 6)
    ideal["time_s"] = written["time_s"] = stamp
    groups = layout.groups
    if "speed" in groups:
        w = at(flight.speed_rad_s, t_motor)
        put(
            [f"rotor_speed_{i + 1}_rad_s" for i in range(n)],
            w,
            noise.rotor_speed_relative * w,
            noise.quantum_rotor_rad_s,
        )
    if "command" in groups:
        put([f"rotor_command_{i + 1}_rad_s" for i in range(n)], at(flight.command_rad_s, t_motor), 0.0)
    if "throttle" in groups:
        put([f"throttle_{i + 1}" for i in range(n)], at(flight.command_rad_s, t_motor) / max_speed, 0.0, 1e-4)
    if "position" in groups:
        put(_names("position", "m"), at(flight.position_m, t_pose), noise.position_m, every=layout.pose_every)
    if "velocity" in groups:
        put(
            _names("velocity", "m_s"),
            at(flight.velocity_m_s, t_pose),
            noise.velocity_m_s,
            every=layout.pose_every,
        )
    if "attitude" in groups:
        q = at(flight.quaternion, t_pose)
        q /= np.linalg.norm(q, axis=1, keepdims=True)
        turn = noise.attitude_rad * _coloured(rng, (k, 3), noise, layout.rate_hz)
        noisy = _turned(q, turn)
        keep = np.arange(k) % layout.pose_every == 0
        for j, a in enumerate("wxyz"):
            ideal[f"quaternion_{a}"] = np.where(keep, q[:, j], np.nan)
            written[f"quaternion_{a}"] = np.where(keep, noisy[:, j], np.nan)
    if "rates" in groups:
        w = at(flight.rates_rad_s, t_inertial) * (1 + np.array(errors.rate_scale)) + np.array(errors.rate_bias)
        put(_names("angular_velocity", "rad_s"), w, noise.angular_velocity_rad_s, noise.quantum_rate_rad_s)
    if "force" in groups:
        f = at(flight.specific_force_at(errors.sensor_point_m), t_inertial)
        f = f + np.cross(f, np.array(errors.force_turn_rad))
        f = f * (1 + np.array(errors.force_scale)) + np.array(errors.force_bias)
        if errors.vibration_m_s2 > 0:
            psi = at(flight.phase_rad, t_inertial)
            relative = (at(flight.speed_rad_s, t_inertial) / np.median(flight.speed_rad_s)) ** 2
            f[:, 0] += errors.vibration_m_s2 * (relative * np.cos(psi + np.arange(n))).sum(1)
            f[:, 1] += errors.vibration_m_s2 * (relative * np.sin(psi + np.arange(n))).sum(1)
            f[:, 2] += errors.vibration_m_s2 * 0.5 * (relative * np.cos(psi + 2 * np.arange(n))).sum(1)
            f[:, 2] += errors.rectified_m_s2 * relative.mean(1)
        put(_names("specific_force", "m_s2"), f, noise.specific_force_m_s2, noise.quantum_force_m_s2)
    if "height" in groups:
        put(["height_m"], -at(flight.position_m, t_pose)[:, 2], noise.height_m, every=layout.pose_every)
    if "battery" in groups:
        put(["battery_voltage_v"], at(flight.voltage_v, t), noise.voltage_v, 0.01)
        put(["battery_current_a"], at(flight.current_a, t), noise.current_a, 0.05)
    return pd.DataFrame(ideal), pd.DataFrame(written)


def _turned(q, turn):
    """Quaternions (k, 4) after a small rotation `turn` (k, 3) about body axes."""
    half = 0.5 * turn
    w, x, y, z = q.T
    a, b, c = half.T
    out = np.stack(
        [
            w - x * a - y * b - z * c,
            x + w * a + y * c - z * b,
            y + w * b + z * a - x * c,
            z + w * c + x * b - y * a,
        ],
        1,
    )
    return out / np.linalg.norm(out, axis=1, keepdims=True)
