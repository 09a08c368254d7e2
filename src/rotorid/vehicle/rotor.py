"""Rotors: speeds that follow their commands with a lag and within limits."""

from __future__ import annotations

import numpy as np


def lagged_speeds(
    command: np.ndarray,
    dt_s,
    time_up_s: float,
    time_down_s: float | None = None,
    start: np.ndarray | None = None,
) -> np.ndarray:
    """Speeds (n, k), rad/s, that follow commands (n, k), rad/s, held over each sample, by a first-order lag.

    dω/dt = (ω_c - ω) / τ, τ = `time_up_s` while the speed grows, `time_down_s` (default the same) while it
    falls; solved exactly over each sample, so any step is stable. `dt_s` is the sample time (number or
    (n-1,)). Starts at `start` (k,), default the first command.
    """
    command = np.asarray(command, float)
    time_down_s = time_up_s if time_down_s is None else time_down_s
    if time_up_s < 0 or time_down_s < 0:
        raise ValueError(f"motor time constants must be 0 or more, got {time_up_s} and {time_down_s} s")
    steps = np.broadcast_to(np.asarray(dt_s, float), (len(command) - 1,))
    keep_up = np.exp(-steps / time_up_s) if time_up_s > 0 else np.zeros(len(steps))
    keep_down = np.exp(-steps / time_down_s) if time_down_s > 0 else np.zeros(len(steps))
    out = np.empty_like(command)
    out[0] = command[0] if start is None else start
    for i in range(len(steps)):
        gap = out[i] - command[i]
        out[i + 1] = command[i] + gap * np.where(gap < 0, keep_up[i], keep_down[i])
    return out


def limited(command: np.ndarray, limits_rad_s: tuple[float, float] | None) -> np.ndarray:
    """Commands held within what the motor can do, rad/s; unchanged without limits."""
    return command if limits_rad_s is None else np.clip(command, *limits_rad_s)
