"""Rear rotors work in the wake of the front ones in forward flight."""

from math import sqrt

import numpy as np

from rotorid.effects.contract import Effect, Form, Parameter, lift_at_hubs, rotor_thrusts
from rotorid.effects.scale import hover_inflow_m_s


def _rear_weight(motion, vehicle):
    """How far to the rear of the flight direction each rotor sits, (n, k), 0 (front) to 1 (rear)."""
    positions = vehicle.rotor_positions_m()[:, :2]
    reach = np.linalg.norm(positions, axis=1).max() or 1.0
    plane = motion.air_velocity[:, :2]
    direction = plane / np.maximum(np.linalg.norm(plane, axis=1, keepdims=True), 1e-6)
    return np.clip(-(direction @ positions.T) / reach, 0.0, 1.0)


def _loss(fraction, motion, vehicle):
    return lift_at_hubs(-fraction * rotor_thrusts(motion, vehicle), vehicle)


def _growing(motion, vehicle, values):
    """T_rear = T (1 - e v_h): the loss grows with in-plane airspeed."""
    speed = np.linalg.norm(motion.air_velocity[:, :2], axis=1)[:, None]
    return _loss(values[0] * speed * _rear_weight(motion, vehicle), motion, vehicle)


def saturating(motion, vehicle, values):
    """T_rear = T (1 - e v_h / (v_h + v_i)), v_i the hover inflow."""
    speed = np.linalg.norm(motion.air_velocity[:, :2], axis=1)[:, None]
    inflow = hover_inflow_m_s(vehicle)
    return _loss(values[0] * speed / (speed + inflow) * _rear_weight(motion, vehicle), motion, vehicle)


def _kernel_growing(m, v, p, w):
    speed = sqrt(m.air_velocity[0] ** 2 + m.air_velocity[1] ** 2)
    x, y = m.air_velocity[0] / max(speed, 1e-6), m.air_velocity[1] / max(speed, 1e-6)
    lost, x, y = p[0] * speed, x / v.reach, y / v.reach
    for i in range(v.rotors):
        rear = min(max(-(x * v.hub[i, 0] + y * v.hub[i, 1]), 0.0), 1.0)
        w.hub_force[i, 2] += lost * rear * m.thrust[i]


def _kernel_saturating(m, v, p, w):
    speed = sqrt(m.air_velocity[0] ** 2 + m.air_velocity[1] ** 2)
    x, y = m.air_velocity[0] / max(speed, 1e-6), m.air_velocity[1] / max(speed, 1e-6)
    lost, x, y = p[0] * speed / (speed + v.hover_inflow), x / v.reach, y / v.reach
    for i in range(v.rotors):
        rear = min(max(-(x * v.hub[i, 0] + y * v.hub[i, 1]), 0.0), 1.0)
        w.hub_force[i, 2] += lost * rear * m.thrust[i]


def forms(vehicle):
    needs = ("velocity", "rotor_speed")
    return (
        Form(
            "growing with airspeed",
            "T_rear = T (1 − e v_h)",
            (Parameter("e", "s/m", 0.0, 0.2, meaning="share of thrust lost per airspeed"),),
            _growing,
            needs,
            (),
            3,
            kernel=_kernel_growing,
        ),
        Form(
            "saturating",
            "T_rear = T (1 − ε v_h/(v_h + v_i))",
            (Parameter("eps", "1", 0.0, 0.6, meaning="share of thrust lost in fast flight"),),
            saturating,
            needs,
            (),
            3,
            kernel=_kernel_saturating,
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
)
