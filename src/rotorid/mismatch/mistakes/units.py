"""Columns in the wrong unit, recognised from size alone: gravity, weight, and what a throttle or a battery can be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.constants import g
from scipy.stats import norm

from rotorid.mismatch.decide.findings import Finding
from rotorid.mismatch.decide.status import Estimate
from rotorid.mismatch.mistakes.signals import Corrected, ReadSet, replace_columns, sensor_columns
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


@dataclass(frozen=True)
class UnitError:
    """Columns that hold `factor` times the contract's unit."""

    columns: tuple[str, ...]
    what: str
    unit: str
    factor: float
    expected: str
    measured: float
    """The factor as the recording itself gives it."""
    spread: float
    """Half width of the 95 % interval of the logarithm of `measured`."""
    p_value: float


def nearest(ratio: float, factors: Mapping[str, float]) -> tuple[str, float] | None:
    """The unit whose factor a measured ratio is, None if it is none of them or the contract's own."""
    if not np.isfinite(ratio) or ratio <= 0 or abs(np.log(ratio)) < _FAR:
        return None
    name = min(factors, key=lambda n: abs(np.log(ratio / factors[n])))
    return (name, factors[name]) if abs(np.log(ratio / factors[name])) < _CLOSE else None


def find(recordings: ReadSet) -> Corrected:
    """The set in the contract's units, with every unit error that the mean sizes of columns give away."""
    result = Corrected(recordings)
    for error in _by_size(recordings):
        result = result.then(partial(corrected, error=error))
    return result


def _pooled(recordings: ReadSet, names: tuple[str, ...]) -> np.ndarray:
    """Values of columns over all runs that have them, (n, m)."""
    parts = [run.array(names) for run in recordings.runs if names and run.has(*names)]
    values = np.concatenate(parts) if parts else np.zeros((0, len(names)))
    return values[np.isfinite(values).all(axis=1)]


def _spread(values: np.ndarray) -> float:
    """Doubt of a median of positive values: what halves, quarters … of the recording disagree by."""
    parts = [np.median(p) for p in np.array_split(values, 8) if len(p)]
    return float(2.4 * np.std(np.log(np.maximum(parts, 1e-12))) / np.sqrt(len(parts)) + 1e-6)


def _by_size(recordings: ReadSet) -> list[UnitError]:
    """Every unit error that the mean sizes of columns give away."""
    vehicle, found = recordings.vehicle, []
    names = sensor_columns(vehicle)

    def add(columns, what, unit, expected, measured=None, spread=0.0) -> None:
        if unit is not None:
            measured = unit[1] if measured is None else measured
            # How sure the recording is that the ratio is nearer to the unit's factor than to one.
            surely = abs(np.log(measured)) / 2 / max(spread / 1.96, 1e-6)
            found.append(UnitError(columns, what, *unit, expected, measured, spread, float(norm.sf(surely))))

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
    return found


def corrected(recordings: ReadSet, error: UnitError) -> Corrected:
    """The set with the columns in the contract's unit, and the finding of a unit error.

    It states the unit's own factor, and in its interval what the recording itself gives.
    """

    def change(run: Run) -> dict:
        own = {n: run.table[n] for n in error.columns if n in run.table.columns}
        if error.unit == _PULSES:
            return {n: (pulse - 1000.0) / 1000.0 for n, pulse in own.items()}
        return {n: values * (1.0 / error.factor) for n, values in own.items()}

    half = max(error.spread, abs(float(np.log(error.measured / error.factor))))
    low, high = error.factor * np.exp(-half), error.factor * np.exp(half)
    finding = Finding(
        id="unit_error",
        status="established",
        sentence=(
            f"{error.what[0].upper()}{error.what[1:]} ({error.columns[0]} …) hold {error.unit}, not {error.expected}: "
            f"corrected by dividing by {error.factor:.6g}."
        ),
        parameters=(Estimate("factor", error.factor, "1", float(low), float(high)),),
        p_value=error.p_value,
        channels=error.columns,
    )
    return Corrected(replace_columns(recordings, change), (finding,))
