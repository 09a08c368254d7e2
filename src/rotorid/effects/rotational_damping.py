"""Damping of body rates that axial inflow at the rotors does not explain."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter
from rotorid.effects.scale import scale


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


def kernel(m, v, p, w):
    for j in range(3):
        w.moment[j] -= p[j] * m.angular_velocity[j]


def _kernel_quadratic(m, v, p, w):
    for j in range(3):
        w.moment[j] -= p[j] * abs(m.angular_velocity[j]) * m.angular_velocity[j]


def _alike(values):
    """c as the kernel's values."""
    return (values[0],) * 3


def forms(vehicle):
    needs = ("angular_velocity",)
    most = scale(vehicle).damping
    each = tuple(Parameter(f"c_{a}", "N m s/rad", 0.0, most, meaning=f"damping about {a}") for a in "xyz")
    square = tuple(Parameter(f"c_{a}", "N m s2/rad2", 0.0, most, meaning=f"damping about {a}") for a in "xyz")
    one = Parameter("c", "N m s/rad", 0.0, most, meaning="damping about every axis")
    return (
        Form("one constant", "M = −c Ω", (one,), isotropic, needs, kernel=kernel, kernel_values=_alike),
        Form("linear", "M_j = −c_j Ω_j", each, linear, needs, kernel=kernel),
        Form("quadratic", "M_j = −c_j |Ω_j| Ω_j", square, quadratic, needs, kernel=_kernel_quadratic),
    )


EFFECT = Effect(
    id="rotational_damping",
    name="rotational damping",
    sentence="a moment opposes the body rates",
    forms=forms,
    source=(
        "Quan, Introduction to Multicopter Design and Control, ch. 6 (damping moment); the recording "
        "contract (M = −c Ω)"
    ),
    sign="positive c opposes the turning",
    validity="what axial inflow at the hubs does not explain; rates below about 10 rad/s for the linear forms",
    excited_by=("angular_velocity",),
    confusers=("axial_inflow", "delay", "gyro_error"),
    separating_manoeuvre="excite roll, pitch and yaw by doublets of several lengths",
)
