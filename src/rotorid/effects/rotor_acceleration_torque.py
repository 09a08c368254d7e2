"""Reaction torque of rotors that speed up or slow down."""

from rotorid.effects.contract import Effect, Form
from rotorid.effects.instant import Wrench
from rotorid.effects.scale import rotor_inertia


def _reaction(m, v, p, w):
    """M_z = J_r Σ y_i dω_i/dt, y_i = +1 for ccw (reaction opposes the spin, as the drag torque does)."""
    total = 0.0
    for i in range(v.rotors):
        total += m.rotor_acceleration[i] * v.yaw_sign[i]
    w.moment[2] += p[0] * total


def forms(vehicle):
    return (
        Form(
            "reaction", "M_z = J_r Σ y_i dω_i/dt", (rotor_inertia(vehicle),), Wrench(_reaction), ("rotor_acceleration",)
        ),
    )


EFFECT = Effect(
    id="rotor_acceleration_torque",
    name="the reaction torque of accelerating rotors",
    sentence="a yaw moment while rotors speed up or slow down",
    forms=forms,
    source="Bouabdallah, PhD thesis, EPFL 2007 (inertial counter torque); catalogue F13",
    sign="positive J_r: a rotor that speeds up turns the airframe against its spin",
    validity="rotor with motor bell as one rigid inertia; needs rotor speeds faster than about 1 Hz",
    excited_by=("rotor_acceleration",),
    confusers=("motor_lag", "delay"),
    separating_manoeuvre="excite yaw on both sides of 1 Hz",
    exact=True,
    shows="in what takes time",
    cases=("single/rotor_acceleration_torque/strong/0", "single/motor_lag/moderate/0"),
)
