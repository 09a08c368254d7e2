"""Ways to fly, as sums of sines and smooth steps on a grid of 10 ms."""

import numpy as np

from .equations import GRID

STYLES = ("survey", "sprint", "bob", "spin", "stir")


def smooth(x):
    """Fifth-order step from 0 to 1 with flat ends."""
    x = np.clip(x, 0, 1)
    return x**3 * (10 - 15 * x + 6 * x * x)


def band(t, rng, low, high, count, power=0.0):
    """Sines between two frequencies with random phases, unit rms; amplitudes fall as f^-power."""
    f = np.exp(rng.uniform(np.log(low), np.log(high), count))
    a = f**-power
    a /= np.sqrt(0.5 * (a**2).sum())
    return (a * np.sin(2 * np.pi * f * t[:, None] + rng.uniform(0, 6.283, count))).sum(axis=1)


def path(seconds: float, style: str, rng: np.random.Generator, scale: float, small: bool) -> np.ndarray:
    """(k, 13): position, velocity, acceleration, heading, angular acceleration to inject.

    `scale` is of everything; `small` vehicles fly slower and turn faster.
    """
    k = int(seconds / GRID) + 8
    t = np.arange(k) * GRID
    gate = smooth((t - 1) / 3) * smooth((seconds - 0.5 - t) / 3)
    reach = (0.5 if small else 1.0) * scale
    place = np.stack([1.2 * band(t, rng, 0.05, 0.25, 4, 1) for _ in range(3)], axis=1) * np.array([1, 1, 0.5]) * reach
    if style == "sprint":
        ahead = rng.uniform(0, 6.283)
        period = rng.uniform(6.0, 9.0)
        speed = rng.uniform(5.0, 9.5) * reach
        along = speed * period / 6.283 * np.sin(6.283 * t / period)
        across = 0.3 * speed * period / 6.283 * np.sin(12.566 * t / period + 1.0)
        place[:, 0] += np.cos(ahead) * along - np.sin(ahead) * across
        place[:, 1] += np.sin(ahead) * along + np.cos(ahead) * across
    if style == "bob":
        place[:, 2] += 1.4 * reach * band(t, rng, 0.12, 0.5, 4, 0.5)
    if style == "survey":
        for axis in (0, 1):
            at = np.sort(rng.uniform(3, seconds - 4, 4))
            steps = rng.uniform(-4, 4, 4) * reach
            place[:, axis] += sum(
                s * (smooth((t - a) / 3.0) - smooth((t - seconds + 6) / 4)) for s, a in zip(steps, at, strict=True)
            )
    heading = np.zeros(k)
    if style == "spin":
        heading = 2.5 * gate * np.sin(2 * np.pi * t / rng.uniform(6, 10))
    place *= gate[:, None]
    place[:, 2] -= 15.0
    velocity = np.gradient(place, GRID, axis=0, edge_order=2)
    acceleration = np.gradient(velocity, GRID, axis=0, edge_order=2)
    strong = {"stir": 1.0, "spin": 0.4}.get(style, 0.25) * (2.0 if small else 0.6) * scale
    top = 6.0 if small else 3.5
    shake = np.stack([a * strong * band(t, rng, 0.4, top, 10) for a in (7.0, 7.0, 2.5)], axis=1) * gate[:, None]
    return np.concatenate([place, velocity, acceleration, heading[:, None], shake], axis=1)
