"""A full calibration matrix from loads of known direction, next to the thesis's equations.

The thesis reconstructs one axis at a time (eqs 2.6 to 2.8) and says itself that six readings do not determine six
unknowns. Three of these, the forces, they do determine once it is known how the cells answer to each: voltages of
loads of known direction give the answer R (6 × 3, V/N), and its weighted pseudo-inverse A = (Rᵀ W R)⁻¹ Rᵀ W gives
the force of any reading, combined loads included, for as long as the bench answers linearly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit as student_quantile

from rotorid.errors import InputError


@dataclass(frozen=True)
class Calibration:
    """The bench's answer to forces and its inverse."""

    response_v_n: np.ndarray
    """R, V/N, shape (6, 3): column by column the cells' voltages for 1 N along +x, +y, +z."""
    matrix_n_v: np.ndarray
    """A, N/V, shape (3, 6)."""
    response_covariance: np.ndarray
    """Covariance of the rows of R up to each cell's variance: (Fᵀ F)⁻¹, 1/N², shape (3, 3)."""
    residual_v: np.ndarray
    """Standard deviation of each cell's residuals, V, shape (6,)."""
    degrees_of_freedom: int

    def force(self, volts: np.ndarray) -> np.ndarray:
        """Force, N, shape (n, 3), of tared voltages (n, 6), V."""
        return np.asarray(volts, float) @ self.matrix_n_v.T

    def response_interval(self, level: float = 0.95) -> np.ndarray:
        """Half widths of the intervals of R, V/N, shape (6, 3)."""
        quantile = student_quantile(self.degrees_of_freedom, 0.5 + level / 2)
        return quantile * np.outer(self.residual_v, np.sqrt(np.diag(self.response_covariance)))

    def force_covariance(self, force_n: np.ndarray, noise_v: np.ndarray) -> np.ndarray:
        """Covariance of a force, N², shape (n, 3, 3), to first order: R's own and the readings' noise (V, shape (6,)).

        dF = A dv − A dR F: the error of R at a force enters as the voltages would.
        """
        force = np.atleast_2d(force_n)
        spread = np.einsum("ni,ij,nj->n", force, self.response_covariance, force)
        variance = np.asarray(noise_v, float) ** 2 + spread[:, None] * self.residual_v**2
        return np.einsum("ij,nj,kj->nik", self.matrix_n_v, variance, self.matrix_n_v)


def calibrate(volts: np.ndarray, force_n: np.ndarray) -> Calibration:
    """The bench's answer to loads of known direction.

    Parameters
    ----------
    volts
        Mean tared voltages of the cells, V, shape (n, 6).
    force_n
        Known loads, N, shape (n, 3), body axes; between them they must cover all three.

    Raises
    ------
    InputError
        Fewer than five loads, or none along some direction.
    """
    volts, force_n = np.asarray(volts, float), np.asarray(force_n, float)
    if len(volts) < 5 or np.linalg.matrix_rank(force_n) < 3:
        raise InputError("a calibration matrix needs at least five loads that cover all three directions")
    response, *_ = np.linalg.lstsq(force_n, volts, rcond=None)
    left = volts - force_n @ response
    freedom = len(volts) - 3
    residual = np.sqrt((left**2).sum(axis=0) / freedom)
    weight = np.diag(1 / residual**2)
    inverse = np.linalg.solve(response @ weight @ response.T, response @ weight)
    return Calibration(response.T, inverse, np.linalg.inv(force_n.T @ force_n), residual, freedom)


def as_dict(calibration: Calibration) -> dict:
    """The calibration for a JSON file."""
    return {
        "response_v_n": calibration.response_v_n.tolist(),
        "response_half_width_95_v_n": calibration.response_interval().tolist(),
        "matrix_n_v": calibration.matrix_n_v.tolist(),
        "residual_v": calibration.residual_v.tolist(),
        "degrees_of_freedom": calibration.degrees_of_freedom,
    }
