"""Columns in the wrong unit, recognised from size alone: gravity, weight, and what a throttle or a battery can be."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.constants import g
from scipy.stats import norm

from rotorid.mismatch.decide.status import Estimate
from rotorid.mismatch.decide.words import capital
from rotorid.mismatch.mistakes.signals import Corrected, ReadSet, established, replace_columns, sensor_columns
from rotorid.recordings import Run
from rotorid.recordings import columns as c

_CLOSE = np.log(1.6)
"""A ratio is taken for a unit's factor within this (a wrong believed value is far smaller)."""
_FAR = np.log(3.0)
"""Only ratios off by more than this are looked at."""
_ACCELERATIONS = {"g": 1 / g, "mg": 1000 / g, "cm/s²": 100.0, "mm/s²": 1000.0}
RATES = {"rpm": 60 / (2 * np.pi), "rev/s": 1 / (2 * np.pi), "deg/s": 180 / np.pi}
_PULSES = "pulses of 1000 to 2000 µs"
_THROTTLES = {
    ("counts of 16 bits", 65535.0): (2300, 65535.5),
    ("per mille", 1000.0): (260, 1000.5),
    ("percent", 100.0): (1.5, 100.5),
    ("counts of 8 bits", 255.0): (100.5, 255.5),
}
"""A throttle's unit with its factor, and what its largest value is above and up to."""


def nearest(ratio: float, factors: Mapping[str, float]) -> tuple[str, float] | None:
    """The unit whose factor a measured ratio is, None if it is none of them or the contract's own."""
    if not np.isfinite(ratio) or ratio <= 0 or abs(np.log(ratio)) < _FAR:
        return None
    name = min(factors, key=lambda n: abs(np.log(ratio / factors[n])))
    return (name, factors[name]) if abs(np.log(ratio / factors[name])) < _CLOSE else None


def _pooled(recordings: ReadSet, names: tuple[str, ...]) -> np.ndarray:
    """Values of columns over all runs that have them, (n, m)."""
    parts = [run.array(names) for run in recordings.runs if names and run.has(*names)]
    values = np.concatenate(parts) if parts else np.zeros((0, len(names)))
    return values[np.isfinite(values).all(axis=1)]


def _spread(values: np.ndarray) -> float:
    """Doubt of a median of positive values: what halves, quarters … of the recording disagree by."""
    parts = [np.median(p) for p in np.array_split(values, 8) if len(p)]
    return float(2.4 * np.std(np.log(np.maximum(parts, 1e-12))) / np.sqrt(len(parts)) + 1e-6)


def find(recordings: ReadSet) -> Corrected:
    """The set in the contract's units, with every unit error that the mean sizes of columns give away."""
    vehicle, result = recordings.vehicle, Corrected(recordings)
    names = sensor_columns(vehicle)

    def add(columns, what, unit, expected, measured=None, spread=0.0) -> None:
        nonlocal result
        if unit is not None:
            measured = unit[1] if measured is None else measured
            # How sure the recording is that the ratio is nearer to the unit's factor than to one.
            p_value = float(norm.sf(abs(np.log(measured)) / 2 / max(spread / 1.96, 1e-6)))
            result = result.then(lambda now: corrected(now, columns, what, unit, expected, measured, spread, p_value))

    force = _pooled(recordings, names["accelerometer"])
    if len(force):
        size = np.linalg.norm(force, axis=1)
        ratio = float(np.median(size)) / vehicle.gravity_m_s2
        unit = nearest(ratio, _ACCELERATIONS)
        add(names["accelerometer"], "the accelerometer", unit, "m/s²", ratio, _spread(size))
    for key, what in (("rotors", "the rotor speeds"), ("commands", "the commanded rotor speeds")):
        speed = _pooled(recordings, names[key])
        if len(speed):
            lift = speed**2 @ vehicle.thrust_coefficients_n_s2()
            # A hovering vehicle's rotors carry its weight on average, whatever it does in between.
            ratio = float(np.sqrt(np.median(lift) / (vehicle.mass_kg * vehicle.gravity_m_s2)))
            unit = nearest(ratio, {**RATES, "1000 rpm": RATES["rpm"] / 1000})
            add(names[key], what, unit, "rad/s", ratio, _spread(np.sqrt(lift + 1e-12)))
    throttle = _pooled(recordings, names["throttle"])
    if len(throttle):
        low, high = (float(np.quantile(throttle, share)) for share in (0.001, 0.999))
        unit = next((unit for unit, (above, most) in _THROTTLES.items() if above < high <= most), None)
        add(names["throttle"], "the throttle", (_PULSES, 1000.0) if 900 <= low and high <= 2300 else unit, "a fraction")
    voltage = _pooled(recordings, (c.BATTERY_VOLTAGE,))
    if len(voltage):
        middle = float(np.median(voltage))
        unit = ("mV", 1000.0) if middle > 1000 else ("0.1 V", 10.0) if 60 < middle < 600 else None
        add((c.BATTERY_VOLTAGE,), "the battery voltage", unit, "V")
    mount = _pooled(recordings, c.MOUNT)
    if len(mount) and np.max(np.abs(mount)) > 3.5:
        add(c.MOUNT, "the mount's angles", ("degrees", RATES["deg/s"]), "rad")
    return result


def corrected(
    recordings: ReadSet,
    columns: tuple[str, ...],
    what: str,
    unit: tuple[str, float],
    expected: str,
    measured: float,
    spread: float,
    p_value: float,
) -> Corrected:
    """The set with columns in the contract's unit (`expected`), and the finding that they hold another, times a factor.

    It states the unit's own factor, and in its interval what the recording itself gives: `measured`, with `spread`,
    half the width of the 95 % interval of its logarithm.
    """
    name, factor = unit

    def change(run: Run) -> dict:
        own = {n: run.table[n] for n in columns if n in run.table.columns}
        if name == _PULSES:
            return {n: (pulse - 1000.0) / 1000.0 for n, pulse in own.items()}
        return {n: values * (1.0 / factor) for n, values in own.items()}

    half = max(spread, abs(float(np.log(measured / factor))))
    low, high = factor * np.exp(-half), factor * np.exp(half)
    sentence = f"{capital(what)} ({columns[0]} …) hold {name}, not {expected}: corrected by dividing by {factor:.6g}."
    parameters = (Estimate("factor", factor, "1", float(low), float(high)),)
    finding = established("unit_error", sentence, p_value, columns, parameters=parameters)
    return Corrected(replace_columns(recordings, change), (finding,))
