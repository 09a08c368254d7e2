"""Rotor coefficients and inertias from flights, as weights of networks (thesis 4.3) or by output error.

- C_F and C_Q by a linear 1-n-1 network without bias (eqs 4.58-4.73).
- Principal inertias by the masked single-layer network (eqs 4.74-4.80), and by least squares. Both fit
  dp/dt = w11 qr + w14 τ_φ and its two companions; inertias are the reciprocals of the torque weights.
- Six weights describe three inertias, so three relations must hold: w11 = w14 (1/w25 - 1/w36), w22 = w25 (1/w36
  - 1/w14), w33 = w36 (1/w14 - 1/w25). A Wald test asks whether their violation is more than the weights' own
  uncertainty.
- By output error: body rates simulated in windows are brought to the measured ones. No measured signal is
  differentiated, so noise of the gyroscope does not bias the estimate. The rates at each window's start, and on request
  a constant moment in each window (slow aerodynamics), are unknowns of that window and are projected out; what stays
  are a few parameters shared by all windows. Their covariance is cluster-robust over windows.

Numbers that the thesis prints are for comparison: no result of ours rests on them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc
from scipy.special import stdtrit as student_quantile

from rotorid.effects.contract import compiled
from rotorid_lab.networks import Network, Training, build, train

MASK = np.array([[1, 0, 0, 1, 0, 0], [0, 1, 0, 0, 1, 0], [0, 0, 1, 0, 0, 1]], float)
"""Which weights of eq. 4.74 are there."""
WEIGHT_NAMES = ("w11", "w22", "w33", "w14", "w25", "w36")
WHITE_BOX = {
    "mass_kg": 0.652,
    "thrust_coefficient_n_s2": 1.3877e-6,
    "torque_coefficient_n_m_s2": 1.8558e-8,
    "inertia_xx_kg_m2": 2.4890e-3,
    "inertia_yy_kg_m2": 2.5743e-3,
    "inertia_zz_kg_m2": 4.6838e-3,
}
"""Table 4.1."""
GREY_BOX = {
    "thrust_coefficient_n_s2": 1.3859e-6,
    "torque_coefficient_n_m_s2": 1.8534e-8,
    "inertia_xx_kg_m2": 2.4903e-3,
    "inertia_yy_kg_m2": 2.5756e-3,
    "inertia_zz_kg_m2": 4.5862e-3,
}
"""Table 4.3."""
INERTIAL_WEIGHTS = (-1.7592, 0.0076, 4.0810, 401.5602, 388.2557, 218.0455)
"""Appendix A.1.3: w11, w22, w33, w14, w25, w36."""


def regressors(rates: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """Inputs (n, 6): qr, pr, pq, τ_φ, τ_θ, τ_ψ, of rates (n, 3), rad/s, and moments (n, 3), N m."""
    p, q, r = rates.T
    return np.column_stack([q * r, p * r, p * q, moments])


def weights_of_inertias(inertias: np.ndarray) -> np.ndarray:
    """The six weights (w11, w22, w33, w14, w25, w36) that inertias (3,), kg m2, imply (eq. 4.79)."""
    x, y, z = inertias
    return np.array([(y - z) / x, (z - x) / y, (x - y) / z, 1 / x, 1 / y, 1 / z])


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
    how = training.rate, training.epochs, group, training.every
    mse = _delta_rule(matrix, inputs * k_x, accelerations * k_d, order, *how)
    if not np.isfinite(matrix).all():
        raise ValueError(f"training ran away: lower the rate {training.rate}")
    matrix = matrix * k_x / k_d[:, None]
    with np.errstate(divide="ignore"):  # an input that is always zero never settles
        settle = 1 / (training.rate * np.mean((inputs * k_x) ** 2, axis=0))
    weights = np.array([matrix[i, i] for i in range(3)] + [matrix[i, 3 + i] for i in range(3)])
    return NetworkFit(weights, np.arange(len(mse)) * training.every, mse, settle)


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


def implied_gyroscopic(weights: np.ndarray) -> np.ndarray:
    """w11, w22, w33 as the torque weights imply them, (3,)."""
    a, b, c = np.asarray(weights)[3:]
    return np.array([a * (1 / b - 1 / c), b * (1 / c - 1 / a), c * (1 / a - 1 / b)])


def _least_squares_slope(weights: np.ndarray) -> np.ndarray:
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


def check_consistency(weights: np.ndarray, covariance: np.ndarray) -> dict:
    """Wald test of the three relations for weights (6,) with covariance (6, 6).

    `gap` (3,): trained minus implied gyroscopic weight; `sigma` its standard error (0 where unknown).
    """
    weights = np.asarray(weights, float)
    implied = implied_gyroscopic(weights)
    gap = weights[:3] - implied
    slope = _least_squares_slope(weights)
    spread = slope @ covariance @ slope.T
    statistic = float(gap @ np.linalg.solve(spread, gap))
    return {
        "trained": weights[:3],
        "implied": implied,
        "gap": gap,
        "sigma": np.sqrt(np.diag(spread)),
        "statistic": statistic,
        "p_value": float(chdtrc(3, statistic)),
    }


def coefficient(network: Network, k_x: float, k_d: float) -> float:
    """C = w⁽²⁾ w⁽¹⁾ k_x² / k_d (eq. 4.73), N s2 or N m s2."""
    product = network.weights[1] @ network.weights[0]
    return float(product[0, 0] * k_x**2 / k_d)


def fit_coefficient_network(
    speed_rad_s: np.ndarray, value: np.ndarray, hidden: int, training: Training
) -> tuple[float, tuple[float, float], Network, np.ndarray, np.ndarray]:
    """Coefficient, scales k_x = 1 / max|ω| and k_d = 1 / max|d| (eq. 4.68), and what `train` gives on steady points.

    Speeds (n,) in rad/s, thrusts in N or torques in N m (n,).
    """
    k_x, k_d = float(1 / np.max(np.abs(speed_rad_s))), float(1 / np.max(np.abs(value)))
    network = build((1, hidden, 1), ("linear", "linear"), np.random.default_rng(training.seed), bias=False)
    inputs = (k_x * np.asarray(speed_rad_s, float)[:, None]) ** 2
    network, epochs, mse = train(network, inputs, k_d * np.asarray(value, float)[:, None], training)
    return coefficient(network, k_x, k_d), (k_x, k_d), network, epochs, mse


def cut_windows(rates: np.ndarray, moments: np.ndarray, dt_s: float, window_s: float) -> tuple[np.ndarray, np.ndarray]:
    """Rates and moments (w, m, 3) in consecutive windows of an evenly sampled flight (n, 3).

    Windows with missing samples are left out.
    """
    length = int(round(window_s / dt_s)) + 1
    first = np.arange(0, len(rates) - length + 1, length - 1)
    index = first[:, None] + np.arange(length)
    good = np.isfinite(rates[index]).all((1, 2)) & np.isfinite(moments[index]).all((1, 2))
    return rates[index[good]], moments[index[good]]


@compiled(error_model="numpy")
def _slope(weights, p, q, r, a, b, c, out):
    out[0] = weights[0] * q * r + weights[3] * a - weights[6] * p
    out[1] = weights[1] * p * r + weights[4] * b - weights[7] * q
    out[2] = weights[2] * p * q + weights[5] * c - weights[8] * r


@compiled(error_model="numpy")
def _simulate(weights, start, moments, extra, dt, out):
    k1, k2, k3, k4 = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for w in range(start.shape[0]):
        p, q, r = start[w, 0], start[w, 1], start[w, 2]
        out[w, 0, 0], out[w, 0, 1], out[w, 0, 2] = p, q, r
        last = moments.shape[1] - 1
        for j in range(last):
            m0, m1 = moments[w, j], moments[w, j + 1]
            before, after = moments[w, max(j - 1, 0)], moments[w, min(j + 2, last)]
            inner = 1.0 if 0 < j < last - 1 else 0.0
            e = extra[w]
            # Half way the cubic through four samples (see rotorid.vehicle.windows._halfway).
            ha = 0.5 * (m0[0] + m1[0]) + inner * (m0[0] + m1[0] - before[0] - after[0]) / 16.0 + e[0]
            hb = 0.5 * (m0[1] + m1[1]) + inner * (m0[1] + m1[1] - before[1] - after[1]) / 16.0 + e[1]
            hc = 0.5 * (m0[2] + m1[2]) + inner * (m0[2] + m1[2] - before[2] - after[2]) / 16.0 + e[2]
            h = 0.5 * dt
            _slope(weights, p, q, r, m0[0] + e[0], m0[1] + e[1], m0[2] + e[2], k1)
            _slope(weights, p + h * k1[0], q + h * k1[1], r + h * k1[2], ha, hb, hc, k2)
            _slope(weights, p + h * k2[0], q + h * k2[1], r + h * k2[2], ha, hb, hc, k3)
            p3, q3, r3 = p + dt * k3[0], q + dt * k3[1], r + dt * k3[2]
            _slope(weights, p3, q3, r3, m1[0] + e[0], m1[1] + e[1], m1[2] + e[2], k4)
            p += dt / 6.0 * (k1[0] + 2.0 * (k2[0] + k3[0]) + k4[0])
            q += dt / 6.0 * (k1[1] + 2.0 * (k2[1] + k3[1]) + k4[1])
            r += dt / 6.0 * (k1[2] + 2.0 * (k2[2] + k3[2]) + k4[2])
            out[w, j + 1, 0], out[w, j + 1, 1], out[w, j + 1, 2] = p, q, r


def simulate_rates(weights: np.ndarray, start: np.ndarray, moments: np.ndarray, dt_s: float, extra=None):
    """Rates (w, m, 3), rad/s, from starts (w, 3) under moments (w, m, 3), N m, and constant `extra` ones (w,
    3).

    `weights` (9,): the six of eq. 4.79 and three damping rates (1/s) of the body rates.
    """
    out = np.empty_like(moments)
    extra = np.zeros_like(start) if extra is None else extra
    _simulate(np.ascontiguousarray(weights, float), np.ascontiguousarray(start), moments, extra, dt_s, out)
    return out


_Model = Callable[[np.ndarray], np.ndarray]
"""From the parameters to the nine weights of `simulate_rates`."""


def tied(parameters: np.ndarray) -> np.ndarray:
    """Parameters: logarithms of the three inertias; gyroscopic terms follow from them."""
    return np.concatenate([weights_of_inertias(np.exp(parameters[:3])), np.zeros(3)])


def untied(parameters: np.ndarray) -> np.ndarray:
    """Parameters: logarithms of the inertias and three gyroscopic weights of their own."""
    return np.concatenate([parameters[3:6], np.exp(-parameters[:3]), np.zeros(3)])


@dataclass(frozen=True)
class _OutputErrorFit:
    """Parameters (p,), covariance (p, p); residual rms per axis (3,), rad/s; share of variance explained."""

    parameters: np.ndarray
    covariance: np.ndarray
    residual_rms: np.ndarray
    explained: np.ndarray
    windows: int

    @property
    def inertias(self) -> np.ndarray:
        """J_xx, J_yy, J_zz, kg m2."""
        return np.exp(self.parameters[:3])

    @property
    def inertia_intervals_95(self) -> np.ndarray:
        """(3, 2), kg m2."""
        freedom = max(self.windows - len(self.parameters), 1)
        half = student_quantile(freedom, 0.975) * np.sqrt(np.diag(self.covariance)[:3])
        return np.exp(self.parameters[:3, None] + half[:, None] * np.array([-1.0, 1.0]))


def _walk_power(samples: int) -> float:
    """Expected sum of squares of a unit random walk over a window, its mean taken off."""
    walk = np.tril(np.ones((samples, samples)), -1)
    walk = walk - walk.mean(axis=0)
    return float(np.sum(walk**2))


def fit_output_error(
    rates: np.ndarray,
    moments: np.ndarray,
    dt_s: float,
    model: _Model,
    start: np.ndarray,
    window_moment: bool = False,
    iterations: int = 30,
    tolerance: float = 1e-7,
    cluster: int = 4,
    moment_noise_n_m: np.ndarray | None = None,
) -> _OutputErrorFit:
    """Gauss-Newton with the windows' own unknowns projected out.

    Measured `rates`, rad/s, and `moments`, N m, are (w, m, 3) of w windows sampled evenly at `dt_s`.

    Noise of the moments (3,), one sigma a sample, blurs the regressors and would make the inertias too large by
    noise power over signal power; where `moment_noise_n_m` states it, that is taken off again. The covariance is
    robust over clusters of `cluster` neighbouring windows. ValueError where there are too few
    windows or the estimate does not converge.
    """
    parameters = np.asarray(start, float).copy()
    w, m, _ = rates.shape
    if w <= len(parameters):
        raise ValueError(f"{w} windows cannot distinguish {len(parameters)} parameters: record longer")
    moments = np.ascontiguousarray(moments)
    begin, extra = rates[:, 0].copy(), np.zeros((w, 3))
    scale = np.ones(3)
    moment_step = 1e-3 * max(float(np.std(moments)), 1e-9)

    def simulate(values, begin, extra):
        return simulate_rates(model(values), begin, moments, dt_s, extra)

    for iteration in range(iterations):
        predicted = simulate(parameters, begin, extra)
        residual = rates - predicted
        own = []
        for axis in range(3):
            moved = begin.copy()
            moved[:, axis] += 1e-4
            own.append((simulate(parameters, moved, extra) - predicted) / 1e-4)
        for axis in range(3 if window_moment else 0):
            moved = extra.copy()
            moved[:, axis] += moment_step
            own.append((simulate(parameters, begin, moved) - predicted) / moment_step)
        shared = []
        for k in range(len(parameters)):
            moved = parameters.copy()
            step = 1e-5 * max(1.0, abs(moved[k]))
            moved[k] += step
            shared.append((simulate(moved, begin, extra) - predicted) / step)
        own, shared = np.stack(own, -1), np.stack(shared, -1)
        a = (own / scale[:, None]).reshape(w, 3 * m, -1)
        s = (shared / scale[:, None]).reshape(w, 3 * m, -1)
        y = (residual / scale).reshape(w, 3 * m)
        q, r = np.linalg.qr(a)
        s_free = s - q @ (np.swapaxes(q, 1, 2) @ s)
        y_free = y - np.einsum("wik,wk->wi", q, np.einsum("wik,wi->wk", q, y))
        information = np.einsum("wik,wil->kl", s_free, s_free)
        scores = np.einsum("wik,wi->wk", s_free, y_free)
        change = np.linalg.solve(information, scores.sum(0))
        rest = y - np.einsum("wik,k->wi", s, change)
        own_change = np.linalg.solve(r, np.einsum("wik,wi->wk", q, rest)[..., None])[..., 0]
        parameters = parameters + change
        begin = begin + own_change[:, :3]
        if window_moment:
            extra = extra + own_change[:, 3:]
        scale_used = scale
        scale = np.sqrt(np.mean((y_free.reshape(w, m, 3) * scale) ** 2, axis=(0, 1)))
        if iteration > 1 and np.max(np.abs(change)) < tolerance:
            break
    else:
        raise ValueError("the output-error estimate did not converge: the flight may not excite every axis")
    inverse = np.linalg.inv(information)
    if moment_noise_n_m is not None:
        torque = model(parameters)[3:6]
        power = w * (np.asarray(moment_noise_n_m) * torque * dt_s / scale_used) ** 2 * _walk_power(m)
        parameters[:3] += np.log1p(-power / np.diag(information)[:3])
    # Neighbouring windows share slow disturbances: their scores are summed before they are squared.
    clustered = np.add.reduceat(scores, np.arange(0, w, cluster), axis=0)
    count = len(clustered)
    covariance = count / max(count - len(parameters), 1) * inverse @ (clustered.T @ clustered) @ inverse
    spread = rates - rates.mean(axis=1, keepdims=True)
    explained = 1.0 - scale**2 / np.mean(spread**2, axis=(0, 1))
    return _OutputErrorFit(parameters, covariance, scale, explained, w)


def printed_coefficient(
    k_x: float, k_d: float, w1, w2, k_x_digit: float = 1e-8, k_d_digit: float = 1e-4, weight_digit: float = 1e-4
) -> tuple[float, float]:
    """Coefficient of a rotor network of appendix A.1 by eq. 4.73, thrust (N s²) or torque (N m s²) over squared speed.

    The second number is by how much the digits that are not printed may change it.

    Scales, s/rad and 1/N or 1/(N m), and weights as printed, and the last digit of each.
    """
    product = sum(first * second for first, second in zip(w1, w2, strict=True))
    coefficient = product * k_x**2 / k_d
    weights = weight_digit / 2 * sum(abs(weight) for weight in (*w1, *w2))
    return coefficient, abs(coefficient) * (weights / abs(product) + k_x_digit / k_x + k_d_digit / 2 / k_d)


ROTOR_NETWORKS = {
    "thrust_coefficient_n_s2": printed_coefficient(
        5.4669e-4, 0.2133, (-0.5311, 0.1014, -1.0462, -0.1708), (-0.4342, -0.6602, -0.7606, -0.1731)
    ),
    "torque_coefficient_n_m_s2": printed_coefficient(
        6.3486e-4, 20.8333, (-0.4279, 1.0063, -0.8083, -0.4139), (-0.3693, 0.5336, -0.0600, -0.5183)
    ),
}
"""Appendix A.1.1 and A.1.2."""
