"""Whether mass, inertia, arms, rotors and rotor speeds can belong to one multirotor.

Each quantity below couples several believed values and lies, for multirotors from 27 g to some tens of kilograms, in
limits that are wide against an error of some tens of percent and narrow against a wrong unit. Where one lies outside,
the one value is sought that brings all of them inside, and the unit in which that value would have been written.

Sources: momentum theory (figure of merit at most 1), tip speed below Mach 0.9, and the range of the vehicles in
`templates` and `workflow/vehicles` with a margin of about a factor of three in each value.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from math import isclose, isfinite, pi, sqrt

import numpy as np

from rotorid.recordings.run import Doubt
from rotorid.recordings.vehicle import Vehicle

_AIR_KG_M3 = 1.2
_USUAL_C_T = 0.012
"""Thrust over ρ π R⁴ ω² of a usual propeller: gives a radius within a factor of two where none is stated."""
_GYRATION_ARMS = (0.1, 1.5)
_SPAN_RADII = (0.6, 6.0)
_C_T = (0.002, 0.2)
_FIGURE_OF_MERIT = (0.07, 1.0)
_SURE_FIGURE_OF_MERIT = (0.07, 1.5)
"""Between 1 and this coefficients are impossible, and by some tens of percent."""
_DISC_LOADING_N_M2 = (3.0, 3000.0)
_HIGHEST_TIP_M_S = 306.0
"""Mach 0.9."""
_LIMIT_OVER_HOVER = (0.8, 8.0)
_PLACE_ARMS = (0.0, 2.0)
_ROTOR_INERTIA = (0.0, 0.1)
"""Of one rotor, over mass times squared radius: with all the vehicle's mass in its rotors, and more."""
_FACTORS = np.logspace(-13, 13, 521)
_MOST_UNITS = 3
_PX4_UNSET_ARM_M = sqrt(2.0)
"""Rotors at ±1 m along x and y."""

_RPM, _REV_S = 2 * pi / 60, 2 * pi
_GF, _LB = 9.80665e-3, 0.45359237
_LENGTHS = {"cm": 1e-2, "mm": 1e-3, "inch": 0.0254, "km": 1e3}
_SPEEDS = {"revolutions per minute": _RPM, "revolutions per second": _REV_S}
_INERTIAS = {
    "g m²": 1e-3, "kg cm²": 1e-4, "kg mm²": 1e-6, "g cm²": 1e-7, "g mm²": 1e-9, "lb in²": _LB * 0.0254**2,
}  # fmt: skip
_UNITS: dict[tuple[str, ...], dict[str, float]] = {
    ("mass_kg",): {"g": 1e-3, "lb": _LB, "oz": _LB / 16, "t": 1e3},
    ("inertia_kg_m2",): _INERTIAS,
    ("rotor_inertia_kg_m2",): _INERTIAS,
    ("accelerometer_position_m",): _LENGTHS,
    ("rotors",): _LENGTHS,
    ("rotor_radius_m",): {**_LENGTHS, "the diameter": 0.5},
    ("thrust_coefficient_n_s2",): {
        "gf s²": _GF, "kgf s²": 1e3 * _GF, "mN s²": 1e-3, "N per rpm²": _RPM**-2,
        "N per (rev/s)²": _REV_S**-2,
    },
    ("torque_coefficient_n_m_s2",): {
        "N mm s²": 1e-3, "gf cm s²": _GF * 1e-2, "gf m s²": _GF,
        "N m per rpm²": _RPM**-2, "N m per (rev/s)²": _REV_S**-2,
    },
    ("rotor_speeds",): _SPEEDS,
    ("rotor_speed_limits_rad_s",): _SPEEDS,
    ("rotors", "rotor_radius_m"): _LENGTHS,
    ("mass_kg", "inertia_kg_m2"): {"g and g m²": 1e-3},
    ("thrust_coefficient_n_s2", "torque_coefficient_n_m_s2"): {
        "N per rpm² and N m per rpm²": _RPM**-2, "gf s² and gf m s²": _GF,
    },
}  # fmt: skip
"""Values that may be wrong together, each with units in which they may have been written, as factors to SI."""


