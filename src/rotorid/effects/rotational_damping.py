"""Damping of body rates that axial inflow at the rotors does not explain."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter


def linear(motion, vehicle, values):
    """M = -(c_x p, c_y q, c_z r)."""
    return Contribution(moment=-np.asarray(values) * motion.angular_velocity)


def quadratic(motion, vehicle, values):
    """M_j = -c_j |Ω_j| Ω_j."""
    rate = motion.angular_velocity
    return Contribution(moment=-np.asarray(values) * np.abs(rate) * rate)


def isotropic(motion, vehicle, values):
    """M = -c Ω."""
    return Contribution(moment=-values[0] * motion.angular_velocity)


def forms(vehicle):
    needs = ("angular_velocity",)
    return (
        Form("one constant", "M = −c Ω", (Parameter("c", "N m s/rad", 0.0),), isotropic, needs),
        Form(
            "linear",
            "M_j = −c_j Ω_j",
            tuple(Parameter(f"c_{a}", "N m s/rad", 0.0) for a in "xyz"),
            linear,
            needs,
        ),
        Form(
            "quadratic",
            "M_j = −c_j |Ω_j| Ω_j",
            tuple(Parameter(f"c_{a}", "N m s2/rad2", 0.0) for a in "xyz"),
            quadratic,
            needs,
        ),
    )


EFFECT = Effect(
    id="rotational_damping",
    name="rotational damping",
    sentence="a moment opposes the body rates",
    forms=forms,
    source="contract and physics.md (M = −c Ω)",
    confusers=("axial_inflow", "delay", "gyro_error"),
    separating_manoeuvre="excite roll, pitch and yaw by doublets of several lengths",
)
