"""Six load cells: gain, zero, seat, drift, creep, hysteresis, overload, noise. Force in, volts out."""

from __future__ import annotations

import numpy as np

from rotorid.acquire.emulators.truth import CellsTruth
from rotorid.acquire.geometry import GF_N


class LoadCells:
    """State of the six bridges; all arrays have shape (6,)."""

    def __init__(self, truth: CellsTruth, rng: np.random.Generator) -> None:
        self._rng = rng
        self._volts_per_n = np.array(truth.volts_per_gf) / GF_N
        self._seat_v = np.array(truth.seat_v)
        self._seat_n = truth.seat_gf * GF_N
        self._zero_v = np.array(truth.zero_v)
        self._drift_v_s = np.array(truth.drift_v_s)
        self._wander = truth.wander_v_sqrt_s
        self._creep_share = np.array(truth.creep_share)
        self._creep_s = np.array(truth.creep_s)
        self._backlash_n = np.array(truth.backlash_n)
        self._rated_n, self._loss = truth.rated_n, truth.overload_loss
        self._noise_v = truth.noise_v
        self._creep_n = np.zeros(6)
        self._play_n = np.zeros(6)

    def process(self, dt_s: float, force_n: np.ndarray) -> None:
        """Advance by `dt_s` under the given forces in N."""
        self._creep_n += (self._creep_share * force_n - self._creep_n) * -np.expm1(-dt_s / self._creep_s)
        self._play_n = np.clip(self._play_n, force_n - self._backlash_n, force_n + self._backlash_n)
        self._zero_v = self._zero_v + self._drift_v_s * dt_s
        if self._wander:
            self._zero_v += self._wander * np.sqrt(dt_s) * self._rng.standard_normal(6)

    def volts(self) -> np.ndarray:
        """What the converter sees now, in V."""
        felt = self._play_n + self._creep_n
        beyond = np.maximum(np.abs(felt) - self._rated_n, 0) * np.sign(felt)
        felt = felt - self._loss * beyond
        seat = self._seat_v * np.tanh(felt / self._seat_n)
        noise = self._noise_v * self._rng.standard_normal(6)
        return self._volts_per_n * felt + seat + self._zero_v + noise
