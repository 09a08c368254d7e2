"""Blade elements with uniform inflow after Glauert, as in Leishman's and Bramwell's textbooks.

With advance ratios μ (in the disc) and μ_z (through it from above: positive in a climb), solidity σ, lift slope a, one
pitch θ along the blade and profile drag C_d: C_T = σa/2 (θ/3 + θ μ²/2 − λ/2), λ = μ_z + C_T / (2 √(μ² + λ²)) and an
in-plane force C_H = σ C_d μ/4 + σ a μ λ θ/4. In still air C_T does not depend on the speed: thrust is C_F ω².
"""

import numpy as np
from numba import njit

LIFT_SLOPE = 5.7
PROFILE_DRAG = 0.03


@njit(cache=True)
def coefficients(mu, climb, solidity, pitch):
    """(C_T, C_H) at advance ratios μ and μ_z."""
    inflow = 0.05
    thrust = 0.0
    for _ in range(60):
        thrust = 0.5 * solidity * LIFT_SLOPE * (pitch / 3 + 0.5 * pitch * mu * mu - 0.5 * inflow)
        thrust = max(thrust, 1e-6)
        new = climb + thrust / (2 * np.sqrt(mu * mu + inflow * inflow))
        step = new - inflow
        inflow += 0.4 * step
        if abs(step) < 1e-10:
            break
    side = 0.25 * solidity * PROFILE_DRAG * mu + 0.25 * solidity * LIFT_SLOPE * mu * inflow * pitch
    return thrust, side


def pitch_for(target: float, solidity: float) -> float:
    """Blade pitch, rad, that gives C_T `target` in still air: closed, with λ = √(C_T/2)."""
    return 3 * (2 * target / (solidity * LIFT_SLOPE) + 0.5 * np.sqrt(target / 2))
