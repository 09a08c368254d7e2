"""Whether one measured quantity is what another integrates to, by their changes over short steps of time.

A gyroscope integrates to the attitude, an accelerometer (turned by the attitude, with gravity) to the velocity, a
velocity to the position. Compared are the changes over `STEP_S`, so that noise averages out and offsets hardly count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.spatial.transform import Rotation

STEP_S = 0.2


@dataclass(frozen=True)
class Agreement:
    """How the changes of a quantity (n, 3) follow those of a candidate (n, 3) that should integrate to it.

    `correlation` about zero over all axes together, `slope` quantity per candidate, `size`, the 95 % quantile of
    the changes of the quantity, and `by_axis`, the correlation of each axis alone.
    """

    correlation: float = 0.0
    slope: float = 0.0
    size: float = 0.0
    by_axis: tuple[float, ...] = (0.0,)

    @property
    def in_words(self) -> str:
        return f"correlation {self.correlation:.2f}, factor {self.slope:.4g}"


def compare(quantity: np.ndarray, candidate: np.ndarray) -> Agreement:
    """`Agreement` of changes (n, 3); rows with a missing value take no part, and less than ten rows say nothing."""
    known = np.isfinite(quantity).all(axis=1) & np.isfinite(candidate).all(axis=1)
    if known.sum() < 10:
        return Agreement()
    a, b = quantity[known], candidate[known]
    a, b = a - np.median(a, axis=0), b - np.median(b, axis=0)
    aa, bb, ab = (a * a).sum(axis=0), (b * b).sum(axis=0), (a * b).sum(axis=0)
    if not (aa.sum() > 0 and bb.sum() > 0):
        return Agreement()
    correlation = float(ab.sum() / np.sqrt(aa.sum() * bb.sum()))
    size = float(np.quantile(np.linalg.norm(a, axis=1), 0.95))
    by_axis = tuple(float(c / np.sqrt(p * q)) if p * q > 0 else 0.0 for c, p, q in zip(ab, aa, bb, strict=True))
    return Agreement(correlation, float(ab.sum() / bb.sum()), size, by_axis)


def steps_of(time_s: np.ndarray) -> np.ndarray:
    """Instants `STEP_S` apart (longer where the clock is slow) from the first to the last of a clock (n,), s."""
    usual = float(np.median(np.diff(time_s)))
    step = max(STEP_S, 4 * usual)
    return np.arange(time_s[0], time_s[-1] + 1e-9, step)


def _at(instants: np.ndarray, time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values (n, k) at instants (m,) by straight lines between the samples that are there; NaN where none is."""
    out = np.full((len(instants), values.shape[1]), np.nan)
    known = np.isfinite(values).all(axis=1)
    if known.sum() > 1:
        for k in range(values.shape[1]):
            out[:, k] = np.interp(instants, time_s[known], values[known, k], left=np.nan, right=np.nan)
    return out


def changes(instants: np.ndarray, time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Changes (m − 1, k) of values (n, k) between instants (m,)."""
    return np.diff(_at(instants, time_s, values), axis=0)


def integrated(instants: np.ndarray, time_s: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Integrals (m − 1, k) of values (n, k) between instants (m,)."""
    known = np.isfinite(values).all(axis=1)
    if known.sum() < 2:
        return np.full((len(instants) - 1, values.shape[1]), np.nan)
    total = cumulative_trapezoid(values[known], time_s[known], axis=0, initial=0)
    return changes(instants, time_s[known], total)


def turned(instants: np.ndarray, time_s: np.ndarray, wxyz: np.ndarray) -> np.ndarray:
    """Rotations in body axes (m − 1, 3), rad, between instants by quaternions (n, 4), scalar first, body to world."""
    turns = rotations(_at(instants, time_s, wxyz))
    if turns is None:
        return np.full((len(instants) - 1, 3), np.nan)
    rotation, known = turns
    out = np.full((len(instants) - 1, 3), np.nan)
    both = known[1:] & known[:-1]
    full = np.full((len(instants), 4), [0.0, 0.0, 0.0, 1.0])
    full[known] = rotation.as_quat()
    every = Rotation.from_quat(full)
    out[both] = (every[:-1].inv() * every[1:]).as_rotvec()[both]
    return out


def rotations(wxyz: np.ndarray) -> tuple[Rotation, np.ndarray] | None:
    """Rotations of the quaternions (n, 4) that are known, and their mask; None where there is none."""
    known = np.isfinite(wxyz).all(axis=1) & (np.linalg.norm(np.nan_to_num(wxyz), axis=1) > 1e-6)
    return (Rotation.from_quat(wxyz[known][:, [1, 2, 3, 0]]), known) if known.any() else None


def into_world(time_s: np.ndarray, wxyz: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    """Vectors (n, 3) of the body turned into the world by quaternions (n, 4) with gaps, which are bridged."""
    out = np.full(vectors.shape, np.nan)
    turns = rotations(_at(time_s, time_s, wxyz))
    if turns is not None:
        rotation, known = turns
        out[known] = rotation.apply(vectors[known])
    return out
