"""What a log says of the vehicle itself, and the rotor orders of the autopilots.

Body axes forward-right-down, looked at from above; `ccw` turns counter-clockwise seen from above.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from rotorid.recordings.importers.report import ImportFault
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


_TILTED_DEG = 1.0
"""Angle between a rotor's axis and body z from which on it is tilted."""
_ALIKE = 0.01
"""Relative difference of a coefficient up to which rotors are alike."""


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


def px4_vehicle(parameters: Mapping[str, float], rotors: int) -> tuple[Known, list[ImportFault]]:
    """Places, turning senses and torque ratio of PX4's control allocation (`CA_ROTOR*`), where a log holds them, and
    what it states of the rotors that a vehicle.yaml cannot hold.

    Places of ±1 m are what a generic airframe has until somebody sets them: they are directions, not distances.
    A positive `CA_ROTORi_KM` is a rotor that turns counter-clockwise seen from above.
    """
    faults = _untaken(parameters, rotors)
    keys = [[f"CA_ROTOR{i}_{k}" for k in ("PX", "PY", "PZ", "KM")] for i in range(rotors)]
    if not all(k in parameters for row in keys for k in row):
        return Known("px4"), faults
    values = [[float(parameters[k]) for k in row] for row in keys]
    if not any(abs(x) + abs(y) > 0 for x, y, _, _ in values):
        return Known("px4"), faults
    rotor = tuple(
        Rotor(x_m=round(x, 6), y_m=round(y, 6), z_m=round(z, 6), spin="ccw" if k > 0 else "cw") for x, y, z, k in values
    )
    ratio = sum(abs(k) for *_, k in values) / rotors
    where = "CA_ROTOR* of the log's parameters"
    if all(abs(v) in (0.0, 1.0) for x, y, *_ in values for v in (x, y)):
        return Known("px4", None, round(ratio, 6) or None, where, directions=rotor), faults
    return Known("px4", rotor, round(ratio, 6) or None, where), faults


def _untaken(parameters: Mapping[str, float], rotors: int) -> list[ImportFault]:
    """A fault for each thing that control allocation states of the rotors and a vehicle.yaml has no place for."""

    def stated(name: str, default: float) -> list[float]:
        return [float(parameters.get(f"CA_ROTOR{i}_{name}", default)) for i in range(rotors)]

    def fault(kind: str, which: list[int], found: str, action: str) -> list[ImportFault]:
        if not which:
            return []
        who = f"rotor{'s' * (len(which) > 1)} {', '.join(map(str, which))}"
        return [ImportFault(kind, "vehicle.yaml", found.format(who), action, 0)]

    axes = np.column_stack([stated("AX", 0.0), stated("AY", 0.0), stated("AZ", -1.0)])
    size = np.linalg.norm(axes, axis=1)  # PX4 makes each axis a unit vector
    lean = np.degrees(np.arccos(np.clip(-axes[:, 2] / np.where(size > 0, size, 1.0), -1, 1)))
    tilted = [i for i in range(rotors) if lean[i] > _TILTED_DEG]
    degrees = ", ".join(f"{lean[i]:.3g}" for i in tilted)
    found = f"{{}} tilted against body z by {degrees} degrees (CA_ROTOR*_AX, _AY, _AZ)"
    faults = fault("tilted_rotor", [i + 1 for i in tilted], found, "its thrust is taken along -z")
    by_servo = [i + 1 for i, servo in enumerate(stated("TILT", 0.0)) if servo > 0]
    faults += fault("tilted_rotor", by_servo, "a servo tilts {} (CA_ROTOR*_TILT)", "its thrust is taken along -z")
    if parameters.get("CA_SV_CS_COUNT", 0) > 0 or parameters.get("CA_SV_TL_COUNT", 0) > 0:
        found = "the vehicle has servos (CA_SV_CS_COUNT, CA_SV_TL_COUNT)"
        faults.append(ImportFault("servo", "vehicle.yaml", found, "what they move is not taken", 0))
    for name, default, action in (
        ("KM", 0.05, "their mean size is taken for the ratio of torque to thrust"),
        ("CT", 6.5, "one thrust coefficient is taken for all"),
    ):
        size = np.abs(stated(name, default))
        usual = float(np.median(size))
        other = [i + 1 for i in range(rotors) if abs(size[i] - usual) > _ALIKE * usual]
        faults += fault("unequal_rotors", other, f"CA_ROTOR*_{name} of {{}} is not that of the others", action)
    return faults
