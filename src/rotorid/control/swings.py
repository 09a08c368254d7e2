"""Flights for a first look at a vehicle: swings in roll, pitch and yaw about hover under an attitude controller."""

from __future__ import annotations

import numpy as np

from rotorid.control.pid import AttitudePid, Gains
from rotorid.control.references import AttitudeReference
from rotorid.errors import InputError
from rotorid.recordings import RecordingSet, Run, Vehicle
from rotorid.vehicle.improved import record_as_stated, simulate_as_stated
from rotorid.vehicle.simulator import Noise

STIFFNESS_RAD_S, DAMPING = 10.0, 0.8
"""Natural frequency and damping of the attitude loop that flies the vehicle."""


def swings(vehicle: Vehicle, name: str, seconds: float, flights: int, seed: int, every: int = 2) -> RecordingSet:
    """`flights` simulated flights of a vehicle with the effects that it states, as noisy sensors record them.

    Every how many steps of 2 ms a sample is kept is `every`. The set's vehicle is the one without the effects.
    InputError for a bench, or where a number makes no flight.
    """
    if vehicle.kind == "bench":
        raise InputError(f"{vehicle.name}: a bench does not fly")
    if not seconds > 0 or flights < 1:
        raise InputError("seconds must be more than 0 and flights at least 1")
    j = np.diag(vehicle.inertia_kg_m2.matrix())
    gains = Gains(tuple(j * STIFFNESS_RAD_S**2), (0.0,) * 3, tuple(2 * DAMPING * STIFFNESS_RAD_S * j))
    noise = Noise(0.0, 0.01, 0.0, 0.1, 0.02, 0.01, 0.003)
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    runs: list[Run] = []
    believed = vehicle
    for number in range(flights):
        rng = np.random.default_rng([seed, number])
        phase = rng.uniform(0, 2 * np.pi, 3)

        def wanted(t: float, phase=phase) -> np.ndarray:
            swing = np.sin(np.array([0.9, 0.7, 0.5]) * t + phase) + 0.5 * np.sin(np.array([3.1, 3.7, 1.3]) * t)
            return np.array([0.25, 0.25, 0.4]) * (swing + 0.3 * np.sin(np.array([9.1, 11.3, 7.1]) * t + phase[::-1]))

        pilot = AttitudePid(vehicle, AttitudeReference("swings", weight / 0.96, wanted), gains, 0.02)
        trace = simulate_as_stated(vehicle, pilot, seconds, 0.002)
        made = record_as_stated(trace, vehicle, f"flight_{number + 1}", noise, rng, every=every)
        believed = made.vehicle
        runs += made.runs
    return RecordingSet(name, believed, tuple(runs))
