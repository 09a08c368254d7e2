"""Flights that a plan asks for, recorded by the simulator that made the set; and sets in which pairs look alike.

A plan is a table of the project's axes (`time_s`, `position_*_m`, `yaw_rad`). Nothing here imports `rotorid`; whoever
plans never sees the answer, which holds how large what is hidden is.
"""

from dataclasses import replace

import numpy as np
import pandas as pd

from .cases import COMMAND, SPEED, Case, _draw, _dressed, _runs, all_cases
from .richsim import manoeuvres, scene
from .richsim.hidden import Hidden
from .richsim.programmes import programme
from .richsim.vehicles import AIRFRAMES
from .write import Recording, write_set

WARM_UP_S = 6.0
LOOK_ALIKE = (
    # truth, form, what it is taken for, flights in which the two look alike, columns
    ("com_offset", "", "unequal_rotors", ("calm",), SPEED),
    ("unequal_rotors", "", "com_offset", ("calm",), SPEED),
    ("rotor_drag", "centre", "steady_wind", ("one_way",), SPEED),
    ("frame_drag", "", "rotor_drag", ("gentle",), SPEED),
    ("rotor_drag", "", "frame_drag", ("gentle",), SPEED),
    ("thrust_tilt", "", "com_offset", ("calm",), SPEED),
    ("translational_lift", "", "axial_inflow", ("gentle",), SPEED),
    ("axial_inflow", "", "frame_drag", ("heave",), SPEED),
    ("flapping_moment", "", "rotor_interference", ("one_way",), SPEED),
    ("rotor_gyroscopic", "", "inertia_products", ("gentle",), SPEED),
    ("inertia_products", "", "rotor_gyroscopic", ("gentle",), SPEED),
    ("rotational_damping", "", "axial_inflow", ("gentle",), SPEED),
    ("imu_lever_arm", "", "com_offset", ("gentle",), SPEED),
    ("gyro_error", "bias", "inertia_products", ("gentle",), SPEED),
    ("accelerometer_error", "turn", "thrust_tilt", ("calm",), SPEED),
    ("payload", "", "com_offset", ("calm",), SPEED),
    ("steady_wind", "", "thrust_tilt", ("calm",), SPEED),
    ("motor_lag", "", "delay", ("heave",), COMMAND),
    ("delay", "actuation", "motor_lag", ("heave",), COMMAND),
    ("unequal_rotors", "one", "com_offset", ("calm",), COMMAND),
)
"""Pairs of the catalogue's confusers, flown so that little distinguishes them."""


def look_alikes() -> list[Case]:
    """One case of every pair of LOOK_ALIKE: two short flights, the cause one and a half times the noise."""
    out = []
    for k, (effect, form, other, purposes, groups) in enumerate(LOOK_ALIKE):
        name = f"look_alike/{effect}-{other}/{k:02d}"
        rng = _draw(name, 0)
        fixed = effect in ("motor_lag", "delay", "steady_wind")
        plan = _dressed(
            rng,
            rate_hz=250.0,
            vehicle=("thesis", "racer")[k % 2],
            groups=groups,
            runs=_runs(purposes * 2, rng),
            hidden=(Hidden(effect, size=None if fixed else 1.5, form=form),),
            late_fraction=0.0,
            trim_s=5.0 if "one_way" in purposes else 0.0,
        )
        out.append(Case(name, 30000 + k, "richsim", plan, (effect,)))
    return out


def ambiguous() -> list[Case]:
    """The listed cases recorded so that a pair cannot be distinguished."""
    return [c for c in all_cases() if c.name.startswith("confusable/") and "/without/" in c.name]


def drawn_anew(case: Case, number: int) -> Case:
    """A case with other hidden sizes, directions, winds and noise: draw `number` of it, from 1."""
    return replace(case, name=f"{case.name}/draw {number}", seed=case.seed + 100_000 * number)


def reference_of(trajectory: pd.DataFrame, step_s: float, rotors: int) -> manoeuvres.Reference:
    """A planned trajectory on the simulator's grid, after a hover that lets the controller settle."""
    until = float(trajectory["time_s"].iloc[-1])
    time_s = np.arange(-WARM_UP_S, until + step_s / 2, step_s)

    def column(name):
        return np.interp(time_s, trajectory["time_s"], trajectory[name])

    def columns(stem, unit):
        return np.stack([column(f"{stem}_{a}_{unit}") for a in "xyz"], axis=1)

    return manoeuvres.Reference(
        time_s=time_s,
        position_m=columns("position", "m"),
        velocity_m_s=columns("velocity", "m_s"),
        acceleration_m_s2=columns("acceleration", "m_s2"),
        yaw_rad=column("yaw_rad"),
        attitude_rad=np.zeros((len(time_s), 3)),
        speed_fraction=np.zeros((len(time_s), rotors)),
    )


