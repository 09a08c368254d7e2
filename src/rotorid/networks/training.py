"""Training by the delta rule and back-propagation with the thesis's three data methods (section 4.2).

Stochastic: one step for each sample. Batch: one step for all samples. Mini-batch: one step for each group.
The order of samples is drawn anew each epoch, from the seed. Training can stop after any epoch and go on from
its checkpoint to the very same weights.
"""

from __future__ import annotations

import logging
import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from rotorid.networks.network import Network, gradients

LOGGER = logging.getLogger("rotorid.networks")
Method = Literal["batch", "stochastic", "mini-batch"]


@dataclass(frozen=True)
class Training:
    """How to train."""

    rate: float
    epochs: int
    method: Method = "batch"
    group: int = 8
    """Samples in a mini-batch."""
    seed: int = 0
    every: int = 1
    """Keep the error of each `every`-th epoch."""
    checkpoint_every: int = 5000


@dataclass(frozen=True)
class Trained:
    """A trained network and its mean squared error (before each kept epoch) per output, (kept, n_out)."""

    network: Network
    epochs: np.ndarray
    mse: np.ndarray


def train(
    network: Network,
    inputs: np.ndarray,
    targets: np.ndarray,
    training: Training,
    checkpoint: Path | None = None,
) -> Trained:
    """Train and return the network with its history.

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
        LOGGER.info("continued after epoch %d", first)
    current = replace(network, weights=tuple(weights), biases=tuple(biases))
    for epoch in range(first, training.epochs):
        errors = np.empty_like(targets)
        for rows in _groups(training, epoch, len(inputs)):
            weight_steps, bias_steps, error = gradients(current, inputs[rows], targets[rows])
            errors[rows] = error
            for w, step in zip(weights, weight_steps, strict=True):
                w += training.rate * step
            for b, step in zip(biases, bias_steps, strict=True):
                if b is not None:
                    b += training.rate * step
        if epoch % training.every == 0:
            history[epoch // training.every] = np.mean(errors**2, axis=0)
        if (epoch + 1) % training.checkpoint_every == 0 or epoch + 1 == training.epochs:
            if not all(np.isfinite(w).all() for w in weights):
                raise ValueError(f"training ran away by epoch {epoch + 1}: lower the rate {training.rate}")
            LOGGER.info("epoch %d of %d, mse %s", epoch + 1, training.epochs, np.mean(errors**2, axis=0).round(9))
            if checkpoint is not None:
                _store(Path(checkpoint), epoch + 1, weights, biases, history)
    epochs = np.arange(kept) * training.every
    return Trained(current, epochs, history)


def _groups(training: Training, epoch: int, count: int) -> list:
    """Rows of each step of an epoch."""
    if training.method == "batch":
        return [slice(None)]
    order = np.random.default_rng([training.seed, epoch]).permutation(count)
    size = 1 if training.method == "stochastic" else training.group
    return [order[i : i + size] for i in range(0, count, size)]


def _store(path: Path, epoch: int, weights, biases, history) -> None:
    arrays = {f"w{i}": w for i, w in enumerate(weights)}
    arrays |= {f"b{i}": b for i, b in enumerate(biases) if b is not None}
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_suffix(".part.npz")
    np.savez(part, epoch=epoch, history=history, **arrays)
    os.replace(part, path)


def _restore(path: Path, weights, biases, history) -> int:
    with np.load(path) as held:
        names = [f"w{i}" for i in range(len(weights))] + [f"b{i}" for i, b in enumerate(biases) if b is not None]
        mine = [*weights, *(b for b in biases if b is not None)]
        if set(names) | {"epoch", "history"} != set(held.files) or any(
            held[n].shape != m.shape for n, m in zip(names, mine, strict=True)
        ):
            raise ValueError(f"{path}: a checkpoint of another network; delete it to start anew")
        for name, array in zip(names, mine, strict=True):
            array[...] = held[name]
        rows = min(len(history), len(held["history"]))
        history[:rows] = held["history"][:rows]
        return int(held["epoch"])
