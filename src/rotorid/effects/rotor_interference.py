"""Rear rotors work in the wake of the front ones in forward flight."""

import numpy as np
from numba.extending import register_jitable

from rotorid.effects.contract import Effect, Form, Parameter
from rotorid.effects.instant import Wrench


@register_jitable
def _lose(m, v, w, speed, share):
    """A share of its thrust that each rotor loses the farther to the rear of the flight direction it sits, 0 to 1."""
    x, y = m.air_velocity[0] / np.maximum(speed, 1e-6), m.air_velocity[1] / np.maximum(speed, 1e-6)
    for i in range(v.rotors):
        rear = np.minimum(np.maximum(-(x * v.hub[i, 0] + y * v.hub[i, 1]) / v.reach, 0.0), 1.0)
        w.hub_force[i, 2] += share * rear * m.thrust[i]


def _growing(m, v, p, w):
    """T_rear = T (1 - e v_h): the loss grows with in-plane airspeed."""
    speed = np.sqrt(m.air_velocity[0] ** 2 + m.air_velocity[1] ** 2)
    _lose(m, v, w, speed, p[0] * speed)


def _saturating(m, v, p, w):
    """T_rear = T (1 - e v_h / (v_h + v_i)), v_i the hover inflow."""
    speed = np.sqrt(m.air_velocity[0] ** 2 + m.air_velocity[1] ** 2)
    _lose(m, v, w, speed, p[0] * speed / (speed + v.hover_inflow))


def forms(vehicle):
    needs = ("velocity", "rotor_speed")
    return (
        Form(
            "growing with airspeed",
            "T_rear = T (1 − e v_h)",
            (Parameter("e", "s/m", 0.0, 0.2, meaning="share of thrust lost per airspeed"),),
            Wrench(_growing),
            needs,
            (),
            3,
        ),
        Form(
            "saturating",
            "T_rear = T (1 − ε v_h/(v_h + v_i))",
            (Parameter("eps", "1", 0.0, 0.6, meaning="share of thrust lost in fast flight"),),
            Wrench(_saturating),
            needs,
            (),
            3,
        ),
    )


EFFECT = Effect(
    id="rotor_interference",
    name="interference between front and rear rotors",
    sentence="the rear rotors lose thrust in forward flight",
    forms=forms,
    source=(
        "Powers, Mellinger, Kumar et al., Influence of aerodynamics and proximity effects in quadrotor "
        "flight, ISER 2012; catalogue F14"
    ),
    sign=(
        "positive takes thrust from the rotors at the rear of the flight direction: the nose (or leading side) rises"
    ),
    validity="an empirical ramp from front to rear, in-plane airspeed only, rotors in one plane",
    excited_by=("velocity",),
    confusers=("flapping_moment", "rotor_drag"),
    separating_manoeuvre="fly forward and backward at several speeds and heights of the rotor plane",
    feels_air=True,
    cases=("single/rotor_interference/moderate/0", "single/flapping_moment/strong/0"),
)