@dataclass(frozen=True)
class Body:
    """Believed values in SI units; None where the vehicle does not state one."""

    mass_kg: float | None
    inertia_kg_m2: tuple[float, ...] | None
    """xx, yy, zz."""
    rotors: float | None
    """Longest arm, m; None of a single rotor on the axis."""
    rotor_radius_m: float | None
    thrust_coefficient_n_s2: float
    torque_coefficient_n_m_s2: float | None
    rotor_speed_limits_rad_s: float | None
    rotor_speeds: tuple[float, float] | None
    """At which equal rotors give a run's median thrust, and at the most."""
    lift_m_s2: float | None
    """Specific force against the thrust; None where nothing was lifted (a stand)."""
    accelerometer_position_m: float | None
    """Distance from the origin; None where it is there."""
    rotor_inertia_kg_m2: float | None
    count: int
    column: str
    """First column of the rotors; `throttle_1` where speed is throttle times the upper limit."""

    @property
    def by_throttle(self) -> bool:
        return self.column.startswith("throttle")

    def scaled(self, keys: tuple[str, ...], factor: float) -> Body:
        """The body with these values multiplied by one factor."""

        def times(value):
            return tuple(factor * v for v in value) if isinstance(value, tuple) else factor * value

        changed = {key: times(getattr(self, key)) for key in keys}
        if self.by_throttle and "rotor_speed_limits_rad_s" in keys:
            changed["rotor_speeds"] = times(self.rotor_speeds)
        return replace(self, **changed)

    @property
    def radius_m(self) -> float:
        """Radius of the rotors, stated or of a usual propeller with this C_F."""
        return self.rotor_radius_m or (self.thrust_coefficient_n_s2 / (_AIR_KG_M3 * pi * _USUAL_C_T)) ** 0.25


@dataclass(frozen=True)
class _CoupledNumber:
    """A number that couples believed values, and where it has to lie."""

    keys: tuple[str, ...]
    """Values in it, the likeliest to be wrong first."""
    value: float
    limits: tuple[float, float]
    words: str
    sure: tuple[float, float] | None = None
    """Wider limits, outside of which a verdict would be about the mistake; None where those above say so."""

    @property
    def fits(self) -> bool:
        return _within(self.value, self.limits)

    @property
    def stops(self) -> bool:
        return not _within(self.value, self.sure or self.limits)


def _within(value: float, limits: tuple[float, float]) -> bool:
    return isfinite(value) and limits[0] <= value <= limits[1]


def body_of(
    vehicle: Vehicle, speeds: tuple[float, float] | None = None, lift_m_s2: float | None = None, column: str = ""
) -> Body | None:
    """The vehicle's values that are coupled, with those of a run where there is one; None without rotors."""
    if not vehicle.rotors or vehicle.thrust_coefficient_n_s2 is None:
        return None
    hubs = vehicle.rotor_positions_m()
    arm = float(np.linalg.norm(hubs[:, :2], axis=1).max())
    inertia, torque = vehicle.inertia_kg_m2, vehicle.torque_coefficient_n_m_s2
    limits = vehicle.rotor_speed_limits_rad_s
    return Body(
        mass_kg=vehicle.mass_kg,
        inertia_kg_m2=None if inertia is None else (inertia.xx, inertia.yy, inertia.zz),
        rotors=arm or None,
        rotor_radius_m=vehicle.rotor_radius_m,
        thrust_coefficient_n_s2=float(vehicle.thrust_coefficients_n_s2().mean()),
        torque_coefficient_n_m_s2=None if torque is None else float(vehicle.torque_coefficients_n_m_s2().mean()),
        rotor_speed_limits_rad_s=None if limits is None else limits[1],
        rotor_speeds=speeds,
        lift_m_s2=lift_m_s2,
        accelerometer_position_m=float(np.linalg.norm(vehicle.accelerometer_position_m)) or None,
        rotor_inertia_kg_m2=vehicle.rotor_inertia_kg_m2,
        count=vehicle.rotor_count,
        column=column,
    )


