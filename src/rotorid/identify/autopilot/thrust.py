"""The thrust curve of the motors, their lag and the hover, from signals of the motors and the accelerometer.

The accelerometer reads, upward, the thrust over the mass, whatever the attitude and the wind. Each motor's signal makes
a steady thrust by the autopilot's own curve; the rotor's speed, its square root, follows with a lag of first order.
What else moves the thrust is estimated jointly: the voltage of the battery (or, where it is not recorded, a drift over
the run), the axial speed, the lift of forward flight, and the zero of the accelerometer, believed to 0.1 m/s².
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from rotorid.identify.autopilot.correlated import CorrelatedFit, EstimatedNumber, fit
from rotorid.identify.autopilot.signals import Stretch
from rotorid.identify.autopilot.thrust_maps import ThrustMap

_STANDARD_GRAVITY = 9.80665
"""m/s²: grams of thrust are by it."""
_ACCELEROMETER_ZERO_M_S2 = 0.1
"""Standard deviation of the error of an accelerometer's zero that is believed."""
TIME_CONSTANTS_S = (0.002, 0.4)
_RATE_HZ = 100.0
"""Residuals are averaged down to about so many a second: there is nothing above that the motors could do."""
_VOLTAGE_MOVES = 0.01
"""Share of the voltage that it must vary by for its part to be estimated."""
_DRIFT, _AXIAL, _LIFT = 0.1, 1.0, 0.05
"""Usual sizes: share of thrust that drifts over a run, m/s² per m/s of axial speed, m/s² per (m/s)² across."""


@dataclass(frozen=True)
class ThrustFit:
    """The estimates of a thrust curve."""

    shapes: tuple[EstimatedNumber, ...]
    """Of the map's numbers, in its order."""
    time_constant_s: EstimatedNumber
    hover_signal: EstimatedNumber
    """Signal of the motors at which they make the weight, 0 to 1."""
    hover_share: EstimatedNumber
    """Weight over the thrust at full signal."""
    throttle_range: tuple[float, float]
    """1 % and 99 % quantile of the signals flown."""


def fit_thrust(
    stretches: Sequence[Stretch], chosen: ThrustMap, mass_kg: float, gravity_m_s2: float = 9.81
) -> ThrustFit | None:
    """The thrust curve; None where no stretch has signals of the motors (or, for grams, the battery's voltage)."""
    used = [s for s in stretches if s.throttle is not None]
    if chosen.in_grams:
        used = [s for s in used if s.voltage is not None]
    if not used:
        return None
    layout = _layout(used, chosen)
    residuals = _residuals(used, chosen, layout, mass_kg)
    start = layout.start.copy()
    if not chosen.in_grams:
        mean = np.concatenate([s.throttle for s in used]).mean(keepdims=True)[None]
        share = max(float(chosen.thrust(mean, None, start[layout.shapes]).mean()), 1e-3)
        start[0] = np.log(gravity_m_s2 / share)
    found = fit(residuals, start, (layout.low, layout.high), layout.scale, layout.prior)
    volts = None
    if chosen.in_grams:
        volts = np.full((1, 1), np.mean(np.concatenate([s.voltage for s in used])))

    def lifted(values: np.ndarray, signal: float) -> float:
        """m/s² of all rotors at one signal."""
        share = chosen.thrust(np.array([[signal]]), volts, values[layout.shapes])
        return float(share[0, 0]) * _per_share(values, chosen, mass_kg, used[0].throttle.shape[1])

    signals = np.concatenate([s.throttle.ravel() for s in used])
    return ThrustFit(
        tuple(found.of(lambda v, k=k: float(v[k])) for k in range(*layout.shapes.indices(len(start)))),
        _exponential(found, layout.lag),
        found.of(lambda v: _solve(lambda u: lifted(v, u), gravity_m_s2)),
        found.of(lambda v: gravity_m_s2 / lifted(v, chosen.full_signal)),
        (float(np.quantile(signals, 0.01)), float(np.quantile(signals, 0.99))),
    )


def _exponential(found: CorrelatedFit, index: int) -> EstimatedNumber:
    """exp of a value, with an interval that stays positive."""
    log = found.of(lambda v: float(v[index]))
    low, high = np.exp(np.clip(log.interval_95, -50, 50))
    return EstimatedNumber(float(np.exp(log.value)), (float(low), float(high)))


def _per_share(values: np.ndarray, chosen: ThrustMap, mass_kg: float, rotors: int) -> float:
    """m/s² that all rotors make by a share (or a gram a rotor)."""
    return rotors * 1e-3 * _STANDARD_GRAVITY / mass_kg if chosen.in_grams else float(np.exp(values[0]))


