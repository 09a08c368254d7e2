"""Parasitic drag of the airframe, quadratic in airspeed."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter


def isotropic(motion, vehicle, values):
    """F = -c |v| v at the centre of mass, c = ρ C_D A / 2."""
    v = motion.air_velocity
    return Contribution(force=-values[0] * np.linalg.norm(v, axis=1, keepdims=True) * v)


def per_axis(motion, vehicle, values):
    """F_j = -c_j |v| v_j at the centre of mass."""
    v = motion.air_velocity
    return Contribution(force=-np.asarray(values) * np.linalg.norm(v, axis=1, keepdims=True) * v)


def per_component(motion, vehicle, values):
    """F_j = -c_j |v_j| v_j at the centre of mass."""
    v = motion.air_velocity
    return Contribution(force=-np.asarray(values) * np.abs(v) * v)


def forms(vehicle):
    unit = "N s2/m2"
    axes = tuple(Parameter(f"c_{a}", unit, 0.0) for a in "xyz")
    return (
        Form("isotropic", "F = −c |v| v", (Parameter("c", unit, 0.0),), isotropic, ("velocity",)),
        Form("per axis", "F_j = −c_j |v| v_j", axes, per_axis, ("velocity",)),
        Form("per component", "F_j = −c_j |v_j| v_j", axes, per_component, ("velocity",)),
    )


EFFECT = Effect(
    id="frame_drag",
    name="drag of the airframe",
    sentence="the force grows with the square of the airspeed",
    forms=forms,
    source="physics.md F7; RotorPy's parasitic drag",
    confusers=("rotor_drag", "steady_wind"),
    separating_manoeuvre="fly a speed sweep beyond 10 m/s in both directions",
)
