"""A layered network: weights, biases, masks and activations, with its output and its gradient.

Notation of the thesis: v = w x + b (eq. 4.34), y = φ(v); samples are rows here, so V = X wᵀ + b.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np


def sigmoid(v: np.ndarray) -> np.ndarray:
    """1 / (1 + exp(-v)), without overflow."""
    return 0.5 * (1.0 + np.tanh(0.5 * v))


@dataclass(frozen=True)
class _Activation:
    """φ and its derivative written in terms of φ's value."""

    name: str
    value: Callable[[np.ndarray], np.ndarray]
    slope_of_value: Callable[[np.ndarray], np.ndarray | float]


LINEAR = _Activation("linear", lambda v: v, lambda y: 1.0)
SIGMOID = _Activation("sigmoid", sigmoid, lambda y: y * (1.0 - y))
_ACTIVATIONS = {a.name: a for a in (LINEAR, SIGMOID)}


@dataclass(frozen=True)
class Network:
    """Layers: weights (n_out, n_in), biases (n_out,), masks like the weights (None: without), activations."""

    weights: tuple[np.ndarray, ...]
    biases: tuple[np.ndarray | None, ...]
    activations: tuple[_Activation, ...]
    masks: tuple[np.ndarray | None, ...]

    def __call__(self, inputs: np.ndarray) -> np.ndarray:
        """Outputs (n, n_out) for inputs (n, n_in)."""
        return outputs(self, inputs)[-1]


def build(
    sizes: Sequence[int],
    activations: Sequence[str],
    rng: np.random.Generator,
    bias: bool = True,
    masks: Sequence[np.ndarray | None] | None = None,
    spread: float = 1.0,
) -> Network:
    """A network of the given layer sizes (inputs first) with weights drawn evenly from ±`spread`."""
    if len(activations) != len(sizes) - 1:
        raise ValueError(f"{len(sizes) - 1} layers need as many activations, got {len(activations)}")
    masks = tuple(masks) if masks is not None else (None,) * len(activations)
    weights, biases = [], []
    for n_in, n_out, mask in zip(sizes[:-1], sizes[1:], masks, strict=True):
        w = rng.uniform(-spread, spread, (n_out, n_in))
        weights.append(w if mask is None else w * mask)
        biases.append(rng.uniform(-spread, spread, n_out) if bias else None)
    return Network(tuple(weights), tuple(biases), tuple(_ACTIVATIONS[a] for a in activations), masks)


def outputs(network: Network, inputs: np.ndarray) -> list[np.ndarray]:
    """Values of every layer, the inputs first: list of (n, size)."""
    values = [inputs]
    for w, b, activation in zip(network.weights, network.biases, network.activations, strict=True):
        v = values[-1] @ w.T
        if b is not None:
            v = v + b
        values.append(activation.value(v))
    return values


def gradients(
    network: Network, inputs: np.ndarray, targets: np.ndarray
) -> tuple[list[np.ndarray], list[np.ndarray | None], np.ndarray]:
    """Back-propagation: the rule's steps for weights and biases at rate 1, and the errors.

    For each sample e = d - y, δ = φ'(v) e; below the last layer e = wᵀ δ (eq. 4.57), and the step of a weight
    is δ_i x_j. The steps are the means over the samples: the batch method; with one sample the stochastic
    one. For a single layer this is the generalised delta rule.
    """
    values = outputs(network, inputs)
    errors = targets - values[-1]
    count = len(inputs)
    delta = errors * network.activations[-1].slope_of_value(values[-1])
    weight_steps: list[np.ndarray] = []
    bias_steps: list[np.ndarray | None] = []
    for layer in range(len(network.weights) - 1, -1, -1):
        step = delta.T @ values[layer] / count
        mask = network.masks[layer]
        weight_steps.append(step if mask is None else step * mask)
        bias_steps.append(None if network.biases[layer] is None else delta.mean(axis=0))
        if layer > 0:
            slope = network.activations[layer - 1].slope_of_value(values[layer])
            delta = (delta @ network.weights[layer]) * slope
    return weight_steps[::-1], bias_steps[::-1], errors
