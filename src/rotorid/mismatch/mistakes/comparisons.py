"""What two sensors say of the same motion, as blocks of spectra ready to be fitted.

In each comparison X is the less noisy side, because noise in X would shrink the gain. Comparisons between
position, velocity, attitude, gyroscope and accelerometer hold for any body; those with the rotors use the
believed vehicle.
"""

from __future__ import annotations

import numpy as np

from rotorid.mismatch.mistakes import lagged
from rotorid.mismatch.mistakes.lagged import Blocks, Signal
from rotorid.mismatch.mistakes.signals import Signals
from rotorid.mismatch.plant.motion import rates_from_attitude
from rotorid.recordings import Vehicle

BANDS_HZ = {
    "turning": (0.3, 20.0),
    "accelerating": (0.3, 12.0),
    "sideways": (0.3, 6.0),
    "moving": (0.3, 12.0),
    "rolling": (2.0, 25.0),
    "yawing": (0.7, 15.0),
    "lifting": (1.5, 15.0),
    "following": (0.5, 15.0),
}
"""Of each comparison the frequencies that are looked at."""
_NYQUIST_SHARE = 0.35
"""Highest frequency used, as a share of the slower sensor's own rate."""


def speeds_of(signals: Signals) -> str | None:
    """Which sensor gives the rotor speeds: measured, else commanded, else throttle."""
    return next((n for n in ("rotors", "commands", "throttle") if n in signals.values), None)


def squared_speeds(signals: Signals, vehicle: Vehicle, sensor: str) -> np.ndarray:
    """Believed thrust of every rotor, (n, k), N; of a throttle only up to its unknown scale."""
    values = signals.values[sensor]
    if sensor == "throttle" and vehicle.rotor_speed_limits_rad_s:
        values = values * vehicle.rotor_speed_limits_rad_s[1]
    return values**2 * vehicle.thrust_coefficients_n_s2()


def _band(all_signals: list[Signals], sensors: tuple[str, ...], wanted: tuple[float, float]) -> tuple[float, float]:
    """A band that the slowest of some sensors can follow in every run."""
    rates = [s.own_rate_hz[n] for s in all_signals for n in sensors if n in s.values and s.own_rate_hz[n] > 0]
    return wanted[0], min(wanted[1], _NYQUIST_SHARE * min(rates, default=0.0))


def gather(all_signals: list[Signals], sensors: tuple[str, ...], wanted: tuple[float, float], make) -> Blocks | None:
    """Blocks of all runs that have the sensors; `make(signals)` gives Y, X and Z."""
    limits = _band([s for s in all_signals if set(sensors) <= set(s.values)], sensors, wanted)
    if limits[1] < 2.5 * limits[0]:
        return None
    parts = []
    for number, signals in enumerate(all_signals):
        if set(sensors) <= set(signals.values):
            y, x, z = make(signals)
            parts.append(lagged.cut(y, x, z, signals.rate_hz, limits, number))
    return lagged.join(parts)


def turning(all_signals: list[Signals]) -> Blocks | None:
    """Y: body rates from the attitude; X: the gyroscope, rad/s."""

    def make(s: Signals):
        q = s.values["attitude"]
        slope = np.gradient(q, 1.0 / s.rate_hz, axis=0)
        return Signal(rates_from_attitude(q, slope)), Signal(s.values["gyroscope"]), None

    return gather(all_signals, ("attitude", "gyroscope"), BANDS_HZ["turning"], make)


def accelerating(all_signals: list[Signals], vehicle: Vehicle, source: str) -> Blocks | None:
    """Y: derivative of the world velocity; X: specific force turned into the world, m/s².

    `source` is `accelerometer`, or the rotors' sensor, whose thrust over the mass then stands for it.
    """

    def make(s: Signals):
        if source == "accelerometer":
            body = s.values[source]
        else:
            lift = squared_speeds(s, vehicle, source).sum(axis=1) / vehicle.mass_kg
            body = np.stack([np.zeros_like(lift), np.zeros_like(lift), -lift], axis=1)
        return Signal(s.values["velocity"], True), Signal(np.einsum("nij,nj->ni", s.rotation(), body)), None

    return gather(all_signals, ("velocity", "attitude", source), BANDS_HZ["accelerating"], make)


def sideways(all_signals: list[Signals], gravity_m_s2: float) -> Blocks | None:
    """Y: specific force that velocity and attitude ask for; X: the accelerometer; body x and y, m/s²."""

    def make(s: Signals):
        slope = np.gradient(s.values["velocity"], 1.0 / s.rate_hz, axis=0)
        body = np.einsum("nji,nj->ni", s.rotation(), slope - np.array([0.0, 0.0, gravity_m_s2]))
        return Signal(body[:, :2]), Signal(s.values["accelerometer"][:, :2]), None

    return gather(all_signals, ("velocity", "attitude", "accelerometer"), BANDS_HZ["sideways"], make)


def moving(all_signals: list[Signals]) -> Blocks | None:
    """Y: derivative of the position; X: the velocity, m/s, world axes."""

    def make(s: Signals):
        return Signal(s.values["position"], True), Signal(s.values["velocity"]), None

    return gather(all_signals, ("position", "velocity"), BANDS_HZ["moving"], make)


def rolling(all_signals: list[Signals], vehicle: Vehicle, sensor: str) -> Blocks | None:
    """Y: derivative of the roll and pitch rate; X: what the believed rotors give, rad/s²; Z: the body rates."""
    at, inertia = vehicle.rotor_positions_m(), vehicle.inertia_kg_m2

    def make(s: Signals):
        rate, thrust = s.values["gyroscope"], squared_speeds(s, vehicle, sensor)
        turning = np.stack([-(thrust @ at[:, 1]) / inertia.xx, (thrust @ at[:, 0]) / inertia.yy], axis=1)
        return Signal(rate[:, :2], True), Signal(turning), Signal(rate)

    return gather(all_signals, ("gyroscope", sensor), BANDS_HZ["rolling"], make)


def lifting(all_signals: list[Signals], vehicle: Vehicle, sensor: str) -> Blocks | None:
    """Y: accelerometer z; X: minus the believed thrust over the mass, m/s²."""

    def make(s: Signals):
        lift = -squared_speeds(s, vehicle, sensor).sum(axis=1, keepdims=True) / vehicle.mass_kg
        return Signal(s.values["accelerometer"][:, 2:]), Signal(lift), None

    return gather(all_signals, ("accelerometer", sensor), BANDS_HZ["lifting"], make)


def following(all_signals: list[Signals], sensor: str) -> Blocks | None:
    """Y: one rotor's measured speed; X: its command (or throttle), all rotors stacked as blocks."""
    parts = []
    limits = _band(all_signals, ("rotors", sensor), BANDS_HZ["following"])
    if limits[1] < 2.5 * limits[0]:
        return None
    for number, s in enumerate(all_signals):
        if {"rotors", sensor} <= set(s.values):
            for i in range(s.values["rotors"].shape[1]):
                pick = slice(i, i + 1)
                y, x = Signal(s.values["rotors"][:, pick]), Signal(s.values[sensor][:, pick])
                parts.append(lagged.cut(y, x, None, s.rate_hz, limits, number))
    return lagged.join(parts)
