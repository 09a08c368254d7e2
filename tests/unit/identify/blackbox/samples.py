"""Samples of the 48 experiments from the white box, for tests of the black box's models."""

import numpy as np
import pandas as pd

from rotorid.recordings.vehicle import Vehicle
from rotorid_acquire.io.wire import EXPERIMENTS
from rotorid_lab.black_box import COLUMNS, INPUTS, OUTPUTS, PLATEAU_BLOCKS, SINE_BLOCKS, stand_wrench


def generated_experiments(
    vehicle: Vehicle, curve, noise_n: float, noise_n_m: float, rng: np.random.Generator
) -> pd.DataFrame:
    """Samples of `vehicle`'s white box with noise (one sigma, N and N m), by table A.1."""
    rows = []
    for number, e in EXPERIMENTS.items():
        if e.signal == "trapezoidal":
            throttles = np.repeat(np.array([e.maxima]), PLATEAU_BLOCKS, axis=0)
        else:
            share = 0.5 - 0.5 * np.cos(2 * np.pi * (np.arange(SINE_BLOCKS) + 0.5) / SINE_BLOCKS)
            throttles = share[:, None] * np.array(e.maxima)
        for sample, throttle in enumerate(throttles, 1):
            rows.append(
                [number, sample, *np.clip(curve(throttle), 0, None), np.radians(e.roll_deg), np.radians(e.pitch_deg)]
            )
    table = pd.DataFrame(rows, columns=list(COLUMNS[:8]))
    wrench = stand_wrench(
        vehicle, table[list(INPUTS[:4])].to_numpy(), table["roll_rad"].to_numpy(), table["pitch_rad"].to_numpy()
    )
    sigma = np.array([noise_n] * 3 + [noise_n_m] * 3)
    table[list(OUTPUTS)] = wrench + rng.normal(size=wrench.shape) * sigma
    return table
