"""Steady wind: a force constant in world axes, or drag built on airspeed instead of ground speed."""

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter, at_hubs

IN_PLANE = np.array([1.0, 1.0, 0.0])


def _world(motion, north, east):
    vector = np.zeros((motion.size, 3))
    vector[:, 0], vector[:, 1] = north, east
    return np.einsum("nji,nj->ni", motion.rotation, vector)


def world_force(motion, vehicle, values):
    """F = Rᵀ (f_N, f_E, 0): constant in world axes."""
    return Contribution(force=_world(motion, values[0], values[1]))


def rotor_force(motion, vehicle, values):
    """F_i = ω_i P Rᵀ (k w_N, k w_E, 0) at each hub: the wind's part of rotor drag on airspeed."""
    wind = _world(motion, values[0], values[1]) * IN_PLANE
    return at_hubs(motion.rotor_speed[:, :, None] * wind[:, None, :], vehicle.rotor_positions_m())


def forms(vehicle):
    return (
        Form(
            "on the rotors",
            "F_i = ω_i P Rᵀ k_d w",
            (Parameter("kw_north", "N s/rad"), Parameter("kw_east", "N s/rad")),
            rotor_force,
            ("rotation", "rotor_speed"),
        ),
        Form(
            "on the airframe",
            "F = Rᵀ f_w",
            (Parameter("f_north", "N"), Parameter("f_east", "N")),
            world_force,
            ("rotation",),
        ),
    )


EFFECT = Effect(
    id="steady_wind",
    name="a steady wind",
    sentence="a force constant in world axes",
    forms=forms,
    source="physics.md F19",
    confusers=("accelerometer_error", "thrust_tilt", "rotor_drag"),
    separating_manoeuvre="hover while yawing through 360 degrees, and fly the same leg in both directions",
)
