"""How each autopilot says what thrust a motor's signal makes: its thrust curve, as published.

A motor's signal u is what the motor is sent, as a share of its range, 0 to 1 (the contract's `throttle_i`). A map gives
the thrust that u makes in the steady state, as a share of the thrust at u = 1; the Crazyflie's gives grams.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

_MOST_SHARE = 1.5
"""Shares of thrust up to which Betaflight's curve is inverted: a signal above its range is no use."""
_CURVE_POINTS = 3001
_SPIN_MAX = 0.95
"""Default of ArduPilot's MOT_SPIN_MAX, at which its curve ends."""
_SPIN_MIN_BELIEVED = 0.3 / np.sqrt(12)
"""MOT_SPIN_MIN is believed to lie in what ArduPilot takes, 0 to 0.3: the deviation of an even spread. Without it a
curve that is nearly a square (MOT_THST_EXPO near 1) leaves a line of pairs that fit alike."""


@dataclass(frozen=True)
class _Shape:
    """A number of a map: its name in the autopilot, where its estimate starts, and between what it lies."""

    name: str
    start: float
    low: float
    high: float
    """Bounds of the estimate; wider than what the autopilot takes, so that an interval is not cut."""
    allowed: tuple[float, float]
    """What the autopilot takes."""
    widest: float
    """Half width of the 95 % interval beyond which the flight does not determine it."""
    decimals: int = 3
    factor: float = 1.0
    """From the estimate to the number that the autopilot takes."""
    believed: float = np.inf
    """Standard deviation about the start that is believed before the flight."""


@dataclass(frozen=True)
class ThrustMap:
    """A thrust curve with its free numbers.

    `thrust` takes signals (n, k), battery voltage (n, 1) or None, and the numbers of `shapes`; it returns shares of the
    thrust at full signal (n, k), or grams where `in_grams`.
    """

    autopilot: str
    shapes: tuple[_Shape, ...]
    thrust: Callable[[np.ndarray, np.ndarray | None, np.ndarray], np.ndarray]
    equation: str
    source: str
    in_grams: bool = False
    full_signal: float = 1.0
    """Signal of full thrust."""


def px4(signal: np.ndarray, voltage: np.ndarray | None, shape: np.ndarray) -> np.ndarray:
    """T/T_max = f u² + (1 − f) u, f = THR_MDL_FAC."""
    return shape[0] * signal**2 + (1 - shape[0]) * signal


def ardupilot(signal: np.ndarray, voltage: np.ndarray | None, shape: np.ndarray) -> np.ndarray:
    """T/T_max = e r² + (1 − e) r with r = (u − spin_min)/(spin_max − spin_min); none below spin_min."""
    expo, spin_min = shape
    r = np.maximum(signal - spin_min, 0.0) / (_SPIN_MAX - spin_min)
    return expo * r**2 + (1 - expo) * r


def betaflight(signal: np.ndarray, voltage: np.ndarray | None, shape: np.ndarray) -> np.ndarray:
    """T/T_max = x where u = x (1 + k (1 − x)²), k = thrust_linear/100; below k = 3 one x for each u."""
    x = np.linspace(0.0, _MOST_SHARE, _CURVE_POINTS)
    return np.interp(signal, x * (1 + shape[0] * (1 - x) ** 2), x)


def crazyflie(signal: np.ndarray, voltage: np.ndarray | None, shape: np.ndarray) -> np.ndarray:
    """Grams t of a rotor where u V = c_1 t + c_2 t²."""
    volts = signal * (1.0 if voltage is None else voltage)
    root = np.sqrt(np.maximum(shape[0] ** 2 + 4 * shape[1] * volts, 1e-6 * shape[0] ** 2))
    return 2 * volts / (shape[0] + root)


MAPS = {
    "px4": ThrustMap(
        "PX4",
        (_Shape("THR_MDL_FAC", 0.5, -0.5, 1.6, (0.0, 1.0), 0.25),),
        px4,
        "T/T_max = f u² + (1 − f) u, f = THR_MDL_FAC",
        "PX4-Autopilot, src/lib/mixer_module/motor_params.c (THR_MDL_FAC) and functions/FunctionMotors.hpp",
    ),
    "ardupilot": ThrustMap(
        "ArduPilot",
        (
            _Shape("MOT_THST_EXPO", 0.5, -0.9, 1.8, (-1.0, 1.0), 0.25),
            _Shape("MOT_SPIN_MIN", 0.15, -0.2, 0.4, (0.0, 0.3), 0.08, believed=_SPIN_MIN_BELIEVED),
        ),
        ardupilot,
        f"T/T_max = e r² + (1 − e) r, r = (u − MOT_SPIN_MIN)/({_SPIN_MAX:g} − MOT_SPIN_MIN), e = MOT_THST_EXPO",
        "ardupilot, libraries/AP_Motors/AP_Motors_Thrust_Linearization.cpp, with MOT_SPIN_MAX at its default",
        full_signal=_SPIN_MAX,
    ),
    "betaflight": ThrustMap(
        "Betaflight",
        (_Shape("thrust_linear", 0.3, -0.6, 2.5, (0.0, 1.5), 0.25, 0, 100.0),),
        betaflight,
        "u = x (1 + k (1 − x)²), x = T/T_max, k = thrust_linear/100",
        "Betaflight 4.5, src/main/flight/pid.c, pidApplyThrustLinearization, and pid_init.c",
    ),
    "crazyflie": ThrustMap(
        "Crazyflie",
        (
            _Shape("volts_per_gram", 0.088, 0.01, 0.5, (0.0, np.inf), 0.02, 5),
            _Shape("volts_per_gram_squared", -0.0006239, -0.004, 0.01, (-np.inf, np.inf), 0.0008, 7),
        ),
        crazyflie,
        "u V = c_1 t + c_2 t², t in grams a rotor, V the battery's voltage",
        "crazyflie-firmware, src/drivers/src/motors.c, motorsCompensateBatteryVoltage (c_1 = 0.088, c_2 = −0.0006239)",
        in_grams=True,
    ),
}
"""By the name that `--to` takes."""
