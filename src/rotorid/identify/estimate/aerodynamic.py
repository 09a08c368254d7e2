"""C_F and C_Q by a linear 1-n-1 network without bias (thesis 4.3.1, eqs 4.58-4.73)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rotorid.identify.networks.network import Network, build
from rotorid.identify.networks.training import Trained, Training, train


@dataclass(frozen=True)
class Scaling:
    """k_x = 1 / max|ω|, k_d = 1 / max|d| (eq. 4.68)."""

    k_x: float
    k_d: float

    @classmethod
    def of(cls, speed_rad_s: np.ndarray, value: np.ndarray) -> Scaling:
        return cls(float(1 / np.max(np.abs(speed_rad_s))), float(1 / np.max(np.abs(value))))


def coefficient(network: Network, scaling: Scaling) -> float:
    """C = w⁽²⁾ w⁽¹⁾ k_x² / k_d (eq. 4.73), N s2 or N m s2."""
    product = network.weights[1] @ network.weights[0]
    return float(product[0, 0] * scaling.k_x**2 / scaling.k_d)


@dataclass(frozen=True)
class _AerodynamicFit:
    coefficient: float
    scaling: Scaling
    trained: Trained


def fit_coefficient_network(
    speed_rad_s: np.ndarray, value: np.ndarray, hidden: int, training: Training
) -> _AerodynamicFit:
    """Train on steady points: speeds (n,), rad/s, and thrusts (N) or torques (N m) (n,)."""
    scaling = Scaling.of(speed_rad_s, value)
    network = build((1, hidden, 1), ("linear", "linear"), np.random.default_rng(training.seed), bias=False)
    inputs = (scaling.k_x * np.asarray(speed_rad_s, float)[:, None]) ** 2
    targets = scaling.k_d * np.asarray(value, float)[:, None]
    trained = train(network, inputs, targets, training)
    return _AerodynamicFit(coefficient(trained.network, scaling), scaling, trained)
