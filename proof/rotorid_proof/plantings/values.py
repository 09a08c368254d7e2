"""Believed values of the vehicle that are off."""

from __future__ import annotations

import numpy as np

from rotorid.recordings import RecordingSet
from rotorid_proof.plantings.columns import has, signed, slow_rotors, with_vehicle
from rotorid_proof.plantings.kinds import Kind, Ratio, both, named

C_F, C_Q, MASS, ARM = "thrust_coefficient_n_s2", "torque_coefficient_n_m_s2", "mass_kg", "arm_scale"
XX, YY, ZZ = (f"inertia_{a}_kg_m2" for a in ("xx", "yy", "zz"))
FULL = "rotor_speed_limits_rad_s"
NO_MOMENT = "no body rates: no moment is known"


def _factor(share: float, rng: np.random.Generator) -> float:
    """1 + share, or one over it."""
    return (1.0 + share) ** signed(rng)


def _of(value, factor: float):
    return tuple(v * factor for v in value) if isinstance(value, tuple) else value * factor


def mass(recordings: RecordingSet, share: float, rng: np.random.Generator):
    """The believed mass times a factor; a flight shows C_F over mass."""
    f = _factor(share, rng)
    ratio = Ratio({C_F: 1.0, MASS: -1.0, FULL: 2.0}, np.log(f))
    truth = named(MASS, fair=(C_F, FULL), ratio=ratio, hidden_by=_open_scale(recordings))
    return with_vehicle(recordings, mass_kg=recordings.vehicle.mass_kg * f), truth


def thrust(recordings: RecordingSet, share: float, rng: np.random.Generator):
    """The believed thrust coefficient times a factor."""
    f = _factor(share, rng)
    ratio = Ratio({C_F: 1.0, MASS: -1.0, FULL: 2.0}, -np.log(f))
    new = _of(recordings.vehicle.thrust_coefficient_n_s2, f)
    truth = named(C_F, fair=(MASS, FULL), ratio=ratio, hidden_by=_open_scale(recordings))
    return with_vehicle(recordings, thrust_coefficient_n_s2=new), truth


def torque(recordings: RecordingSet, share: float, rng: np.random.Generator):
    """The believed torque coefficient times a factor; a flight shows C_Q over the yaw inertia."""
    f = _factor(share, rng)
    ratio = Ratio({C_Q: 1.0, ZZ: -1.0, FULL: 2.0}, -np.log(f))
    new = _of(recordings.vehicle.torque_coefficient_n_m_s2, f)
    truth = named(C_Q, fair=(ZZ,), ratio=ratio, unseen=_turning(recordings))
    return with_vehicle(recordings, torque_coefficient_n_m_s2=new), truth


def inertia(axis: str):
    """The believed moment of inertia about an axis times a factor."""

    def plant(recordings: RecordingSet, share: float, rng: np.random.Generator):
        f, key = _factor(share, rng), axis * 2
        old, name = recordings.vehicle.inertia_kg_m2, f"inertia_{axis * 2}_kg_m2"
        new = old.model_copy(update={key: getattr(old, key) * f})
        over = {C_Q: 1.0, FULL: 2.0} if axis == "z" else {C_F: 1.0, ARM: 1.0, FULL: 2.0}
        truth = named(
            name,
            fair=(C_Q,) if axis == "z" else (),
            ratio=Ratio({**over, name: -1.0}, np.log(f)),
            unseen=_turning(recordings),
        )
        return with_vehicle(recordings, inertia_kg_m2=new), truth

    return plant


def arm(recordings: RecordingSet, share: float, rng: np.random.Generator):
    """The believed distances of the rotors times a factor; the same as both inertias off by its inverse."""
    f = _factor(share, rng)
    rotors = tuple(r.model_copy(update={"x_m": r.x_m * f, "y_m": r.y_m * f}) for r in recordings.vehicle.rotors)
    ratio = Ratio({C_F: 1.0, ARM: 1.0, FULL: 2.0, XX: -0.5, YY: -0.5}, -np.log(f))
    truth = named(ARM, fair=(XX, YY), ratio=ratio, unseen=_turning(recordings))
    return with_vehicle(recordings, rotors=rotors), truth


def _turning(recordings: RecordingSet) -> str:
    return slow_rotors(recordings) if has(recordings, "gyroscope") else NO_MOMENT


def _open_scale(recordings: RecordingSet) -> frozenset[str]:
    """Effects given which only commands say how fast rotors turn, so that a thrust per mass shows no more."""
    return frozenset() if has(recordings, "rotors") else frozenset({"throttle_curve", "battery_sag"})


def _any(recordings: RecordingSet) -> bool:
    return True


KINDS = (
    Kind("values", "mass", frozenset({"mass", "thrust"}), both(0.20, 0.10), _any, mass),
    Kind("values", "thrust_coefficient", frozenset({"mass", "thrust"}), both(0.20, 0.10), _any, thrust),
    Kind("values", "torque_coefficient", frozenset({"yaw"}), both(0.8, 0.4), _any, torque),
    Kind("values", "inertia_xx", frozenset({"inertia"}), both(0.5, 0.25), _any, inertia("x")),
    Kind("values", "inertia_yy", frozenset({"inertia"}), both(0.5, 0.25), _any, inertia("y")),
    Kind("values", "inertia_zz", frozenset({"yaw"}), both(0.8, 0.4), _any, inertia("z")),
    Kind("values", "arm", frozenset({"inertia", "arms"}), both(0.4, 0.2), _any, arm),
)
