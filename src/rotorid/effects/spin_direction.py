"""Rotors that turn the other way than vehicle.yaml says.

Recognised before the physics (rotorid.mismatch.mistakes); it is no wrench, so it has no form to fit.
"""

from rotorid.effects.contract import Effect


def forms(vehicle):
    return ()


EFFECT = Effect(
    id="spin_direction",
    name="a wrong turning sense of the rotors",
    sentence="the yaw moment answers the rotors with the opposite sign",
    forms=forms,
    source="contract, mistakes in the set; methods.md, lesson 10",
    confusers=("rotor_order", "axis_sign", "rotor_acceleration_torque"),
    separating_manoeuvre="look at the propellers, or yaw to both sides with sharp inputs",
    kind="mistake",
)
