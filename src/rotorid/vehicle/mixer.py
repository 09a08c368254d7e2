"""From rotor speeds to the wrench on the airframe, and back (thesis eqs 4.31, 4.32)."""

from __future__ import annotations

import numpy as np

from rotorid.effects.instant import Constants
from rotorid.errors import InputError
from rotorid.recordings.vehicle import Vehicle


def wrench_matrix(vehicle: Vehicle) -> np.ndarray:
    """Matrix (4, k): total thrust (N, up) and moments about x, y, z (N m) = matrix @ ω² (eq. 4.31)."""
    return Constants(vehicle).mixer


def allocation_matrix(vehicle: Vehicle) -> np.ndarray:
    """Matrix (k, 4): ω² = matrix @ (thrust, moments), the true inverse of eq. 4.31 for four rotors.

    With more rotors than four it is the least-squares (Moore-Penrose) inverse. InputError where the rotors
    cannot make the four wanted quantities independently.
    """
    matrix = wrench_matrix(vehicle)
    # Scaled rows, so that the rank does not hang on N against N m.
    scaled = matrix / np.maximum(np.linalg.norm(matrix, axis=1, keepdims=True), np.finfo(float).tiny)
    if np.linalg.matrix_rank(scaled, tol=1e-9) < 4:
        rotors = "1 rotor" if vehicle.rotor_count == 1 else f"{vehicle.rotor_count} rotors"
        raise InputError(
            f"vehicle {vehicle.name}: its {rotors} cannot set thrust, roll, pitch and "
            "yaw independently (check positions, spins and torque_coefficient_n_m_s2)"
        )
    if vehicle.rotor_count == 4:
        return np.linalg.inv(matrix)
    return np.linalg.pinv(matrix)


def hover_speed_rad_s(vehicle: Vehicle) -> float:
    """Rotor speed, rad/s, at which the believed thrust, the same speed on every rotor, carries the weight."""
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    return float(np.sqrt(weight / vehicle.thrust_coefficients_n_s2().sum()))
