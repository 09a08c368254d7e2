"""Whether a vehicle is a body that hovers and flies.

A value can leave every channel better and still be that of no vehicle: a thrust coefficient that absorbs a drag may
leave a maximum thrust below the weight.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import product

import numpy as np

from rotorid.errors import InputError
from rotorid.mismatch.decide.problem import Values
from rotorid.mismatch.decide.values import changed_vehicle
from rotorid.recordings import Run, Vehicle
from rotorid.recordings import columns as c
from rotorid.recordings.body import body_of, unfit
from rotorid.recordings.files import NO_BODY
from rotorid.steps import step
from rotorid.vehicle.control import FLIGHTS, SECONDS, SEED, swings, turned_over
from rotorid.vehicle.exports import export_vehicle
from rotorid.vehicle.exports.forms import FORMS
from rotorid.vehicle.improved import command_path, flyable, wrench_at_rest, wrench_of_command

_HIGH_ABOVE_GROUND_M = 1e3
_LIGHT = 0.5
"""Share of the largest recorded thrust below which a vehicle is not taken to be in the air."""


_SPLITS = (("arm", "inertia_xx", "inertia_yy"), ("torque", "inertia_zz"))
"""Values of which a flight knows the ratio of the first to each of the others."""
_SPLIT_STEPS = np.linspace(-1.2, 1.2, 61)
"""Logarithms of the factors that are tried: up to three times."""

_Question = Callable[[Vehicle], str]
"""Takes a vehicle of kind `flight`; gives why it is not fit for use, without a full stop, or nothing."""


def question_of(believed: Vehicle, runs: Sequence[Run]) -> tuple[_Question, tuple[str, ...]]:
    """What is asked of a vehicle derived from a believed one (a body, that hovers, that flies), and what the believed
    vehicle fails itself, a sentence each.

    That is not asked: what is derived from it may fail it, too, and no part of the model is to blame for it.
    """
    answers = {question: question(believed) for question in _questions(believed, runs)}
    asked = [question for question, why in answers.items() if not why]
    faults = (f"The believed vehicle itself is not fit to be flown: {why}." for why in answers.values() if why)
    return lambda vehicle: next((why for question in asked if (why := question(vehicle))), ""), tuple(faults)


def _questions(believed: Vehicle, runs: Sequence[Run]) -> tuple[_Question, ...]:
    """Everything that is asked, the cheapest first."""
    share, recorded = recorded_share(runs, believed), _recorded_hover(runs, believed)
    return (
        no_body,
        _held_by_a_constant,
        lambda vehicle: cannot_hover(_by_its_rotors(vehicle), share),
        lambda vehicle: _off_as_recorded(_by_its_rotors(vehicle), recorded),
        cannot_fly,
    )


def _by_its_rotors(vehicle: Vehicle) -> Vehicle:
    """The vehicle without the constants of its derivatives, which lift whether rotors turn or not."""
    kept = tuple(d for d in vehicle.derivatives if d.quantity != "constant")
    return vehicle.model_copy(update={"derivatives": kept})


def _held_by_a_constant(vehicle: Vehicle) -> str:
    """Which constant force would carry it; empty where all are trims."""
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    # Share of the weight that a constant force of the derivatives may be: more is lift that the rotors do not make.
    most_trim = 0.1
    for d in vehicle.derivatives:
        if d.quantity == "constant" and d.channel.startswith("force") and abs(d.value) > most_trim * weight:
            share = 100 * abs(d.value) / weight
            return f"its derivatives hold a constant {d.channel} of {d.value:.3g} N, {share:.0f} % of its weight"
    return ""


def no_body(vehicle: Vehicle) -> str:
    """Which values are not those of one body with rotors; empty where they may be."""
    least, middle, largest = np.linalg.eigvalsh(vehicle.inertia_kg_m2.matrix())
    if largest > NO_BODY * (least + middle):
        return f"its principal moments of inertia {least:.3g}, {middle:.3g} and {largest:.3g} kg m2 are of no body"
    wrong = unfit(body_of(vehicle, None))
    return f"it would have {wrong[0].words}" if wrong else ""


def as_a_body(believed: Vehicle, values: Values, moved: Values) -> Values:
    """Values `moved` within their trust such that, next to the `values` called wrong, they are those of one body.

    A flight knows the ratios C_F l/J_xx, C_F l/J_yy and C_Q/J_zz, and not how each is split. Where its split is of no
    body, arm and inertias about it, or C_Q and the yaw inertia, change by one factor each, the nearest that give a
    body; what is predicted stays. A value that is called wrong stays as it is stated, and so does one that nobody
    holds for a body anyway.
    """
    given = {key: change for key, (change, _) in {**moved, **values}.items()}
    if no_body(believed) or not no_body(changed_vehicle(believed, given)):
        return moved
    free = [keys for keys in _SPLITS if not set(keys) & set(values)]
    tried = sorted(product(_SPLIT_STEPS, repeat=len(free)), key=lambda own: sum(x * x for x in own))
    for logarithms in tried:
        factors = {key: float(np.exp(x)) for keys, x in zip(free, logarithms, strict=True) for key in keys}
        turned = {key: (1.0 + given.get(key, 0.0)) * factor - 1.0 for key, factor in factors.items() if factor != 1.0}
        if not no_body(changed_vehicle(believed, {**given, **turned})):
            return {**moved, **{key: (change, moved.get(key, (0.0, 0.0))[1]) for key, change in turned.items()}}
    return moved


def cannot_hover(vehicle: Vehicle, recorded_share: float) -> str:
    """Why it cannot hover; empty where it can, or where no largest rotor speed is stated."""
    most = full_thrust_n(vehicle)
    if most is None:
        return ""
    weight = vehicle.mass_kg * vehicle.gravity_m_s2
    most_hover_share = 0.9  # Share of the full thrust at which a vehicle may hover: what steers it needs the rest.
    allowed = max(most_hover_share, recorded_share)
    if weight <= allowed * most:
        return ""
    return (
        f"its full thrust is {most:.3g} N for a weight of {weight:.3g} N; hovering may take {100 * allowed:.0f} % of it"
    )


def _recorded_hover(runs: Sequence[Run], vehicle: Vehicle) -> tuple[np.ndarray, str, float] | None:
    """What was recorded in the air, medians over time; None where the runs do not have all of it.

    Rotor speeds, (k,), rad/s (of a throttle its share of the full speed), which of the three they are, and the upward
    specific force, m/s².
    """
    force = c.SPECIFIC_FORCE[2]
    for group in ("rotor_speed", "rotor_command", "throttle"):
        names = list(c.rotor_columns(group, vehicle.rotor_count))
        own = [r.table[[*names, force]].to_numpy() for r in runs if r.has(*names, force)]
        if own:
            table = np.concatenate(own)
            square = (table[:, :-1] ** 2).mean(axis=1)
            flying = table[square > _LIGHT * np.nanquantile(square, 0.99)]
            if len(flying):
                middle = np.nanmedian(flying, axis=0)
                return middle[:-1], group, -float(middle[-1])
    return None


def _off_as_recorded(vehicle: Vehicle, recorded: tuple[np.ndarray, str, float] | None) -> str:
    """Why its force at the rotor speeds of `_recorded_hover` is not the one that was felt; empty where it is."""
    if recorded is None or recorded[2] <= 0:
        return ""
    speed_rad_s, group, specific_force_m_s2 = recorded
    flown = flyable(vehicle)[0]
    if group == "throttle":
        speed_rad_s = speed_rad_s * flown.rotor_speed_limits_rad_s[1]
    path = None if group == "rotor_speed" else command_path(flown)
    up = wrench_of_command(flown, path, speed_rad_s, _HIGH_ABOVE_GROUND_M)[0]
    share = float(up) / (vehicle.mass_kg * specific_force_m_s2)
    # Upward force at the recorded rotor speeds, over what was felt with them, that a vehicle which flies like the
    # recorded one may make: airspeed and climb change the thrust at the same speed by some ten percent.
    carries = (0.7, 1.4)
    if carries[0] <= share <= carries[1]:
        return ""
    return f"at the rotor speeds that were recorded it makes {share:.2g} times the upward force that was felt"


def full_thrust_n(vehicle: Vehicle) -> float | None:
    """Upward force at rest in still air with full command, effects included, N.

    None without a limit of the speed, and for rotors that cannot set thrust and moments independently (one central
    rotor, whose vanes or flaps are not recorded): `cannot_fly` says so of them.
    """
    if vehicle.rotor_speed_limits_rad_s is None:
        return None
    flown = flyable(vehicle)[0]
    beyond_all = 1e6  # Weights that no rotors lift: asked for, each turns at its limit.
    asked = np.array([beyond_all * vehicle.mass_kg * vehicle.gravity_m_s2, 0.0, 0.0, 0.0])
    try:
        return float(wrench_at_rest(flown, command_path(flown), asked, _HIGH_ABOVE_GROUND_M)[0])
    except InputError:
        return None


@step("flying the vehicle in simulation")
def cannot_fly(vehicle: Vehicle) -> str:
    """Why it does not fly the swings about hover of `rotorid simulate`; empty where it does.

    The very flights that are made of the file later: shorter ones end before a slow swing has grown.
    """
    try:
        flown = swings(vehicle, "trial", SECONDS, FLIGHTS, SEED)
    except InputError as error:
        return f"it cannot be simulated: {error}"
    return "simulated under an attitude controller it turns over" if turned_over(flown) else ""


def recorded_share(runs: Sequence[Run], vehicle: Vehicle) -> float:
    """Share of the full thrust that the rotors made while flying, by the squares of their speeds; 0 if not known.

    A log says it without any coefficient: a racer that hovers at a fifth of its thrust, a lifter at nine tenths.
    """
    limits = vehicle.rotor_speed_limits_rad_s
    if limits is None:
        return 0.0
    for group, scale in (("rotor_speed", 1.0), ("rotor_command", 1.0), ("throttle", limits[1])):
        names = list(c.rotor_columns(group, vehicle.rotor_count))
        tables = [r.table[names].to_numpy() for r in runs if r.has(*names)]
        if tables:
            table = np.concatenate(tables)
            share = np.mean((scale * table[np.isfinite(table).all(axis=1)] / limits[1]) ** 2, axis=1)
            flying = share[share > _LIGHT * share.max(initial=0.0)]
            return float(np.median(flying)) if len(flying) else 0.0
    return 0.0


def exports_lost(vehicle: Vehicle, believed: Vehicle) -> tuple[str, ...]:
    """Forms of other tools that take the believed vehicle and not this one, a sentence each."""
    out = []
    for form in FORMS:
        try:
            export_vehicle(believed, form)
        except InputError:
            continue
        try:
            export_vehicle(vehicle, form)
        except InputError as error:
            out.append(f"The improved vehicle cannot be exported as {form}: {error}.")
    return tuple(out)
