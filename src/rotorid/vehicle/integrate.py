"""Integration in time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np


def rk4_step(
    derivative: Callable[[float, np.ndarray], np.ndarray], share: float, state: np.ndarray, step_s
) -> np.ndarray:
    """One step of the classical Runge-Kutta method (fourth order).

    `derivative(share, state)` is evaluated at the beginning, middle and end of the step: `share` counts
    steps, so that inputs known at samples can be read by index. `step_s` is a number or an array that
    broadcasts with `state`.
    """
    k1 = derivative(share, state)
    k2 = derivative(share + 0.5, state + (0.5 * step_s) * k1)
    k3 = derivative(share + 0.5, state + (0.5 * step_s) * k2)
    k4 = derivative(share + 1.0, state + step_s * k3)
    return state + (step_s / 6.0) * (k1 + 2 * (k2 + k3) + k4)
