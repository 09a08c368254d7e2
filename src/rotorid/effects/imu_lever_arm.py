"""Accelerometer away from where the user believes it sits."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter


def lever_arm(motion, vehicle, values):
    """a_m = a + dΩ × r + Ω × (Ω × r), r beyond the believed position."""
    arm = np.asarray(values, float)[None, :]
    rate = motion.angular_velocity
    return Contribution(specific_force=np.cross(motion.angular_acceleration, arm) + np.cross(rate, np.cross(rate, arm)))


def forms(vehicle):
    return (
        Form(
            "lever arm",
            "a_m = a + dΩ × r + Ω × (Ω × r)",
            tuple(Parameter(f"r_{a}", "m", -0.5, 0.5, meaning=f"its place along {a} beyond belief") for a in "xyz"),
            lever_arm,
            ("accelerometer", "angular_velocity", "angular_acceleration"),
        ),
    )


EFFECT = Effect(
    id="imu_lever_arm",
    name="a lever arm of the accelerometer",
    sentence="the accelerometer feels rotation: it does not sit where it is believed",
    forms=forms,
    source="Titterton and Weston, Strapdown Inertial Navigation Technology, 2nd ed., ch. 4; catalogue F22",
    sign="r is where the accelerometer sits from where it is believed; positive along the body axis",
    validity="rigid mount; needs angular accelerations well above their noise",
    excited_by=("angular_velocity", "angular_acceleration"),
    confusers=("com_offset",),
    separating_manoeuvre="excite roll, pitch and yaw by doublets",
    kind="sensor",
    cases=("single/imu_lever_arm/moderate/0", "single/com_offset/moderate/0"),
)
