"""What a log says of the vehicle itself, and the rotor orders of the autopilots.

Body axes forward-right-down, looked at from above; `ccw` turns counter-clockwise seen from above.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from rotorid.recordings.importers.report import Fault
from rotorid.recordings.vehicle import Rotor

PLACES = {"front right": (1, 1), "rear left": (-1, -1), "front left": (1, -1), "rear right": (-1, 1)}
"""Signs of x and y of a rotor of a quadrotor in X shape."""
ORDERS: dict[str, tuple[tuple[str, str], ...]] = {
    "px4": (("front right", "ccw"), ("rear left", "ccw"), ("front left", "cw"), ("rear right", "cw")),
    "ardupilot": (("front right", "ccw"), ("rear left", "ccw"), ("front left", "cw"), ("rear right", "cw")),
    "betaflight": (("rear right", "cw"), ("front right", "ccw"), ("rear left", "ccw"), ("front left", "cw")),
    "crazyflie": (("front right", "ccw"), ("rear right", "cw"), ("rear left", "ccw"), ("front left", "cw")),
    "thesis": (("front right", "ccw"), ("front left", "cw"), ("rear left", "ccw"), ("rear right", "cw")),
}
"""Rotors 1 to 4 of a quadrotor in X shape by autopilot: place and turning sense (Betaflight: propellers in)."""


@dataclass(frozen=True)
class Known:
    """What a log states about the vehicle; None for what it does not."""

    autopilot: str
    """Key of `ORDERS`, or empty."""
    rotors: tuple[Rotor, ...] | None = None
    torque_over_thrust_m: float | None = None
    where: str = ""
    """Where the log states the rotors, in words."""
    directions: tuple[Rotor, ...] | None = None
    """Rotors whose places hold directions alone: the log's geometry was never set."""


def quad_x(order: str, x_m: float, y_m: float) -> tuple[Rotor, ...]:
    """Rotors of a quadrotor in X shape in an autopilot's order, at ±x, ±y (m)."""
    return tuple(
        Rotor(x_m=PLACES[place][0] * x_m, y_m=PLACES[place][1] * y_m, spin=spin) for place, spin in ORDERS[order]
    )


def px4_vehicle(parameters: Mapping[str, float], rotors: int) -> tuple[Known, list[Fault]]:
    """Places, turning senses and torque ratio of PX4's control allocation (`CA_ROTOR*`), where a log holds them.

    Places of ±1 m are what a generic airframe has until somebody sets them: they are directions, not distances.
    A positive `CA_ROTORi_KM` is a rotor that turns counter-clockwise seen from above.
    """
    keys = [[f"CA_ROTOR{i}_{k}" for k in ("PX", "PY", "PZ", "KM")] for i in range(rotors)]
    if not all(k in parameters for row in keys for k in row):
        return Known("px4"), []
    values = [[float(parameters[k]) for k in row] for row in keys]
    if not any(abs(x) + abs(y) > 0 for x, y, _, _ in values):
        return Known("px4"), []
    faults = []
    tilted = [i + 1 for i in range(rotors) if abs(parameters.get(f"CA_ROTOR{i}_AZ", -1.0) + 1) > 1e-3]
    if tilted:
        found = f"rotor {', '.join(map(str, tilted))} does not thrust along body z (CA_ROTOR*_AZ)"
        faults.append(Fault("tilted_rotor", "vehicle.yaml", found, "its thrust is taken along -z", 0))
    rotor = tuple(
        Rotor(x_m=round(x, 6), y_m=round(y, 6), z_m=round(z, 6), spin="ccw" if k > 0 else "cw") for x, y, z, k in values
    )
    ratio = sum(abs(k) for *_, k in values) / rotors
    where = "CA_ROTOR* of the log's parameters"
    if all(abs(v) in (0.0, 1.0) for x, y, *_ in values for v in (x, y)):
        return Known("px4", None, round(ratio, 6) or None, where, directions=rotor), faults
    return Known("px4", rotor, round(ratio, 6) or None, where), faults
