"""Do the gyroscopic weights agree with the inertias trained jointly?

Six weights describe three inertias, so three relations must hold: w11 = w14 (1/w25 - 1/w36), w22 = w25 (1/w36
- 1/w14), w33 = w36 (1/w14 - 1/w25). A Wald test asks whether their violation is more than the weights' own
uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc


@dataclass(frozen=True)
class _Consistency:
    """`gap` (3,): trained minus implied gyroscopic weight; `sigma` its standard error (0 where unknown)."""

    trained: np.ndarray
    implied: np.ndarray
    gap: np.ndarray
    sigma: np.ndarray
    statistic: float
    p_value: float


def implied_gyroscopic(weights: np.ndarray) -> np.ndarray:
    """w11, w22, w33 as the torque weights imply them, (3,)."""
    a, b, c = np.asarray(weights)[3:]
    return np.array([a * (1 / b - 1 / c), b * (1 / c - 1 / a), c * (1 / a - 1 / b)])


def _slope(weights: np.ndarray) -> np.ndarray:
    """Derivative of the gaps (3,) by the six weights, (3, 6)."""
    a, b, c = np.asarray(weights)[3:]
    implied = np.array(
        [
            [1 / b - 1 / c, -a / b**2, a / c**2],
            [b / a**2, 1 / c - 1 / a, -b / c**2],
            [-c / a**2, c / b**2, 1 / a - 1 / b],
        ]
    )
    return np.hstack([np.eye(3), -implied])


def check_consistency(weights: np.ndarray, covariance: np.ndarray) -> _Consistency:
    """Wald test of the three relations for weights (6,) with covariance (6, 6)."""
    weights = np.asarray(weights, float)
    implied = implied_gyroscopic(weights)
    gap = weights[:3] - implied
    slope = _slope(weights)
    spread = slope @ covariance @ slope.T
    statistic = float(gap @ np.linalg.solve(spread, gap))
    return _Consistency(weights[:3], implied, gap, np.sqrt(np.diag(spread)), statistic, float(chdtrc(3, statistic)))
