"""Vortex ring state: thrust is lost (and fluctuates) in a descent close to the hover inflow."""

import numpy as np

from rotorid.effects.contract import Effect, Form, Parameter
from rotorid.effects.instant import Wrench


def _mean_loss(m, v, p, w):
    """T_i = T (1 - k g(x)), x = descent speed over hover inflow.

    g = 1 - ((x - 1)/0.7)² where positive, fading with in-plane speed.
    """
    x = m.air_velocity[2] / v.hover_inflow
    slow = (m.air_velocity[0] ** 2 + m.air_velocity[1] ** 2) / v.hover_inflow**2
    bump = np.maximum(1.0 - ((x - 1.0) / 0.7) ** 2, 0.0) * np.exp(-slow)
    for i in range(v.rotors):
        w.hub_force[i, 2] += p[0] * bump * m.thrust[i]


def forms(vehicle):
    return (
        Form(
            "mean loss",
            "T_i = T (1 − k g(v_z/v_h))",
            (Parameter("k", "1", 0.0, 0.8, meaning="largest share of thrust lost"),),
            Wrench(_mean_loss),
            ("velocity", "rotor_speed"),
        ),
    )


EFFECT = Effect(
    id="vortex_ring",
    name="the vortex ring state",
    sentence="thrust is lost and fluctuates in a steep descent",
    forms=forms,
    source="Leishman, Principles of Helicopter Aerodynamics, ch. 2.13; catalogue F11",
    sign="positive k takes thrust in a steep descent",
    validity=(
        "mean loss at descents of 0.3 to 1.7 hover inflows with little forward speed; the fluctuations "
        "are random and only their mean is modelled"
    ),
    excited_by=("velocity",),
    confusers=("gust", "axial_inflow"),
    separating_manoeuvre="descend vertically at 0.5, 1 and 1.5 times the hover inflow, and climb likewise",
    cases=("single/vortex_ring/weak/0", "single/axial_inflow/moderate/0"),
)
