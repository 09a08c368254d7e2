"""Parasitic drag of the airframe, quadratic in airspeed."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter
from rotorid.effects.scale import scale

E3 = np.array([0.0, 0.0, 1.0])
MOST_WEIGHTS_AT_10_M_S = 2.0
"""Drag at 10 m/s beyond this many weights is no airframe's (published: 0.1 to 0.5)."""


def isotropic(motion, vehicle, values):
    """F = -c |v| v at the centre of mass, c = ρ C_D A / 2."""
    v = motion.air_velocity
    return Contribution(force=-values[0] * np.linalg.norm(v, axis=1, keepdims=True) * v)


def per_axis(motion, vehicle, values):
    """F_j = -c_j |v| v_j at the centre of mass."""
    v = motion.air_velocity
    return Contribution(force=-np.asarray(values) * np.linalg.norm(v, axis=1, keepdims=True) * v)


def isotropic_off_centre(motion, vehicle, values):
    """F = -c |v| v at a height of h above the centre of mass, M = −h e3 × F: linear in c and c h."""
    return _off_centre(motion, values[0], values[1])


def per_axis_off_centre(motion, vehicle, values):
    """F_j = -c_j |v| v_j at a height of h above the centre of mass, M = −h e3 × F: linear in c_j, c_x h and c_y h."""
    return _off_centre(motion, np.asarray(values[:3]), np.array([*values[3:], 0.0]))


def _off_centre(motion, c, c_h):
    v = motion.air_velocity
    square = np.linalg.norm(v, axis=1, keepdims=True) * v
    return Contribution(force=-c * square, moment=np.cross(E3, c_h * square))


def per_component(motion, vehicle, values):
    """F_j = -c_j |v_j| v_j at the centre of mass."""
    v = motion.air_velocity
    return Contribution(force=-np.asarray(values) * np.abs(v) * v)


def forms(vehicle):
    unit = "N s2/m2"
    size = scale(vehicle)
    most = MOST_WEIGHTS_AT_10_M_S * size.weight_n / 100.0
    axes = tuple(Parameter(f"c_{a}", unit, 0.0, most, meaning=f"ρ C_D A / 2 along {a}") for a in "xyz")
    c = Parameter("c", unit, 0.0, most, meaning="ρ C_D A / 2")
    farthest = most * size.arm_m
    meaning = "times the height of the centre of pressure above that of mass"
    c_h, c_x_h, c_y_h = (
        Parameter(f"{symbol} h", "N s2/m", -farthest, farthest, meaning=f"{symbol} {meaning}")
        for symbol in ("c", "c_x", "c_y")
    )
    return (
        Form("isotropic", "F = −c |v| v", (c,), isotropic, ("velocity",)),
        Form("per axis", "F_j = −c_j |v| v_j", axes, per_axis, ("velocity",)),
        Form("per component", "F_j = −c_j |v_j| v_j", axes, per_component, ("velocity",)),
        Form(
            "isotropic, off the centre of mass",
            "F = −c |v| v, M = −h e3 × F",
            (c, c_h),
            isotropic_off_centre,
            ("velocity",),
            must_show=(0, 1),
            compound=True,
        ),
        Form(
            "per axis, off the centre of mass",
            "F_j = −c_j |v| v_j, M = −h e3 × F",
            (*axes, c_x_h, c_y_h),
            per_axis_off_centre,
            ("velocity",),
            must_show=(0, 1, 3),
            compound=True,
        ),
    )


EFFECT = Effect(
    id="frame_drag",
    name="drag of the airframe",
    sentence="the force grows with the square of the airspeed",
    forms=forms,
    source=(
        "RotorPy's parasitic drag (Folk et al., 2023); Leishman, Principles of Helicopter Aerodynamics, "
        "ch. 5; catalogue F7"
    ),
    sign="positive c opposes the motion through the air",
    validity=(
        "force at the centre of mass or above it, constant drag coefficient; at low speed linear rotor drag hides it "
        "(span beyond 8 m/s)"
    ),
    excited_by=("velocity",),
    confusers=("rotor_drag", "steady_wind"),
    separating_manoeuvre="fly a speed sweep beyond 10 m/s in both directions",
)
