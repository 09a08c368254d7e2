"""Centre of mass away from where the user believes it."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter
from rotorid.effects.loading import NO_ROTORS, weight


def moment_only(motion, vehicle, values):
    """M = -r_c × F_thrust: the rotors' arms are r_i - r_c; moments about the true centre of mass."""
    return along_the_axis(values, (vehicle.thrust_coefficients_n_s2() * motion.rotor_speed**2).sum(axis=1))


def of_all_forces(motion, vehicle, values):
    """M = -r_c × F: what drag and inflow do to the rotors' forces acts on that arm, too; F = m a, a the specific force.

    Of F the part along the rotors' axis, as of the thrust.
    """
    return along_the_axis(values, -vehicle.mass_kg * motion.specific_force[:, 2])


def along_the_axis(values, upward_n):
    """Moment (n, 3) of a force along the rotors' axis, (n,), about a centre of mass at (x, y)."""
    return Contribution(moment=np.stack([values[1] * upward_n, -values[0] * upward_n, 0.0 * upward_n], axis=1))


def with_lever_arm(motion, vehicle, values):
    """The same, and the accelerometer then sits at -r_c from the true centre of mass; r_c in the plane or in space."""
    offset = np.zeros(3)
    offset[: len(values)] = values
    rate = motion.angular_velocity
    shift = np.cross(motion.angular_acceleration, -offset) + np.cross(rate, np.cross(rate, -offset))
    return Contribution(moment=of_all_forces(motion, vehicle, values).moment, specific_force=shift)


def kernel(m, v, p, w):
    thrust = 0.0
    for i in range(v.rotors):
        thrust += m.thrust[i]
    w.moment[0] += p[1] * thrust
    w.moment[1] -= p[0] * thrust


def kernel_of_all_forces(m, v, p, w):
    upward = -v.mass * m.specific_force[2]
    w.moment[0] += p[1] * upward
    w.moment[1] -= p[0] * upward


def forms(vehicle):
    space = tuple(Parameter(f"r_{a}", "m", -0.3, 0.3, meaning=f"centre of mass along {a}") for a in "xyz")
    plane, text = space[:2], "M = −r_c × m a"
    read_too = text + ", a_m = a + dΩ × (−r_c) + Ω × (Ω × (−r_c))"
    known = ("rotor_speed", "angular_velocity")
    needs = (*known, "angular_acceleration", "specific_force", "accelerometer")
    return (
        Form("moment", "M = −r_c × F_thrust", plane, moment_only, known, excited_by=("rotor_speed",), kernel=kernel),
        Form(
            "moment of all forces",
            text,
            plane,
            of_all_forces,
            (*known, "specific_force"),
            excited_by=("specific_force",),
            kernel=kernel_of_all_forces,
        ),
        Form("moment and accelerometer", read_too, plane, with_lever_arm, needs, kernel=kernel_of_all_forces),
        Form(
            "moment and accelerometer, in space",
            read_too,
            space,
            with_lever_arm,
            needs,
            must_show=(0, 1),
            kernel=kernel_of_all_forces,
        ),
    )


def weight_moment(loading, vehicle, values):
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
    forms = [Form("moment of the weight", "M = r_c × m g", space[:2], weight_moment, excited_by=("always",))]
    if instrument.tilts:
        forms.append(
            Form("moment of the weight, in space", "M = r_c × m g", space, weight_moment, excited_by=("always",))
        )
    return tuple(forms)


EFFECT = Effect(
    id="com_offset",
    name="an offset of the centre of mass",
    sentence="a roll or pitch moment proportional to thrust",
    forms=forms,
    source="rigid-body mechanics; Titterton and Weston, ch. 4 (lever arm); catalogue F15",
    sign=(
        "r is where the true centre of mass lies from the believed one; positive r_x (forward) gives a "
        "nose-down moment in hover"
    ),
    validity=(
        "offsets in the rotor plane; a vertical one shows in the accelerometer alone, as the moment of side forces is "
        "left out, and so is the change of inertia (m r², below 1 % for r under 5 mm)"
    ),
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
)
