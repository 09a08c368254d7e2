"""References flown by the controller, built segment by segment; every segment starts and ends at rest.

A flight is `Reference` arrays on the simulator's grid: position, velocity, acceleration (world, z down), yaw,
and small additions to the attitude (roll, pitch, yaw; rad) and to the rotor speeds (relative).
"""

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class Reference:
    time_s: np.ndarray  # (k,)
    position_m: np.ndarray  # (k, 3)
    velocity_m_s: np.ndarray  # (k, 3)
    acceleration_m_s2: np.ndarray  # (k, 3)
    yaw_rad: np.ndarray  # (k,)
    attitude_rad: np.ndarray  # (k, 3)
    speed_fraction: np.ndarray  # (k, n)


class Lost(RuntimeError):
    """The controller did not hold the vehicle on its reference."""


CALMER = (1.0, 0.6, 0.35)
"""Sizes in which a reference is flown, one after the other, where the vehicle is lost in the larger one."""


def calmer(reference: Reference, size: float) -> Reference:
    """The same flight in a smaller size: places about its start, speeds, turns and excitation."""
    start = reference.position_m[:1]
    scaled = {
        name: size * getattr(reference, name)
        for name in ("velocity_m_s", "acceleration_m_s2", "yaw_rad", "attitude_rad", "speed_fraction")
    }
    return replace(reference, position_m=start + size * (reference.position_m - start), **scaled)


def flown(fly, reference: Reference):
    """`fly(reference)` in the largest size that the vehicle is not lost in."""
    for size in CALMER[:-1]:
        try:
            return fly(reference if size == 1.0 else calmer(reference, size))
        except Lost:
            continue
    return fly(calmer(reference, CALMER[-1]))


@dataclass(frozen=True)
class Segment:
    """One piece of a flight. `speed` in m/s (or rad/s for yaw, rad for excitation), `size` in m."""

    kind: str
    duration_s: float
    speed: float = 0.0
    size: float = 0.0
    heading_rad: float = 0.0


def _ramped_phase(t, duration, rate, ramp):
    """Phase whose rate rises smoothly from 0 to `rate` and falls back to 0."""
    ramp = min(ramp, duration / 2.5)
    up = np.clip(t / ramp, 0, 1)
    down = np.clip((duration - t) / ramp, 0, 1)
    envelope = (0.5 - 0.5 * np.cos(np.pi * up)) * (0.5 - 0.5 * np.cos(np.pi * down))
    dt = t[1] - t[0]
    return np.concatenate([[0.0], np.cumsum(0.5 * (envelope[1:] + envelope[:-1]) * rate * dt)])


def _step(t, duration):
    """Smooth 0 to 1 (quintic)."""
    s = np.clip(t / duration, 0, 1)
    return s**3 * (10 - 15 * s + 6 * s**2)


def _multisine(t, rng, low_hz, high_hz, lines):
    freqs = np.linspace(low_hz, high_hz, lines) * (1 + 0.02 * rng.standard_normal(lines))
    x = np.sin(2 * np.pi * freqs[:, None] * t + rng.uniform(0, 2 * np.pi, lines)[:, None]).sum(0)
    return x / np.sqrt(lines / 2)


def _fade(t, duration, ramp=0.5):
    return np.clip(t / ramp, 0, 1) * np.clip((duration - t) / ramp, 0, 1)


