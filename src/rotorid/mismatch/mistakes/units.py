"""Columns in the wrong unit, recognised from size alone: gravity, weight, and what a throttle or a battery can be."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.stats import norm

from rotorid.mismatch.decision.findings import Finding
from rotorid.mismatch.mistakes.signals import scaled, sensor_columns
from rotorid.mismatch.posterior.status import Estimate
from rotorid.recordings import RecordingSet
from rotorid.recordings import columns as c

GRAVITY = 9.80665
RPM = 60 / (2 * np.pi)
CLOSE = np.log(1.6)
"""A ratio is taken for a unit's factor within this (a wrong believed value is far smaller)."""
FAR = np.log(3.0)
"""Only ratios off by more than this are looked at."""


@dataclass(frozen=True)
class UnitError:
    """Columns that hold `factor` times the contract's unit."""

    columns: tuple[str, ...]
    what: str
    unit: str
    expected: str
    factor: float
    measured: float
    """The factor as the recording itself gives it."""
    spread: float
    """Half width of the 95 % interval of the logarithm of `measured`."""
    p_value: float = 0.0
    certain: bool = True


def nearest(ratio: float, factors: dict[str, float]) -> tuple[str, float] | None:
    """The unit whose factor a measured ratio is, None if it is none of them or the contract's own."""
    if not np.isfinite(ratio) or ratio <= 0 or abs(np.log(ratio)) < FAR:
        return None
    name = min(factors, key=lambda n: abs(np.log(ratio / factors[n])))
    return (name, factors[name]) if abs(np.log(ratio / factors[name])) < CLOSE else None


def _pooled(recordings: RecordingSet, names: tuple[str, ...]) -> np.ndarray:
    """Values of columns over all runs that have them, (n, m)."""
    parts = [run.array(names) for run in recordings.runs if names and run.has(*names)]
    values = np.concatenate(parts) if parts else np.zeros((0, len(names)))
    return values[np.isfinite(values).all(axis=1)]


def _spread(values: np.ndarray) -> float:
    """Doubt of a median of positive values: what halves, quarters … of the recording disagree by."""
    parts = [np.median(p) for p in np.array_split(values, 8) if len(p)]
    return float(2.4 * np.std(np.log(np.maximum(parts, 1e-12))) / np.sqrt(len(parts)) + 1e-6)


def by_size(recordings: RecordingSet) -> list[UnitError]:
    """Every unit error that the mean sizes of columns give away."""
    vehicle, found = recordings.vehicle, []
    names = sensor_columns(vehicle)
    force = _pooled(recordings, names["accelerometer"])
    if vehicle.kind == "flight" and len(force):
        size = np.linalg.norm(force, axis=1)
        ratio = float(np.median(size)) / vehicle.gravity_m_s2
        unit = nearest(ratio, {"g": 1 / GRAVITY, "mg": 1000 / GRAVITY, "cm/s²": 100.0, "mm/s²": 1000.0})
        if unit:
            found.append(_error(names["accelerometer"], "the accelerometer", unit, "m/s²", ratio, _spread(size)))
    if vehicle.kind == "flight":
        for key, what in (("rotors", "the rotor speeds"), ("commands", "the commanded rotor speeds")):
            speed = _pooled(recordings, names[key])
            if not len(speed):
                continue
            lift = speed**2 @ vehicle.thrust_coefficients_n_s2()
            # A hovering vehicle's rotors carry its weight on average, whatever it does in between.
            ratio = float(np.sqrt(np.median(lift) / (vehicle.mass_kg * vehicle.gravity_m_s2)))
            unit = nearest(ratio, {"rpm": RPM, "rev/s": 1 / (2 * np.pi), "1000 rpm": RPM / 1000, "deg/s": 180 / np.pi})
            if unit:
                found.append(_error(names[key], what, unit, "rad/s", ratio, _spread(np.sqrt(lift + 1e-12))))
    throttle = _pooled(recordings, names["throttle"])
    if len(throttle):
        high, low = float(np.quantile(throttle, 0.999)), float(np.quantile(throttle, 0.001))
        factor = None
        if 900 <= low and high <= 2300:
            factor = ("pulses of 1000 to 2000 µs", 1000.0)
        elif 2300 < high <= 65535.5:
            factor = ("counts of 16 bits", 65535.0)
        elif 260 < high <= 1000.5:
            factor = ("per mille", 1000.0)
        elif 1.5 < high <= 100.5:
            factor = ("percent", 100.0)
        elif 100.5 < high <= 255.5:
            factor = ("counts of 8 bits", 255.0)
        if factor:
            found.append(_error(names["throttle"], "the throttle", factor, "a fraction", factor[1], 0.0))
    voltage = _pooled(recordings, (c.BATTERY_VOLTAGE,))
    if len(voltage):
        middle = float(np.median(voltage))
        factor = ("mV", 1000.0) if middle > 1000 else ("0.1 V", 10.0) if 60 < middle < 600 else None
        if factor:
            found.append(_error((c.BATTERY_VOLTAGE,), "the battery voltage", factor, "V", factor[1], 0.0))
    mount = _pooled(recordings, c.MOUNT)
    if len(mount) and np.max(np.abs(mount)) > 3.5:
        found.append(_error(c.MOUNT, "the mount's angles", ("degrees", 180 / np.pi), "rad", 180 / np.pi, 0.0))
    if vehicle.kind == "stand":
        found += _stand_force(recordings, names["rotors"])
    return found