def quantities(body: Body) -> Iterator[_CoupledNumber]:
    """What couples the believed values, as far as they are stated."""
    rough_figure_of_merit = (0.05, 1.5)  # With a radius that is itself estimated from C_F.
    radius, c_f = body.radius_m, body.thrust_coefficient_n_s2
    stated = body.rotor_radius_m is not None
    length = "rotor_radius_m" if stated else "thrust_coefficient_n_s2"
    disc = f"rotors of {radius:.3g} m radius" + ("" if stated else " (as C_F suggests)")
    if body.mass_kg and body.inertia_kg_m2 and body.rotors:
        for moment in (min(body.inertia_kg_m2), max(body.inertia_kg_m2)):
            gyration = sqrt(moment / body.mass_kg)
            words = f"a radius of gyration of {gyration:.3g} m with arms of {body.rotors:.3g} m"
            keys = ("inertia_kg_m2", "mass_kg", "rotors")
            yield _CoupledNumber(keys, gyration / body.rotors, _GYRATION_ARMS, words)
    if body.rotors:
        words = f"arms of {body.rotors:.3g} m with {disc}"
        yield _CoupledNumber(("rotors", length), body.rotors / radius, _SPAN_RADII, words)
    if stated:
        c_t = c_f / (_AIR_KG_M3 * pi * radius**4)
        words = f"a dimensionless C_T of {c_t:.3g} (C_F over ρ π R⁴, R {radius:.3g} m)"
        yield _CoupledNumber(("rotor_radius_m", "thrust_coefficient_n_s2"), c_t, _C_T, words)
    if body.torque_coefficient_n_m_s2:
        merit = c_f**1.5 / (body.torque_coefficient_n_m_s2 * sqrt(2 * _AIR_KG_M3 * pi) * radius)
        words = f"a figure of merit of {merit:.3g} (C_F^1.5 over C_Q √(2 ρ π) R)"
        keys = ("torque_coefficient_n_m_s2", "thrust_coefficient_n_s2", length)
        limits, sure = (_FIGURE_OF_MERIT, _SURE_FIGURE_OF_MERIT) if stated else (rough_figure_of_merit, None)
        yield _CoupledNumber(keys, merit, limits, words, sure)
    if body.mass_kg:
        loading = body.mass_kg * 9.81 / (body.count * pi * radius**2)
        words = f"a disc loading of {loading:.3g} N/m² with {disc}"
        yield _CoupledNumber(("mass_kg", length), loading, _DISC_LOADING_N_M2, words)
    if body.rotor_speeds:
        yield from _turning(body, disc)
    if body.accelerometer_position_m and body.rotors:
        place = body.accelerometer_position_m
        words = f"an accelerometer {place:.3g} m from the origin with arms of {body.rotors:.3g} m"
        yield _CoupledNumber(("accelerometer_position_m", "rotors"), place / body.rotors, _PLACE_ARMS, words)
    if body.rotor_inertia_kg_m2 and body.mass_kg:
        share = body.rotor_inertia_kg_m2 / (body.mass_kg * radius**2)
        words = f"the inertia of a rotor is {share:.3g} times that of the whole mass at its tip, with {disc}"
        yield _CoupledNumber(("rotor_inertia_kg_m2", "mass_kg", length), share, _ROTOR_INERTIA, words)


def _turning(body: Body, disc: str) -> Iterator[_CoupledNumber]:
    """What couples the values with the rotor speeds."""
    # Thrust over what carries the vehicle; outside, mass or thrust is wrong by about a factor of two.
    weight = (0.55, 1.9)
    weight_by_throttle = (0.2, 5.0)  # The same where speed is throttle times limit, which no real throttle obeys.
    hover, top = body.rotor_speeds
    source = "rotor_speed_limits_rad_s" if body.by_throttle else "rotor_speeds"
    tip = top * body.radius_m
    words = f"a tip speed of {tip:.3g} m/s with {disc}"
    yield _CoupledNumber((source, "rotor_radius_m"), tip, (0.0, _HIGHEST_TIP_M_S), words)
    if body.mass_kg and body.lift_m_s2:
        ratio = body.count * body.thrust_coefficient_n_s2 * hover**2 / (body.mass_kg * body.lift_m_s2)
        words = f"the thrust is {ratio:.3g} times what carries the vehicle (C_F Σω² over mass times specific force)"
        limits = weight_by_throttle if body.by_throttle else weight
        yield _CoupledNumber(("mass_kg", "thrust_coefficient_n_s2", source), ratio, limits, words)
        if body.rotor_speed_limits_rad_s and not body.by_throttle:
            share = body.rotor_speed_limits_rad_s / hover
            words = f"an upper limit of {share:.3g} times the hovering speed of {hover:.4g} rad/s"
            yield _CoupledNumber(("rotor_speed_limits_rad_s", "rotor_speeds"), share, _LIMIT_OVER_HOVER, words)


