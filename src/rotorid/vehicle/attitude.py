"""Attitudes: quaternions (Hamilton, scalar first, body to world), rotation matrices, Euler angles (zyx).

Every function works on batches: leading axes are free, the last ones hold the vector or matrix.
"""

from __future__ import annotations

import numpy as np


def rotation_from_quaternion(quaternion: np.ndarray) -> np.ndarray:
    """Rotation of body vectors into the world, (..., 3, 3), of unit quaternions (..., 4)."""
    w, x, y, z = np.moveaxis(quaternion, -1, 0)
    out = np.empty(quaternion.shape[:-1] + (3, 3))
    out[..., 0, 0] = 1 - 2 * (y * y + z * z)
    out[..., 0, 1] = 2 * (x * y - w * z)
    out[..., 0, 2] = 2 * (x * z + w * y)
    out[..., 1, 0] = 2 * (x * y + w * z)
    out[..., 1, 1] = 1 - 2 * (x * x + z * z)
    out[..., 1, 2] = 2 * (y * z - w * x)
    out[..., 2, 0] = 2 * (x * z - w * y)
    out[..., 2, 1] = 2 * (y * z + w * x)
    out[..., 2, 2] = 1 - 2 * (x * x + y * y)
    return out


def quaternion_rate(quaternion: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """dq/dt = ½ q ⊗ (0, Ω), (..., 4), 1/s, of quaternions (..., 4) and body rates (..., 3), rad/s."""
    w, x, y, z = np.moveaxis(quaternion, -1, 0)
    p, q, r = np.moveaxis(rates, -1, 0)
    out = np.empty(np.broadcast_shapes(quaternion.shape[:-1], rates.shape[:-1]) + (4,))
    out[..., 0] = -0.5 * (x * p + y * q + z * r)
    out[..., 1] = 0.5 * (w * p + y * r - z * q)
    out[..., 2] = 0.5 * (w * q + z * p - x * r)
    out[..., 3] = 0.5 * (w * r + x * q - y * p)
    return out


def normalised(quaternion: np.ndarray) -> np.ndarray:
    """Quaternions of length one, (..., 4)."""
    return quaternion / np.sqrt(np.einsum("...i,...i->...", quaternion, quaternion))[..., None]


def quaternion_from_euler(euler_rad: np.ndarray) -> np.ndarray:
    """Quaternion (..., 4) of roll, pitch, yaw (..., 3), rad; order yaw, pitch, roll (thesis 4.5-4.9)."""
    half = np.asarray(euler_rad, float) / 2
    c, s = np.cos(half), np.sin(half)
    cr, cp, cy = np.moveaxis(c, -1, 0)
    sr, sp, sy = np.moveaxis(s, -1, 0)
    return np.stack(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ],
        axis=-1,
    )


def euler_from_quaternion(quaternion: np.ndarray) -> np.ndarray:
    """Roll, pitch, yaw (..., 3), rad, of unit quaternions (..., 4); roll and yaw in (-π, π]."""
    w, x, y, z = np.moveaxis(quaternion, -1, 0)
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (w * y - x * z), -1.0, 1.0))
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.stack([roll, pitch, yaw], axis=-1)
