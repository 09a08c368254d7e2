"""Steady wind: a force constant in world axes, or drag built on airspeed instead of ground speed."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from rotorid.effects.contract import Contribution, Effect, Form, Parameter
from rotorid.effects.instant import Wrench
from rotorid.effects.scale import scale

_MOST_WIND_M_S = 30.0
_MOST_WEIGHTS = 2.0
"""No multirotor holds its place against a wind that pushes with more weights than this."""


def _world_force(m, v, p, w):
    """F = Rᵀ (f_N, f_E, 0): constant in world axes."""
    for j in range(3):
        w.force[j] += m.rotation[0, j] * p[0] + m.rotation[1, j] * p[1]


def _rotor_force(m, v, p, w):
    """F_i = ω_i P Rᵀ (k w_N, k w_E, 0) at each hub: the wind's part of rotor drag on airspeed."""
    x = m.rotation[0, 0] * p[0] + m.rotation[1, 0] * p[1]
    y = m.rotation[0, 1] * p[0] + m.rotation[1, 1] * p[1]
    for i in range(v.rotors):
        w.hub_force[i, 0] += m.rotor_speed[i] * x
        w.hub_force[i, 1] += m.rotor_speed[i] * y


def forms(vehicle):
    size = scale(vehicle)
    force = _MOST_WEIGHTS * size.weight_n
    share = force / (size.rotors * size.hover_speed_rad_s)
    directions = ("north", "east")
    on_rotors = tuple(
        Parameter(f"kw_{d}", "N s/rad", -share, share, meaning=f"k_d times the wind's velocity to the {d}")
        for d in directions
    )
    on_frame = tuple(Parameter(f"f_{d}", "N", -force, force, meaning=f"force to the {d}") for d in directions)
    return (
        Form(
            "on the rotors",
            "F_i = ω_i P Rᵀ k_d w",
            on_rotors,
            Wrench(_rotor_force),
            ("rotation", "rotor_speed"),
            linear_drag="times rotor speed",
        ),
        Form(
            "on the airframe",
            "F = Rᵀ f_w",
            on_frame,
            Wrench(_world_force),
            ("rotation",),
            linear_drag="of airspeed alone",
            excited_by=("always",),
        ),
    )


def through_drag(drags: Sequence[tuple[Form, np.ndarray]]) -> Form:
    """F = Σ F_j(v − Rᵀ w) − F_j(v): what a wind adds to effects that feel the air, forms with their values.

    To first order in w, by differences over a metre a second about the air as it is.
    """

    def contribution(motion, vehicle, values):
        wind = np.zeros(3) if motion.wind is None else motion.wind
        step = 0.5 * np.array([*values, 0.0])
        force, moment = np.zeros((motion.size, 3)), np.zeros((motion.size, 3))
        for sign in (1.0, -1.0):
            moved = replace(motion, wind=wind + sign * step)
            for form, own in drags:
                part = form.contribution(moved, vehicle, own)
                force += 0.0 if part.force is None else sign * part.force
                moment += 0.0 if part.moment is None else sign * part.moment
        return Contribution(force=force, moment=moment)

    parameters = tuple(Parameter(f"w_{d}", "m/s", -_MOST_WIND_M_S, _MOST_WIND_M_S) for d in ("north", "east"))
    return Form("through the drag", "v_air = v − Rᵀ w", parameters, contribution, ("rotation", "velocity"))


EFFECT = Effect(
    id="steady_wind",
    name="a steady wind",
    sentence="a force constant in world axes",
    forms=forms,
    shows_in=("sideways",),
    source="drag on airspeed (Faessler et al., RA-L 2018) with v − Rᵀ w; catalogue F19",
    sign="positive pushes the vehicle to the north or east; w is the velocity of the air",
    validity=(
        "constant over all runs, horizontal; the forms are linear in the wind, the analysis refits it as "
        "a velocity through every effect that feels the air"
    ),
    excited_by=("rotor_speed",),
    confusers=("accelerometer_error", "thrust_tilt", "rotor_drag"),
    separating_manoeuvre="hover while yawing through 360 degrees, and fly the same leg in both directions",
    air_moves="all the time",
    cases=("single/steady_wind/strong/0", "single/thrust_tilt/strong/0"),
)
