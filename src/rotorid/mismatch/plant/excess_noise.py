"""Noise of the rotors' speeds and of the gyroscope that is more than its white part.

The white part is read from the highest frequencies of each sensor. A tachometer that averages, or a filter before the
log, leaves far more in the band that is analysed; as a regressor it would shrink every value that multiplies it. In
that band the rotors' moment is often noise alone, and what is left of the balance shows it: noise of the modelled side
is in the residual with the other sign, noise of the measured side with its own.
"""

from __future__ import annotations

import numpy as np
from scipy.signal import csd

from rotorid.mismatch.plant.motion import Segment
from rotorid.mismatch.plant.rows import Thinner, baseline_wrench, residual
from rotorid.recordings import Vehicle

NOISE_BAND = (0.5, 0.85)
"""Band, as shares of the cutoff, in which noise is distinguished from motion."""
MOSTLY_NOISE = 0.3
"""Share of a side's power in the band that must be noise before it says how much noise there is."""
SHORTEST_ROWS = 32
LEAST_FACTOR, MOST_FACTOR = 1.2, 10.0
"""A sensor with more noise than that was filtered before it was recorded: what is left in the band may be the model's
own."""


def noise_factors(
    segments: list[Segment], noisy: list[Segment], vehicle: Vehicle, thinner: Thinner
) -> dict[str, np.ndarray]:
    """Sensor (`rotors`, `gyroscope`) to the factors by which its noise in the band exceeds that of the `noisy` copies.

    The gyroscope's are of its axes, (3,); of the rotors, which are alike, one, (1,). Sensors without a word here are
    as noisy as assumed, or their noise is hidden by motion in the band.
    """
    squares = {"rotors": np.full(3, np.nan), "gyroscope": np.full(3, np.nan)}
    sides = [(_sides(a, vehicle, thinner), _sides(b, vehicle, thinner)) for a, b in zip(segments, noisy, strict=True)]
    sides = [pair for pair in sides if None not in pair]
    if not sides:
        return {}
    rate_hz, band = thinner.rate_hz, tuple(share * thinner.cutoff_hz for share in NOISE_BAND)
    for c in range(3):
        left = [measured[:, c] - modelled[:, c] for (measured, modelled), _ in sides]
        whole = band_power(left, rate_hz, band)
        for sensor, side, sign in (("gyroscope", 0, 1.0), ("rotors", 1, -1.0)):
            own = [a[side][:, c] for a, _ in sides]
            added = [b[side][:, c] - a[side][:, c] for a, b in sides]
            power, assumed = band_power(own, rate_hz, band), band_power(added, rate_hz, band)
            found = min(sign * band_power(left, rate_hz, band, own), whole)
            if assumed > 0 and found > MOSTLY_NOISE * power:
                squares[sensor][c] = found / assumed
    ratios = {"gyroscope": squares["gyroscope"], "rotors": squares["rotors"][np.isfinite(squares["rotors"])]}
    ratios["rotors"] = np.median(ratios["rotors"], keepdims=True) if len(ratios["rotors"]) else np.ones(1)
    factors = {sensor: np.sqrt(found) for sensor, found in ratios.items()}
    plain = {s: np.where((f > LEAST_FACTOR) & (f < MOST_FACTOR), f, 1.0) for s, f in factors.items()}
    return {sensor: factor for sensor, factor in plain.items() if (factor > 1.0).any()}


def _sides(segment: Segment, vehicle: Vehicle, thinner: Thinner) -> tuple[np.ndarray, np.ndarray] | None:
    """Measured and modelled moment of a segment's rows, (n, 3) each; None where either is unknown."""
    groups = residual(segment, vehicle)
    if "moment" not in groups or not segment.measured_speed:
        return None
    _, arm, torque = baseline_wrench(segment.motion, vehicle)
    modelled = thinner(arm + torque)
    return thinner(groups["moment"]) + modelled, modelled


def band_power(
    one: list[np.ndarray], rate_hz: float, band_hz: tuple[float, float], other: list[np.ndarray] | None = None
) -> float:
    """Mean power density of stretches in a band of frequency, or its real cross density with `other` stretches."""
    total, weight = 0.0, 0
    for a, b in zip(one, one if other is None else other, strict=True):
        if len(a) >= SHORTEST_ROWS:
            frequency, density = csd(a, b, fs=rate_hz, nperseg=min(len(a), 256))
            inside = (frequency >= band_hz[0]) & (frequency <= band_hz[1])
            total, weight = total + float(density[inside].real.mean()) * len(a), weight + len(a)
    return total / max(weight, 1)
