"""Vibration of the rotors in the inertial sensors, with a bias that it may rectify.

Recognised before the physics (rotorid.mismatch.mistakes); it is no wrench, so it has no form to fit.
"""

from rotorid.effects.contract import Effect


def forms(vehicle):
    return ()


EFFECT = Effect(
    id="vibration",
    name="vibration of the rotors",
    sentence="a line that follows the rotors' speed, or its alias, stands in the inertial sensors",
    forms=forms,
    source="physics.md F24",
    confusers=("thrust_curve", "accelerometer_error"),
    separating_manoeuvre="balance the propellers, or hover at several speeds of the rotors",
    kind="sensor",
)
