"""What a log says of the vehicle itself, the rotor orders of the autopilots, and their parameters over a log.

Body axes forward-right-down, looked at from above; `ccw` turns counter-clockwise seen from above. Parameters are tuned
in the air, and each value belongs to those that held then.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from rotorid.recordings.importers.faults import ImportFault
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
Values = Mapping[str, float]
_MOST_LISTED = 4
"""Changes of one parameter that a sentence lists."""


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


@dataclass(frozen=True)
class Parameters:
    """Values at the start of a log, and what was set to another value since: (time, name, value) by time.

    Times are on a clock of the log, in its own unit.
    """

    start: Values
    changes: tuple[tuple[float, str, float], ...] = ()

    @classmethod
    def of(cls, stated: Iterable[tuple[float, str, float]], start: Values | None = None) -> Parameters:
        """From all that a log states, in order: what it states first of a parameter is its value at the start."""
        first, latest, changes = dict(start or {}), dict(start or {}), []
        for time, name, value in stated:
            if latest.get(name, value) != value:
                changes.append((float(time), name, value))
            first.setdefault(name, value)
            latest[name] = value
        return cls(first, tuple(sorted(changes, key=lambda change: change[0])))

    def spans(self, names: str) -> list[tuple[float, float, Values]]:
        """Spans of the log [from, to) in which no parameter whose whole name matches `names` changes, with the values
        that hold in each; the first begins and the last ends at infinity."""
        cuts = sorted({time for time, name, _ in self.changes if re.fullmatch(names, name)})
        return [(a, b, self.at(a)) for a, b in pairwise([-np.inf, *cuts, np.inf])]

    def at(self, time: float) -> Values:
        """What holds at an instant."""
        return {**self.start, **{name: value for t, name, value in self.changes if t <= time}}

    def mostly(self, times: np.ndarray) -> Values:
        """What holds at most of some instants, each parameter by itself."""
        values = dict(self.start)
        for name in {name for _, name, _ in self.changes}:
            own = [(t, v) for t, n, v in self.changes if n == name]
            held = [self.start[name], *(v for _, v in own)]
            index = np.searchsorted([t for t, _ in own], times, side="right")
            counts = {v: sum(int((index == k).sum()) for k, w in enumerate(held) if w == v) for v in held}
            values[name] = max(counts, key=counts.get)
        return values

    def faults(
        self, actions: Sequence[tuple[str, str, str]], zero: float = 0.0, unit_s: float = 1.0
    ) -> list[ImportFault]:
        """One fault for each parameter that changes and matters.

        `actions` hold a pattern of names, the column and what is done about a change; `zero` is the time, in the
        log's clock, from which seconds are counted, `unit_s` what that clock counts in.
        """
        found = []
        for name in dict.fromkeys(name for _, name, _ in self.changes):
            known = next(((column, action) for names, column, action in actions if re.fullmatch(names, name)), None)
            if known is None:
                continue
            own = [(t, v) for t, n, v in self.changes if n == name]
            steps = ", ".join(f"to {v:g} at {(t - zero) * unit_s:.2f} s" for t, v in own[:_MOST_LISTED])
            more = f" and {len(own) - _MOST_LISTED} times more" if len(own) > _MOST_LISTED else ""
            seen = f"{name} was set from {self.start[name]:g} {steps}{more} of the log"
            found.append(ImportFault("parameter_changed", known[0], seen, known[1], len(own)))
        return found