def _stand_force(recordings: RecordingSet, speed_columns: tuple[str, ...]) -> list[UnitError]:
    """A stand's force against the believed thrust."""
    ratios = []
    for run in recordings.runs:
        force = tuple(n for n in c.FORCE if run.has(n))
        if not force or not run.has(*speed_columns):
            continue
        lift = run.array(speed_columns) ** 2 @ recordings.vehicle.thrust_coefficients_n_s2()
        read = np.linalg.norm(run.array(force), axis=1)
        good = np.isfinite(lift) & np.isfinite(read) & (lift > 0.3 * np.nanmax(lift))
        ratios.append(read[good] / np.maximum(lift[good], 1e-12))
    pooled = np.concatenate(ratios) if ratios else np.zeros(0)
    if len(pooled) < 5:
        return []
    unit = nearest(float(np.median(pooled)), {"gf": 1000 / GRAVITY, "kgf": 1 / GRAVITY, "mN": 1000.0})
    columns = tuple(n for n in c.FORCE if recordings.runs[0].has(n))
    # The believed thrust coefficient may be far off on a stand; kilograms are within its reach.
    if unit is None or unit[0] == "kgf" and recordings.vehicle.trust.get("thrust_coefficient_n_s2", 0.0) > 0.5:
        return []
    return [_error(columns, "the forces", unit, "N", float(np.median(pooled)), _spread(pooled))]


def _error(columns, what, unit, expected, measured, spread) -> UnitError:
    # How sure the recording is that the ratio is nearer to the unit's factor than to one.
    surely = abs(np.log(measured)) / 2 / max(spread / 1.96, 1e-6)
    return UnitError(tuple(columns), what, unit[0], expected, unit[1], measured, spread, float(norm.sf(surely)))


def corrected(recordings: RecordingSet, error: UnitError) -> RecordingSet:
    """The set with the columns in the contract's unit."""
    if error.unit == "pulses of 1000 to 2000 µs":
        runs = []
        for run in recordings.runs:
            columns = {n: (run.table[n] - 1000.0) / 1000.0 for n in error.columns if n in run.table.columns}
            runs.append(replace(run, table=run.table.assign(**columns)))
        return replace(recordings, runs=tuple(runs))
    return scaled(recordings, error.columns, 1.0 / error.factor)


def as_finding(error: UnitError) -> Finding:
    """The finding of one unit error: the unit's own factor, and in its interval what the recording itself gives."""
    half = max(error.spread, abs(float(np.log(error.measured / error.factor))))
    low, high = error.factor * np.exp(-half), error.factor * np.exp(half)
    return Finding(
        id="unit_error",
        status="established" if error.certain else "ambiguous",
        sentence=(
            f"{error.what[0].upper()}{error.what[1:]} ({error.columns[0]} …) hold {error.unit}, not {error.expected}: "
            f"corrected by dividing by {error.factor:.6g}."
        ),
        parameters=(Estimate("factor", error.factor, "1", float(low), float(high)),),
        p_value=error.p_value,
        channels=error.columns,
    )
