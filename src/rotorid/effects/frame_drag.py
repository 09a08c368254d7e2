"""Parasitic drag of the airframe, quadratic in airspeed."""

from math import sqrt

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter
from rotorid.effects.scale import scale

_E3 = np.array([0.0, 0.0, 1.0])
_MOST_WEIGHTS_AT_10_M_S = 2.0
"""Drag at 10 m/s beyond this many weights is no airframe's (published: 0.1 to 0.5)."""


def isotropic(motion, vehicle, values):
    """F = -c |v| v at the centre of mass, c = ρ C_D A / 2."""
    v = motion.air_velocity
    return Contribution(force=-values[0] * np.linalg.norm(v, axis=1, keepdims=True) * v)


def _per_axis(motion, vehicle, values):
    """F_j = -c_j |v| v_j at the centre of mass."""
    v = motion.air_velocity
    return Contribution(force=-np.asarray(values) * np.linalg.norm(v, axis=1, keepdims=True) * v)


def _isotropic_off_centre(motion, vehicle, values):
    """F = -c |v| v at a height of h above the centre of mass, M = −h e3 × F: linear in c and c h."""
    return _off_centre(motion, values[0], values[1])


def _per_axis_off_centre(motion, vehicle, values):
    """F_j = -c_j |v| v_j at a height of h above the centre of mass, M = −h e3 × F: linear in c_j, c_x h and c_y h."""
    return _off_centre(motion, np.asarray(values[:3]), np.array([*values[3:], 0.0]))


def _off_centre(motion, c, c_h):
    v = motion.air_velocity
    square = np.linalg.norm(v, axis=1, keepdims=True) * v
    return Contribution(force=-c * square, moment=np.cross(_E3, c_h * square))


def _per_component(motion, vehicle, values):
    """F_j = -c_j |v_j| v_j at the centre of mass."""
    v = motion.air_velocity
    return Contribution(force=-np.asarray(values) * np.abs(v) * v)


def kernel(m, v, p, w):
    """F_j = -c_j |v| v_j, M = e3 × (c h) |v| v; `p` is c_x, c_y, c_z, c_x h, c_y h."""
    speed = sqrt(m.air_velocity[0] ** 2 + m.air_velocity[1] ** 2 + m.air_velocity[2] ** 2)
    for j in range(3):
        w.force[j] -= p[j] * speed * m.air_velocity[j]
    w.moment[0] -= p[4] * speed * m.air_velocity[1]
    w.moment[1] += p[3] * speed * m.air_velocity[0]


def _kernel_per_component(m, v, p, w):
    for j in range(3):
        w.force[j] -= p[j] * abs(m.air_velocity[j]) * m.air_velocity[j]


def _alike(values):
    """c, and c h where it is there, as the kernel's values."""
    c_h = values[1] if len(values) > 1 else 0.0
    return (*[values[0]] * 3, c_h, c_h)


def _each(values):
    """c_x, c_y, c_z, and c_x h, c_y h where they are there, as the kernel's values."""
    return (*values, 0.0, 0.0)[:5]


def forms(vehicle):
    unit = "N s2/m2"
    size = scale(vehicle)
    most = _MOST_WEIGHTS_AT_10_M_S * size.weight_n / 100.0
    axes = tuple(Parameter(f"c_{a}", unit, 0.0, most, meaning=f"ρ C_D A / 2 along {a}") for a in "xyz")
    c = Parameter("c", unit, 0.0, most, meaning="ρ C_D A / 2")
    farthest = most * size.arm_m
    meaning = "times the height of the centre of pressure above that of mass"
    c_h, c_x_h, c_y_h = (
        Parameter(f"{symbol} h", "N s2/m", -farthest, farthest, meaning=f"{symbol} {meaning}")
        for symbol in ("c", "c_x", "c_y")
    )
    return (
        Form("isotropic", "F = −c |v| v", (c,), isotropic, ("velocity",), kernel=kernel, kernel_values=_alike),
        Form("per axis", "F_j = −c_j |v| v_j", axes, _per_axis, ("velocity",), kernel=kernel, kernel_values=_each),
        Form(
            "per component", "F_j = −c_j |v_j| v_j", axes, _per_component, ("velocity",), kernel=_kernel_per_component
        ),
        Form(
            "isotropic, off the centre of mass",
            "F = −c |v| v, M = −h e3 × F",
            (c, c_h),
            _isotropic_off_centre,
            ("velocity",),
            must_show=(0, 1),
            kernel=kernel,
            kernel_values=_alike,
        ),
        Form(
            "per axis, off the centre of mass",
            "F_j = −c_j |v| v_j, M = −h e3 × F",
            (*axes, c_x_h, c_y_h),
            _per_axis_off_centre,
            ("velocity",),
            must_show=(0, 1, 3),
            kernel=kernel,
            kernel_values=_each,
        ),
    )


EFFECT = Effect(
    id="frame_drag",
    name="drag of the airframe",
    sentence="the force grows with the square of the airspeed",
    forms=forms,
    shows_in=("sideways", "drag"),
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
    feels_air=True,
    drag=True,
)
