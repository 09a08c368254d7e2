"""Centre of mass away from where the user believes it."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter


def moment_only(motion, vehicle, values):
    """M = -r_c × F_thrust: the rotors' arms are r_i - r_c; moments about the true centre of mass."""
    offset = np.array([values[0], values[1], 0.0])
    thrust = np.zeros((motion.size, 3))
    thrust[:, 2] = -(vehicle.thrust_coefficients_n_s2() * motion.rotor_speed**2).sum(axis=1)
    return Contribution(moment=-np.cross(offset, thrust))


def with_lever_arm(motion, vehicle, values):
    """The same, and the accelerometer then sits at -r_c from the true centre of mass."""
    offset = np.array([values[0], values[1], 0.0])
    rate = motion.angular_velocity
    shift = np.cross(motion.angular_acceleration, -offset) + np.cross(rate, np.cross(rate, -offset))
    return Contribution(moment=moment_only(motion, vehicle, values).moment, specific_force=shift)


def forms(vehicle):
    plane = (Parameter("r_x", "m", -0.3, 0.3), Parameter("r_y", "m", -0.3, 0.3))
    text = "M = −r_c × F_thrust"
    return (
        Form("moment", text, plane, moment_only, ("rotor_speed", "angular_velocity")),
        Form(
            "moment and accelerometer",
            text + ", a_m = a + dΩ × (−r_c) + Ω × (Ω × (−r_c))",
            plane,
            with_lever_arm,
            ("rotor_speed", "angular_velocity", "angular_acceleration", "accelerometer"),
        ),
    )


EFFECT = Effect(
    id="com_offset",
    name="an offset of the centre of mass",
    sentence="a roll or pitch moment proportional to thrust",
    forms=forms,
    source="physics.md F15",
    confusers=("unequal_rotors", "thrust_tilt"),
    separating_manoeuvre="excite roll, pitch and yaw by doublets with rotor speeds recorded",
)
