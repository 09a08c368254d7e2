"""A six-axis force-torque sensor: crosstalk, resonance of what stands on it, drift, noise."""

from __future__ import annotations

import numpy as np

from rotorid.acquire.emulators.oscillator import Oscillator
from rotorid.acquire.emulators.truth import SensorTruth


class SixAxis:
    """State of the sensor; wrenches have shape (6,): force in N, moment in N m, sensor axes."""

    def __init__(self, truth: SensorTruth, rng: np.random.Generator, at_rest: np.ndarray) -> None:
        self._truth = truth
        self._rng = rng
        self._crosstalk = np.array(truth.crosstalk)
        self._noise, self._vibration = np.array(truth.noise), np.array(truth.vibration)
        self._drift_per_s = np.array(truth.drift_per_s)
        self._structure = Oscillator(6, truth.resonance_hz, truth.damping)
        self._structure.position = at_rest.copy()
        self._zero = np.zeros(6)
        self._offset = np.zeros(6)

    def process(self, dt_s: float, wrench: np.ndarray) -> None:
        """Advance by `dt_s` under a wrench."""
        self._structure.process(dt_s, wrench)
        self._zero = self._zero + self._drift_per_s * dt_s

    def read(self, speed_rad_s: float = 0.0) -> np.ndarray:
        """A reading; rotors that turn at a mean speed shake it."""
        noise = self._noise + self._vibration * (speed_rad_s / 1000) ** 2
        felt = self._crosstalk @ self._structure.position
        return felt + self._zero - self._offset + noise * self._rng.standard_normal(6)

    def offset(self) -> None:
        """Take the present mean reading as zero."""
        self._offset = self._crosstalk @ self._structure.position + self._zero
