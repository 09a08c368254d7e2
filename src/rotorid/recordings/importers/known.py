"""What a log says of the vehicle and of its parameters over time, and a `vehicle.yaml` proposed for the rest.

Body axes forward-right-down, looked at from above; `ccw` turns counter-clockwise seen from above. Parameters are tuned
in the air, and each value belongs to those that held then.

What a log or the user states is taken. The rest is proposed: the thrust coefficient from the flights themselves
(thrust, mass times specific force along the rotors' axis, over the sum of squared rotor speeds), inertia from a
template vehicle scaled by mass and arm squared, the torque coefficient from the log's or the template's ratio of torque
to thrust. `trust` is wide where a value is a guess, so that the verdict re-estimates it and calls nothing wrong.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pandas as pd

from rotorid.errors import InputError
from rotorid.io.text.files import as_yaml
from rotorid.io.text.wording import printable
from rotorid.recordings import columns as c
from rotorid.recordings.importers.faults import ImportFault
from rotorid.recordings.templates import names
from rotorid.recordings.templates import read as read_template
from rotorid.recordings.vehicle import Rotor, Vehicle

_WEIGHED, _GUESSED_MASS = 0.02, 0.3
_FROM_FLIGHT, _GUESSED_COEFFICIENT = 0.1, 0.5
_GUESSED_INERTIA, _GUESSED_TORQUE = 0.5, 0.5
_CALM_RAD_S = 1.0
"""Body rate below which thrust and speeds of nearby instants are compared."""
_PLACES = {"front right": (1, 1), "rear left": (-1, -1), "front left": (1, -1), "rear right": (-1, 1)}
"""Signs of x and y of a rotor of a quadrotor in X shape."""
ORDERS: dict[str, tuple[tuple[str, str], ...]] = {
    "px4": (("front right", "ccw"), ("rear left", "ccw"), ("front left", "cw"), ("rear right", "cw")),
    "ardupilot": (("front right", "ccw"), ("rear left", "ccw"), ("front left", "cw"), ("rear right", "cw")),
    "betaflight": (("rear right", "cw"), ("front right", "ccw"), ("rear left", "ccw"), ("front left", "cw")),
    "crazyflie": (("front right", "ccw"), ("rear right", "cw"), ("rear left", "ccw"), ("front left", "cw")),
    "thesis": (("front right", "ccw"), ("front left", "cw"), ("rear left", "ccw"), ("rear right", "cw")),
}
"""Rotors 1 to 4 of a quadrotor in X shape by autopilot: place and turning sense (Betaflight: propellers in)."""


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
        Rotor(x_m=_PLACES[place][0] * x_m, y_m=_PLACES[place][1] * y_m, spin=spin) for place, spin in ORDERS[order]
    )


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

    def spans(self, names: str, times: np.ndarray) -> list[tuple[np.ndarray, Values]]:
        """Spans of the log in which no parameter whose whole name matches `names` changes: which of some instants (n,)
        are in each, a mask, and the values that hold there; none without an instant."""
        cuts = sorted({time for time, name, _ in self.changes if re.fullmatch(names, name)})
        every = [((times >= a) & (times < b), self.at(a)) for a, b in pairwise([-np.inf, *cuts, np.inf])]
        return [(inside, values) for inside, values in every if inside.any()]

    def at(self, time: float) -> Values:
        """What holds at an instant."""
        return {**self.start, **{name: value for t, name, value in self.changes if t <= time}}

    def mostly(self, times: np.ndarray, flown: np.ndarray | None) -> Values:
        """What holds at most of some instants (n,), each parameter by itself: at those in flight (n,), where any is."""
        times, values = times if flown is None or not flown.any() else times[flown], dict(self.start)
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


def propose(
    name: str,
    tables: Sequence[pd.DataFrame],
    known: Known,
    template: Vehicle,
    template_name: str,
    mass_kg: float | None = None,
) -> tuple[str, tuple[str, ...]]:
    """The `vehicle.yaml` for flights in contract columns, and a sentence for each value that is proposed, not known.

    InputError where the rotors of log and template do not agree.
    """
    remarks: list[str] = []
    mass, mass_trust, mass_note = _mass(mass_kg, template, template_name, remarks)
    rotors, rotor_note = _rotors(known, template, template_name, remarks)
    count = len(rotors)
    speeds = any(set(c.rotor_columns("rotor_speed", count)) <= set(t.columns) for t in tables)
    limit = None
    if not speeds:
        limit = (template.rotor_speed_limits_rad_s or (0.0, 2500.0))[1]
        remarks.append(
            f"no rotor speed is recorded: full throttle is taken as {limit:g} rad/s (template {template_name}); "
            "only the product of C_F and its square matters"
        )
    thrust, thrust_trust, thrust_note = _thrust(tables, mass, limit, template, count, remarks)
    closer = closer_template(thrust / mass, template, template_name) if speeds else None
    if closer:
        remarks.append(
            f"the rotors turn in flight as those of template {closer} do, rather than of {template_name}: if that is "
            f"the vehicle, import again with --like {closer}"
        )
    ratio, ratio_note = known.torque_over_thrust_m, known.where
    if not ratio:
        ratio = float(template.torque_coefficients_n_m_s2()[0] / template.thrust_coefficients_n_s2()[0])
        ratio_note = f"template {template_name}"
    remarks.append(f"the torque coefficient is C_F times {ratio:.4g} m ({ratio_note})")
    inertia, scale = _inertia(rotors, mass, template)
    remarks.append(f"the inertia is that of template {template_name} times {scale:.3g} (mass and arm squared)")
    words = {signs: place for place, signs in _PLACES.items()}
    signs = [(int(np.sign(r.x_m)), int(np.sign(r.y_m))) for r in rotors]
    places = [words.get(own, f"at x {r.x_m:g}, y {r.y_m:g}") for own, r in zip(signs, rotors, strict=True)]
    lines = [
        f"# Proposed from {name}. Lines marked PROPOSED are guesses: replace them by what you know, and then",
        "# lower their `trust` (the relative one-sigma belief) at the bottom.",
        f"name: {as_yaml(name)}",
        "kind: flight",
        f"mass_kg: {mass:.6g}   # {mass_note}",
        f"inertia_kg_m2: {{xx: {inertia[0]:.4e}, yy: {inertia[1]:.4e}, zz: {inertia[2]:.4e}}}   "
        f"# PROPOSED: template {template_name}, scaled by mass and arm squared",
        f"rotors:   # {rotor_note}",
        *(
            f"  - {{x_m: {r.x_m:g}, y_m: {r.y_m:g}, z_m: {r.z_m:g}, spin: {r.spin}}}   # {i} {place}"
            for i, (r, place) in enumerate(zip(rotors, places, strict=True), 1)
        ),
        f"thrust_coefficient_n_s2: {thrust:.5e}   # {thrust_note}",
        f"torque_coefficient_n_m_s2: {ratio * thrust:.5e}   # PROPOSED: {ratio:.4g} m times C_F, {ratio_note}",
        "gravity_m_s2: 9.81",
    ]
    if limit is not None:
        lines.append(f"rotor_speed_limits_rad_s: [0.0, {limit:.6g}]   # PROPOSED: template {template_name}")
    lines += [
        "# rotor_radius_m:   half the propeller's diameter; without it no ground effect, no vortex ring",
        "# ground_z_m:   world z of the ground (down is positive), where no height above ground is recorded",
        "trust: "
        f"{{mass_kg: {mass_trust:g}, thrust_coefficient_n_s2: {thrust_trust:g}, "
        f"torque_coefficient_n_m_s2: {_GUESSED_TORQUE:g}, inertia_xx_kg_m2: {_GUESSED_INERTIA:g}, "
        f"inertia_yy_kg_m2: {_GUESSED_INERTIA:g}, inertia_zz_kg_m2: {_GUESSED_INERTIA:g}}}",
    ]
    return "\n".join(map(printable, lines)) + "\n", tuple(remarks)


def closer_template(lift_n_s2_kg: float, template: Vehicle, template_name: str) -> str | None:
    """Another template of the same order of rotors that hovers at the speeds flown, where the one chosen does not.

    `lift_n_s2_kg` is C_F over mass as flown, which holds whatever the mass is. None where the chosen one is within a
    fifth.
    """

    def off(vehicle: Vehicle) -> float:
        return abs(float(np.log(vehicle.thrust_coefficients_n_s2()[0] / vehicle.mass_kg / lift_n_s2_kg)))

    def corners(vehicle: Vehicle) -> list[tuple]:
        return [(np.sign(r.x_m), np.sign(r.y_m), r.spin) for r in vehicle.rotors]

    others = {n: v for n in names() if n != template_name and corners(v := read_template(n)) == corners(template)}
    best = min(others, key=lambda n: off(others[n]), default=None)
    return best if best and off(template) > 0.2 and off(others[best]) < 0.1 else None


def _mass(mass_kg, template: Vehicle, template_name: str, remarks: list[str]) -> tuple[float, float, str]:
    if mass_kg is not None:
        if not mass_kg > 0:
            raise InputError(f"--mass-kg is {mass_kg:g}, expected more than 0")
        return mass_kg, _WEIGHED, "as you stated it"
    remarks.append(
        f"the mass is {template.mass_kg:g} kg by template {template_name}: weigh the vehicle and give --mass-kg, "
        "since every force stands on it"
    )
    return template.mass_kg, _GUESSED_MASS, f"PROPOSED: template {template_name}; weigh it"


def _rotors(known: Known, template: Vehicle, template_name: str, remarks: list[str]):
    if known.rotors is not None:
        return known.rotors, known.where
    first = template.rotors[0]
    if known.directions is not None:
        scale = _arm(template.rotors) / _arm(known.directions)
        remarks.append(
            f"the rotors' order and turning senses are {known.where}, which states directions alone (±1 m is unset); "
            f"their distances are those of template {template_name}: measure them"
        )
        rotors = tuple(
            r.model_copy(update={"x_m": round(r.x_m * scale, 6), "y_m": round(r.y_m * scale, 6)})
            for r in known.directions
        )
        return rotors, f"PROPOSED: directions by {known.where}, distances of template {template_name}"
    if known.autopilot in ORDERS and template.rotor_count == 4:
        remarks.append(
            f"the rotors' order and turning senses are those of {known.autopilot}, their places of "
            f"template {template_name}"
        )
        rotors = quad_x(known.autopilot, abs(first.x_m), abs(first.y_m))
        return rotors, f"PROPOSED: order of {known.autopilot}, places of template {template_name}"
    remarks.append(f"the rotors' places, order and turning senses are those of template {template_name}")
    return template.rotors, f"PROPOSED: template {template_name}; check order and turning senses"


def _arm(rotors) -> float:
    """Mean distance of rotors from the centre, m."""
    return float(np.mean([np.hypot(r.x_m, r.y_m) for r in rotors]))


def _inertia(rotors, mass: float, template: Vehicle) -> tuple[np.ndarray, float]:
    """Principal inertias of the template scaled by mass and mean squared arm, and the factor."""
    arm = np.mean([r.x_m**2 + r.y_m**2 for r in rotors])
    arm_of_template = np.mean([r.x_m**2 + r.y_m**2 for r in template.rotors])
    scale = float(mass * arm / (template.mass_kg * arm_of_template))
    j = template.inertia_kg_m2
    return scale * np.array([j.xx, j.yy, j.zz]), scale


def _thrust(tables, mass: float, limit: float | None, template: Vehicle, count: int, remarks: list[str]):
    value = thrust_coefficient(tables, mass, count, limit)
    if value is None:
        remarks.append("the thrust coefficient is the template's: the flights hold nothing to take it from")
        value = float(template.thrust_coefficients_n_s2()[0])
        return value, _GUESSED_COEFFICIENT, "PROPOSED: template"
    what = "squared rotor speeds" if limit is None else "squared throttles times limit"
    remarks.append(f"the thrust coefficient is {value:.4g} N s2: thrust over the sum of {what} in these flights")
    trust = _FROM_FLIGHT if limit is None else 2 * _FROM_FLIGHT
    return value, trust, f"PROPOSED: thrust over {what} in these flights; ground it by a thrust stand"


def thrust_coefficient(
    tables: Sequence[pd.DataFrame],
    mass_kg: float,
    rotors: int,
    full_speed_rad_s: float | None = None,
    kind: str = "rotor_speed",
) -> float | None:
    """C_F in N s2 that carries the vehicle: median of m (−f_z) / Σω² over calm instants, None where nothing says it.

    `kind` names the columns of speeds; `full_speed_rad_s` turns throttles into speeds where none is recorded. Without
    an accelerometer the thrust is taken to carry the weight on average.
    """
    ratios: list[np.ndarray] = []
    for table in tables:
        names = list(c.rotor_columns(kind if full_speed_rad_s is None else "throttle", rotors))
        if not set(names) <= set(table.columns):
            continue
        drive = table[[c.TIME, *names]].dropna()
        squared = ((drive[names].to_numpy(float) * (full_speed_rad_s or 1.0)) ** 2).sum(axis=1)
        lift = _specific_lift(table, drive[c.TIME].to_numpy(float))
        if len(squared):
            good = (squared > 0.25 * np.median(squared)) & np.isfinite(lift)
            ratios.append(mass_kg * lift[good] / squared[good])
    values = np.concatenate(ratios) if ratios else np.zeros(0)
    value = float(np.median(values)) if len(values) else 0.0
    return value if value > 0 else None


def _specific_lift(table: pd.DataFrame, time_s: np.ndarray) -> np.ndarray:
    """−f_z at given instants as a mean over 0.1 s, m/s2; NaN while turning fast; 9.81 without an accelerometer."""
    name = c.SPECIFIC_FORCE[2]
    if name not in table.columns:
        return np.full(len(time_s), 9.81)
    known = table[[c.TIME, name]].dropna()
    period = float(np.median(np.diff(known[c.TIME]))) if len(known) > 1 else 0.01
    smooth = known[name].rolling(max(int(0.1 / period), 1), center=True, min_periods=1).mean()
    lift = -np.interp(time_s, known[c.TIME], smooth)
    if set(c.ANGULAR_VELOCITY) <= set(table.columns):
        rates = table[[c.TIME, *c.ANGULAR_VELOCITY]].dropna()
        size = np.linalg.norm(rates[list(c.ANGULAR_VELOCITY)].to_numpy(float), axis=1)
        if len(size):
            lift = np.where(np.interp(time_s, rates[c.TIME], size) < _CALM_RAD_S, lift, np.nan)
    return lift
