"""Rotor columns in another order than vehicle.yaml lists the rotors.

Recognised before the physics (rotorid.mismatch.mistakes); it is no wrench, so it has no form to fit.
"""

from rotorid.effects.contract import Effect


def forms(vehicle):
    return ()


EFFECT = Effect(
    id="rotor_order",
    name="rotor columns in the wrong order",
    sentence="the moments answer the rotors of other columns than vehicle.yaml says",
    forms=forms,
    source="contract, mistakes in the set; methods.md, lesson 10",
    confusers=("spin_direction", "axis_sign", "unequal_rotors"),
    separating_manoeuvre="raise one motor at a time with the propellers off and watch which column moves",
    kind="mistake",
)
