"""How often a true value lies in its stated 95 % interval: simulated flights by each autopilot's own map.

    python -m rotorid_proof.autopilot_coverage docs/proof/autopilot_parameters.csv [flights a map]

writes a row a flight and parameter. A flight is made by each autopilot's own law from thrust to signal of a motor:
attitude and thrust are prescribed; velocity follows by Newton's law with drag and wind, the moments by Euler's, the
signals from the rotors' lag and the law that the firmware flies. None of it goes through the estimators.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.signal import lfilter

from rotorid.identify.autopilot import MAPS, AutopilotParameter, parameters_of, specific_drag
from rotorid.recordings import RecordingSet, Run, Vehicle, templates
from rotorid.recordings import columns as c
from rotorid.vehicle.attitude import quaternion_from_euler, rotation_from_quaternion
from rotorid.vehicle.mixer import allocation_matrix

_GRAVITY = 9.81
_INNER_HZ = 500
_STEP = 5
_LEAST_SHARE = 0.02
_FLIGHTS = 25
_SEED = 46


@dataclass(frozen=True)
class _FlightTruth:
    """What a flight is made with; SI units unless named."""

    autopilot: str
    shapes: tuple[float, ...]
    """Numbers of the autopilot's map, as its estimator has them."""
    mass_kg: float
    full_m_s2: float
    """Thrust of all rotors at full signal and the mean voltage, over the mass (not for the Crazyflie)."""
    time_constant_s: float
    bluff: tuple[float, float]
    momentum: float
    wind_m_s: tuple[float, float]
    axial: float
    """Thrust over mass that is lost by m/s of climb."""
    zero_m_s2: tuple[float, float, float]
    colour_m_s2: float
    """Deviation of a coloured error of the specific force."""
    colour_s: float
    white_m_s2: float
    voltage: tuple[float, float]
    """At the start and at the end, V."""
    vigour_m_s2: float
    """Vertical acceleration of the climbs."""


def drawn(autopilot: str, rng: np.random.Generator) -> _FlightTruth:
    """A truth of usual size for an autopilot."""
    u = rng.uniform
    shapes = {
        "px4": lambda: (u(0.0, 1.0),),
        "ardupilot": lambda: (u(0.2, 0.85), u(0.05, 0.2)),
        "betaflight": lambda: (u(0.0, 1.2),),
        "crazyflie": lambda: (u(0.075, 0.1), u(-0.0008, -0.0004)),
    }[autopilot]()
    small = autopilot == "crazyflie"
    return _FlightTruth(
        autopilot,
        shapes,
        mass_kg=u(0.027, 0.036) if small else u(0.5, 2.5),
        full_m_s2=_GRAVITY / u(0.2, 0.45),
        time_constant_s=u(0.015, 0.06),
        bluff=(u(0.01, 0.05), u(0.01, 0.05)),
        momentum=u(0.05, 0.3),
        wind_m_s=(u(-4, 4), u(-4, 4)) if not small else (0.0, 0.0),
        axial=u(0.0, 0.3),
        zero_m_s2=tuple(rng.normal(0, 0.1, 3)),
        colour_m_s2=u(0.03, 0.2),
        colour_s=u(0.05, 1.0),
        white_m_s2=u(0.2, 1.0),
        voltage=(u(4.0, 4.2), u(3.5, 3.9)) if small else (u(16.0, 16.8), u(14.4, 15.8)),
        vigour_m_s2=u(1.5, 4.0),
    )


def signal_of(autopilot: str, thrust: np.ndarray, voltage: np.ndarray, shapes: tuple[float, ...]) -> np.ndarray:
    """The firmware's way: the signal that is sent for a thrust, a share (or grams), (n, k), of voltage (n, 1)."""
    if autopilot == "px4":  # FunctionMotors::updateValues
        f = shapes[0]
        if f < 1e-6:
            return thrust
        return -(1 - f) / (2 * f) + np.sqrt((1 - f) ** 2 / (4 * f**2) + thrust / f)
    if autopilot == "ardupilot":  # Thrust_Linearization::thrust_to_actuator, MOT_SPIN_MAX 0.95
        e, spin_min = shapes
        ratio = ((e - 1) + np.sqrt((1 - e) ** 2 + 4 * e * thrust)) / (2 * e)
        return spin_min + (0.95 - spin_min) * ratio
    if autopilot == "betaflight":  # pidApplyThrustLinearization
        return thrust * (1 + shapes[0] * (1 - thrust) ** 2)
    return (shapes[1] * thrust**2 + shapes[0] * thrust) / voltage  # motorsCompensateBatteryVoltage


