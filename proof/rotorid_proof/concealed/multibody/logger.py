"""What is written down: instruments of three grades, noise, clocks, columns of the contract."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.signal import butter, lfilter, sosfilt

from .engine import STEP


@dataclass(frozen=True)
class Grade:
    """One-sigma noise of a recording's instruments and its columns."""

    name: str  # lab: motion capture and rotor speeds; tele: autopilot with telemetry; log: commands, estimates
    rate_hz: int
    groups: tuple[str, ...]
    position: float = 0.0005
    velocity: float = 0.02
    attitude: float = 0.002
    rate: float = 0.012
    force: float = 0.12
    speed: float = 0.003
    late_steps: int = 0  # rotor columns late, steps of 1 ms: below one sample
    vibration: float = 0.0  # m/s² at hover, once a revolution


POSE = ("position", "velocity", "attitude", "rates", "force")


def drawn(name: str, rng: np.random.Generator, command: bool, speed: bool = True) -> Grade:
    """Instruments of a grade; `command` and `speed`: whether the case needs these columns."""
    noise = float(np.exp(rng.uniform(np.log(0.6), np.log(1.6))))
    groups = (*(("speed",) if speed else ()), *(("command",) if command else ()), *POSE)
    if name == "lab":
        rate = int(rng.choice([200, 250, 500]))
        late = int(rng.integers(0, 1000 // rate))
        return Grade(name, rate, groups, 0.0004 * noise, 0.015 * noise, 0.0015 * noise, 0.01 * noise, 0.1 * noise,
                     0.002 * noise, late)  # fmt: skip
    if name == "tele":
        rate = int(rng.choice([100, 125, 200]))
        late = int(rng.integers(0, 1000 // rate))
        return Grade(name, rate, groups, 0.002 * noise, 0.03 * noise, 0.003 * noise, 0.015 * noise, 0.2 * noise,
                     0.006 * noise, late)  # fmt: skip
    return Grade(name, 100, ("command", *POSE), 0.02 * noise, 0.04 * noise, 0.006 * noise, 0.008 * noise, 0.15 * noise,
                 0.0, 0, 0.35 * noise)  # fmt: skip


def gyro_noise(k: int, sigma: float, rng: np.random.Generator) -> np.ndarray:
    """Noise of the rates, every step: the sensor's own low-pass at 90 Hz. The controller hears it too."""
    sos = butter(2, 90.0, fs=1 / STEP, output="sos")
    raw = sosfilt(sos, rng.standard_normal((k, 3)), axis=0)
    return sigma * raw / raw[200:].std()


def wander(k: int, memory_s: float, rate_hz: float, rng: np.random.Generator, columns: int = 3) -> np.ndarray:
    """First-order coloured noise of unit size, (k, columns)."""
    a = np.exp(-1 / (memory_s * rate_hz))
    drive = rng.standard_normal((k + 1000, columns))
    return lfilter([np.sqrt(1 - a * a)], [1, -a], drive, axis=0)[1000:]


def turned(q: np.ndarray, small: np.ndarray) -> np.ndarray:
    """Quaternions (k, 4) after small rotations (k, 3) in body axes, to second order."""
    half = np.concatenate([np.ones((len(q), 1)), 0.5 * small], axis=1)
    half /= np.linalg.norm(half, axis=1, keepdims=True)
    w, x, y, z = q.T
    a, b, c, d = half.T
    return np.stack([w * a - x * b - y * c - z * d, w * b + x * a + y * d - z * c,
                     w * c - x * d + y * a + z * b, w * d + x * c - y * b + z * a], axis=1)  # fmt: skip


def record(flight: dict, grade: Grade, hover: float, noise: np.ndarray, rng: np.random.Generator):
    """(ideal, written): tables of one run as perfect instruments and as these would have written it."""
    every = int(round(1 / STEP / grade.rate_hz))
    pick = np.arange(500, len(flight["p"]) - 500, every)
    k, rate = len(pick), grade.rate_hz
    force = flight["f"]
    if grade.name == "log":
        # what an autopilot logs has passed its low-pass; of 40 Hz and second order, 6 ms late: below one sample
        sos = butter(2, 40.0, fs=1 / STEP, output="sos")
        force = sosfilt(sos, force - force[0], axis=0) + force[0]
    ideal, written = {"time_s": pick * STEP}, {"time_s": pick * STEP}

    def put(names, clean, sigma, quantum=0.0):
        noisy = clean + sigma
        if quantum:
            noisy = np.round(noisy / quantum) * quantum
        for j, name in enumerate(names):
            ideal[name], written[name] = clean[:, j], noisy[:, j]

    def three(prefix, unit):
        return [f"{prefix}_{a}_{unit}" for a in "xyz"]

    rotors = range(1, flight["speed"].shape[1] + 1)
    motor = pick - grade.late_steps
    if "speed" in grade.groups:
        w = flight["speed"][motor]
        put([f"rotor_speed_{i}_rad_s" for i in rotors], w, grade.speed * w * rng.standard_normal(w.shape))
    if "command" in grade.groups:
        w = flight["command"][motor]
        put([f"rotor_command_{i}_rad_s" for i in rotors], w, 0.0 * w, 0.05)
    if grade.name == "log":
        # estimates of a filter: smooth errors that wander, no white noise to speak of
        put(three("position", "m"), flight["p"][pick], grade.position * wander(k, 2.0, rate, rng))
        put(three("velocity", "m_s"), flight["v"][pick], grade.velocity * wander(k, 1.5, rate, rng))
        q = flight["q"][pick]
        small = grade.attitude * wander(k, 3.0, rate, rng)
    else:
        put(three("position", "m"), flight["p"][pick], grade.position * rng.standard_normal((k, 3)))
        put(three("velocity", "m_s"), flight["v"][pick], grade.velocity * rng.standard_normal((k, 3)))
        q = flight["q"][pick]
        small = grade.attitude * rng.standard_normal((k, 3))
    put([f"quaternion_{c}" for c in "wxyz"], q, turned(q, small) - q)
    put(three("angular_velocity", "rad_s"), flight["w"][pick], noise[pick])
    f = force[pick].copy()
    rough = grade.force * rng.standard_normal((k, 3))
    if grade.vibration:
        phase = np.cumsum(flight["speed"], axis=0) * STEP + rng.uniform(0, 6.28, len(rotors))
        size = (flight["speed"] / hover) ** 2
        shake = np.stack(
            [(size * np.cos(phase)).sum(1), (size * np.sin(phase)).sum(1), (size * np.cos(phase + 1)).sum(1)], 1
        )
        sos = butter(2, 40.0, fs=1 / STEP, output="sos")
        rough = rough + grade.vibration * sosfilt(sos, shake, axis=0)[pick]
    put(three("specific_force", "m_s2"), f, rough)
    if "battery" in grade.groups:
        put(["battery_voltage_v"], flight["voltage"][pick][:, None], 0.01 * rng.standard_normal((k, 1)))
        put(["battery_current_a"], flight["current"][pick][:, None], 0.1 * rng.standard_normal((k, 1)))
    if "height" in grade.groups:
        put(["height_m"], -flight["p"][pick][:, 2:], 0.005 * rng.standard_normal((k, 1)))
    return pd.DataFrame(ideal), pd.DataFrame(written)
