"""A damped oscillator driven by a force held over a step: structures ring when their load changes."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np


@lru_cache(maxsize=64)
def _transition(omega: float, damping: float, dt_s: float) -> tuple[float, float, float, float]:
    """Exact transition of (deviation from rest position, velocity) over a step, underdamped."""
    decay = math.exp(-damping * omega * dt_s)
    omega_d = omega * math.sqrt(1 - damping**2)
    c, s = math.cos(omega_d * dt_s), math.sin(omega_d * dt_s)
    k = damping * omega / omega_d
    return decay * (c + k * s), decay * s / omega_d, -decay * s * omega**2 / omega_d, decay * (c - k * s)


class Oscillator:
    """x'' + 2 ζ ω x' + ω² x = ω² u for every entry of u; unit static gain."""

    def __init__(self, size: int, frequency_hz: float, damping: float) -> None:
        self.position = np.zeros(size)
        self.velocity = np.zeros(size)
        self._omega = 2 * math.pi * frequency_hz
        self._damping = damping

    def process(self, dt_s: float, drive: np.ndarray) -> np.ndarray:
        """Advance by `dt_s` with the drive held; returns the position."""
        a, b, c, d = _transition(self._omega, self._damping, round(dt_s, 7))
        deviation = self.position - drive
        self.position = drive + a * deviation + b * self.velocity
        self.velocity = c * deviation + d * self.velocity
        return self.position