def flight(truth: _FlightTruth, rng: np.random.Generator, seconds: float = 40.0, rate_hz: int = 250) -> RecordingSet:
    """One flight as its sensors record it; the vehicle is of the right mass, its other values are the template's."""
    time_s = np.arange(int(seconds * _INNER_HZ) + 1) / _INNER_HZ
    euler = _angles(time_s, truth, rng)
    rotation = rotation_from_quaternion(quaternion_from_euler(euler))
    up = _sines(time_s, [0.15, 0.5, 1.2, 3.0], [0.3, 0.8, 2.0, 5.0], truth.vigour_m_s2 * rng.uniform(0.3, 0.5, 4), rng)
    thrust = (_GRAVITY + up) / rotation[:, 2, 2]
    velocity = _velocity(time_s, rotation, thrust, truth)
    force = np.column_stack([_drag(rotation, velocity, truth), -thrust])
    turning = _rates(rotation)
    vehicle = _vehicle(truth)
    inertia = vehicle.inertia_kg_m2.matrix()
    moment = np.gradient(turning, 1 / _INNER_HZ, axis=0) @ inertia + np.cross(turning, turning @ inertia)
    climb = np.einsum("nji,nj->ni", rotation, velocity)[:, 2]
    wanted = np.column_stack([(-force[:, 2] - truth.axial * climb) * truth.mass_kg, moment])
    rotor_n = (allocation_matrix(vehicle) @ wanted.T).T * vehicle.thrust_coefficients_n_s2()
    voltage = (
        np.linspace(*truth.voltage, len(time_s))[:, None] - 0.02 * truth.voltage[0] * _smooth(rng, time_s)[:, None]
    )
    if truth.autopilot == "crazyflie":
        unit = 1e-3 * 9.80665
    else:
        # Full thrust goes with the voltage; the law of the share is at each voltage the same.
        unit = truth.full_m_s2 * truth.mass_kg / 4 * (voltage / voltage.mean()) ** 1.5
    root = np.sqrt(np.maximum(rotor_n / unit, _LEAST_SHARE))
    steady = np.maximum(root + truth.time_constant_s * np.gradient(root, 1 / _INNER_HZ, axis=0), 1e-3) ** 2
    throttle = signal_of(truth.autopilot, steady, voltage, truth.shapes)
    keep = np.arange(0, len(time_s), _INNER_HZ // rate_hz)
    spread = truth.colour_m_s2 * _coloured(rng, (len(keep), 3), truth.colour_s * rate_hz)
    table = {c.TIME: time_s[keep]}
    table |= dict(zip(c.rotor_columns("throttle", 4), throttle[keep].T, strict=True))
    read = force[keep] + truth.zero_m_s2 + spread + truth.white_m_s2 * rng.standard_normal((len(keep), 3))
    table |= dict(zip(c.SPECIFIC_FORCE, read.T, strict=True))
    measured = velocity[keep] + 0.05 * _coloured(rng, (len(keep), 3), 0.5 * rate_hz)
    table |= dict(zip(c.VELOCITY, measured.T, strict=True))
    table |= dict(zip(c.QUATERNION, quaternion_from_euler(euler[keep]).T, strict=True))
    table |= dict(zip(c.ANGULAR_VELOCITY, turning[keep].T, strict=True))
    table[c.BATTERY_VOLTAGE] = voltage[keep, 0]
    return RecordingSet("known", vehicle, (Run("flight", pd.DataFrame(table)),))


def _vehicle(truth: _FlightTruth) -> Vehicle:
    """A template of about the right size with the true mass and an inertia that goes with it."""
    name = "crazyflie-2.1" if truth.autopilot == "crazyflie" else "x500"
    template = templates.read(name)
    share = truth.mass_kg / template.mass_kg
    moments = {k: v * share for k, v in template.inertia_kg_m2.model_dump().items()}
    return Vehicle.model_validate(
        template.model_dump(exclude_defaults=True) | {"mass_kg": truth.mass_kg, "inertia_kg_m2": moments}
    )


def _sines(time_s: np.ndarray, lowest_hz, highest_hz, sizes, rng: np.random.Generator) -> np.ndarray:
    """A sum of sines (n,), one of each size with a frequency between the two and any phase."""
    omega = 2 * np.pi * rng.uniform(lowest_hz, highest_hz)
    phase = rng.uniform(0, 2 * np.pi, len(omega))
    return np.sin(time_s[:, None] * omega + phase) @ np.asarray(sizes)


def _angles(time_s: np.ndarray, truth: _FlightTruth, rng: np.random.Generator) -> np.ndarray:
    """Roll, pitch, yaw (n, 3), rad: slow tilts that make speed, small quick ones, and a yaw that turns."""
    tilts = [
        _sines(time_s, [0.04, 0.1, 0.5], [0.09, 0.2, 1.0], rng.uniform([0.1, 0.05, 0.02], [0.25, 0.1, 0.05]), rng)
        for _ in range(2)
    ]
    return np.column_stack([*tilts, rng.uniform(-3, 3) + _sines(time_s, [0.03], [0.07], [1.0], rng)])


def _drag(rotation: np.ndarray, velocity: np.ndarray, truth: _FlightTruth) -> np.ndarray:
    """Specific force along body x and y, (n, 2), m/s²."""
    through = np.einsum("nji,nj->ni", rotation, velocity - np.array([*truth.wind_m_s, 0.0]))
    return specific_drag(through, *truth.bluff, truth.momentum)


def _velocity(time_s: np.ndarray, rotation: np.ndarray, thrust: np.ndarray, truth: _FlightTruth) -> np.ndarray:
    """Velocity (n, 3), m/s, by Euler's steps of `_STEP` samples, joined by straight lines."""
    coarse = np.arange(0, len(time_s), _STEP)
    out, now = np.empty((len(coarse), 3)), np.zeros(3)
    for row, k in enumerate(coarse):
        out[row] = now
        body = np.array([*_drag(rotation[[k]], now[None], truth)[0], -thrust[k]])
        now = now + _STEP / _INNER_HZ * (rotation[k] @ body + [0, 0, _GRAVITY])
    return np.stack([np.interp(time_s, time_s[coarse], out[:, j]) for j in range(3)], axis=1)


def _rates(rotation: np.ndarray) -> np.ndarray:
    """Body rates (n, 3), rad/s."""
    change = np.einsum("nji,njk->nik", rotation, np.gradient(rotation, 1 / _INNER_HZ, axis=0))
    return np.column_stack([change[:, 2, 1], change[:, 0, 2], change[:, 1, 0]])


def _coloured(rng: np.random.Generator, shape: tuple[int, int], samples: float) -> np.ndarray:
    """Noise of deviation 1 whose correlation falls to 1/e after so many samples."""
    keep = np.exp(-1 / max(samples, 1e-6))
    white = rng.standard_normal(shape) * np.sqrt(1 - keep**2)
    white[0] = rng.standard_normal(shape[1])
    return lfilter([1.0], [1.0, -keep], white, axis=0)


def _smooth(rng: np.random.Generator, time_s: np.ndarray) -> np.ndarray:
    """A slow wave of size 1."""
    return np.sin(2 * np.pi * time_s / rng.uniform(8, 20) + rng.uniform(0, 6))


def _true_values(truth: _FlightTruth) -> dict[str, float]:
    """What a flight was made with, by the names and in the units of `parameters_of`."""
    shapes = MAPS[truth.autopilot].shapes
    values = {s.name: s.factor * v for s, v in zip(shapes, truth.shapes, strict=True)}
    values["motor_time_constant_s"] = truth.time_constant_s
    if truth.autopilot in ("px4", "ardupilot"):
        values["MPC_THR_HOVER" if truth.autopilot == "px4" else "MOT_THST_HOVER"] = _GRAVITY / truth.full_m_s2
    if truth.autopilot == "px4":
        values |= {"EKF2_BCOEF_X": 1 / truth.bluff[0], "EKF2_BCOEF_Y": 1 / truth.bluff[1]}
        values |= {"EKF2_MCOEF": truth.momentum}
        values |= {"wind_north_m_s (flight)": truth.wind_m_s[0], "wind_east_m_s (flight)": truth.wind_m_s[1]}
    return values


def counted(autopilot: str, seeds: Sequence[int], seconds: float = 40.0) -> pd.DataFrame:
    """A row a flight and parameter: true, value, low, high, whether it is determined, whether it is in."""
    rows = []
    for seed in seeds:
        rng = np.random.default_rng([_SEED, list(MAPS).index(autopilot), seed])
        truth = drawn(autopilot, rng)
        found: dict[str, AutopilotParameter] = {
            p.name: p for p in parameters_of(flight(truth, rng, seconds), autopilot)
        }
        for name, true in _true_values(truth).items():
            p = found[name]
            low, high = p.interval_95
            rows.append((autopilot, seed, name, true, p.value, low, high, p.determined, low <= true <= high))
    names = ["autopilot", "flight", "parameter", "true", "value", "low_95", "high_95", "determined", "covered"]
    return pd.DataFrame(rows, columns=names)


def main(path: Path, flights: int) -> None:
    """Count `flights` of each map and write the table."""
    table = pd.concat([counted(autopilot, range(flights)) for autopilot in MAPS], ignore_index=True)
    table.round(9).to_csv(path, index=False)
    for keys, own in table.groupby(["autopilot", "parameter"], sort=False):
        print(*keys, f"{own['covered'].sum()} of {len(own)} covered, {own['determined'].sum()} determined")
    print(f"{table['covered'].sum()} of {len(table)} covered ({table['covered'].mean():.1%})")


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else _FLIGHTS)
