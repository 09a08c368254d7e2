"""Turning z-up laboratory frames into the contract's north-east-down and forward-right-down.

Most laboratories log body axes forward-left-up (FLU) and a world with z up (north-west-up or
east-north-up). Turning both by half a turn about the x axis gives forward-right-down (FRD) and a world with
z down; x stays x, y and z change sign. A quaternion between the two then keeps w and x and changes the sign
of y and z.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

HALF_TURN_ABOUT_X = np.array([1.0, -1.0, -1.0])


def half_turn_about_x(vectors: np.ndarray) -> np.ndarray:
    """Vectors shape (n, 3) from FLU to FRD (or from z up to z down); its own inverse."""
    return np.asarray(vectors, float) * HALF_TURN_ABOUT_X


def quaternion_to_frd_ned(wxyz: np.ndarray) -> np.ndarray:
    """Quaternions (n, 4), scalar first, FLU body to z-up world, as FRD body to z-down world; unit length."""
    wxyz = np.asarray(wxyz, float) * np.array([1.0, 1.0, -1.0, -1.0])
    return continuous(wxyz / np.linalg.norm(wxyz, axis=1, keepdims=True))


def continuous(wxyz: np.ndarray) -> np.ndarray:
    """The same attitudes with signs chosen so that neighbours are close (q and -q are one attitude)."""
    dots = np.sum(wxyz[1:] * wxyz[:-1], axis=1)
    signs = np.cumprod(np.concatenate([[1.0], np.where(dots < 0, -1.0, 1.0)]))
    return wxyz * signs[:, None]


def quaternion_from_euler_frd(roll: np.ndarray, pitch: np.ndarray, yaw: np.ndarray) -> np.ndarray:
    """Quaternions (n, 4), scalar first, from FRD roll, pitch, yaw in rad (aerospace order z-y'-x'')."""
    xyzw = Rotation.from_euler("ZYX", np.column_stack([yaw, pitch, roll])).as_quat()
    return continuous(xyzw[:, [3, 0, 1, 2]])