def build(segments, altitude_m, step_s, n_rotors, rng, warm_up_s=6.0, top_hz=8.0) -> Reference:
    """Join segments after a hover of `warm_up_s`, at time -warm_up_s to 0, that lets the controller settle.

    top_hz bounds the excitation's frequencies.
    """
    pieces = [Segment("hover", warm_up_s), *segments]
    base = np.array([0.0, 0.0, -altitude_m])
    yaw0 = 0.0
    p_all, yaw_all, att_all, w_all = [], [], [], []
    for s in pieces:
        k = int(round(s.duration_s / step_s))
        t = np.arange(k) * step_s
        offset = np.zeros((k, 3))
        yaw = np.full(k, yaw0)
        att = np.zeros((k, 3))
        rot = np.zeros((k, n_rotors))
        ahead = np.array([np.cos(s.heading_rad), np.sin(s.heading_rad)])
        side = np.array([-ahead[1], ahead[0]])
        if s.kind == "eight":
            phase = _ramped_phase(t, s.duration_s, s.speed / s.size / np.sqrt(2), 3.0)
            offset[:, :2] = s.size * np.sin(phase)[:, None] * ahead + s.size / 2 * np.sin(2 * phase)[:, None] * side
        elif s.kind == "circle":
            phase = _ramped_phase(t, s.duration_s, s.speed / s.size, 3.0)
            offset[:, :2] = s.size * np.sin(phase)[:, None] * ahead + s.size * (1 - np.cos(phase))[:, None] * side
        elif s.kind == "sweep":
            phase = _ramped_phase(t, s.duration_s, s.speed / s.size, 3.0)
            offset[:, :2] = s.size * np.sin(phase)[:, None] * ahead
        elif s.kind == "one_way":
            # speed up in 4 s, hold it within a tenth, slow down in 4 s
            envelope = _step(t, 4.0) * _step(s.duration_s - t, 4.0)
            speed = s.speed * envelope * (1 + 0.08 * np.sin(2 * np.pi * t / 7.0))
            offset[:, :2] = (np.cumsum(speed) * step_s)[:, None] * ahead
        elif s.kind == "vertical":
            phase = _ramped_phase(t, s.duration_s, s.speed / s.size, 2.0)
            offset[:, 2] = -s.size * np.sin(phase)
        elif s.kind == "climb_to":
            offset[:, 2] = -(s.size + base[2]) * _step(t, s.duration_s)
        elif s.kind == "descend":
            offset[:, 2] = s.size * _step(t, s.duration_s)
        elif s.kind == "yaw":
            yaw = yaw0 + _ramped_phase(t, s.duration_s, s.speed, 1.5)
        elif s.kind == "multisine":
            for axis in range(3):
                att[:, axis] = s.speed * _multisine(t, rng, 0.3, top_hz, 14) * _fade(t, s.duration_s)
            att[:, 2] *= 1.5
        elif s.kind == "rotor_multisine":
            for i in range(n_rotors):
                rot[:, i] = s.speed * _multisine(t, rng, 0.3, top_hz, 14) * _fade(t, s.duration_s)
        elif s.kind == "doublets":
            start = 0.5
            axis = 0
            while start + 1.2 < s.duration_s:
                width = rng.uniform(0.15, 0.4)
                sign = rng.choice([-1.0, 1.0])
                att[:, axis] += sign * s.speed * ((t >= start) & (t < start + width))
                att[:, axis] -= sign * s.speed * ((t >= start + width) & (t < start + 2 * width))
                start += 1.2
                axis = (axis + 1) % 3
        elif s.kind == "pulses":
            # collective steps, as a pilot's throttle blips
            start = 0.5
            while start + 1.5 < s.duration_s:
                sign = rng.choice([-1.0, 1.0])
                rot += (sign * s.speed * ((t >= start) & (t < start + 0.35)))[:, None]
                rot -= (sign * s.speed * ((t >= start + 0.35) & (t < start + 0.7)))[:, None]
                start += 1.5
        elif s.kind != "hover":
            raise ValueError(f"unknown segment kind {s.kind!r}")
        p_all.append(base + offset)
        base = base + offset[-1]
        yaw_all.append(yaw)
        yaw0 = yaw[-1]
        att_all.append(att)
        w_all.append(rot)
    position = np.concatenate(p_all)
    velocity = np.gradient(position, step_s, axis=0)
    return Reference(
        time_s=np.arange(len(position)) * step_s - warm_up_s,
        position_m=position,
        velocity_m_s=velocity,
        acceleration_m_s2=np.gradient(velocity, step_s, axis=0),
        yaw_rad=np.concatenate(yaw_all),
        attitude_rad=np.concatenate(att_all),
        speed_fraction=np.concatenate(w_all),
    )
