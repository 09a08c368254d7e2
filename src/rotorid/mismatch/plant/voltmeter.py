"""The battery's voltage without its voltmeter's noise.

A voltage is a regressor of the battery's sag, and noise in a regressor flattens what multiplies it: the exponent comes
out too small, and what is left follows the command (which loads the battery), as a throttle curve would. A battery
changes slowly, and quickly only as it is loaded: the reading's slow part, and of its quick part what follows the
commanded load, is what can be expected of the voltage. Noise of any colour stays out of it, for it knows no commands
(two-stage least squares with time and load as instruments).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from rotorid.mismatch.plant.motion import Segment

SLOW_S = 5.0
"""Length of the mean that is taken for slow."""
_MEMORY_S, _MOST_MEMORY = 1.0, 0.2
"""Noise has forgotten itself after so long: means over it hold less than this share of its power."""
_RELAXATION_S = (0.0, 0.03, 0.1, 0.3, 1.0)
"""Time constants with which the voltage may follow the load."""


def without_noise(segments: list[Segment]) -> list[Segment]:
    """Segments with the expected voltage in place of the reading; as they are where voltage or command is missing."""
    if not segments or any(s.motion.voltage is None or s.command is None for s in segments):
        return segments
    expected = expected_voltages(
        [s.motion.voltage for s in segments], [s.command for s in segments], [s.dt_s for s in segments]
    )
    return [replace(s, motion=replace(s.motion, voltage=v)) for s, v in zip(segments, expected, strict=True)]


def expected_voltages(voltages: list[np.ndarray], commands: list[np.ndarray], steps_s: list[float]) -> list[np.ndarray]:
    """What can be expected of voltages (n,), V, read in stretches of even steps with commanded rotor speeds (n, k)."""
    slow, quick, loads = [], [], []
    for voltage, command, dt_s in zip(voltages, commands, steps_s, strict=True):
        size = min(len(voltage) - 1, int(SLOW_S / dt_s)) | 1
        slow.append(running_mean(voltage, size))
        quick.append(voltage - slow[-1])
        columns = _relaxed((command**3).sum(axis=1), dt_s)
        loads.append(columns - np.stack([running_mean(c, size) for c in columns.T], axis=1))
    all_loads = np.concatenate(loads)
    scale = np.maximum(all_loads.std(axis=0), 1e-300)
    drop, *_ = np.linalg.lstsq(all_loads / scale, np.concatenate(quick), rcond=1e-6)
    return [a + (b / scale) @ drop for a, b in zip(slow, loads, strict=True)]


def is_noise(rests: list[np.ndarray], steps_s: list[float]) -> bool:
    """Whether what was taken off voltages (n,) is a voltmeter's noise: means over MEMORY_S of it are near nothing.

    A supply that is switched over in steps is neither slow nor does it follow the load; it stays as it was read.
    """
    power, kept = 0.0, 0.0
    for rest, dt_s in zip(rests, steps_s, strict=True):
        size = max(int(_MEMORY_S / dt_s), 1)
        count = len(rest) // size
        power += float(rest[: count * size] @ rest[: count * size]) / size
        kept += float(np.sum(rest[: count * size].reshape(count, size).mean(axis=1) ** 2))
    return kept < _MOST_MEMORY * power


def _relaxed(load: np.ndarray, dt_s: float) -> np.ndarray:
    """A load (n,) through first-order lags of every time constant, settled at the start, (n, 5)."""
    keeps = [np.exp(-dt_s / tau) if tau > 0 else 0.0 for tau in _RELAXATION_S]
    return np.stack([lfilter([1 - k], [1, -k], load, zi=[k * load[0]])[0] for k in keeps], axis=1)


def running_mean(values: np.ndarray, size: int) -> np.ndarray:
    """Mean of `size` (odd) samples about each of (n,), continued at the ends along a line through the last `size`."""
    half = size // 2
    total = np.cumsum(np.concatenate([[0.0], values - values[0]]))
    inner = values[0] + (total[size:] - total[:-size]) / size
    at = np.arange(size)
    first, last = (np.polyval(np.polyfit(at, end, 1), at) for end in (values[:size], values[-size:]))
    return np.concatenate([first[:half], inner, last[size - half :]])
