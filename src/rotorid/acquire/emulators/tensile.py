"""A printed specimen in the tensile tester: linear up to a limit, then yielding, then it breaks."""

from __future__ import annotations

import numpy as np

from rotorid.acquire.emulators.truth import PlasticTruth

GAUGE_MM = 40.0
SECTION_MM2 = 19.2  # type IV: 6.0 mm × 3.2 mm
_SPEED_MM_S = 10 / 60
_ELASTIC_SHARE = 0.62  # of the yield strength: up to here the specimen is linear
_HARDENING = 1.2
_FORCE_NOISE_N = 0.25


class TensilePhysics:
    """Strain ε = σ/E + 0.002 ((σ − σ_p)/(σ_y − σ_p))^n beyond the proportional limit σ_p, so that the stress
    at 0.2 % plastic strain is the yield strength; it breaks a little after the ultimate strength."""

    def __init__(self, plastic: PlasticTruth, scale: float, slack_mm: float, rng: np.random.Generator) -> None:
        """`scale` multiplies all strengths and the modulus; the crosshead moves `slack_mm` before the force rises."""
        self._rng = rng
        stress = np.linspace(0, plastic.ultimate_pa * scale, 2000)
        limit = _ELASTIC_SHARE * plastic.yield_pa * scale
        beyond = np.maximum(stress - limit, 0) / (plastic.yield_pa * scale - limit)
        self._strain = stress / (plastic.modulus_pa * scale) + 0.002 * beyond**_HARDENING
        self._stress = stress
        self._slack_mm = slack_mm
        self.displacement_mm = 0.0
        self.moving = False

    def process(self, dt_s: float) -> None:
        """Advance by `dt_s`."""
        if self.moving:
            self.displacement_mm += _SPEED_MM_S * dt_s

    def force_n(self) -> float:
        """Reading of the tester's force cell, N."""
        strain = max(self.displacement_mm - self._slack_mm, 0) / GAUGE_MM
        last = self._strain[-1]
        if strain <= last:
            stress = np.interp(strain, self._strain, self._stress)
        elif strain <= 1.12 * last:  # necking
            stress = self._stress[-1] * (1 - 0.5 * (strain / last - 1))
        else:
            stress = 0.0
        return float(stress * SECTION_MM2 * 1e-6 + _FORCE_NOISE_N * self._rng.standard_normal())

    @property
    def broken(self) -> bool:
        return max(self.displacement_mm - self._slack_mm, 0) / GAUGE_MM > 1.2 * self._strain[-1]
