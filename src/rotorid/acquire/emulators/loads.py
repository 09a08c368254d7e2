"""Weights as an operator puts them down: never twice in quite the same place."""

from __future__ import annotations

import numpy as np

from rotorid.acquire.geometry import GF_N

# a load "along z" pulls upwards, as thrust does
AXES = {"x": np.array([1.0, 0, 0]), "y": np.array([0, 1.0, 0]), "z": np.array([0, 0, -1.0])}


def direction_of(axis: str) -> np.ndarray:
    """Unit vector of a load along one axis, or along several alike (`xz`: halfway between x and z)."""
    together = sum(AXES[letter] for letter in axis)
    return together / np.linalg.norm(together)


SPREAD = 1e-4
SPREAD_GF = 0.08


def put_down(load_gf: float, rng: np.random.Generator) -> float:
    """Force in N that a weight in gf exerts this time; no weight exerts none."""
    if load_gf == 0:
        return 0.0
    return (load_gf * (1 + SPREAD * rng.standard_normal()) + SPREAD_GF * rng.standard_normal()) * GF_N