def grid(case: Case) -> tuple[float, int]:
    """Step of the simulator, s, and number of rotors."""
    airframe = AIRFRAMES[case.settings.vehicle]
    return airframe.step_s, airframe.n


def standard(case: Case, duration_s: float) -> manoeuvres.Reference:
    """What a pilot flies who has no plan: eights, climbs, turns, oscillations and doublets in one flight."""
    airframe = AIRFRAMES[case.settings.vehicle]
    rng = np.random.default_rng([case.seed, 77])
    segments, altitude = programme("rich", duration_s, airframe, rng, False)
    return manoeuvres.build(segments, altitude, airframe.step_s, airframe.n, rng)


def record(case: Case, answer: dict, references: dict[str, manoeuvres.Reference]) -> Recording:
    """The flights of these references as the case's vehicle, with what is hidden in it, would have recorded them."""
    plan = replace(case.settings, runs=(), trim_s=0.0)
    airframe = AIRFRAMES[plan.vehicle]
    extra = scene._needs(plan.hidden)
    sizes = {e["id"]: e["amount"] for e in answer["effects"]}
    hidden = (*plan.hidden, *extra)
    world, _ = scene._world(airframe, hidden, [sizes[h.id] for h in hidden], case.seed)
    vehicle, _ = scene._believed(plan, airframe, world)
    runs = {}
    for number, (name, reference) in enumerate(references.items()):
        flight = scene._fly(plan, airframe, world, reference, 0, case.seed)
        _, runs[name] = scene._record(plan, airframe, world, flight, 100 + number, case.seed)
    return Recording(vehicle, runs, (), plan.form)


def record_by_hand(case: Case, answer: dict, duration_s: float, swapped=(), mass_kg=0.0, place_m=(0.0, 0.0, 0.0)):
    """A hover of the case's vehicle after a step by hand, as it would have been recorded.

    Propellers of the places `swapped` (pairs, from 0) changed places, or a mass was attached at `place_m` (body axes
    from the believed centre of mass, m).
    """
    plan = replace(case.settings, runs=(), trim_s=0.0)
    airframe = AIRFRAMES[plan.vehicle]
    hidden = (*plan.hidden, *scene._needs(plan.hidden))
    sizes = {e["id"]: e["amount"] for e in answer["effects"]}
    world, _ = scene._world(airframe, hidden, [sizes[h.id] for h in hidden], case.seed)
    values = world.values
    for i, j in swapped:
        for name in ("cf", "cq"):
            values[name] = np.array(values[name])
            values[name][[i, j]] = values[name][[j, i]]
    if mass_kg:
        mass, place, centre = values["mass"], np.array(place_m), values["centre_m"]
        after = (mass * centre + mass_kg * place) / (mass + mass_kg)
        inertia = np.array(values["inertia"], float)
        for m, at in ((mass, centre - after), (mass_kg, place - after)):
            inertia = inertia + m * (at @ at * np.eye(3) - np.outer(at, at))
        values |= {"mass": mass + mass_kg, "centre_m": after, "inertia": inertia}
    t = np.arange(-WARM_UP_S, duration_s, airframe.step_s)
    still = np.zeros((len(t), 3))
    at = still - np.array([0.0, 0.0, 5.0])
    flat = np.zeros((len(t), airframe.n))
    reference = manoeuvres.Reference(t, at, still, still, np.zeros(len(t)), still, flat)
    flight = scene._fly(plan, airframe, world, reference, 0, case.seed)
    _, table = scene._record(plan, airframe, world, flight, 200, case.seed)
    vehicle, _ = scene._believed(plan, airframe, world)
    return Recording(vehicle, {"by hand": table}, (), plan.form)


__all__ = [
    "ambiguous",
    "drawn_anew",
    "grid",
    "look_alikes",
    "record",
    "record_by_hand",
    "reference_of",
    "standard",
    "write_set",
]
