"""Weights of networks that are numbers of physics (thesis 4.3): rotor coefficients and principal inertias.

- C_F and C_Q by a linear 1-n-1 network without bias (eqs 4.58-4.73).
- Principal inertias by the masked single-layer network (eqs 4.74-4.80), and by least squares. Both fit
  dp/dt = w11 qr + w14 τ_φ and its two companions; inertias are the reciprocals of the torque weights.
- Six weights describe three inertias, so three relations must hold: w11 = w14 (1/w25 - 1/w36), w22 = w25 (1/w36
  - 1/w14), w33 = w36 (1/w14 - 1/w25). A Wald test asks whether their violation is more than the weights' own
  uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc

from rotorid.effects.contract import compiled
from rotorid.identify.networks import Network, Trained, Training, build, train

MASK = np.array([[1, 0, 0, 1, 0, 0], [0, 1, 0, 0, 1, 0], [0, 0, 1, 0, 0, 1]], float)
"""Which weights of eq. 4.74 are there."""
WEIGHT_NAMES = ("w11", "w22", "w33", "w14", "w25", "w36")


def regressors(rates: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """Inputs (n, 6): qr, pr, pq, τ_φ, τ_θ, τ_ψ, of rates (n, 3), rad/s, and moments (n, 3), N m."""
    p, q, r = rates.T
    return np.column_stack([q * r, p * r, p * q, moments])


def weights_of_inertias(inertias: np.ndarray) -> np.ndarray:
    """The six weights (w11, w22, w33, w14, w25, w36) that inertias (3,), kg m2, imply (eq. 4.79)."""
    x, y, z = inertias
    return np.array([(y - z) / x, (z - x) / y, (x - y) / z, 1 / x, 1 / y, 1 / z])


def _six_weights(matrix: np.ndarray) -> np.ndarray:
    """(w11, w22, w33, w14, w25, w36) of the weight matrix (3, 6)."""
    return np.array([matrix[i, i] for i in range(3)] + [matrix[i, 3 + i] for i in range(3)])


def inertias_of_weights(weights: np.ndarray) -> np.ndarray:
    """J_xx, J_yy, J_zz = 1 / (w14, w25, w36) (eq. 4.80), kg m2."""
    return 1.0 / np.asarray(weights)[3:]


@dataclass(frozen=True)
class _WeightFit:
    """Six weights, their covariance (6, 6), residual of the accelerations (n, 3)."""

    weights: np.ndarray
    covariance: np.ndarray
    residual: np.ndarray

    @property
    def inertias(self) -> np.ndarray:
        return inertias_of_weights(self.weights)

    @property
    def inertia_errors(self) -> np.ndarray:
        """Standard errors of the inertias, (3,), kg m2 (first order)."""
        return np.sqrt(np.diag(self.covariance)[3:]) * self.inertias**2


@dataclass(frozen=True)
class NetworkFit:
    """Six weights in physical units, the error by epoch (kept, 3), and the epochs (6,) in which each weight's error
    shrinks to 1/e under the batch method.

    `epochs_to_settle` is 1 / (rate <x²>) of the weight's input: what the plain gradient rule needs, other weights
    apart.
    """

    weights: np.ndarray
    epochs: np.ndarray
    mse: np.ndarray
    epochs_to_settle: np.ndarray

    @property
    def inertias(self) -> np.ndarray:
        return inertias_of_weights(self.weights)


@compiled()
def _delta_rule(weights, inputs, targets, order, rate, epochs, group, every):  # pragma: no cover - compiled
    """Train the weights (3, 6) in place; the mean squared error (kept, 3) of each `every`-th epoch.

    A step is the mean over `group` samples, taken in `order` (count,).
    """
    count = len(inputs)
    kept = (epochs + every - 1) // every
    history = np.zeros((kept, 3))
    for epoch in range(epochs):
        for start in range(0, count, group):
            stop = min(start + group, count)
            step = np.zeros((3, 2))
            for place in range(start, stop):
                row = inputs[order[place]]
                for axis in range(3):
                    product, moment = row[axis], row[3 + axis]
                    known = weights[axis, axis] * product + weights[axis, 3 + axis] * moment
                    error = targets[order[place], axis] - known
                    step[axis, 0] += error * product
                    step[axis, 1] += error * moment
                    if epoch % every == 0:
                        history[epoch // every, axis] += error * error / count
            for axis in range(3):
                weights[axis, axis] += rate * step[axis, 0] / (stop - start)
                weights[axis, 3 + axis] += rate * step[axis, 1] / (stop - start)
    return history


def fit_masked_network(
    rates: np.ndarray, accelerations: np.ndarray, moments: np.ndarray, training: Training, scaled: bool = False
) -> NetworkFit:
    """Train the masked network from random weights by the generalised delta rule, with any of the data methods.

    `scaled` divides every input and output by its largest magnitude, as eqs 4.67-4.73 do for the rotor networks;
    the thesis trains this network without. The history is of scaled or plain accelerations alike.
    """
    inputs = regressors(rates, moments)
    k_x = 1 / np.abs(inputs).max(axis=0) if scaled else np.ones(6)
    k_d = 1 / np.abs(accelerations).max(axis=0) if scaled else np.ones(3)
    rng = np.random.default_rng(training.seed)
    matrix = rng.uniform(-1, 1, (3, 6)) * MASK
    group = {"batch": len(inputs), "stochastic": 1, "mini-batch": training.group}[training.method]
    order = rng.permutation(len(inputs))
    mse = _delta_rule(
        matrix, inputs * k_x, accelerations * k_d, order, training.rate, training.epochs, group, training.every
    )
    if not np.isfinite(matrix).all():
        raise ValueError(f"training ran away: lower the rate {training.rate}")
    matrix = matrix * k_x / k_d[:, None]
    with np.errstate(divide="ignore"):  # an input that is always zero never settles
        settle = 1 / (training.rate * np.mean((inputs * k_x) ** 2, axis=0))
    return NetworkFit(_six_weights(matrix), np.arange(len(mse)) * training.every, mse, settle)


def fit_least_squares(rates: np.ndarray, accelerations: np.ndarray, moments: np.ndarray, block: int = 50) -> _WeightFit:
    """The weights where the network would end, with a covariance that holds for residuals correlated in time.

    Scores are summed over blocks of `block` samples (cluster-robust), so that correlation shorter than a
    block is counted.
    """
    inputs = regressors(rates, moments)
    weights, covariance = np.empty(6), np.zeros((6, 6))
    residual = np.empty_like(accelerations)
    edges = np.arange(0, len(inputs), block)
    for axis in range(3):
        x = inputs[:, [axis, 3 + axis]]
        inverse = np.linalg.inv(x.T @ x)
        found = inverse @ (x.T @ accelerations[:, axis])
        residual[:, axis] = accelerations[:, axis] - x @ found
        scores = np.add.reduceat(x * residual[:, axis, None], edges, axis=0)
        spread = len(edges) / max(len(edges) - 2, 1) * inverse @ (scores.T @ scores) @ inverse
        weights[[axis, 3 + axis]] = found
        covariance[np.ix_([axis, 3 + axis], [axis, 3 + axis])] = spread
    return _WeightFit(weights, covariance, residual)


@dataclass(frozen=True)
class _Consistency:
    """`gap` (3,): trained minus implied gyroscopic weight; `sigma` its standard error (0 where unknown)."""

    trained: np.ndarray
    implied: np.ndarray
    gap: np.ndarray
    sigma: np.ndarray
    statistic: float
    p_value: float


def implied_gyroscopic(weights: np.ndarray) -> np.ndarray:
    """w11, w22, w33 as the torque weights imply them, (3,)."""
    a, b, c = np.asarray(weights)[3:]
    return np.array([a * (1 / b - 1 / c), b * (1 / c - 1 / a), c * (1 / a - 1 / b)])


def _slope(weights: np.ndarray) -> np.ndarray:
    """Derivative of the gaps (3,) by the six weights, (3, 6)."""
    a, b, c = np.asarray(weights)[3:]
    implied = np.array(
        [
            [1 / b - 1 / c, -a / b**2, a / c**2],
            [b / a**2, 1 / c - 1 / a, -b / c**2],
            [-c / a**2, c / b**2, 1 / a - 1 / b],
        ]
    )
    return np.hstack([np.eye(3), -implied])


def check_consistency(weights: np.ndarray, covariance: np.ndarray) -> _Consistency:
    """Wald test of the three relations for weights (6,) with covariance (6, 6)."""
    weights = np.asarray(weights, float)
    implied = implied_gyroscopic(weights)
    gap = weights[:3] - implied
    slope = _slope(weights)
    spread = slope @ covariance @ slope.T
    statistic = float(gap @ np.linalg.solve(spread, gap))
    return _Consistency(weights[:3], implied, gap, np.sqrt(np.diag(spread)), statistic, float(chdtrc(3, statistic)))


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
