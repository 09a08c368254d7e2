"""A pendulum below a vehicle: how it swings, and how long its cable may be."""

from functools import lru_cache
from math import exp, sqrt

import numpy as np

SWING_RATE_HZ = 100.0
"""Rate of the pendulum's own steps: thirty a radian for the shortest cable allowed."""
SCAN_RATE_HZ = 20.0
"""Rate at which lengths are tried: a swing has less than 2 Hz."""
SHORTEST_SCAN = 40
"""Instants that a stretch must have to say anything about a length."""
LENGTHS_TRIED = 180
"""Steps of two in a hundred: the phase of what rings for a minute tells its length so well."""
MOST_LIKELY = 3
LEAST_HANG = 0.3
"""Share of gravity that must pull down for the small angles of the scan."""


def swing(hanging, time_s, length_m, damping_ratio, gravity_m_s2):
    """Direction (n, 3) and squared rate (n,), rad²/s², of a spherical pendulum in world axes.

    n'' = (e − (e·n) n)/L − |n'|² n − 2 ζ ω n', ω² = g/L, e = `hanging` (n, 3), m/s2, by leapfrog on blocks of
    instants, which are averaged before and interpolated between afterwards.
    """
    size = len(hanging)
    dt = float(np.median(np.diff(time_s))) if size > 1 else 1.0 / SWING_RATE_HZ
    block = max(1, min(round(1.0 / (SWING_RATE_HZ * dt)), size))
    edges = np.arange(0, size, block)
    counts = np.diff(np.append(edges, size))[:, None]
    coarse, instants = np.add.reduceat(hanging, edges) / counts, np.add.reduceat(time_s, edges) / counts[:, 0]
    omega = sqrt(gravity_m_s2 / length_m)
    recent = np.maximum(1.0 - omega * block * dt * np.arange(len(coarse)) / np.pi, 0.0)
    start = recent @ coarse / recent.sum()
    states = _swung(coarse.tobytes(), *start.tolist(), block * dt, length_m, 2 * damping_ratio * omega)
    states = np.stack([np.interp(time_s, instants, column) for column in states.T], axis=1)
    direction = states[:, :3] / np.maximum(np.linalg.norm(states[:, :3], axis=1, keepdims=True), 1e-12)
    return direction, states[:, 3]


@lru_cache(maxsize=32)
def _swung(hanging, start_x, start_y, start_z, dt, length_m, damping):
    """As `_leapfrog`, remembered: each column that a payload has asks for the same swing."""
    return _leapfrog(
        np.frombuffer(hanging).reshape(-1, 3), np.array([start_x, start_y, start_z]), dt, length_m, damping
    )


def _leapfrog(hanging, start, dt, length_m, damping):
    """Direction and squared rate of a pendulum at even instants, (n, 4), from rest along `start`."""
    # Plain numbers: a step of an array of three costs ten times as much.
    kept = exp(-damping * dt)
    pull = sqrt(kept) * dt / length_m
    length = sqrt(float(start @ start))
    x, y, z = (start / length).tolist() if length > 0 else (0.0, 0.0, 1.0)
    # Rates live half a step behind: a half step back from rest.
    u, v, w = (-0.5 * pull * (hanging[0] - (hanging[0] @ (x, y, z)) * np.array((x, y, z)))).tolist()
    before = u * u + v * v + w * w
    states = []
    for e_x, e_y, e_z in hanging.tolist():
        along = e_x * x + e_y * y + e_z * z
        u = kept * u + pull * (e_x - along * x)
        v = kept * v + pull * (e_y - along * y)
        w = kept * w + pull * (e_z - along * z)
        after = u * u + v * v + w * w
        states.append((x, y, z, 0.5 * (before + after)))
        before = after
        x, y, z = x + dt * u, y + dt * v, z + dt * w
        longer = sqrt(x * x + y * y + z * z)
        x, y, z = x / longer, y / longer, z / longer
        # The rate is carried along the sphere: it turns with the direction and keeps its size.
        u, v, w = u * longer - dt * after * x, v * longer - dt * after * y, w * longer - dt * after * z
    return np.array(states)


def likely_lengths(parts, bounds_m, damping_ratio, gravity_m_s2):
    """Lengths of a cable, m, at which a small pendulum explains most of what is left: the best peaks of a scan.

    `parts` are (time_s (n,), hanging (n, 3), velocity (n, 2), pulls) of stretches in world axes; `pulls` are residuals
    (n, 2) that the swing may be seen in (a force; a moment turned to the force that it is of), each counted by its own
    size. What follows the hanging itself and the velocity is left to others, and the swing from before the first
    instant to the cable's own free motion.
    """
    lengths = np.geomspace(*bounds_m, LENGTHS_TRIED)
    ways = min((len(pulls) for *_, pulls in parts), default=0)
    own, shared, whole = np.zeros((ways, LENGTHS_TRIED)), np.zeros((ways, LENGTHS_TRIED)), np.zeros(ways)
    for time_s, *columns, pulls in parts:
        step = float(np.median(np.diff(time_s))) if len(time_s) > 1 else 1.0
        block = max(1, round(1.0 / (SCAN_RATE_HZ * step)))
        count = len(time_s) // block
        if count < SHORTEST_SCAN:
            continue
        hanging, velocity, *pulls = (
            x[: count * block].reshape(count, block, -1).mean(axis=1) for x in (*columns, *pulls)
        )
        pulls = [p - p.mean(axis=0) for p in pulls]
        whole += [float((p**2).sum()) for p in pulls]
        slope = hanging[:, :2] / np.maximum(hanging[:, 2:], LEAST_HANG * gravity_m_s2)
        spectrum = np.fft.rfft(slope - slope.mean(axis=0), 2 * count, axis=0)
        omega = 2 * np.pi * np.fft.rfftfreq(2 * count, block * step)
        since = np.arange(count) * block * step
        for k, length in enumerate(lengths):
            ring = sqrt(gravity_m_s2 / length)
            answer = ring**2 / (ring**2 - omega**2 + 2j * damping_ratio * ring * omega)
            lean = np.fft.irfft(spectrum * answer[:, None], 2 * count, axis=0)[:count]
            fading = np.exp(-damping_ratio * ring * since)
            free = (fading * np.cos(ring * since), fading * np.sin(ring * since))
            for axis in (0, 1):
                others = np.column_stack([np.ones(count), slope[:, axis], velocity[:, axis], *free])
                base = np.linalg.qr(others)[0]
                column = lean[:, axis] - base @ (base.T @ lean[:, axis])
                own[:, k] += column @ column
                shared[:, k] += [column @ p[:, axis] for p in pulls]
    gain = (shared**2 / np.maximum(own, 1e-300) / np.maximum(whole, 1e-300)[:, None]).sum(axis=0)
    inner = np.flatnonzero((gain[1:-1] > gain[:-2]) & (gain[1:-1] >= gain[2:])) + 1
    return tuple(float(lengths[k]) for k in inner[np.argsort(-gain[inner])][:MOST_LIKELY])
