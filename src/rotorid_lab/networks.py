"""Layered networks, and their training by the delta rule and back-propagation (thesis 4.2).

Notation of the thesis: v = w x + b (eq. 4.34), y = φ(v); samples are rows here, so V = X wᵀ + b.

Three data methods: stochastic, one step for each sample; batch, one step for all samples; mini-batch, one step for each
group. The order of samples is drawn anew each epoch, from the seed. Training can stop after any epoch and go on from
its checkpoint to the very same weights. Epochs of the batch method are compiled: the same rule as `gradients`, without
numpy's cost of small arrays.
"""

from __future__ import annotations

import logging
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal
from zipfile import BadZipFile, ZipFile

import numpy as np
from numba import njit

from rotorid.errors import InputError
from rotorid.io.text.files import LARGEST_CHECKPOINT, check_file
from rotorid.io.text.wording import printable
from rotorid.io.text.writing import all_or_none

_CODES = {"linear": 0, "sigmoid": 1}
_LOGGER = logging.getLogger("rotorid_lab.networks")
_Method = Literal["batch", "stochastic", "mini-batch"]


def sigmoid(v: np.ndarray) -> np.ndarray:
    """1 / (1 + exp(-v)), without overflow."""
    return 0.5 * (1.0 + np.tanh(0.5 * v))


_VALUE: dict[str, Callable[[np.ndarray], np.ndarray]] = {"linear": lambda v: v, "sigmoid": sigmoid}
"""φ of each activation."""
_SLOPE: dict[str, Callable[[np.ndarray], np.ndarray | float]] = {
    "linear": lambda y: 1.0,
    "sigmoid": lambda y: y * (1.0 - y),
}
"""Its derivative, of φ's value."""


@dataclass(frozen=True)
class Network:
    """Layers: weights (n_out, n_in), biases (n_out,), masks like the weights (None: without), activations by name."""

    weights: tuple[np.ndarray, ...]
    biases: tuple[np.ndarray | None, ...]
    activations: tuple[str, ...]
    masks: tuple[np.ndarray | None, ...]

    def __call__(self, inputs: np.ndarray) -> np.ndarray:
        """Outputs (n, n_out) for inputs (n, n_in)."""
        return _outputs(self, inputs)[-1]


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
    return Network(tuple(weights), tuple(biases), tuple(activations), masks)


def _outputs(network: Network, inputs: np.ndarray) -> list[np.ndarray]:
    """Values of every layer, the inputs first: list of (n, size)."""
    values = [inputs]
    for w, b, activation in zip(network.weights, network.biases, network.activations, strict=True):
        v = values[-1] @ w.T
        if b is not None:
            v = v + b
        values.append(_VALUE[activation](v))
    return values


def gradients(
    network: Network, inputs: np.ndarray, targets: np.ndarray
) -> tuple[list[np.ndarray], list[np.ndarray | None], np.ndarray]:
    """Back-propagation: the rule's steps for weights and biases at rate 1, and the errors.

    For each sample e = d - y, δ = φ'(v) e; below the last layer e = wᵀ δ (eq. 4.57), and the step of a weight
    is δ_i x_j. The steps are the means over the samples: the batch method; with one sample the stochastic
    one. For a single layer this is the generalised delta rule.
    """
    values = _outputs(network, inputs)
    errors = targets - values[-1]
    count = len(inputs)
    delta = errors * _SLOPE[network.activations[-1]](values[-1])
    weight_steps: list[np.ndarray] = []
    bias_steps: list[np.ndarray | None] = []
    for layer in range(len(network.weights) - 1, -1, -1):
        step = delta.T @ values[layer] / count
        mask = network.masks[layer]
        weight_steps.append(step if mask is None else step * mask)
        bias_steps.append(None if network.biases[layer] is None else delta.mean(axis=0))
        if layer > 0:
            delta = (delta @ network.weights[layer]) * _SLOPE[network.activations[layer - 1]](values[layer])
    return weight_steps[::-1], bias_steps[::-1], errors


@dataclass(frozen=True)
class Training:
    """How to train."""

    rate: float
    epochs: int
    method: _Method = "batch"
    group: int = 8
    """Samples in a mini-batch."""
    seed: int = 0
    every: int = 1
    """Keep the error of each `every`-th epoch."""
    checkpoint_every: int = 5000


def train(
    network: Network, inputs: np.ndarray, targets: np.ndarray, training: Training, checkpoint: Path | None = None
) -> tuple[Network, np.ndarray, np.ndarray]:
    """The trained network, epochs (kept,), and before each of them the mean squared error per output, (kept, n_out).

    `inputs` (n, n_in), `targets` (n, n_out). With `checkpoint` (.npz) the state is written every
    `checkpoint_every` epochs (atomically) and an existing file is continued. ValueError where the weights run
    away.
    """
    inputs, targets = np.ascontiguousarray(inputs, float), np.ascontiguousarray(targets, float)
    if len(inputs) != len(targets) or len(inputs) == 0:
        raise ValueError(f"{len(inputs)} inputs and {len(targets)} targets, expected as many, at least one")
    weights = [w.copy() for w in network.weights]
    biases = [None if b is None else b.copy() for b in network.biases]
    kept = (training.epochs + training.every - 1) // training.every
    history = np.full((kept, targets.shape[1]), np.nan)
    first = 0
    if checkpoint is not None and Path(checkpoint).exists():
        first = _restore(Path(checkpoint), weights, biases, history)
        _LOGGER.info("continued after epoch %d", first)
    current = replace(network, weights=tuple(weights), biases=tuple(biases))
    run = _batch if training.method == "batch" else _by_groups
    for start in range(first, training.epochs, training.checkpoint_every):
        stop = min(start - start % training.checkpoint_every + training.checkpoint_every, training.epochs)
        mse = run(current, inputs, targets, training, range(start, stop), history)
        if not all(np.isfinite(w).all() for w in weights):
            raise ValueError(f"training ran away by epoch {stop}: lower the rate {training.rate}")
        _LOGGER.info("epoch %d of %d, mse %s", stop, training.epochs, mse.round(9))
        if checkpoint is not None:
            _store(Path(checkpoint), stop, weights, biases, history)
    return current, np.arange(kept) * training.every, history