def _remedies(body: Body) -> Iterator[tuple[tuple[str, ...], tuple[int, np.ndarray, tuple[str, ...]]]]:
    """For each value that may be wrong alone, and for values wrong by one unit together, what one factor mends.

    To the values how many quantities lie outside their limits even then, all factors that do so, ascending, and the
    units whose factor is one of them, the likeliest first.
    """
    before = [q.fits for q in quantities(body)]

    def left(keys: tuple[str, ...], factor: float) -> int:
        """Quantities still outside; all of them where the factor puts one outside that was inside."""
        after = [q.fits for q in quantities(body.scaled(keys, factor))]
        spoils = any(a and not b for a, b in zip(before, after, strict=True))
        return len(before) if spoils else after.count(False)

    for keys, units in _UNITS.items():
        if any(getattr(body, key) is None for key in keys) or (body.by_throttle and keys == ("rotor_speeds",)):
            continue
        by_unit = {unit: left(keys, factor) for unit, factor in units.items()}
        grid = np.array(list(units.values()) if len(keys) > 1 else _FACTORS)
        rest = np.array([left(keys, factor) for factor in grid])
        least = min(rest.min(), *by_unit.values())
        fitting = [unit for unit, count in by_unit.items() if count == least]
        factors = np.sort([*grid[rest == least], *(units[u] for u in fitting)])
        middle = float(np.log(factors[-1:] if factors[0] <= _FACTORS[0] else factors).mean())
        nearest = sorted(fitting, key=lambda unit: abs(np.log(units[unit]) - middle))[:_MOST_UNITS]
        yield keys, (int(least), factors, tuple(nearest))


def unfit(body: Body) -> list[_CoupledNumber]:
    """The quantities that lie outside their limits."""
    return [q for q in quantities(body) if not q.fits]


def impossible(body: Body) -> Iterator[Doubt]:
    """Believed values that no multirotor has together: one doubt for each value that has to change."""
    while wrong := unfit(body):
        order = {key: place for place, key in enumerate(dict.fromkeys(key for q in wrong for key in q.keys))}
        found = {keys: r for keys, r in _remedies(body) if r[0] < len(wrong) and keys[0] in order}
        if not found:
            # Several values are wrong at once, and no single one of them improves anything.
            yield _doubt(body, wrong[0].keys[:1], np.array([]), (), wrong, ())
            return
        best = min(found, key=lambda keys: (found[keys][0], not found[keys][2], len(keys), order[keys[0]]))
        left, factors, units = found[best]
        mended = body.scaled(best, float(np.exp(np.log(factors).mean())))
        fixed = [q for q, after in zip(quantities(body), quantities(mended), strict=True) if after.fits > q.fits]
        others = [keys[0] for keys, r in found.items() if r[0] == left and len(keys) == 1 and keys != best]
        yield _doubt(body, best, factors, units, fixed, others)
        body = mended


def _doubt(
    body: Body,
    keys: tuple[str, ...],
    factors: np.ndarray,
    units: Sequence[str],
    raised_by: Sequence[_CoupledNumber],
    others: Sequence[str],
) -> Doubt:
    """The doubt of a value, with what raised it, what was expected and which unit would fit."""

    def name(key: str) -> str:
        return body.column if key == "rotor_speeds" else key

    key, about = keys[0], raised_by[0]
    value = getattr(body, key)
    label = f"{name(key)} = "
    if key == "inertia_kg_m2":
        # The axis that is farther outside.
        axis = int(np.argmax(value) if about.value > about.limits[1] else np.argmin(value))
        label, value = f"{key} {('xx', 'yy', 'zz')[axis]} = ", value[axis]
    elif key == "rotors":
        label = "rotors, longest arm in m = "
    elif key == "rotor_speeds":
        label, value = f"{body.column} and its like, at hover = ", value[0]
    sentence = f"{label}{value:.4g}: {about.words}"
    ends = (factors[0], factors[-1]) if len(factors) else None
    if ends:
        low, high = value * ends[0], value * ends[1]
        least = "at most " if ends[0] <= _FACTORS[0] else f"{low:.3g} to " if high > low else "about "
        sentence += f"; expected {least}{high:.3g}"
    if key == "torque_coefficient_n_m_s2" and ends and _within(body.thrust_coefficient_n_s2, ends):
        sentence += "; the ratio of torque to thrust in m would fit"
    elif units:
        both = " (" + " and ".join(map(name, keys)) + " alike)" if len(keys) > 1 else ""
        sentence += f"; {' or '.join(units)} would fit{both}"
    if others:
        sentence += f"; {' or '.join(map(name, others))} may be wrong in its place"
    if key == "rotors" and isclose(value, _PX4_UNSET_ARM_M):
        sentence += "; PX4 logs x and y of 1 m where its geometry was never set"
    return Doubt(name(key), sentence, stops=any(q.stops for q in raised_by))
