"""Where rotors sit, how strong and in which order they are, and which way they turn."""

from __future__ import annotations

import numpy as np

from rotorid.recordings import RecordingSet
from rotorid_proof.plantings.columns import DRIVERS, changed, has, names_of, scaled, slow_rotors, with_vehicle
from rotorid_proof.plantings.kinds import Kind, Size, both, named, once

NO_ROLL = "no body rates: no roll or pitch moment is known"
ROTORS = frozenset({"rotors", "commands", "throttle"})


def _turns(recordings: RecordingSet) -> str:
    turning = has(recordings, "gyroscope") or has(recordings, "attitude")
    return slow_rotors(recordings) if turning else NO_ROLL


def _arm_m(recordings: RecordingSet) -> float:
    return float(np.abs(recordings.vehicle.rotor_positions_m()[:, :2]).mean())


def centre_of_mass(recordings: RecordingSet, share: float, rng: np.random.Generator):
    """All rotors, and the accelerometer, believed further along r: the true centre of mass lies at r.

    Exact: arms, and the accelerometer's place, are counted from the believed centre of mass, and all else is about the
    true one. `share` of the mean arm.
    """
    angle = rng.uniform(0, 2 * np.pi)
    r = share * _arm_m(recordings) * np.array([np.cos(angle), np.sin(angle), 0.0])
    vehicle = recordings.vehicle
    rotors = tuple(p.model_copy(update={"x_m": p.x_m + r[0], "y_m": p.y_m + r[1]}) for p in vehicle.rotors)
    sensor = tuple(float(a + b) for a, b in zip(vehicle.accelerometer_position_m, r, strict=True))
    sizes = ((Size("com_offset", "r_x", r[0]), Size("com_offset", "r_y", r[1])),)
    # Of a vehicle whose mass is not known to the gram, a load off the middle is as good a name.
    fair = ("unequal_rotors", "payload")
    truth = named("com_offset", fair=fair, sizes=sizes, unseen=_turns(recordings))
    return with_vehicle(recordings, rotors=rotors, accelerometer_position_m=sensor), truth


def weak_rotor(recordings: RecordingSet, share: float, rng: np.random.Generator):
    """One rotor's thrust and torque less by a share at the same recorded speed.

    Where speeds are measured its recorded speed and command are larger by 1/√(1 − share); where only a throttle is, its
    believed coefficients are larger instead, which is exact with any curve of the throttle.
    """
    vehicle, k = recordings.vehicle, int(rng.integers(recordings.vehicle.rotor_count))
    d = -share
    if has(recordings, "rotors"):
        factors = np.ones(vehicle.rotor_count)
        factors[k] = 1.0 / np.sqrt(1.0 + d)
        out = scaled(recordings, "rotors", factors)
        if has(recordings, "commands"):
            out = scaled(out, "commands", factors)
    else:
        factors = np.ones(vehicle.rotor_count)
        factors[k] = 1.0 / (1.0 + d)
        out = with_vehicle(
            recordings,
            thrust_coefficient_n_s2=tuple(float(v) for v in vehicle.thrust_coefficients_n_s2() * factors),
            torque_coefficient_n_m_s2=tuple(float(v) for v in vehicle.torque_coefficients_n_m_s2() * factors),
        )
    shares = np.ones(vehicle.rotor_count)
    shares[k] += d
    contrast = shares / shares.mean() - 1.0
    single = (Size("unequal_rotors", f"d_{k + 1}", d),)
    free = tuple(Size("unequal_rotors", f"d_{i + 1}", float(x)) for i, x in enumerate(contrast[:-1]))
    truth = named(
        "unequal_rotors", fair=("com_offset",), sizes=(free, single), form_bound=True, unseen=_turns(recordings)
    )
    return out, truth


def swapped(recordings: RecordingSet, size: float, rng: np.random.Generator):
    """Two rotors' columns exchanged, speeds, commands and throttles alike."""
    i, j = rng.choice(recordings.vehicle.rotor_count, size=2, replace=False)
    order = np.arange(recordings.vehicle.rotor_count)
    order[[i, j]] = order[[j, i]]
    out = recordings
    for driver in DRIVERS:
        if has(out, driver):
            out = changed(out, names_of(out, driver), lambda run, values: values[:, order])
    return out, named("rotor_order", fair=("spin_direction",), unseen=_turns(recordings))


def reversed_spins(recordings: RecordingSet, size: float, rng: np.random.Generator):
    """All rotors believed to turn the other way."""
    other = {"ccw": "cw", "cw": "ccw"}
    rotors = tuple(r.model_copy(update={"spin": other[r.spin]}) for r in recordings.vehicle.rotors)
    truth = named("spin_direction", fair=("rotor_order",), unseen=_turns(recordings))
    return with_vehicle(recordings, rotors=rotors), truth


def _speeds(recordings: RecordingSet) -> bool:
    return any(has(recordings, driver) for driver in DRIVERS)


KINDS = (
    Kind("geometry", "centre_of_mass", frozenset({"arms"}), both(0.08, 0.03), _speeds, centre_of_mass),
    Kind("geometry", "weak_rotor", ROTORS | {"arms"}, both(0.08, 0.04), _speeds, weak_rotor),
    Kind("geometry", "rotors_swapped", ROTORS | {"arms", "spins"}, once(), _speeds, swapped),
    Kind("geometry", "spins_reversed", frozenset({"spins"}), once(), _speeds, reversed_spins),
)