def _batch(network, inputs, targets, training: Training, epochs: range, history: np.ndarray) -> np.ndarray:
    """Train the network in place by some epochs, one step each; the last epoch's mean squared errors (n_out,)."""
    errors = _batch_epochs(network, inputs, targets, training.rate, len(epochs), training.every, epochs.start)
    start = -(-epochs.start // training.every)
    history[start : start + len(errors) - 1] = errors[:-1]
    return errors[-1]


def _by_groups(network, inputs, targets, training: Training, epochs: range, history: np.ndarray) -> np.ndarray:
    """The same with one step for each group of samples."""
    errors = np.empty_like(targets)
    for epoch in epochs:
        for rows in _groups(training, epoch, len(inputs)):
            weight_steps, bias_steps, errors[rows] = gradients(network, inputs[rows], targets[rows])
            for w, step in zip(network.weights, weight_steps, strict=True):
                w += training.rate * step
            for b, step in zip(network.biases, bias_steps, strict=True):
                if b is not None:
                    b += training.rate * step
        if epoch % training.every == 0:
            history[epoch // training.every] = np.mean(errors**2, axis=0)
    return np.mean(errors**2, axis=0)


def _groups(training: Training, epoch: int, count: int) -> list:
    """Rows of each step of an epoch."""
    order = np.random.default_rng([training.seed, epoch]).permutation(count)
    size = 1 if training.method == "stochastic" else training.group
    return [order[i : i + size] for i in range(0, count, size)]


def _store(path: Path, epoch: int, weights, biases, history) -> None:
    arrays = {f"w{i}": w for i, w in enumerate(weights)}
    arrays |= {f"b{i}": b for i, b in enumerate(biases) if b is not None}
    with all_or_none(path) as (part,), part.open("wb") as file:
        np.savez(file, epoch=epoch, history=history, **arrays)


def _restore(path: Path, weights, biases, history) -> int:
    """Fill weights, biases and history from a checkpoint; the epoch to go on with. InputError where it is none."""
    stored = _stored_arrays(path)
    mine = {f"w{i}": w for i, w in enumerate(weights)} | {f"b{i}": b for i, b in enumerate(biases) if b is not None}
    if set(mine) | {"epoch", "history"} != set(stored) or any(stored[n].shape != m.shape for n, m in mine.items()):
        raise InputError(f"{path}: a checkpoint of another network; delete it to start anew")
    epoch, past = stored["epoch"], stored["history"]
    numbers = all(array.dtype == float for name, array in stored.items() if name != "epoch")
    counted = epoch.shape == () and epoch.dtype.kind in "iu" and epoch >= 0
    if not numbers or not counted or past.ndim != 2 or past.shape[1] != history.shape[1]:
        raise InputError(f"{path}: no checkpoint of a training; delete it to start anew")
    if not all(np.isfinite(stored[name]).all() for name in mine):
        raise InputError(f"{path}: holds weights that are no numbers; delete it to start anew")
    for name, array in mine.items():
        array[...] = stored[name]
    rows = min(len(history), len(past))
    history[:rows] = past[:rows]
    return int(epoch)


def _stored_arrays(path: Path) -> dict[str, np.ndarray]:
    """Arrays of an .npz, no code of it run, its unpacked size looked at first."""
    try:
        check_file(path)
        with ZipFile(path) as parts:
            size = sum(part.file_size for part in parts.infolist())
            if size > LARGEST_CHECKPOINT:
                most = f"{LARGEST_CHECKPOINT / 1e6:g}"
                raise InputError(f"{path}: unpacks to {size / 1e6:.3g} MB, expected at most {most}")
            if parts.testzip() is not None:  # numpy stops reading before the checksum
                raise BadZipFile("its checksum does not fit")
        with np.load(path, allow_pickle=False) as held:
            return {name: held[name] for name in held.files}
    except InputError:
        raise
    except (OSError, EOFError, BadZipFile, ValueError, TypeError, KeyError, RuntimeError, zlib.error) as error:
        what = printable(error)
        raise InputError(f"{path}: cannot be read as a checkpoint ({what}); delete it to start anew") from None


def _batch_epochs(
    network: Network, inputs: np.ndarray, targets: np.ndarray, rate: float, epochs: int, every: int, first: int
) -> np.ndarray:
    """Train in place by `epochs` epochs, the first of which has the number `first`.

    Returns the mean squared errors (kept, n_out) before each epoch whose number is a multiple of `every`, and of the
    last one as the last row. Activations are those of `_CODES`.
    """
    weights = tuple(np.ascontiguousarray(w.T) for w in network.weights)
    biases = tuple(np.zeros(0) if b is None else b.copy() for b in network.biases)
    masks = tuple(np.zeros((0, 0)) if m is None else np.ascontiguousarray(m.T, dtype=float) for m in network.masks)
    codes = tuple(_CODES[a] for a in network.activations)
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
