"""The bench's geometry: cell forces to body forces (thesis eqs 2.3–2.9, table 2.3), and the inverse.

The recorder shows forces with it; the emulated bench uses the inverse. The pipeline has its own
implementation, so that one can be checked against the other.

Weights as an operator puts them down: never twice in quite the same place.
"""

from __future__ import annotations

import math

import numpy as np

# a load "along z" pulls upwards, as thrust does
AXES = {"x": np.array([1.0, 0, 0]), "y": np.array([0, 1.0, 0]), "z": np.array([0, 0, -1.0])}
GF_N = 9.80665e-3
_L_M = 0.225
_D_135Z, _D_246Z = 0.02120, 0.050457916
_D_2X, _D_4X, _D_6X = 0.068585472, 0.053814095, 0.014771377
_D_2Y, _D_4Y, _D_6Y = 0.022541324, 0.048126099, 0.070667423
_C30, _C45, _C60 = (math.cos(math.radians(angle)) for angle in (30, 45, 60))

# eq. 2.9, first two rows (forces along x and y) and the linear part of the third, shape (3, 6)
M = np.array(
    [
        [
            -_D_135Z / (_C60 * _L_M),
            (_D_246Z / _C30 - _D_2X) / (_C45 * _L_M),
            _D_135Z / _L_M,
            _D_4X / (_C45 * _L_M),
            -_D_135Z / (_C60 * _L_M),
            -(_D_246Z / _C30 - _D_6X) / (_C45 * _L_M),
        ],
        [
            _D_135Z / (_C30 * _L_M),
            (_D_246Z / _C60 + _D_2Y) / (_C45 * _L_M),
            0.0,
            (_D_4Y - _D_246Z) / (_C45 * _L_M),
            -_D_135Z / (_C30 * _L_M),
            (_D_246Z / _C60 - _D_6Y) / (_C45 * _L_M),
        ],
        [0.0, -1 / _C45, 0.0, -1 / _C45, 0.0, -1 / _C45],
    ]
)

# table 2.8, as printed: gf per 1e-5 V and gf
SLOPE = np.array([39.7571, 37.2649, 40.9000, 39.9259, 42.4717, 39.4705])
INTERCEPT = np.array([-0.0829, -0.3379, 0.1014, 0.0289, 0.1096, 0.0771])


def body_forces(cells_n: np.ndarray) -> np.ndarray:
    """Force on the vehicle, body axes, shape (3,), N, from the six cells' forces, shape (6,), N (eq. 2.9)."""
    force = M @ cells_n
    force[2] -= np.abs(cells_n[[0, 2, 4]]).sum()
    return force


def cell_forces(volts: np.ndarray) -> np.ndarray:
    """Cells' forces in N, shape (6,), from tared voltages in V, with table 2.8's calibration (eq. 2.10)."""
    return (INTERCEPT + SLOPE * volts * 1e5) * GF_N


def cell_response() -> np.ndarray:
    """Forces on the six cells for a unit force on the body along x, y and −z, shape (6, 3).

    The inverse of the equations above where they hold, along one axis at a time; six unknowns and three
    equations leave a choice, and it is: least squares of the cells' forces for x and y (with no share in
    the linear part of z), and for −z all cells alike ("the load cells deform equally", thesis 2.4) as
    nearly as no reading in x and y allows.
    """
    lateral = np.linalg.pinv(M)[:, :2]
    rows = M.copy()
    rows[2, [0, 2, 4]] = -1.0  # cells 1, 3, 5 pulled: their absolute value is their value
    wanted = np.array([0.0, 0.0, -1.0])
    alike = np.full(6, 1 / (3 + 3 / _C45))
    vertical = alike + np.linalg.pinv(rows) @ (wanted - rows @ alike)
    if (vertical[[0, 2, 4]] <= 0).any():
        raise AssertionError("cells 1, 3 and 5 must be pulled by a force along -z")
    return np.column_stack([lateral, vertical])


def direction_of(axis: str) -> np.ndarray:
    """Unit vector of a load along one axis, or along several alike (`xz`: halfway between x and z)."""
    together = sum(AXES[letter] for letter in axis)
    return together / np.linalg.norm(together)


_SPREAD = 1e-4
_SPREAD_GF = 0.08


def put_down(load_gf: float, rng: np.random.Generator) -> float:
    """Force in N that a weight in gf exerts this time; no weight exerts none."""
    if load_gf == 0:
        return 0.0
    return (load_gf * (1 + _SPREAD * rng.standard_normal()) + _SPREAD_GF * rng.standard_normal()) * GF_N
