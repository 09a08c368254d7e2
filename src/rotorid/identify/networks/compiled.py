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
    # A layer's values lie sample next to sample, so that one instruction works on several samples.
    inputs, targets = np.ascontiguousarray(inputs.T), np.ascontiguousarray(targets.T)
    values = tuple(np.empty((w.shape[1], inputs.shape[1])) for w in weights)
    deltas = tuple(np.empty_like(v) for v in values)
    kept = len(range(-(-first // every) * every, first + epochs, every))
    history = np.empty((kept + 1, len(targets)))
    _epochs(weights, biases, masks, codes, inputs, targets, rate, epochs, every, first, values, deltas, history)
    for w, trained in zip(network.weights, weights, strict=True):
        w[...] = trained.T
    for b, trained in zip(network.biases, biases, strict=True):
        if b is not None:
            b[...] = trained
    return history


@njit(cache=True, fastmath={"reassoc", "contract", "nsz"})
def _epochs(weights, biases, masks, codes, inputs, targets, rate, epochs, every, first, values, deltas, history):
    last, rows, row = len(weights) - 1, inputs.shape[1], 0
    for epoch in range(first, first + epochs):
        for layer in range(last + 1):
            w, b, out = weights[layer], biases[layer], values[layer]
            below = inputs if layer == 0 else values[layer - 1]
            for j in range(w.shape[1]):
                own = out[j]
                own[:] = b[j] if len(b) else 0.0
                for k in range(w.shape[0]):
                    step, given = w[k, j], below[k]
                    for i in range(rows):
                        own[i] += step * given[i]
                if codes[layer] == 1:
                    for i in range(rows):
                        own[i] = 1.0 / (1.0 + np.exp(-own[i]))
        delta, out = deltas[last], values[last]
        for j in range(targets.shape[0]):
            summed = 0.0
            for i in range(rows):
                error = targets[j, i] - out[j, i]
                summed += error * error
                slope = out[j, i] * (1.0 - out[j, i]) if codes[last] == 1 else 1.0
                delta[j, i] = error * slope
            history[-1, j] = summed / rows
        if epoch % every == 0:
            for j in range(targets.shape[0]):
                history[row, j] = history[-1, j]
            row += 1
        for layer in range(last, -1, -1):
            w, b, mask, delta = weights[layer], biases[layer], masks[layer], deltas[layer]
            below = inputs if layer == 0 else values[layer - 1]
            if layer > 0:
                lower = deltas[layer - 1]
                for k in range(w.shape[0]):
                    own, y = lower[k], below[k]
                    own[:] = 0.0
                    for j in range(w.shape[1]):
                        back, passed = w[k, j], delta[j]
                        for i in range(rows):
                            own[i] += back * passed[i]
                    if codes[layer - 1] == 1:
                        for i in range(rows):
                            own[i] *= y[i] * (1.0 - y[i])
            step = rate / rows
            for j in range(w.shape[1]):
                own = delta[j]
                for k in range(w.shape[0]):
                    given, summed = below[k], 0.0
                    for i in range(rows):
                        summed += given[i] * own[i]
                    w[k, j] += step * summed
                if len(b):
                    summed = 0.0
                    for i in range(rows):
                        summed += own[i]
                    b[j] += step * summed
            for k in range(len(mask)):
                for j in range(w.shape[1]):
                    w[k, j] *= mask[k, j]
