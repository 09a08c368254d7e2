"""Gyroscopic moment of the spinning rotors."""

from rotorid.effects.contract import Effect, Form
from rotorid.effects.instant import Wrench
from rotorid.effects.scale import rotor_inertia


def _gyroscopic(m, v, p, w):
    """M = -Ω × (J_r Σ s_i ω_i e3), s_i = +1 for clockwise seen from above (momentum along body +z)."""
    momentum = 0.0
    for i in range(v.rotors):
        momentum -= p[0] * m.rotor_speed[i] * v.yaw_sign[i]
    w.moment[0] -= m.angular_velocity[1] * momentum
    w.moment[1] += m.angular_velocity[0] * momentum


def forms(vehicle):
    return (
        Form(
            "gyroscopic",
            "M = −Ω × J_r Σ s_i ω_i e3",
            (rotor_inertia(vehicle),),
            Wrench(_gyroscopic),
            ("angular_velocity", "rotor_speed"),
        ),
    )


EFFECT = Effect(
    id="rotor_gyroscopic",
    name="the gyroscopic moment of the rotors",
    sentence="a moment proportional to body rate times the rotors' net spin",
    forms=forms,
    source="Bouabdallah, PhD thesis, EPFL 2007; thesis eqs 4.12 to 4.19; catalogue F12",
    sign="positive J_r; the momentum of a rotor clockwise seen from above points along body +z (down)",
    validity="rotor axes parallel to body z; equals zero where the rotors' speeds cancel",
    excited_by=("angular_velocity",),
    confusers=("inertia_products",),
    separating_manoeuvre="roll and pitch quickly while yawing, so that the rotors' net spin is large",
    cases=("single/rotor_gyroscopic/weak/0", "single/inertia_products/moderate/0"),
)
