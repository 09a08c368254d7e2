"""Columns in another unit than their name says.

Recognised before the physics (rotorid.mismatch.mistakes); it is no wrench, so it has no form to fit.
"""

from rotorid.effects.contract import Effect


def forms(vehicle):
    return ()


EFFECT = Effect(
    id="unit_error",
    name="a column in the wrong unit",
    sentence="a column is larger or smaller than it can be by a unit's own factor",
    forms=forms,
    source="contract, mistakes in the set; kinematics and weight",
    confusers=("accelerometer_error", "gyro_error"),
    separating_manoeuvre="hover at rest: the accelerometer must read gravity and the rotors must carry the weight",
    kind="mistake",
)