def _solve(rising: Callable[[float], float], wanted: float) -> float:
    """Where a rising function reaches a value, by bisection on signals of 0 to 2."""
    low, high = 0.0, 2.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if rising(middle) < wanted else (low, middle)
    return (low + high) / 2


@dataclass(frozen=True)
class _Layout:
    """Which value is where."""

    shapes: slice
    lag: int
    zero: int
    voltage: int | None
    drift: dict[str, int]
    motion: int | None
    start: np.ndarray
    low: np.ndarray
    high: np.ndarray
    scale: np.ndarray
    prior: np.ndarray
    full_voltage: float


def _layout(used: Sequence[Stretch], chosen: ThrustMap) -> _Layout:
    rows: list[tuple[float, float, float, float, float]] = []

    def add(start: float, low: float, high: float, scale: float, prior: float = np.inf) -> int:
        rows.append((start, low, high, scale, prior))
        return len(rows) - 1

    if not chosen.in_grams:
        add(np.log(25.0), np.log(2.0), np.log(1000.0), 0.1)
    first = len(rows)
    for shape in chosen.shapes:
        add(shape.start, shape.low, shape.high, (shape.high - shape.low) / 10, shape.believed)
    shapes = slice(first, len(rows))
    lag = add(np.log(0.04), *np.log(TIME_CONSTANTS_S), 0.3)
    zero = add(0.0, -2.0, 2.0, _ACCELEROMETER_ZERO_M_S2, _ACCELEROMETER_ZERO_M_S2)
    voltage, drift, mean = None, {}, 1.0
    if not chosen.in_grams:
        if all(s.voltage is not None for s in used):
            volts = np.concatenate([s.voltage for s in used])
            mean = float(volts.mean())
            if np.ptp(volts) > _VOLTAGE_MOVES * mean:
                voltage = add(1.0, -2.0, 5.0, 0.5)
        else:
            drift = {name: add(0.0, -1.0, 1.0, _DRIFT) for name in dict.fromkeys(s.run for s in used)}
    motion = None
    if all(s.attitude is not None and s.velocity is not None for s in used):
        motion = add(0.0, -5.0, 5.0, _AXIAL)
        add(0.0, -1.0, 1.0, _LIFT)
    columns = np.array(rows).T
    return _Layout(shapes, lag, zero, voltage, drift, motion, *columns, mean)


def _residuals(used: Sequence[Stretch], chosen: ThrustMap, layout: _Layout, mass_kg: float):
    """The function from values to the residuals of each stretch, m/s², averaged down to `_RATE_HZ`."""
    prepared = []
    for s in used:
        through = None
        if layout.motion is not None:
            body = np.einsum("nji,nj->ni", s.attitude, s.velocity)
            through = np.stack([body[:, 2], body[:, 0] ** 2 + body[:, 1] ** 2], axis=1)
        middle, length = s.time_s.mean(), max(np.ptp(s.time_s), 1e-9)
        prepared.append((s, through, (s.time_s - middle) / length, max(int(round(1 / (_RATE_HZ * s.dt_s))), 1)))

    def residuals(values: np.ndarray) -> list[np.ndarray]:
        out = []
        for s, through, along, every in prepared:
            volts = None if s.voltage is None else s.voltage[:, None]
            steady = np.maximum(chosen.thrust(s.throttle, volts, values[layout.shapes]), 0.0)
            thrust = (lagging(np.sqrt(steady), s.dt_s, np.exp(values[layout.lag])) ** 2).mean(axis=1)
            up = thrust * _per_share(values, chosen, mass_kg, s.throttle.shape[1])
            if layout.voltage is not None:
                up = up * (s.voltage / layout.full_voltage) ** values[layout.voltage]
            if s.run in layout.drift:
                up = up * (1 + values[layout.drift[s.run]] * along)
            up = up + values[layout.zero]
            if through is not None:
                up = up + through @ values[layout.motion : layout.motion + 2]
            out.append(averaged(-s.specific_force[:, 2] - up, every))
        return out

    return residuals


def lagging(series: np.ndarray, dt_s: float, time_constant_s: float) -> np.ndarray:
    """Series (n, k) behind a lag of first order that starts settled; exact for straight lines between samples."""
    keep = np.exp(-dt_s / time_constant_s)
    ahead = 1 - (1 - keep) * time_constant_s / dt_s
    behind = (1 - keep) * time_constant_s / dt_s - keep
    return series[:1] + lfilter([ahead, behind], [1.0, -keep], series - series[:1], axis=0)


def averaged(series: np.ndarray, every: int) -> np.ndarray:
    """Means of `every` neighbours, (n // every,)."""
    count = len(series) // every
    return series[: count * every].reshape(count, every).mean(axis=1)
