"""How well a manoeuvre can determine each parameter: Fisher information and what follows from it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rotorid.identify.estimate.inertial import regressors, weights_of_inertias


@dataclass(frozen=True)
class _Identifiability:
    """Relative standard errors that a manoeuvre allows, for accelerations with white noise of one sigma.

    `weights` (6,): w11, w22, w33, w14, w25, w36 free, relative to the weight where it is not small (else
    absolute). `inertias` (3,): the three inertias estimated jointly with the gyroscopic terms tied to them.
    """

    weights: np.ndarray
    inertias: np.ndarray
    shares: np.ndarray
    """RMS of the gyroscopic acceleration over that of the torque's, per axis (3,)."""


def identifiability(
    rates: np.ndarray, moments: np.ndarray, inertias: np.ndarray, noise_rad_s2: float
) -> _Identifiability:
    """Of rates (n, 3), rad/s, and moments (n, 3), N m, for noise `noise_rad_s2` of each acceleration."""
    inputs = regressors(rates, moments)
    true = weights_of_inertias(inertias)
    errors = np.empty(6)
    shares = np.empty(3)
    for axis in range(3):
        x = inputs[:, [axis, 3 + axis]]
        errors[[axis, 3 + axis]] = noise_rad_s2 * np.sqrt(np.diag(np.linalg.inv(x.T @ x)))
        parts = x * true[[axis, 3 + axis]]
        shares[axis] = np.sqrt(np.mean(parts[:, 0] ** 2) / np.mean(parts[:, 1] ** 2))
    # Sensitivity of the accelerations to the logarithm of each inertia, gyroscopic terms tied.
    step = 1e-6
    columns = []
    for k in range(3):
        changed = inertias.copy()
        changed[k] *= 1 + step
        slope = (weights_of_inertias(changed) - true) / step
        columns.append(np.concatenate([inputs[:, [a, 3 + a]] @ slope[[a, 3 + a]] for a in range(3)]))
    sensitivity = np.column_stack(columns)
    inertia_errors = noise_rad_s2 * np.sqrt(np.diag(np.linalg.inv(sensitivity.T @ sensitivity)))
    return _Identifiability(errors / np.maximum(np.abs(true), 1e-300), inertia_errors, shares)
