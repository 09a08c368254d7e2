"""Parasitic drag of the airframe, quadratic in airspeed."""

import numpy as np
from numba.extending import register_jitable

from rotorid.effects.contract import Effect, Form, Parameter
from rotorid.effects.instant import Wrench
from rotorid.effects.scale import scale

_MOST_WEIGHTS_AT_10_M_S = 2.0
"""Drag at 10 m/s beyond this many weights is no airframe's (published: 0.1 to 0.5)."""


@register_jitable
def _drag(m, v, p, w):
    """F_j = -c_j |v| v_j at the centre of mass, c = ρ C_D A / 2; `p` is c_x, c_y, c_z."""
    speed = np.sqrt(m.air_velocity[0] ** 2 + m.air_velocity[1] ** 2 + m.air_velocity[2] ** 2)
    for j in range(3):
        w.force[j] -= p[j] * speed * m.air_velocity[j]


def _drag_off_centre(m, v, p, w):
    """The same at a height of h above the centre of mass, M = −h e3 × F: linear in c_x, c_y, c_z, c_x h and c_y h."""
    _drag(m, v, p, w)
    speed = np.sqrt(m.air_velocity[0] ** 2 + m.air_velocity[1] ** 2 + m.air_velocity[2] ** 2)
    w.moment[0] -= p[4] * speed * m.air_velocity[1]
    w.moment[1] += p[3] * speed * m.air_velocity[0]


def _per_component(m, v, p, w):
    """F_j = -c_j |v_j| v_j at the centre of mass."""
    for j in range(3):
        w.force[j] -= p[j] * abs(m.air_velocity[j]) * m.air_velocity[j]


def _alike(values):
    """c, and c h where it is there, of every axis."""
    return np.repeat(values, (3, 2)[: len(values)])


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
        Form("isotropic", "F = −c |v| v", (c,), Wrench(_drag, _alike), ("velocity",)),
        Form("per axis", "F_j = −c_j |v| v_j", axes, Wrench(_drag), ("velocity",)),
        Form("per component", "F_j = −c_j |v_j| v_j", axes, Wrench(_per_component), ("velocity",)),
        Form(
            "isotropic, off the centre of mass",
            "F = −c |v| v, M = −h e3 × F",
            (c, c_h),
            Wrench(_drag_off_centre, _alike),
            ("velocity",),
            must_show=(0, 1),
        ),
        Form(
            "per axis, off the centre of mass",
            "F_j = −c_j |v| v_j, M = −h e3 × F",
            (*axes, c_x_h, c_y_h),
            Wrench(_drag_off_centre),
            ("velocity",),
            must_show=(0, 1, 3),
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
    cases=("single/frame_drag/strong/0", "single/rotor_drag/strong/0"),
)
