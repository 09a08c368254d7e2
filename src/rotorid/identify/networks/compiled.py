"""Epochs of the batch method compiled: the same rule as `network.gradients`, without numpy's cost of small arrays."""

from __future__ import annotations

import numpy as np
from numba import njit

from rotorid.identify.networks.network import Network

CODES = {"linear": 0, "sigmoid": 1}


def batch_epochs(
    network: Network, inputs: np.ndarray, targets: np.ndarray, rate: float, epochs: int, every: int, first: int
) -> np.ndarray:
    """Train in place by `epochs` epochs, the first of which has the number `first`.

    Returns the mean squared errors (kept, n_out) before each epoch whose number is a multiple of `every`, and of the
    last one as the last row. Activations are those of `CODES`.
    """
    weights = tuple(np.ascontiguousarray(w.T) for w in network.weights)
    biases = tuple(np.zeros(0) if b is None else b.copy() for b in network.biases)
    masks = tuple(np.zeros((0, 0)) if m is None else np.ascontiguousarray(m.T, dtype=float) for m in network.masks)
    codes = tuple(CODES[a.name] for a in network.activations)
    values = tuple(np.empty((len(inputs), w.shape[1])) for w in weights)
    deltas = tuple(np.empty_like(v) for v in values)
    kept = len(range(-(-first // every) * every, first + epochs, every))
    history = np.empty((kept + 1, targets.shape[1]))
    _epochs(weights, biases, masks, codes, inputs, targets, rate, epochs, every, first, values, deltas, history)
    for w, trained in zip(network.weights, weights, strict=True):
        w[...] = trained.T
    for b, trained in zip(network.biases, biases, strict=True):
        if b is not None:
            b[...] = trained
    return history


@njit(cache=True, fastmath={"reassoc", "contract", "nsz"})
def _epochs(weights, biases, masks, codes, inputs, targets, rate, epochs, every, first, values, deltas, history):
    last, rows, row = len(weights) - 1, len(inputs), 0
    for epoch in range(first, first + epochs):
        for layer in range(last + 1):
            w, b, out = weights[layer], biases[layer], values[layer]
            below = inputs if layer == 0 else values[layer - 1]
            for i in range(rows):
                for j in range(w.shape[1]):
                    out[i, j] = b[j] if len(b) else 0.0
                for k in range(w.shape[0]):
                    own = below[i, k]
                    for j in range(w.shape[1]):
                        out[i, j] += own * w[k, j]
                if codes[layer] == 1:
                    for j in range(w.shape[1]):
                        out[i, j] = 1.0 / (1.0 + np.exp(-out[i, j]))
        delta, out = deltas[last], values[last]
        for j in range(targets.shape[1]):
            history[-1, j] = 0.0
        for i in range(rows):
            for j in range(targets.shape[1]):
                error = targets[i, j] - out[i, j]
                history[-1, j] += error * error / rows
                slope = out[i, j] * (1.0 - out[i, j]) if codes[last] == 1 else 1.0
                delta[i, j] = error * slope
        if epoch % every == 0:
            for j in range(targets.shape[1]):
                history[row, j] = history[-1, j]
            row += 1
        for layer in range(last, -1, -1):
            w, b, mask, delta = weights[layer], biases[layer], masks[layer], deltas[layer]
            below = inputs if layer == 0 else values[layer - 1]
            if layer > 0:
                lower = deltas[layer - 1]
                for i in range(rows):
                    for k in range(w.shape[0]):
                        passed = 0.0
                        for j in range(w.shape[1]):
                            passed += delta[i, j] * w[k, j]
                        y = below[i, k]
                        lower[i, k] = passed * y * (1.0 - y) if codes[layer - 1] == 1 else passed
            step = rate / rows
            for i in range(rows):
                for k in range(w.shape[0]):
                    own = step * below[i, k]
                    for j in range(w.shape[1]):
                        w[k, j] += own * delta[i, j]
                for j in range(len(b)):
                    b[j] += step * delta[i, j]
            for k in range(len(mask)):
                for j in range(w.shape[1]):
                    w[k, j] *= mask[k, j]
