"""Reference flights: stretches of waypoints, fast figures, vertical work, turning and shaking, joined and smoothed."""

import numpy as np
from scipy.ndimage import gaussian_filter1d

from .engine import STEP

KINDS = ("waypoints", "figure", "vertical", "turning", "shaking")


def sweep(t, rng, lowest, highest, count):
    """Sum of sines of unit rms, frequencies spread evenly on a logarithmic scale."""
    f = np.exp(np.linspace(np.log(lowest), np.log(highest), count)) * rng.uniform(0.9, 1.1, count)
    return np.sqrt(2 / count) * np.sin(2 * np.pi * f * t[:, None] + rng.uniform(0, 2 * np.pi, count)).sum(axis=1)


def reference(
    seconds: float, kinds, rng: np.random.Generator, agility: float, base_m: float = 12.0, floor_m: float = 0.2
):
    """(k, 13): position, velocity, acceleration in the world, heading, angular acceleration to inject (body).

    `agility` scales speeds and shaking; with `low` among the kinds all is flown between `floor_m` and about a metre
    above the ground at z = 0.
    """
    k = int(seconds / STEP)
    t = np.arange(k) * STEP
    lead = int(1.0 / STEP)
    place, heading, shake = np.zeros((k, 3)), np.zeros(k), np.zeros((k, 3))
    edges = np.linspace(lead, k - lead, len(kinds) + 1).astype(int)
    now, yaw = np.zeros(3), 0.0
    for kind, a, b in zip(kinds, edges[:-1], edges[1:], strict=True):
        own = t[a:b] - t[a]
        gate = np.clip(np.minimum(own, own[-1] - own) / 1.5, 0, 1)
        gate = gate * gate * (3 - 2 * gate)
        path = np.tile(now, (b - a, 1))
        if kind == "waypoints":
            legs = max(2, int(own[-1] / 2.5))
            points = rng.uniform(-4, 4, (legs, 3)) * np.array([1, 1, 0.4]) * agility
            points[-1] = 0
            for axis in range(3):
                path[:, axis] += np.interp(own, np.linspace(0, own[-1] - 1.0, legs + 1), [0, *points[:, axis]])
            now = path[-1].copy()
        elif kind == "figure":
            speed = rng.uniform(4.5, 9.0) * agility
            size = rng.uniform(4.0, 7.0)
            rate = speed / size
            turn = rng.uniform(0, 2 * np.pi)
            u, w = size * np.sin(rate * own) * gate, 0.5 * size * np.sin(2 * rate * own) * gate
            path[:, 0] += np.cos(turn) * u - np.sin(turn) * w
            path[:, 1] += np.sin(turn) * u + np.cos(turn) * w
            path[:, 2] += gate * sweep(own, rng, 0.1, 0.4, 3) * 0.5
        elif kind == "vertical":
            path[:, 2] += gate * sweep(own, rng, 0.08, 0.6, 4) * 1.3 * agility
        elif kind == "low":
            path[:, 2] += gate * (0.35 * sweep(own, rng, 0.08, 0.3, 3))
        elif kind == "turning":
            heading[a:b] += gate * 2.2 * np.sin(2 * np.pi * own / rng.uniform(5, 8))
            path[:, :2] += (gate * sweep(own, rng, 0.1, 0.3, 3))[:, None] * rng.uniform(-1.5, 1.5, 2)
        if kind != "low":
            for axis, most in enumerate((9.0, 9.0, 4.0)):
                strong = 1.0 if kind == "shaking" else 0.25
                shake[a:b, axis] = strong * most * agility * gate * sweep(own, rng, 0.6, 5.0, 9)
        place[a:b] = path
        heading[a:b] += yaw
    place[edges[-1] :] = now
    place = gaussian_filter1d(place, 0.35 / STEP, axis=0, mode="nearest")
    heading = gaussian_filter1d(heading, 0.35 / STEP, mode="nearest")
    if "low" in kinds:
        place[:, 2] = -(floor_m + np.sqrt(place[:, 2] ** 2 + 0.03**2))
    else:
        place[:, 2] -= base_m
    velocity = np.gradient(place, STEP, axis=0)
    acceleration = gaussian_filter1d(np.gradient(velocity, STEP, axis=0), 0.05 / STEP, axis=0)
    return np.concatenate([place, velocity, acceleration, heading[:, None], shake], axis=1)
