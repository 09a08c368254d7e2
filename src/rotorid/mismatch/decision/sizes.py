"""How large an error is in units that a pilot knows: shares of the weight, of the moment that the rotors can make, and
metres after half a second of simulation.

Errors in units of a sensor's noise order a verdict by what is surest: on a vehicle of 20 N, 0.015 N sideways would lead
before half a newton metre of pitch.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from rotorid.mismatch.decision.drift import drift_m
from rotorid.mismatch.decision.findings import Analysis, ChannelTrace, rms
from rotorid.mismatch.decision.shares import fitted_part
from rotorid.mismatch.decision.words import channel_words, number
from rotorid.recordings import Vehicle


@dataclass(frozen=True)
class _ChannelScale:
    """What a channel's errors are stated as a share of: a number in the channel's unit, and its name."""

    value: float
    words: str


def scales(analysis: Analysis) -> dict[str, _ChannelScale]:
    """To every compared channel its scale; channels of which none is known are not among them."""
    if analysis.instrument is not None:
        return _of_reading(analysis)
    return _of_flight(analysis.believed)


def _of_flight(vehicle: Vehicle) -> dict[str, _ChannelScale]:
    """Weight for forces, and for moments what the rotors can make by differing while they carry the vehicle.

    Half of the rotors at twice the hover's thrust and the others at none: Σ |y_i| F_i, Σ |x_i| F_i and Σ Q_i at hover.
    """
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    coefficients = vehicle.thrust_coefficients_n_s2()
    hover = float(np.sqrt(weight / coefficients.sum()))
    thrust = coefficients * hover**2
    x, y, _ = np.abs(vehicle.rotor_positions_m()).T
    moments = (y @ thrust, x @ thrust, vehicle.torque_coefficients_n_m_s2().sum() * hover**2)
    out = {f"force_{axis}": _ChannelScale(weight, "of the weight") for axis in "xyz"}
    for axis, moment in zip("xyz", moments, strict=True):
        if moment > 0:
            out[f"moment_{axis}"] = _ChannelScale(float(moment), f"of the available {channel_words(f'moment_{axis}')}")
    out |= {f"rotor_speed_{i + 1}": _ChannelScale(hover, "of the hover speed") for i in range(vehicle.rotor_count)}
    out |= {f"accelerometer_{axis}": _ChannelScale(vehicle.gravity_m_s2, "of gravity") for axis in "xyz"}
    return out | {f"gyroscope_{axis}": _ChannelScale(1.0, "of 1 rad/s") for axis in "xyz"}


def _of_reading(analysis: Analysis) -> dict[str, _ChannelScale]:
    """The largest load of the recordings, of forces and of moments."""
    out: dict[str, _ChannelScale] = {}
    for group, columns in (("force", slice(0, 3)), ("moment", slice(3, 6))):
        largest = max((float(np.abs(x.load[:, columns]).max()) for x in analysis.loadings if x.size), default=0.0)
        if largest > 0:
            out |= {f"{group}_{axis}": _ChannelScale(largest, f"of the largest {group}") for axis in "xyz"}
    if analysis.believed.rotors:
        speeds = [x.motion.rotor_speed for x in analysis.loadings if x.motion.rotor_speed is not None]
        top = max((float(np.nanmax(s)) for s in speeds if s.size), default=0.0)
        if top > 0:
            count = analysis.believed.rotor_count
            out |= {f"rotor_speed_{i + 1}": _ChannelScale(top, "of the largest speed") for i in range(count)}
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
    metres: float | None = None
    """How far off it alone leads within half a second of simulation; None where it moves nothing."""


def effect_sizes(analysis: Analysis, held: list[np.ndarray]) -> dict[str, Size]:
    """To every stated effect its size on masked rows of the compared traces: the model with it less that without it."""
    known, units = scales(analysis), {t.channel: t.unit for t in analysis.compared}
    out: dict[str, Size] = {}
    for effect_id, without in analysis.without.items():
        moved = [(t, left - t.named, mask) for t, left, mask in zip(analysis.compared, without, held, strict=True)]
        parts: dict[str, list[np.ndarray]] = {}
        for trace, added, mask in moved:
            parts.setdefault(trace.channel, []).append(added[mask])
        found = {c: rms(own) for c, own in parts.items() if c in known}
        sizes = [Size(c, r, units[c], r / known[c].value, known[c].words) for c, r in found.items() if r > 0]
        if sizes:
            most = max(sizes, key=lambda s: s.share)
            out[effect_id] = replace(most, metres=_metres(analysis, most.channel, moved))
    return out


def channel_metres(analysis: Analysis, channel: str, stage: Literal["before", "named"]) -> float | None:
    """How far off a channel's error leads within half a second, on the runs held out where there are any."""
    part = fitted_part(analysis)
    own = [(t, getattr(t, stage), part(t.run, t.time_s)) for t in analysis.traces if t.channel == channel]
    held = any((sign < 0).any() for _, _, sign in own)
    return _metres(analysis, channel, [(t, error, sign < 0 if held else sign > 0) for t, error, sign in own])


def _metres(
    analysis: Analysis, channel: str, errors: Iterable[tuple[ChannelTrace, np.ndarray, np.ndarray]]
) -> float | None:
    """Drift of one channel's errors, each with its trace and the mask of the rows that count."""
    if analysis.instrument is not None:
        return None
    own = [(t.time_s, np.where(mask, error, np.nan)) for t, error, mask in errors if t.channel == channel]
    return drift_m(analysis.believed, channel, own)


def channel_size(analysis: Analysis, channel: str, rms: float, stage: Literal["before", "named"]) -> Size | None:
    """The size of a channel's error; None where the channel has no scale."""
    known, units = scales(analysis), {t.channel: t.unit for t in analysis.traces}
    if channel not in known or channel not in units:
        return None
    scale = known[channel]
    return Size(channel, rms, units[channel], rms / scale.value, scale.words, channel_metres(analysis, channel, stage))


def share_words(size: Size) -> str:
    """`6 % of the weight`."""
    share = 100 * size.share
    return f"{share:.0f} % {size.words}" if share >= 1 else f"{share:.1g} % {size.words}"


def metres_words(size: Size) -> str:
    """`0.060 m after 0.5 s simulated`; empty where it moves nothing."""
    return "" if size.metres is None else f"{number(size.metres)} m after 0.5 s simulated"
