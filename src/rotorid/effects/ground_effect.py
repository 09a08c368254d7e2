"""Ground effect: more thrust close to the ground."""

import numpy as np
from numba.extending import register_jitable

from rotorid.effects.contract import Effect, Form, Parameter
from rotorid.effects.instant import Wrench
from rotorid.effects.scale import rotor_radius_m

_CLOSEST_RADII = 0.3
"""Heights below this many rotor radii are held there: the closed forms diverge and no rotor gets closer."""


@register_jitable
def _height_of_hub(m, v, i):
    """Height of a hub above ground, m; tilted by the attitude where it is known."""
    drop = m.rotation[2, 0] * v.hub[i, 0] + m.rotation[2, 1] * v.hub[i, 1] + m.rotation[2, 2] * v.hub[i, 2]
    return np.maximum(m.height - drop, _CLOSEST_RADII * v.radius)


def _image(m, v, p, w):
    """T/T_∞ = 1 / (1 - c (R/4z)²), z the hub's height (Cheeseman and Bennett: c = 1)."""
    for i in range(v.rotors):
        ratio = p[0] * (v.radius / (4.0 * _height_of_hub(m, v, i))) ** 2
        w.hub_force[i, 2] -= (1.0 / (1.0 - np.minimum(ratio, 0.8)) - 1.0) * m.thrust[i]


def _inverse_square(m, v, p, w):
    """T/T_∞ = 1 + c (R/4z)²."""
    for i in range(v.rotors):
        w.hub_force[i, 2] -= p[0] * (v.radius / (4.0 * _height_of_hub(m, v, i))) ** 2 * m.thrust[i]


def _exponential(m, v, p, w):
    """T/T_∞ = 1 + a exp(-b z)."""
    for i in range(v.rotors):
        w.hub_force[i, 2] -= p[0] * np.exp(-p[1] * _height_of_hub(m, v, i)) * m.thrust[i]


def forms(vehicle):
    needs = ("height", "rotor_speed")
    radius = rotor_radius_m(vehicle)
    return (
        Form(
            "image rotor",
            "T/T_∞ = 1/(1 − c (R/4z)²)",
            (Parameter("c", "1", 0.0, 40.0, True, (1.0, 4.0, 10.0), "gain of the image rotor, 1 for a single one"),),
            Wrench(_image),
            needs,
        ),
        Form(
            "inverse square",
            "T/T_∞ = 1 + c (R/4z)²",
            (Parameter("c", "1", 0.0, 60.0, meaning="gain of the image rotor, 1 for a single one"),),
            Wrench(_inverse_square),
            needs,
        ),
        Form(
            "exponential",
            "T/T_∞ = 1 + a exp(−b z)",
            (
                Parameter("a", "1", 0.0, 3.0, meaning="thrust gained on the ground itself"),
                Parameter(
                    "b",
                    "1/m",
                    0.02 / radius,
                    10.0 / radius,
                    nonlinear=True,
                    starts=(0.3 / radius, 1.0 / radius),
                    meaning="one over the height at which it has fallen to 37 %",
                ),
            ),
            Wrench(_exponential),
            needs,
        ),
    )


EFFECT = Effect(
    id="ground_effect",
    name="ground effect",
    sentence="thrust grows within a few rotor radii of the ground",
    forms=forms,
    source="Cheeseman and Bennett, ARC R&M 3021, 1955; catalogue F10",
    sign="positive c and a add thrust close to the ground",
    validity=(
        "level flat ground, hub heights above 0.3 R (below, the height is held) and up to about 5 R; slow flight"
    ),
    excited_by=("height",),
    confusers=("translational_lift", "axial_inflow"),
    separating_manoeuvre="hover at a ladder of heights from half to ten rotor radii",
    cases=("multibody/ground/f0e7b8f8/001", "single/axial_inflow/moderate/0"),
)
