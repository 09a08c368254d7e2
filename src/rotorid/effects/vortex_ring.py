"""Vortex ring state: thrust is lost (and fluctuates) in a descent close to the hover inflow."""

from math import exp

import numpy as np

from rotorid.effects.contract import Effect, Form, Parameter, lift_at_hubs, rotor_thrusts
from rotorid.effects.scale import hover_inflow_m_s


def _mean_loss(motion, vehicle, values):
    """T_i = T (1 - k g(x)), x = descent speed over hover inflow.

    g = 1 - ((x - 1)/0.7)² where positive, fading with in-plane speed.
    """
    x = motion.air_velocity[:, 2] / hover_inflow_m_s(vehicle)
    slow = np.linalg.norm(motion.air_velocity[:, :2], axis=1) / hover_inflow_m_s(vehicle)
    bump = np.clip(1.0 - ((x - 1.0) / 0.7) ** 2, 0.0, None) * np.exp(-(slow**2))
    return lift_at_hubs(-values[0] * bump[:, None] * rotor_thrusts(motion, vehicle), vehicle)


def kernel(m, v, p, w):
    x = m.air_velocity[2] / v.hover_inflow
    slow = (m.air_velocity[0] ** 2 + m.air_velocity[1] ** 2) / v.hover_inflow**2
    bump = max(1.0 - ((x - 1.0) / 0.7) ** 2, 0.0) * exp(-slow)
    for i in range(v.rotors):
        w.hub_force[i, 2] += p[0] * bump * m.thrust[i]


def forms(vehicle):
    return (
        Form(
            "mean loss",
            "T_i = T (1 − k g(v_z/v_h))",
            (Parameter("k", "1", 0.0, 0.8, meaning="largest share of thrust lost"),),
            _mean_loss,
            ("velocity", "rotor_speed"),
            kernel=kernel,
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
)
