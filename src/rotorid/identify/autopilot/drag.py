"""Drag by PX4's own law, jointly with a constant wind: EKF2_BCOEF_X, EKF2_BCOEF_Y, EKF2_MCOEF.

PX4's estimator of wind takes the specific force across the rotors' axis as

    a = −½ ρ b |v| v − M √(ρ/1.225) v,   b = |(v_x/B_x, v_y/B_y)| / |(v_x, v_y)|

with v the velocity through the air in body axes. Source: PX4-Autopilot,
src/modules/ekf2/EKF/aid_sources/drag/drag_fusion.cpp. Its own script for the numbers (mc_wind_estimator_tuning.py)
takes the air for still; here each run has a wind of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from rotorid.identify.autopilot.correlated import EstimatedNumber, fit
from rotorid.identify.autopilot.signals import Stretch
from rotorid.identify.autopilot.thrust import averaged

_AIR_DENSITY_KG_M3 = 1.225
_RATE_HZ = 20.0
"""Residuals are averaged down to about so many a second: drag follows the velocity, which is slow."""
_LEAST_AIRSPEED_M_S = 1e-3
_ZERO_M_S2 = 0.3
"""Believed deviation of the specific force at rest: the accelerometer's zero, and rotors whose axis is not quite z."""
_WIND_M_S = 5.0
"""Believed deviation of each component of the wind about none."""


@dataclass(frozen=True)
class DragFit:
    """Drag by PX4's law."""

    bluff_x: EstimatedNumber
    """1/EKF2_BCOEF_X, m²/kg."""
    bluff_y: EstimatedNumber
    momentum: EstimatedNumber
    """EKF2_MCOEF, 1/s."""
    wind: dict[str, tuple[EstimatedNumber, EstimatedNumber]]
    """By run the wind towards north and east, m/s."""
    fastest_m_s: float
    """99 % quantile of the horizontal speed."""


def specific_drag(
    through_air: np.ndarray, bluff_x: float, bluff_y: float, momentum: float, density_kg_m3: float = _AIR_DENSITY_KG_M3
) -> np.ndarray:
    """Specific force (n, 2), m/s², along body x and y, of velocities through the air (n, 3), body axes."""
    across = through_air[:, :2]
    speed = np.maximum(np.linalg.norm(across, axis=1), _LEAST_AIRSPEED_M_S)
    bluff = np.linalg.norm(across * [bluff_x, bluff_y], axis=1) / speed
    quadratic = 0.5 * density_kg_m3 * bluff * np.linalg.norm(through_air, axis=1)
    return -(quadratic + momentum * np.sqrt(density_kg_m3 / _AIR_DENSITY_KG_M3))[:, None] * across


def fit_drag(stretches: Sequence[Stretch], density_kg_m3: float = _AIR_DENSITY_KG_M3) -> DragFit | None:
    """Drag and wind; None where no stretch has attitude and velocity."""
    used = [s for s in stretches if s.attitude is not None and s.velocity is not None]
    if not used:
        return None
    runs = list(dict.fromkeys(s.run for s in used))
    count = 5 + 2 * len(runs)
    start = np.zeros(count)
    start[:3] = 0.02, 0.02, 0.1
    low = np.array([-0.2, -0.2, -1.0, -3, -3, *[-30.0] * (2 * len(runs))])
    high = np.array([1.0, 1.0, 3.0, 3, 3, *[30.0] * (2 * len(runs))])
    scale = np.array([0.02, 0.02, 0.1, _ZERO_M_S2, _ZERO_M_S2, *[2.0] * (2 * len(runs))])
    prior = np.array([np.inf, np.inf, np.inf, _ZERO_M_S2, _ZERO_M_S2, *[_WIND_M_S] * (2 * len(runs))])

    def residuals(values: np.ndarray) -> list[np.ndarray]:
        out = []
        for s in used:
            at = 5 + 2 * runs.index(s.run)
            moving = s.velocity - np.array([*values[at : at + 2], 0.0])
            through = np.einsum("nji,nj->ni", s.attitude, moving)
            force = specific_drag(through, *values[:3], density_kg_m3) + values[3:5]
            every = max(int(round(1 / (_RATE_HZ * s.dt_s))), 1)
            out += [averaged(s.specific_force[:, j] - force[:, j], every) for j in range(2)]
        return out

    found = fit(residuals, start, (low, high), scale, prior)
    of = [found.of(lambda v, k=k: float(v[k])) for k in range(count)]
    across = np.concatenate([np.linalg.norm(s.velocity[:, :2], axis=1) for s in used])
    wind = {run: (of[5 + 2 * k], of[6 + 2 * k]) for k, run in enumerate(runs)}
    return DragFit(of[0], of[1], of[2], wind, float(np.quantile(across, 0.99)))
