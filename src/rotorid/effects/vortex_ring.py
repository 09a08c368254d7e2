"""Vortex ring state: thrust is lost (and fluctuates) in a descent close to the hover inflow."""

import numpy as np

from rotorid.effects.contract import Effect, Form, Parameter, at_hubs
from rotorid.effects.rotor_interference import hover_inflow_m_s


def mean_loss(motion, vehicle, values):
    """T_i = T (1 - k g(x)), x = descent speed / hover inflow, g a bump over 0.5 to 1.5 centred at 1."""
    x = motion.air_velocity[:, 2] / hover_inflow_m_s(vehicle)
    slow = np.linalg.norm(motion.air_velocity[:, :2], axis=1) / hover_inflow_m_s(vehicle)
    bump = np.clip(1.0 - ((x - 1.0) / 0.7) ** 2, 0.0, None) * np.exp(-(slow**2))
    thrust = vehicle.thrust_coefficients_n_s2() * motion.rotor_speed**2
    forces = np.zeros((*thrust.shape, 3))
    forces[:, :, 2] = values[0] * bump[:, None] * thrust
    return at_hubs(forces, vehicle.rotor_positions_m())


def forms(vehicle):
    return (
        Form(
            "mean loss",
            "T_i = T (1 − k g(v_z/v_h))",
            (Parameter("k", "1", 0.0, 0.8),),
            mean_loss,
            ("velocity", "rotor_speed"),
        ),
    )


EFFECT = Effect(
    id="vortex_ring",
    name="the vortex ring state",
    sentence="thrust is lost and fluctuates in a steep descent",
    forms=forms,
    source="physics.md F11; Leishman, Principles of Helicopter Aerodynamics, ch. 2.13",
    confusers=("gust", "axial_inflow"),
    separating_manoeuvre="descend vertically at 0.5, 1 and 1.5 times the hover inflow, and climb likewise",
)
