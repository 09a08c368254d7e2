"""How large an error is in units that a pilot knows: shares of the weight, of the moment that the rotors can make.

Errors in units of a sensor's noise order a verdict by what is surest: on a vehicle of 20 N, 0.015 N sideways would lead
before half a newton metre of pitch.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rotorid.mismatch.findings import Analysis
from rotorid.recordings import Vehicle

AXES = ("roll", "pitch", "yaw")
FASTEST_RAD_S = 1.0
"""A body rate against which errors between gyroscope and attitude are stated."""


@dataclass(frozen=True)
class Scale:
    """What a channel's errors are stated as a share of: a number in the channel's unit, and its name."""

    value: float
    words: str


def scales(analysis: Analysis) -> dict[str, Scale]:
    """To every compared channel its scale; channels of which none is known are not among them."""
    if analysis.instrument is not None:
        return of_reading(analysis)
    return of_flight(analysis.believed)


def of_flight(vehicle: Vehicle) -> dict[str, Scale]:
    """Weight for forces, and for moments what the rotors can make by differing while they carry the vehicle.

    Half of the rotors at twice the hover's thrust and the others at none: Σ |y_i| F_i, Σ |x_i| F_i and Σ Q_i at hover.
    """
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    coefficients = vehicle.thrust_coefficients_n_s2()
    hover = float(np.sqrt(weight / coefficients.sum()))
    thrust = coefficients * hover**2
    x, y, _ = np.abs(vehicle.rotor_positions_m()).T
    moments = (y @ thrust, x @ thrust, vehicle.torque_coefficients_n_m_s2().sum() * hover**2)
    out = {f"force_{axis}": Scale(weight, "of the weight") for axis in "xyz"}
    for axis, name, moment in zip("xyz", AXES, moments, strict=True):
        if moment > 0:
            out[f"moment_{axis}"] = Scale(float(moment), f"of the {name} moment it can make")
    out |= {f"rotor_speed_{i + 1}": Scale(hover, "of the hover speed") for i in range(vehicle.rotor_count)}
    out |= {f"accelerometer_{axis}": Scale(vehicle.gravity_m_s2, "of gravity") for axis in "xyz"}
    return out | {f"gyroscope_{axis}": Scale(FASTEST_RAD_S, "of 1 rad/s") for axis in "xyz"}


def of_reading(analysis: Analysis) -> dict[str, Scale]:
    """The largest load of the recordings, of forces and of moments."""
    out: dict[str, Scale] = {}
    for group, columns, unit in (("force", slice(0, 3), "force"), ("moment", slice(3, 6), "moment")):
        largest = max((float(np.abs(x.load[:, columns]).max()) for x in analysis.loadings if x.size), default=0.0)
        if largest > 0:
            out |= {f"{group}_{axis}": Scale(largest, f"of the largest {unit}") for axis in "xyz"}
    if analysis.believed.rotors:
        speeds = [x.motion.rotor_speed for x in analysis.loadings if x.motion.rotor_speed is not None]
        top = max((float(np.nanmax(s)) for s in speeds if s.size), default=0.0)
        if top > 0:
            count = analysis.believed.rotor_count
            out |= {f"rotor_speed_{i + 1}": Scale(top, "of the largest speed") for i in range(count)}
    return out


@dataclass(frozen=True)
class Size:
    """Root mean square of what an effect does to the channel in which it does most."""

    channel: str
    rms: float
    unit: str
    share: float
    """Of the channel's scale."""
    words: str
    """What it is a share of: `of the weight`."""


def effect_sizes(analysis: Analysis, held: list[np.ndarray]) -> dict[str, Size]:
    """To every stated effect its size on masked rows of the compared traces: the model with it less that without it."""
    known, units = scales(analysis), {t.channel: t.unit for t in analysis.compared}
    out: dict[str, Size] = {}
    for effect_id, without in analysis.without.items():
        squares: dict[str, list[np.ndarray]] = {}
        for trace, left, mask in zip(analysis.compared, without, held, strict=True):
            squares.setdefault(trace.channel, []).append((left - trace.after)[mask] ** 2)
        rms = {c: float(np.sqrt(np.nanmean(x))) for c, parts in squares.items() if len(x := np.concatenate(parts))}
        sizes = [
            Size(c, r, units[c], r / known[c].value, known[c].words) for c, r in rms.items() if c in known and r > 0
        ]
        if sizes:
            out[effect_id] = max(sizes, key=lambda s: s.share)
    return out


def share_words(value: float, channel: str, known: Mapping[str, Scale]) -> str:
    """`6 % of the weight`; empty where the channel has no scale."""
    if channel not in known:
        return ""
    share = 100 * value / known[channel].value
    return f"{share:.0f} % {known[channel].words}" if share >= 1 else f"{share:.1g} % {known[channel].words}"
