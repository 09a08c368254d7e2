"""Axes of a sensor flipped or exchanged, or an attitude in another convention.

Recognised before the physics (rotorid.mismatch.mistakes); it is no wrench, so it has no form to fit.
"""

from rotorid.effects.contract import Effect


def forms(vehicle):
    return ()


EFFECT = Effect(
    id="axis_sign",
    name="flipped or exchanged axes of a sensor",
    sentence="a sensor sees the motion mirrored or in other axes than the others do",
    forms=forms,
    source="contract, mistakes in the set; kinematics",
    confusers=("rotor_order", "spin_direction"),
    separating_manoeuvre="turn the vehicle by hand about each axis in turn while recording",
    kind="mistake",
)
