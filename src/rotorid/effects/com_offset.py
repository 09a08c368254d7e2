"""Centre of mass away from where the user believes it."""

from __future__ import annotations

import numpy as np
from numba.extending import register_jitable

from rotorid.effects.contract import Contribution, Effect, Form, Parameter
from rotorid.effects.instant import Wrench
from rotorid.effects.loading import NO_ROTORS, weight


def _moment_only(m, v, p, w):
    """M = -r_c × F_thrust: the rotors' arms are r_i - r_c; moments about the true centre of mass."""
    thrust = 0.0
    for i in range(v.rotors):
        thrust += v.thrust_coefficient[i] * m.rotor_speed[i] ** 2
    w.moment[0] += p[1] * thrust
    w.moment[1] -= p[0] * thrust


@register_jitable
def _of_all_forces(m, v, p, w):
    """M = -r_c × F: what drag and inflow do to the forces acts on that arm, too; F = m a, a the specific force.

    `p` is r_x, r_y, r_z.
    """
    s = m.specific_force
    w.moment[0] -= v.mass * (p[1] * s[2] - p[2] * s[1])
    w.moment[1] -= v.mass * (p[2] * s[0] - p[0] * s[2])
    w.moment[2] -= v.mass * (p[0] * s[1] - p[1] * s[0])


def _with_lever_arm(m, v, p, w):
    """The same, and what is recorded is the motion of the believed centre of mass, at −r_c from the true one.

    F = −m (dΩ × r_c + Ω × (Ω × r_c)): an accelerometer there and the recorded velocity both hold it.
    """
    _of_all_forces(m, v, p, w)
    a, o = m.angular_acceleration, m.angular_velocity
    # Ω × r, and of that Ω × once more.
    i, j, k = o[1] * p[2] - o[2] * p[1], o[2] * p[0] - o[0] * p[2], o[0] * p[1] - o[1] * p[0]
    w.force[0] -= v.mass * (a[1] * p[2] - a[2] * p[1] + o[1] * k - o[2] * j)
    w.force[1] -= v.mass * (a[2] * p[0] - a[0] * p[2] + o[2] * i - o[0] * k)
    w.force[2] -= v.mass * (a[0] * p[1] - a[1] * p[0] + o[0] * j - o[1] * i)


def _in_the_plane(values):
    """r_x, r_y, r_z of an offset in the rotor plane."""
    return (*values, 0.0)


def forms(vehicle):
    space = tuple(Parameter(f"r_{a}", "m", -0.3, 0.3, meaning=f"centre of mass along {a}") for a in "xyz")
    plane, text = space[:2], "M = −r_c × m a"
    felt = text + ", F = −m (dΩ × r_c + Ω × (Ω × r_c))"
    known = ("rotor_speed", "angular_velocity")
    needs = (*known, "angular_acceleration", "specific_force")
    return (
        Form("moment", "M = −r_c × F_thrust", plane, Wrench(_moment_only), known, excited_by=("rotor_speed",)),
        Form(
            "moment of all forces",
            text,
            plane,
            Wrench(_of_all_forces, _in_the_plane),
            (*known, "specific_force"),
            excited_by=("specific_force",),
        ),
        Form("moment and lever arm", felt, plane, Wrench(_with_lever_arm, _in_the_plane), needs),
        Form("moment and lever arm, in space", felt, space, Wrench(_with_lever_arm), needs, must_show=(0, 1)),
    )


def _weight_moment(loading, vehicle, values):
    """On a stand the weight, not the thrust, moves with the centre of mass: M = r_c × m g."""
    offset = np.zeros(3)
    offset[: len(values)] = values
    here, there = weight(loading.motion, vehicle), weight(loading.motion, vehicle, offset)
    return Contribution(reading=there - here)


def reading_forms(instrument):
    vehicle = instrument.vehicle
    if instrument.bench or vehicle.tared or not vehicle.mass_kg or not any(c >= 3 for c in instrument.channels):
        return ()
    space = tuple(Parameter(f"r_{a}", "m", -0.3, 0.3, meaning=f"centre of mass along {a}") for a in "xyz")
    forms = [Form("moment of the weight", "M = r_c × m g", space[:2], _weight_moment, excited_by=("always",))]
    if instrument.tilts:
        forms.append(
            Form("moment of the weight, in space", "M = r_c × m g", space, _weight_moment, excited_by=("always",))
        )
    return tuple(forms)


EFFECT = Effect(
    id="com_offset",
    name="an offset of the centre of mass",
    sentence="a roll or pitch moment proportional to thrust",
    forms=forms,
    turns_like="unequal_rotors",
    shows_in=("share", "trim"),
    source="rigid-body mechanics; Titterton and Weston, ch. 4 (lever arm); catalogue F15",
    sign=(
        "r is where the true centre of mass lies from the believed one; positive r_x (forward) gives a "
        "nose-down moment in hover"
    ),
    validity="the change of inertia (m r², below 1 % for r under 5 mm) is left out",
    excited_by=("specific_force", "angular_velocity", "angular_acceleration"),
    reading_forms=reading_forms,
    confusers=("unequal_rotors", "thrust_tilt"),
    separating_manoeuvre="excite roll, pitch and yaw by doublets",
    separating_columns=("rotor_speed",),
    exact=True,
    lack_on=lambda instrument: (
        NO_ROTORS
        if instrument.bench
        else "the weight was zeroed away"
        if instrument.vehicle.tared
        else "no mass is stated or no moment is read"
    ),
    cases=("single/com_offset/moderate/0", "single/thrust_tilt/strong/0"),
)
